"""Judges one stage: reads it, runs the rules of a lab or of none, and places the findings."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Scope
from lab3_usd.check.rule_runs import RuleResults, run_family
from lab3_usd.config.settings import Config, matching
from lab3_usd.data import program
from lab3_usd.errors import StageError, UsageError
from lab3_usd.files import is_script_file
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import StageResult, ordered
from lab3_usd.pipeline.any_stage import lint_platform, lint_subject, scene_at
from lab3_usd.pipeline.results import (
    is_stage_file,
    located_findings,
    unreadable_result,
    with_findings,
    without_ignored,
)
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.spec.submission import named_checkpoint

if TYPE_CHECKING:
    from lab3_usd.pipeline.starter_comparison import Starter


class JudgeSettings(Struct, frozen=True):
    """How to judge: `of_lab` at a checkpoint of the lab, else any stage by what its nodes do.

    With `heeds_ignores`, what notes in a stage ignore on purpose is left out. With `native`,
    OpenUSD's own validators judge as well. `config` also has the rules of one's own.

    Of a lab: without a `checkpoint`, `config` or the name of each file gives one. Stages are
    compared with the `starter`; `maps` is the folder of maps. With `require_evidence`, saved output
    that is missing is an error instead of a note. With `handed_in`, folders are submissions, and
    what they lack is missing.

    Of none: `release` is the one of Isaac Sim. `moved_from` is the release that the stages come
    from, where that counts; AUTO lets the stage tell it. `scene` is the stage that scripts load, ''
    where that is not known.
    """

    of_lab: bool = True
    heeds_ignores: bool = False
    native: bool = False
    config: Config = Config()
    checkpoint: str | None = None
    starter: Path | Starter | None = None
    maps: Path | None = None
    require_evidence: bool = False
    handed_in: bool = False
    release: str = BASE
    moved_from: str = ""
    scene: str = ""


def checkpoint_of(name: str, lab: Lab, given: str | None = None) -> str | None:
    """Return the checkpoint that is given, else the one that a file name begins with, else None.

    Raises:
        UsageError: there is no such checkpoint.
    """
    if given is not None:
        return checkpoint_number(given, lab.checkpoints)
    return named_checkpoint(name, lab.files)


def checkpoint_number(given: str, numbers: Collection[str]) -> str:
    """Return the number of a checkpoint as the lab writes it: `2` is `02`.

    Raises:
        UsageError: there is no such checkpoint; the line lists those there are.
    """
    alike = (
        checkpoint
        for checkpoint in numbers
        if checkpoint.isdecimal() and given.isdecimal() and int(checkpoint) == int(given)
    )
    number = given if given in numbers else next(alike, given)
    if number not in numbers:
        raise UsageError(f"there is no checkpoint '{given}'; known are {', '.join(numbers)}")
    return number


def checkpoint_at(path: str, settings: JudgeSettings, lab: Lab) -> str:
    """Return the checkpoint to judge a file at.

    Raises:
        UsageError: neither settings nor name give one, or it is unknown.
    """
    checkpoint = known_checkpoint(path, settings, lab)
    if checkpoint is not None and checkpoint not in lab.checkpoints:
        raise UsageError(f"{settings.config.file}: there is no checkpoint '{checkpoint}' ({path})")
    if checkpoint is None and _is_archive(path):
        judging = f"{program()} check --untrusted --starter FILE judges it"
        raise UsageError(f"{path}: is an archive; {judging}, {program()} grade a class")
    if checkpoint is None:
        raise UsageError(
            f"{path}: the name gives no checkpoint (as {lab.checkpoints[lab.first].file} does); "
            f"give one with --checkpoint, or use {program()} lint, or fix --lint, which need none"
        )
    return checkpoint


def _is_archive(path: str) -> bool:
    """Whether a file is a zip or tar and no stage, which may be packed as well."""
    import tarfile
    import zipfile

    if is_stage_file(Path(path).name) or not Path(path).is_file():
        return False
    return zipfile.is_zipfile(path) or tarfile.is_tarfile(path)


def known_checkpoint(path: str, settings: JudgeSettings, lab: Lab) -> str | None:
    """Return the checkpoint that settings, configuration or name give a file."""
    if settings.checkpoint is not None:
        return checkpoint_number(settings.checkpoint, lab.checkpoints)
    configured = next(matching(settings.config.checkpoints, path, settings.config), None)
    return configured or checkpoint_of(Path(path).name, lab)


def check_stage(
    path: str | Path, checkpoint: str | None = None, lab: Lab | None = None
) -> StageResult:
    """Judge the stage at `path`, at the checkpoint given or else named by the file.

    The result holds every finding at its place, the requirements met and asked, and the rules
    that crashed. A file that cannot be read is a result as well, with the verdict `unreadable`.
    A `lab` is taken as it was loaded; else values by team are those of the team in the file name.

    Raises:
        UsageError: the checkpoint is unknown, or neither given nor in the file name; so is the
            team, where the lab has values by team.
    """
    given, lab = lab, lab or load_lab()
    number = checkpoint_at(str(path), JudgeSettings(checkpoint=checkpoint or None), lab)
    lab = given or lab_of_team(lab, [(str(path), number)])
    return judge_stage(path, JudgeSettings(), (lab, number))


def lint_stage(path: str | Path, settings: JudgeSettings | None = None) -> StageResult:
    """Judge the stage or script at `path` by what its nodes do, whatever it is for.

    Raises:
        UsageError: the release is not known, or the installed usd-core has no validators.
    """
    return judge_stage(path, settings or JudgeSettings(of_lab=False))


def judge_stage(
    path: str | Path, settings: JudgeSettings, at: tuple[Lab, str] | None = None
) -> StageResult:
    """Judge the stage at `path` at a checkpoint of a lab; without one, by what its nodes do.

    A starter to compare with is open in `settings`.

    Raises:
        UsageError: the release is not known, or the installed usd-core has no validators.
    """
    platform = lint_platform(settings.release) if at is None else at[0].platform
    if at is None and is_script_file(str(path)):
        from lab3_usd.pipeline.script_results import ScriptSettings, lint_script

        scene = scene_at(settings.scene, platform)
        parameters = settings.config.parameters
        over_scene = ScriptSettings(platform, scene, settings.heeds_ignores, parameters)
        return lint_script(path, over_scene)
    from lab3_usd.stage.read.opening import kept_open, open_stage, quiet, reading_cache

    with kept_open():  # so that nothing is asked of the stage twice
        try:
            stage = open_stage(Path(path))
            # Rules are imported only now: a command has another thread do it meanwhile.
            from lab3_usd.stage.read.stage_reader import read_model

            with quiet():
                model = read_model(stage, platform, str(path))
                if at is None:
                    from lab3_usd.check.lint import lint

                    parameters = settings.config.parameters
                    judged = lint(lint_subject(model, settings.moved_from, parameters))
                else:
                    from lab3_usd.check.checker import judge

                    demands = at[0].same_demands(at[1])
                    # The model, which is kept as well, keeps the stage that `id` names.
                    key, readings = ("judgement", id(stage), demands.id), reading_cache.get()
                    if readings is None or key not in readings:
                        judged = judge(at[0], demands, model)
                    else:
                        judged = readings[key]
                    if readings is not None:
                        readings[key] = judged
        except StageError as error:
            return unreadable_result(str(path), None if at is None else at[1], error)
        findings = judged.findings
        # Notes of a lab ask for no repair: a stage that passes is not read again for them.
        if at is None or any(finding.severity != "note" for finding in findings):
            findings = tuple(located_findings(findings, path, stage))
        result = StageResult(
            path=str(path),
            checkpoint=None if at is None else at[1],
            findings=ordered(findings),
            requirements=judged.requirements,
            crashes=judged.crashes,
            not_judged=judged.not_judged,
            coverage=judged.coverage,
            gaps=judged.gaps,
            release=platform.release if at is None else "",
        )
        if at is not None and settings.starter is not None:
            from lab3_usd.pipeline.starter_comparison import against_starter, opened_starter

            result = against_starter(result, opened_starter(settings.starter, at[0]), at[0])
        if settings.native and result.verdict != "unreadable":
            result = _with_native(result, stage)
        if settings.heeds_ignores:
            more: set[Scope] = {"starter"} if settings.starter is not None else set()
            result = without_ignored(result, more | {"native"} if settings.native else more)
    return result


def _with_native(result: StageResult, stage: Any) -> StageResult:
    """Return the result of an open stage together with what OpenUSD's validators say.

    Requirements and score stay as they are: no lab asks for these.

    Raises:
        UsageError: the installed usd-core has no validators.
    """
    from lab3_usd.model.native import FAMILY, NativeErrors
    from lab3_usd.stage.read.native_validators import native_errors
    from lab3_usd.stage.read.opening import stage_errors

    try:
        with stage_errors(result.path):
            errors = native_errors(stage, result.path)
    except StageError as error:  # of a prim that no other rule asks for
        return unreadable_result(result.path, result.checkpoint, error)
    judged = run_family("native", FAMILY, NativeErrors(errors), None)
    findings = located_findings(judged.findings, result.path, stage)
    crashes = (*result.crashes, *judged.crashes)
    return with_findings(replace(result, crashes=crashes), (*result.findings, *findings))


def judge_open_stage(stage: Any, lab: Lab | None = None) -> RuleResults:
    """Judge a stage that somebody else has open, which is left as it is.

    With a lab, at the checkpoint that the name of its file begins with; of another name, nothing.

    Raises:
        StageError: a file of the stage is damaged.
    """
    from lab3_usd.stage.read.opening import reopened
    from lab3_usd.stage.read.stage_reader import read_model

    if lab is None:
        from lab3_usd.check.lint import lint

        name = stage.GetRootLayer().identifier
        judged = lint(LintSubject(read_model(reopened(stage), lint_platform(), name)))
    else:
        file = Path(stage.GetRootLayer().realPath)
        number = checkpoint_of(file.name, lab)
        if number is None:
            return RuleResults()
        from lab3_usd.check.checker import judge

        lab = lab_of_team(lab, [(file.name, number)])
        model = read_model(reopened(stage), lab.platform, str(file))
        judged = judge(lab, lab.checkpoints[number], model)
    return replace(judged, findings=ordered(judged.findings))
