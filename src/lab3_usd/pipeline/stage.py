"""Checks one stage: reads it, runs the rules, and finds the lines of the findings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.data import program
from lab3_usd.errors import StageError, UsageError
from lab3_usd.model.finding import StageResult, ordered
from lab3_usd.pipeline.results import located, unreadable
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint


def checkpoint_of(name: str, lab: Lab) -> str | None:
    """Return the checkpoint that a file name begins with (`Lab3_03...`), else None."""
    return named_checkpoint(name, lab.files)


def check_stage(
    path: str | Path, checkpoint: str | None = None, lab: Lab | None = None
) -> StageResult:
    """Judge the stage at `path`, at the checkpoint given or else named by the file.

    The result holds every finding at its place, the requirements met and asked, and the rules
    that crashed. A file that cannot be read is a result as well, with the verdict `unreadable`.

    Raises:
        UsageError: the checkpoint is unknown, or neither given nor in the file name.
    """
    lab = lab or load_lab()
    number = checkpoint or checkpoint_of(Path(path).name, lab)
    if number is None:
        raise UsageError(
            f"{path}: names no checkpoint (as {lab.checkpoints[lab.first].file} does); "
            f"give one with --checkpoint, or use {program()} lint, which needs none"
        )
    if number not in lab.checkpoints:
        raise UsageError(
            f"there is no checkpoint '{number}'; known are {', '.join(lab.checkpoints)}"
        )
    from lab3_usd.stage.read.opening import kept_open

    with kept_open():  # so that nothing is asked of the stage twice
        return _checked(path, number, lab)


def _checked(path: str | Path, number: str, lab: Lab) -> StageResult:
    from lab3_usd.stage.read.opening import cached, open_stage, quiet

    try:
        stage = open_stage(Path(path))
        # Imported only now: a command has another thread do it while the stage opens.
        from lab3_usd.check.checker import judge
        from lab3_usd.stage.read.reader import read_model

        demands = lab.same_demands(number)
        with quiet():
            model = read_model(stage, lab.platform, str(path))
            # The model, which is kept as well, keeps the stage that `id` names.
            judged = cached(
                ("judgement", id(stage), demands.id), lambda: judge(lab, demands, model)
            )
    except StageError as error:
        return unreadable(str(path), number, error)
    findings = judged.findings
    # Notes ask for no repair: a stage that passes is not read a second time for them.
    if any(finding.severity != "note" for finding in findings):
        findings = tuple(located(findings, path, stage))
    findings = ordered(findings)
    return StageResult(
        path=str(path),
        checkpoint=number,
        findings=findings,
        requirements=judged.requirements,
        crashes=judged.crashes,
        not_judged=judged.not_judged,
        gaps=judged.gaps,
    )


def check_open_stage(stage: Any, lab: Lab) -> RuleResults:
    """Judge a stage that somebody else has open, which is left as it is; of another name, nothing.

    The checkpoint is the one that the name of its file begins with.

    Raises:
        StageError: a file of the stage is damaged.
    """
    file = Path(stage.GetRootLayer().realPath)
    number = checkpoint_of(file.name, lab)
    if number is None:
        return RuleResults()
    from lab3_usd.check.checker import judge
    from lab3_usd.stage.read.opening import reopened
    from lab3_usd.stage.read.reader import read_model

    judged = judge(
        lab, lab.checkpoints[number], read_model(reopened(stage), lab.platform, str(file))
    )
    return RuleResults(ordered(judged.findings), judged.crashes, judged.not_judged, judged.gaps)
