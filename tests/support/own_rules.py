"""Rules of a test's own, in the registry for as long as the test takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import _RULES, Scope, rule, without_rules
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import StageModel


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
