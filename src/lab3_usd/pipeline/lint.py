"""Lints one stage: reads it, runs the rules, and finds the lines of the findings."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.config.settings import Config
from lab3_usd.data import data_folder
from lab3_usd.errors import Lab3Error, SpecError, StageError, UsageError, described
from lab3_usd.files import is_script_file
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import NodeCoverage, StageResult, ordered
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.pipeline.results import (
    FAILED,
    Results,
    Target,
    crashed,
    is_stage_file,
    located,
    unreadable,
)
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_platform

AUTO = "auto"


class LintSettings(Struct, frozen=True):
    """How to judge: by which release of Isaac Sim, and whether notes in the stage count.

    `moved_from` is the release that the stages come from, where that counts; AUTO lets the stage
    tell it. With `native`, OpenUSD's own validators judge as well. `own_rules` are sources of
    rules, which a process adds that judges for another one. `scene` is the stage that scripts load,
    '' where that is not known.
    """

    release: str = BASE
    moved_from: str = ""
    heeds_ignores: bool = False
    native: bool = False
    own_rules: tuple[str, ...] = ()
    scene: str = ""


def lint_platform(release: str = BASE) -> Platform:
    """Return a release of Isaac Sim, with the node types that the lab adds.

    A stage of no lab needs none: a lab that cannot be loaded adds nothing.

    Raises:
        UsageError: the release is not known.
    """
    try:
        return _in_release(load_platform(), release)
    except SpecError:
        return _in_release(load_platform(data_folder("graphs")), release)


def lab_in_release(lab: Lab, release: str, checkpoint: str | None = None) -> Lab:
    """Return a lab beside another release of Isaac Sim, for stages that it does not judge.

    Raises:
        UsageError: the release is not known, or the stage is one of a checkpoint.
    """
    if checkpoint:
        raise UsageError(f"--isaac {release}: at checkpoint {checkpoint} the lab names the release")
    return replace(lab, platform=lint_platform(release))


@lru_cache(maxsize=8)
def _in_release(platform: Platform, release: str) -> Platform:
    known = platform.known_releases
    if release not in known:
        raise UsageError(f"there is no Isaac Sim '{release}' here; known are {', '.join(known)}")
    return platform.in_release(release)


def lint_stage(path: str | Path, settings: LintSettings | None = None) -> StageResult:
    """Judge the stage at `path` by what its nodes do, whatever it is for.

    Raises:
        UsageError: the release is not known, or the installed usd-core has no validators.
    """
    settings = settings or LintSettings()
    if is_script_file(str(path)):
        return _linted_script(path, settings)
    from lab3_usd.stage.read.opening import kept_open

    with kept_open():  # so that nothing is asked of the stage twice
        result = _linted(path, settings)
        if settings.native:
            from lab3_usd.pipeline.native import with_native

            result = with_native(result)
        if settings.heeds_ignores:
            from lab3_usd.pipeline.results import scopes_run, without_ignored

            result = without_ignored(result, scopes_run(starter=None, native=settings.native))
    return result


def _linted_script(path: str | Path, settings: LintSettings) -> StageResult:
    from lab3_usd.pipeline.scripts import ScriptSettings, lint_script

    platform = lint_platform(settings.release)
    scene = _scene(settings.scene, platform)
    return lint_script(path, ScriptSettings(platform, scene, heeds_ignores=settings.heeds_ignores))


def _scene(path: str, platform: Platform) -> StageModel | None:
    """Read the stage that scripts load.

    Raises:
        StageError: it cannot be opened.
    """
    if not path:
        return None
    from lab3_usd.stage.read.reader import read_stage

    return read_stage(Path(path), platform)


def lint_subject(model: StageModel, moved_from: str = "") -> LintSubject:
    """Return a stage as it is judged, beside the release that it comes from.

    Raises:
        UsageError: the release is not known.
    """
    if moved_from != AUTO:
        return LintSubject(model, lint_platform(moved_from) if moved_from else None)
    from lab3_usd.facts.saved_releases import saved_by

    saved = saved_by(model)
    known = model.platform if saved is None else lint_platform(saved.release)
    return LintSubject(model, known, is_guessed=True)


def _linted(path: str | Path, settings: LintSettings) -> StageResult:
    platform = lint_platform(settings.release)
    from lab3_usd.stage.read.opening import open_stage, quiet

    try:
        stage = open_stage(Path(path))
        # Imported only now: a command has another thread do it while the stage opens.
        from lab3_usd.check.lint import lint
        from lab3_usd.stage.read.reader import read_model

        with quiet():
            model = read_model(stage, platform, str(path))
            judged = lint(lint_subject(model, settings.moved_from))
    except StageError as error:
        return unreadable(str(path), None, error)
    results = judged.results
    findings = ordered(located(results.findings, path, stage))
    return StageResult(
        path=str(path),
        checkpoint=None,
        findings=findings,
        crashes=results.crashes,
        not_judged=results.not_judged,
        coverage=judged.coverage,
        gaps=results.gaps,
    )


def lint_open_stage(stage: Any) -> RuleResults:
    """Judge a stage that somebody else has open, which is left as it is.

    Raises:
        StageError: a file of the stage is damaged.
    """
    from lab3_usd.check.lint import lint
    from lab3_usd.stage.read.opening import reopened
    from lab3_usd.stage.read.reader import read_model

    platform = lint_platform()
    model = read_model(reopened(stage), platform, stage.GetRootLayer().identifier)
    judged = lint(LintSubject(model)).results
    return replace(judged, findings=ordered(judged.findings))


class RosStage(Struct, frozen=True):
    """A stage whose topics and frames are listed, and its nodes of unknown type."""

    subject: LintSubject
    coverage: NodeCoverage
    unknown: tuple[Node, ...]


def read_any(path: Path, platform: Platform, scene: str = "") -> StageModel:
    """Read a stage, or the one that a script leaves, over the `scene` that it loads.

    Raises:
        StageError: the file cannot be opened, or builds no graph.
        UsageError: a stage is given a scene, or the release is not known.
    """
    if is_script_file(path):
        from lab3_usd.pipeline.scripts import joined_stage

        return joined_stage(path, platform, _scene(scene, platform))
    if scene:
        raise UsageError(f"--stage is for scripts, and {path} is none")
    from lab3_usd.stage.read.reader import read_stage

    return read_stage(path, platform)


def read_ros(path: Path, scene: str = "", release: str = BASE) -> RosStage:
    """Read any stage, or a script over the `scene` that it loads, by the platform of lint.

    Raises:
        StageError: the file cannot be opened, or builds no graph.
        UsageError: a stage is given a scene, or the release is not known.
    """
    from lab3_usd.check.lint import lint
    from lab3_usd.facts.stalled_nodes import nodes_of_unknown_type

    subject = LintSubject(read_any(path, lint_platform(release), scene))
    coverage = lint(subject).coverage
    return RosStage(subject, coverage, tuple(nodes_of_unknown_type(subject.stage)))


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


def lint_stages(entries: Sequence[Target], settings: LintSettings, jobs: int) -> Generator[Results]:
    """Yield the result of each stage, in order, judged in as many processes as asked for."""
    if min(jobs, len(entries)) <= 1:
        from lab3_usd.stage.read.opening import kept_open

        with kept_open():
            yield from (_lint(settings, entry) for entry in entries)
        return
    from lab3_usd.pipeline.processes import in_processes

    judge = partial(_lint_in_process, settings)
    yield from in_processes(judge, _crashed, entries, min(jobs, len(entries)))


def _lint_in_process(settings: LintSettings, entry: Target) -> Results:
    from lab3_usd.check.own_rules import add_own_rules

    add_own_rules(settings.own_rules)
    return _lint(settings, entry)


def _lint(settings: LintSettings, entry: Target) -> Results:
    """Judge a stage; where the program itself fails, that is its result."""
    try:
        return (lint_stage(entry.path, settings),), ()
    except (Lab3Error, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever it is, the other stages are judged
        return (crashed(entry.path, None, described(error), FAILED),), ()


def _crashed(entry: Target, how: str) -> Results:
    return (crashed(entry.path, None, how),), ()
