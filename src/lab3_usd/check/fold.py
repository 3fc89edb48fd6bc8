"""Keeps the roots: a finding that rests on what another one says is wrong is not reported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from lab3_usd.model.finding import SEVERITIES, Finding, Place


def fold(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings of which no other one is the reason, in their order.

    A finding goes where another one that is as grave stands at a place that it assumes to be right,
    whether that one stays or goes for a third. Of findings that rest on each other the first stays.
    """
    findings = list(findings)
    at: dict[str, list[int]] = {}
    for number, finding in enumerate(findings):
        for prim in dict.fromkeys(prim for prim, _ in _places(finding)):
            at.setdefault(prim, []).append(number)
    reasons = {
        number: found
        for number, finding in enumerate(findings)
        if finding.assumes and (found := set(_reasons(number, findings, at)))
    }
    gone: set[int] = set()
    while len(gone) < len(reasons):
        resting = [
            number
            for number, found in reasons.items()
            if number not in gone and any(other in gone or other not in reasons for other in found)
        ]
        gone.update(resting)
        if not resting:
            del reasons[next(number for number in reasons if number not in gone)]
    return [finding for number, finding in enumerate(findings) if number not in gone]


def _places(finding: Finding) -> Iterator[Place]:
    yield finding.prim, finding.property
    yield from finding.covers


def _reasons(number: int, findings: list[Finding], at: Mapping[str, list[int]]) -> Iterator[int]:
    """Yield the findings as grave as one that stand at a place which it assumes to be right."""
    finding = findings[number]
    for prim, name in finding.assumes:
        below = (path for path in at if path.startswith(prim)) if prim.endswith("/") else (prim,)
        for other in (other for path in below for other in at.get(path, ())):
            is_as_grave = _rank(findings[other]) <= _rank(finding)
            if other != number and is_as_grave and _stands_at(findings[other], prim, name):
                yield other


def _rank(finding: Finding) -> int:
    return SEVERITIES.index(finding.severity)


def _stands_at(finding: Finding, prim: str, name: str | None) -> bool:
    for path, port in _places(finding):
        is_there = path.startswith(prim) if prim.endswith("/") else path == prim
        begins = name is not None and name.endswith("*") and (port or "").startswith(name[:-1])
        if is_there and (name is None or port == name or begins):
            return True
    return False
