"""Lints stages in memory, and says what was found."""

from __future__ import annotations

from typing import Any

from breaking import STEPS
from pxr import Usd
from robot_kinds import KINDS

from lab3_usd.check.lint import lint
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import RuleResults, run_rule
from lab3_usd.pipeline.any_stage import lint_platform, lint_subject
from lab3_usd.stage.read.stage_reader import read_model


def linted(stage: Usd.Stage, release: str = "6.0", moved_from: str = "") -> RuleResults:
    model = read_model(stage, lint_platform(release), "stage.usda")
    return lint(lint_subject(model, moved_from))


def found_by(
    rule: str, stage: Usd.Stage, release: str = "6.0", moved_from: str = ""
) -> RuleResults:
    """Return what one rule finds."""
    model = read_model(stage, lint_platform(release), "stage.usda")
    subject = lint_subject(model, moved_from)
    return run_rule(all_rules()[rule], subject, None)


def said_by(stage: Usd.Stage, *severities: str, release: str = "6.0") -> list[str]:
    """Return what is found as `RULE PRIM PROPERTY`, sorted; of all severities where none is."""
    return sites_of(linted(stage, release), *severities)


def sites_of(results: RuleResults, *severities: str) -> list[str]:
    """Return the findings of a stage as `said_by` does."""
    assert not results.crashes
    return sorted(
        f"{finding.rule} {finding.prim} {finding.property or ''}".strip()
        for finding in results.findings
        if not severities or finding.severity in severities
    )


def broken_robot(name: str, steps: list[dict[str, Any]]) -> Usd.Stage:
    """Return a robot after these steps."""
    stage = KINDS[name]()
    for step in steps:
        for verb, arguments in step.items():
            STEPS[verb](stage, *(arguments if isinstance(arguments, list) else [arguments]))
    return stage
