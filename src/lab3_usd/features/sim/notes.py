"""What a dry run shows, as notes beside the findings of a check: `lab3 check --sim`."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from lab3_usd.check.explanations import ONLY_IN_A_DRY_RUN, explaining_finding
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import run_rule
from lab3_usd.data import program
from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline.results import unreadable_result, with_findings
from lab3_usd.report.behaviour.page import DryRunSummary, dry_run_summary
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import lab_of_team, load_lab


def with_dry_run(result: StageResult) -> tuple[StageResult, DryRunSummary | None]:
    """Return a result with a note for each bad check of a dry run, and what a page shows of it.

    The score stays.
    """
    if result.verdict == "unreadable" or result.checkpoint is None:
        return result, None
    lab = lab_of_team(load_lab(), [(result.path, result.checkpoint)])
    run = dry_run(Path(result.path), lab, result.checkpoint)
    if run.behaviour.verdict == "unreadable":  # by damage where no rule looks
        reason = run.behaviour.not_simulated[0].reason
        return unreadable_result(result.path, result.checkpoint, reason), None
    hint = f"{program()} sim plays the stage and shows what it does"
    notes = []
    for check in (check for check in run.behaviour.checks if check.verdict == "bad"):
        (note,) = run_rule(all_rules()[ONLY_IN_A_DRY_RUN], check, None).findings
        cause = explaining_finding(check, result.findings)
        rule, name = (note.rule, note.name) if cause is None else (cause.rule, cause.name)
        notes.append(replace(note, rule=rule, name=name, hint=hint))
    noted = with_findings(result, (*result.findings, *notes))
    return noted, dry_run_summary(run.behaviour, run.replays)
