"""What `lab3 check --sim` adds: what goes wrong in a dry run of a stage, as notes, and its maps."""

from __future__ import annotations

from pathlib import Path

from lab3_usd.check.explanations import explaining_rule
from lab3_usd.check.registry import all_rules
from lab3_usd.data import program
from lab3_usd.judge.results import unreadable, with_findings
from lab3_usd.model.finding import Finding, StageResult
from lab3_usd.report.behaviour.page import DryRunSummary, dry_run_summary
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab


def with_dry_run(result: StageResult, shown: dict[str, DryRunSummary]) -> StageResult:
    """Return a result with a note for each check of a dry run that is bad; the score stays.

    What a page shows of it is added to `shown`.
    """
    if result.verdict == "unreadable" or result.checkpoint is None:
        return result
    run = dry_run(Path(result.path), load_lab(), result.checkpoint)
    if run.behaviour.verdict == "unreadable":  # by damage where no rule looks
        return unreadable(result.path, result.checkpoint, run.behaviour.not_simulated[0].reason)
    drawn = dry_run_summary(run.behaviour, run.replay)
    if drawn is not None:
        shown[result.path] = drawn
    rules = all_rules()
    wrong = [check for check in run.behaviour.checks if check.verdict == "bad"]
    notes = (
        Finding(
            rule,
            rules[rule].name,
            "note",
            check.prim or "/",
            f"in a dry run ({check.name}): {check.text}",
            hint=f"{program()} sim plays the stage and shows what it does",
        )
        for check, rule in ((check, explaining_rule(check)) for check in wrong)
    )
    return with_findings(result, (*result.findings, *notes))
