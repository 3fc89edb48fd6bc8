"""Lints stages in memory and says what was found, also with rules of a test's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from breaking import STEPS
from pxr import Usd
from robot_kinds import KINDS

from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import _RULES, Scope, all_rules, rule, without_rules
from lab3_usd.check.rule_runs import RuleResults, run_rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform, lint_subject
from lab3_usd.stage.read.stage_reader import read_model


@contextmanager
def registered_for_a_while() -> Iterator[None]:
    """Forget the rules that others than this program register meanwhile."""
    usual = set(_RULES)
    yield
    made_by = {name: _RULES[name].check.__module__ for name in set(_RULES) - usual}
    without_rules(name for name, module in made_by.items() if not module.startswith("lab3_usd"))


def add_failing_rule(rule_id: str, scope: Scope, error: type[Exception], *said: str) -> None:
    """Register a rule that fails by itself, once it has yielded a problem."""

    @rule(rule_id, "failing", scope=scope)
    def failing(_subject: object) -> Iterator[Problem]:
        """Nothing is wrong."""
        yield Problem("/", "said before the failure")
        raise error(*said)


def add_acting_rule(rule_id: str, act: Callable[[StageSubject], object]) -> None:
    """Register a rule of the scene that does something when it is asked, and finds nothing."""

    @rule(rule_id, f"acting-{rule_id.lower()}", scope="stage")
    def acting(subject: StageSubject) -> Iterator[Problem]:
        """Nothing is wrong."""
        act(subject)
        yield from ()


def add_counting_rule(rule_id: str, asked: list[StageModel]) -> None:
    """Register a rule of the scene that notes which stage it is asked about, and finds nothing."""
    add_acting_rule(rule_id, lambda subject: asked.append(subject.stage))


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
