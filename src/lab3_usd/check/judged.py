"""Runs the rules of one family over one subject, and keeps what they found and what failed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct

from lab3_usd.check.finding import Crash, Finding, Problem
from lab3_usd.check.registry import Rule, Scope, rules_of
from lab3_usd.errors import StageError


class Judged(Struct, frozen=True):
    """What rules found, and which of them failed themselves."""

    findings: tuple[Finding, ...] = ()
    crashes: tuple[Crash, ...] = ()


def run_family(scope: Scope, family: str, subject: Any) -> Judged:  # noqa: ANN401 - the scope decides
    """Run every rule of a family; one that fails itself is a crash, never a pass.

    Raises:
        StageError: a file turns out to be damaged.
    """
    found: list[Finding] = []
    crashes: list[Crash] = []
    for each in rules_of(scope, family):
        try:
            found.extend(finding_of(each, problem) for problem in each.check(subject))
        except StageError:  # noqa: PERF203
            raise
        except Exception as error:  # noqa: BLE001 - whatever a rule raises is its crash
            crashes.append(Crash(each.id, f"{type(error).__name__}: {error}"))
    return Judged(tuple(found), tuple(crashes))


def join(judged: Iterable[Judged]) -> Judged:
    """Return everything that several runs found, in their order."""
    runs = list(judged)
    return Judged(
        tuple(finding for each in runs for finding in each.findings),
        tuple(crash for each in runs for crash in each.crashes),
    )


def finding_of(found: Rule, problem: Problem) -> Finding:
    """Stamp the rule's id, name and severity on what it yielded."""
    return Finding(
        rule=found.id,
        name=found.name,
        severity=problem.severity or found.severity,
        prim=problem.prim or "/",
        property=problem.property,
        message=problem.message,
        expected=problem.expected,
        actual=problem.actual,
        handout=problem.handout,
        hint=problem.hint or found.section("Fix") or None,
        related=problem.related,
    )
