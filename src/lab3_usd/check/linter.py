"""Runs the rules that need no spec over a stage."""

from __future__ import annotations

from msgspec.structs import replace

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.registry import import_rules, rules_of
from lab3_usd.check.repairs.lint import with_lint_repairs
from lab3_usd.check.rule_runs import RuleResults, merge_results, run_rule

import_rules("F", "K")


def lint(subject: LintSubject) -> RuleResults:
    """Run every rule over a stage, which is read as they ask.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        files = merge_results(run_rule(each, subject, None) for each in rules_of("model", "F"))
        stage = merge_results(run_rule(each, subject, None) for each in rules_of("lint", "K"))
        # What cannot be found leaves the verdict open; whether it should be there is not known.
        notes = RuleResults(
            tuple(replace(each, severity="note") for each in files.findings), files.crashes
        )
        repairs = tuple(with_lint_repairs(stage.findings, subject))
        return merge_results((notes, RuleResults(repairs, stage.crashes)))
    finally:
        # What rules derive holds what they were given, and so the stage.
        subject.stage.judged.clear()
