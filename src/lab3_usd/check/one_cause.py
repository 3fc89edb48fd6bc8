"""Says once what has one cause: many wires or targets that lead into one prim that is not there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import StageModel, absence_reason

_MOST = 3  # problems of one cause that are listed one by one


def absent_above(path: str, stage: StageModel) -> str:
    """Return the topmost prim at or above a path that is not in the scene, '' where all are."""
    absent = ""
    while path:
        absent = path if stage.prim(path) is None else absent
        path = path.rpartition("/")[0]
    return absent


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
