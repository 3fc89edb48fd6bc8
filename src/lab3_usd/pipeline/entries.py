"""Finds what a path names, stages, scripts or a submission, and judges it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.config.settings import Config
from lab3_usd.data import program
from lab3_usd.errors import Lab3Error, StageError, UsageError, failure_text
from lab3_usd.files import is_script_file
from lab3_usd.model.finding import Submission
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.results import (
    ENDED,
    FAILED,
    Results,
    Target,
    crashed,
    is_stage_file,
    with_findings,
)
from lab3_usd.pipeline.stage import (
    JudgeSettings,
    checkpoint_at,
    judge_stage,
    known_checkpoint,
)
from lab3_usd.spec.load.loader import lab_of_team, load_lab


def find_stages(path: str, config: Config, *, alone: bool = True) -> Iterator[Target]:
    """Yield what a path names: a stage or script, or those in a folder and below it.

    Folders whose names begin with a dot are left out, and links to folders are not followed. A
    folder that may not be opened is a target that cannot be read. Of scripts in a folder, and of
    those that are not named `alone`, only those that may build graphs count.

    Raises:
        UsageError: the folder holds neither a stage nor a script.
    """
    if not Path(path).is_dir():
        if alone or not is_script_file(path) or _may_build(Path(path)):
            yield Target(path)
        return
    files: list[Path] = []
    scripts: list[Path] = []

    def add_closed(error: OSError) -> None:
        files.append(Path(error.filename))

    for folder, folders, names in os.walk(path, onerror=add_closed):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            kind = files if is_stage_file(name) else scripts if is_script_file(name) else None
            if kind is not None and not config.excludes(Path(folder, name)):
                kind.append(Path(folder, name))
    if not (files or scripts):
        raise UsageError(f"{path}: holds no stage and no script, nor does a folder in it")
    files += (script for script in scripts if _may_build(script))
    yield from (Target(str(file)) for file in sorted(files))


def _may_build(path: Path) -> bool:
    """Whether a script may build graphs; one that cannot be read says so when it is judged."""
    from lab3_usd.scripts.sources import may_build

    try:
        return may_build(path, lint_platform().building.module)
    except StageError:
        return True


def find_entries(path: str, settings: JudgeSettings) -> Iterator[Target]:
    """Yield what a path names: a stage, the stages of a folder, or a submission.

    Raises:
        UsageError: the folder holds no stage, or the checkpoint of a file is not known.
    """
    lab = load_lab()
    if is_script_file(path):
        raise UsageError(
            f"{path}: is a script and no stage; {program()} lint judges the graphs that scripts "
            "build"
        )
    if not Path(path).is_dir():
        checkpoint_at(path, settings, lab)
        yield Target(path, is_submission=False)
        return
    from lab3_usd.pipeline.folder import is_submission

    if settings.handed_in or is_submission(Path(path)):
        yield Target(path, is_submission=True)
        return
    files = sorted(
        file
        for file in Path(path).iterdir()
        if is_stage_file(file.name) and not settings.config.excludes(file)
    )
    if not any(known_checkpoint(str(file), settings, lab) for file in files):
        what = "no stage with a checkpoint in its name" if files else "no stage"
        raise UsageError(f"{path}: holds {what} and is not a submission; {_elsewhere(Path(path))}")
    for file in files:
        checkpoint_at(str(file), settings, lab)
        yield Target(str(file), is_submission=False)


def _elsewhere(folder: Path) -> str:
    """Say where below a folder stages are, or how to get some."""
    below = (file for depth in ("*/*", "*/*/*") for file in folder.glob(depth))
    folders = sorted({str(file.parent) for file in below if is_stage_file(file.name)})
    if not folders:
        write = f"{program()} build --output {folder}"
        return f"{write} writes stages of the lab, {program()} lint judges any"
    more = ", ..." if len(folders) > _NAMED else ""
    named = ", ".join(folders[:_NAMED])
    return f"stages are in {named}{more} ({program()} grade judges a class, {program()} lint any)"


_NAMED = 3  # folders


def judge_all(settings: JudgeSettings, targets: Sequence[Target], jobs: int) -> Iterator[Results]:
    """Return the results of each target, in order, judged in as many processes as asked for.

    Raises:
        StageError: the starter cannot be opened.
    """
    jobs = min(jobs, len(targets))
    if jobs <= 1:
        return map(partial(judge_target, with_open_starter(settings)), targets)
    from lab3_usd.pipeline.processes import in_processes

    return in_processes(
        partial(_judge_in_process, settings), partial(crashed_target, settings), targets, jobs
    )


def with_open_starter(settings: JudgeSettings) -> JudgeSettings:
    """Open the starter once for all the stages that are compared with it."""
    if settings.starter is None:
        return settings
    from lab3_usd.pipeline.starter_comparison import opened_starter

    return replace(settings, starter=opened_starter(settings.starter, load_lab()))


with_kept_starter = lru_cache(maxsize=1)(with_open_starter)  # for as long as a process serves


def _judge_in_process(settings: JudgeSettings, target: Target) -> Results:
    from lab3_usd.check.own_rules import add_own_rules

    add_own_rules(settings.config.rules)
    return judge_target(with_kept_starter(settings), target)


def judge_target(settings: JudgeSettings, target: Target) -> Results:
    """Judge a stage, a script or a submission; where this program fails, that is its result."""
    try:
        if target.is_submission:
            from lab3_usd.pipeline.folder import check_folder

            judged = check_folder(Path(target.path), settings)
            return judged.results, (judged.submission,)
        if not settings.of_lab:
            return (judge_stage(target.path, settings),), ()
        lab = load_lab()
        checkpoint = checkpoint_at(target.path, settings, lab)
        lab = lab_of_team(lab, [(target.path, checkpoint)])
        result = judge_stage(target.path, settings, (lab, checkpoint))
        if lab.checkpoints[checkpoint].localization:
            from lab3_usd.pipeline.deliverables import map_findings

            about_map = map_findings(settings.maps, lab)
            result = with_findings(result, (*result.findings, *about_map))
    except (Lab3Error, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the other targets are judged
        return crashed_target(settings, target, failure_text(error), FAILED)
    return (result,), ()


def crashed_target(settings: JudgeSettings, target: Target, how: str, what: str = ENDED) -> Results:
    """Return the result for a path at which the process that judged it ended, or failed."""
    if target.is_submission:
        ended = crashed(target.path, None, how, what).crashes
        return (), (Submission(target.path, crashes=ended),)
    checkpoint = checkpoint_at(target.path, settings, load_lab()) if settings.of_lab else None
    return (crashed(target.path, checkpoint, how, what),), ()
