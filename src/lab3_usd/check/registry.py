"""The table of rules: what a rule is, and how a function becomes one."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Literal, TypeVar

from msgspec import Struct

from lab3_usd.check.finding import Problem, Severity

# What a rule looks at: one graph of a spec beside its graph in the stage, the whole stage, what
# came out of judging it, the stage beside its starter, the map files, the saved output of the
# running system, the folder.
Scope = Literal[
    "graph", "stage", "outcome", "starter", "maps", "navigation", "evidence", "submission", "file"
]
Check = TypeVar("Check", bound=Callable[..., Iterator[Problem]])

FAMILIES = {
    "F": "files",
    "G": "graphs",
    "N": "nodes",
    "P": "settings",
    "R": "targets",
    "W": "wires",
    "S": "scene",
    "L": "lidar",
    "C": "camera",
    "T": "frames",
    "Q": "topics",
    "U": "starter",
    "M": "maps",
    "V": "navigation",
    "E": "evidence",
    "X": "submission",
    "Z": "fence",
}


class Rule(Struct, frozen=True):
    """One rule: a stable id, a name, a usual severity, and the generator that finds problems."""

    id: str
    name: str
    severity: Severity
    scope: Scope
    check: Callable[..., Iterator[Problem]]

    @property
    def manual(self) -> str:
        """The docstring: what is wrong; `Why:`; `Fix:`; `Example:`."""
        return inspect.getdoc(self.check) or ""

    def section(self, title: str) -> str:
        """Return the paragraph of the manual that opens with `title:`, as one line."""
        for paragraph in self.manual.split("\n\n"):
            if paragraph.startswith(f"{title}:"):
                return " ".join(paragraph[len(title) + 1 :].split())
        return ""


_RULES: dict[str, Rule] = {}


def _origin(check: Callable[..., Iterator[Problem]]) -> tuple[str, str]:
    """Name where a rule is written; a module that is imported again brings the same rules."""
    return check.__module__, check.__qualname__


def rule(
    rule_id: str, name: str, scope: Scope, severity: Severity = "error"
) -> Callable[[Check], Check]:
    """Register a generator of `Problem`s as the rule `rule_id`, which is never used again."""

    def register(check: Check) -> Check:
        known = _RULES.get(rule_id)
        if known is not None and _origin(known.check) != _origin(check):
            message = f"rule {rule_id} is registered twice"
            raise ValueError(message)
        _RULES[rule_id] = Rule(rule_id, name, severity, scope, check)
        _in_order.cache_clear()
        return check

    return register


def all_rules() -> dict[str, Rule]:
    """Return every rule by id, in order of id; imports the families on the first call."""
    for family in FAMILIES.values():
        importlib.import_module(f"lab3_usd.check.rules.{family}")
    return dict(sorted(_RULES.items()))


def rules_of(scope: Scope, *families: str) -> list[Rule]:
    """Return the rules of one scope and of the families named, in order of id.

    Only those families are imported.
    """
    for family in families:
        importlib.import_module(f"lab3_usd.check.rules.{FAMILIES[family]}")
    return list(_in_order(scope, families))


@cache
def _in_order(scope: Scope, families: tuple[str, ...]) -> tuple[Rule, ...]:
    rules = (found for _, found in sorted(_RULES.items()) if found.scope == scope)
    return tuple(found for found in rules if found.id[0] in families)


def run_rule(found: Rule, subject: Any) -> list[Problem]:  # noqa: ANN401 - the scope decides
    """Run one rule over its subject; what it raises is the caller's to record as a crash."""
    return list(found.check(subject))
