"""Finds what a path names, a stage or a submission, and judges it."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.config.settings import Config, matching
from lab3_usd.data import program
from lab3_usd.errors import Lab3Error, UsageError, described
from lab3_usd.files import is_script_file
from lab3_usd.model.finding import Submission
from lab3_usd.pipeline.results import (
    ENDED,
    FAILED,
    Results,
    Target,
    crashed,
    is_stage_file,
    with_findings,
)
from lab3_usd.pipeline.stage import check_stage, checkpoint_of
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

if TYPE_CHECKING:
    from lab3_usd.pipeline.starter_comparison import Starter


class JudgeSettings(Struct, frozen=True):
    """How to judge: at which checkpoint, and with which starter and folder of maps.

    Without a checkpoint `config` or the name of each file gives one. With `require_evidence`,
    saved output that is missing is an error instead of a note. With `heeds_ignores`, what notes in
    a stage ignore on purpose is left out. With `native`, OpenUSD's own validators judge as well.
    With `handed_in`, folders are submissions, and what they lack is missing.
    """

    checkpoint: str | None = None
    starter: Path | Starter | None = None
    maps: Path | None = None
    require_evidence: bool = False
    config: Config = Config()
    heeds_ignores: bool = False
    native: bool = False
    handed_in: bool = False


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
    if not any(_known_checkpoint(str(file), settings, lab) for file in files):
        what = "no stage with a checkpoint in its name" if files else "no stage"
        raise UsageError(f"{path}: holds {what} and is no submission; {_elsewhere(Path(path))}")
    for file in files:
        checkpoint_at(str(file), settings, lab)
        yield Target(str(file), is_submission=False)


def _elsewhere(folder: Path) -> str:
    """Say where below a folder stages are, or how to get some."""
    below = (file for depth in ("*/*", "*/*/*") for file in folder.glob(depth))
    folders = sorted({str(file.parent) for file in below if is_stage_file(file.name)})
    if not folders:
        write = f"{program()} build --out {folder}"
        return f"{write} writes stages of the lab, {program()} lint judges any"
    more = ", ..." if len(folders) > _NAMED else ""
    named = ", ".join(folders[:_NAMED])
    return f"stages are in {named}{more} ({program()} grade judges a class, {program()} lint any)"


_NAMED = 3  # folders


def checkpoint_at(path: str, settings: JudgeSettings, lab: Lab) -> str:
    """Return the checkpoint to judge a file at.

    Raises:
        UsageError: neither settings nor name give one.
    """
    checkpoint = _known_checkpoint(path, settings, lab)
    if checkpoint is not None and checkpoint not in lab.checkpoints:
        raise UsageError(f"{settings.config.file}: there is no checkpoint '{checkpoint}' ({path})")
    if checkpoint is None:
        raise UsageError(
            f"{path}: the name gives no checkpoint (as {lab.checkpoints[lab.first].file} does); "
            f"give one with --checkpoint, or use {program()} lint, or fix --lint, which need none"
        )
    return checkpoint


def _known_checkpoint(path: str, settings: JudgeSettings, lab: Lab) -> str | None:
    """Return the checkpoint that settings, configuration or name give a file."""
    configured = next(matching(settings.config.checkpoints, path, settings.config), None)
    return settings.checkpoint or configured or checkpoint_of(Path(path).name, lab)


def judge_entries(
    entries: Sequence[Target], settings: JudgeSettings, jobs: int
) -> Generator[Results]:
    """Yield the results of each entry, in order, judged in as many processes as asked for.

    Raises:
        StageError: the starter cannot be opened.
    """
    if min(jobs, len(entries)) <= 1:
        opened = _with_open_starter(settings)
        yield from (_judge_or_crash(opened, entry) for entry in entries)
        return
    from lab3_usd.pipeline.processes import in_processes

    judge, crashed = partial(_judge_in_process, settings), partial(crashed_entry, settings)
    yield from in_processes(judge, crashed, entries, min(jobs, len(entries)))


def _with_open_starter(settings: JudgeSettings) -> JudgeSettings:
    """Open the starter once for all the stages that are compared with it."""
    if not isinstance(settings.starter, Path):
        return settings
    from lab3_usd.pipeline.starter_comparison import open_starter

    return replace(settings, starter=open_starter(settings.starter, load_lab()))


with_kept_starter = lru_cache(maxsize=1)(_with_open_starter)  # for as long as a process serves


def _judge_in_process(settings: JudgeSettings, entry: Target) -> Results:
    from lab3_usd.check.own_rules import add_own_rules

    add_own_rules(settings.config.rules)
    return _judge_or_crash(with_kept_starter(settings), entry)


def _judge_or_crash(settings: JudgeSettings, entry: Target) -> Results:
    """Judge a stage or a submission; where the program itself fails, that is its result."""
    try:
        return judge_entry(settings, entry)
    except (Lab3Error, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the other entries are judged
        return crashed_entry(settings, entry, described(error), FAILED)


def judge_entry(settings: JudgeSettings, entry: Target) -> Results:
    """Judge a stage or a submission."""
    if entry.is_submission:
        from lab3_usd.pipeline.folder import FolderSettings, check_folder

        folder = FolderSettings(
            settings.starter,
            settings.maps,
            settings.require_evidence,
            settings.heeds_ignores,
            settings.native,
            handed_in=settings.handed_in,
        )
        judged = check_folder(Path(entry.path), folder)
        return judged.results, (judged.submission,)
    lab = load_lab()
    checkpoint = checkpoint_at(entry.path, settings, lab)
    from lab3_usd.stage.read.opening import kept_open

    with kept_open():
        result = check_stage(entry.path, checkpoint, lab)
        if settings.starter is not None:
            from lab3_usd.pipeline.starter_comparison import Starter, against_starter

            starter = _with_open_starter(settings).starter
            result = (
                against_starter(result, starter, lab) if isinstance(starter, Starter) else result
            )
        if settings.native:
            from lab3_usd.pipeline.native import with_native

            result = with_native(result)
        if settings.heeds_ignores:
            from lab3_usd.pipeline.results import scopes_run, without_ignored

            more = scopes_run(starter=settings.starter, native=settings.native)
            result = without_ignored(result, more)
    if lab.checkpoints[checkpoint].localization:
        from lab3_usd.pipeline.deliverables import lone_stage_notes, map_findings

        maps = settings.maps
        about_maps = lone_stage_notes(checkpoint, lab) if maps is None else map_findings(maps, lab)
        result = with_findings(result, (*result.findings, *about_maps))
    return (result,), ()


def crashed_entry(settings: JudgeSettings, entry: Target, how: str, what: str = ENDED) -> Results:
    """Return the result for a path at which the process that judged it ended, or failed."""
    if entry.is_submission:
        return (), (Submission(entry.path, crashes=crashed(entry.path, None, how, what).crashes),)
    checkpoint = checkpoint_at(entry.path, settings, load_lab())
    return (crashed(entry.path, checkpoint, how, what),), ()
