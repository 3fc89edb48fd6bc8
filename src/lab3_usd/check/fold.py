"""One mistake is one finding: the root of several, and one for many of one cause.

A finding that rests on what another one says is wrong is not reported. Wires or targets that lead
into one prim that is not there are said once.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec.structs import replace

from lab3_usd.model.finding import SEVERITIES, Finding, Place, Problem
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import StageModel, absence_reason

_MOST = 3  # problems of one cause that are listed one by one


def fold(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings that no other finding explains, in their order.

    A finding is dropped if a site that it assumes to be right has a finding of at least the same
    severity, even if that one is dropped too. Of findings that assume each other, the first stays.
    A finding that assumes a property of its own repeats another one there, which then also fails
    its requirements.
    """
    findings = list(findings)
    at: dict[str, list[int]] = {}
    for number, finding in enumerate(findings):
        for prim in dict.fromkeys(prim for prim, _ in _places(finding)):
            at.setdefault(prim, []).append(number)
    paths = sorted(at)
    reasons = {
        number: causes
        for number, finding in enumerate(findings)
        if finding.assumes and (causes := set(_reasons(number, findings, at, paths)))
    }
    gone: set[int] = set()
    while len(gone) < len(reasons):
        resting = [
            number
            for number, causes in reasons.items()
            if number not in gone and any(other in gone or other not in reasons for other in causes)
        ]
        gone.update(resting)
        if not resting:
            del reasons[next(number for number in reasons if number not in gone)]
    for number in gone:
        told = findings[number]
        own = [place for place in told.assumes if place[1] is not None and place in _places(told)]
        for other in reasons[number] - gone if own else ():
            if any(_stands_at(findings[other], *place) for place in own):
                unmet = dict.fromkeys((*findings[other].unmet, *told.unmet))
                findings[other] = replace(findings[other], unmet=tuple(unmet))
    return [finding for number, finding in enumerate(findings) if number not in gone]


def _places(finding: Finding) -> Iterator[Place]:
    yield finding.prim, finding.property
    yield from finding.covers


def _reasons(
    number: int, findings: list[Finding], at: Mapping[str, list[int]], paths: list[str]
) -> Iterator[int]:
    """Yield the findings, at least as severe as this one, at sites that it assumes to be right.

    `paths` are the prims of `at`, sorted.
    """
    finding = findings[number]
    for prim, name in finding.assumes:
        below: Sequence[str] = (prim,)
        if prim.endswith("/"):
            below = paths[bisect_left(paths, prim) : bisect_left(paths, f"{prim[:-1]}0")]  # "/" + 1
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


def absent_above(path: str, stage: StageModel) -> str:
    """Return the topmost prim at or above a path that is not in the scene, '' where all are."""
    absent = [top for top in upwards(path) if stage.prim(top) is None]
    return absent[-1] if absent else ""


def of_one_cause(
    problems: Iterable[tuple[Problem, str]], what: str, stage: StageModel
) -> Iterator[Problem]:
    """Yield problems, those of one cause as one with their number; '' is a cause of its own.

    `what` they are is a plural. What rests on a missing asset stays by itself.
    """
    listed = list(problems)
    groups: dict[str, list[Problem]] = {}
    for problem, cause in listed:
        if cause and problem.rests_on is None:
            groups.setdefault(cause, []).append(problem)
    merged = {cause: group for cause, group in groups.items() if len(group) > _MOST}
    for problem, cause in listed:
        if problem.rests_on is not None or cause not in merged:
            yield problem
        elif problem is merged[cause][0]:
            yield _merged(merged[cause], cause, what, stage)


def _merged(group: list[Problem], cause: str, what: str, stage: StageModel) -> Problem:
    first = next((problem for problem in group if problem.severity is None), group[0])
    reason, count = absence_reason(stage, cause), len(group) - 1
    return replace(
        first,
        message=f"{first.message}; {count} more {what} lead to {cause}, which {reason}",
        related=tuple(dict.fromkeys(problem.prim for problem in group)),
        covers=tuple((problem.prim, problem.property) for problem in group),
        fix=tuple(edit for problem in group for edit in problem.fix),
        identity=cause,
    )
