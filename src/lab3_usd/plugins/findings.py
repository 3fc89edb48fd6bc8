"""Lints and checks a stage that another validator has open; never raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import judge_open_stage
from lab3_usd.spec.load.loader import load_lab

CRASH = "the program itself failed"


def findings_of(stage: Any) -> tuple[Finding, ...]:
    """Return what the linter finds in an open stage, in order."""
    return _findings_of(lambda: judge_open_stage(stage))


def checked_findings_of(stage: Any) -> tuple[Finding, ...]:
    """Return what the check finds in an open stage whose file is named after a checkpoint."""
    return _findings_of(lambda: judge_open_stage(stage, load_lab()))


def _findings_of(judge: Callable[[], RuleResults]) -> tuple[Finding, ...]:
    """Return the findings; a gap and a crash of a rule are findings as well.

    An exception that leaves a validator ends the whole run of the program around it.
    """
    try:
        results = judge()
    except Exception as error:  # noqa: BLE001 - see above
        return (_crash(f"{type(error).__name__}: {error}"),)
    crashes = (_crash(f"{crash.rule}: {crash.error}") for crash in results.crashes)
    gaps = (
        Finding("F02", "not-verifiable", "warning", "/", f"not judged: {gap}")
        for gap in results.gaps
    )
    return (*results.findings, *gaps, *crashes)


def _crash(text: str) -> Finding:
    return Finding("F01", "crash", "error", "/", f"{CRASH}: {text}")


def text_of(finding: Finding) -> str:
    """Return a finding as one line: rule, message and repair."""
    is_named = finding.property is None or finding.property in finding.message
    place = "" if is_named else f"{finding.property}: "
    hint = f" ({' '.join(finding.hint.split())})" if finding.hint else ""
    return f"{finding.rule} {finding.name}: {place}{finding.message}{hint}"
