"""Judges any stage of Isaac Sim without a spec."""

from __future__ import annotations

from msgspec.structs import replace

from lab3_usd.check.registry import import_rules, rules_of
from lab3_usd.check.ros.running import LintSubject
from lab3_usd.check.rule_runs import RuleResults, merge_results, run_rule

import_rules("F", "K")


def lint(subject: LintSubject) -> RuleResults:
    """Run every rule over a stage, which is read as they ask.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        files = merge_results(run_rule(rule, subject, None) for rule in rules_of("model", "F"))
        stage = merge_results(run_rule(rule, subject, None) for rule in rules_of("lint", "K"))
        # What cannot be found leaves the verdict open; whether it should be there is not known.
        notes = replace(
            files, findings=tuple(replace(finding, severity="note") for finding in files.findings)
        )
        return merge_results((notes, stage))
    finally:
        # What rules derive holds what they were given, and so the stage.
        subject.stage.judged.clear()
