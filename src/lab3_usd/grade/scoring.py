"""Turns the requirements that stages meet into points: the same faults, the same grade."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.grade.rubric import Cap, Item, Rubric
from lab3_usd.model.finding import ChecklistItem, StageResult

State = Literal["full", "part", "none", "missing", "unreadable", "blocked", "open"]


class ItemGrade(Struct, frozen=True):
    """What one item earned, of what was possible after what is blocked has left.

    `open` items are for a person to judge: nothing earned, nothing possible yet.
    """

    id: str
    state: State
    earned: float
    possible: float
    blocked: float
    because: str = ""


class LostRequirement(Struct, frozen=True):
    """A requirement that cost points, at the item where it did."""

    item: str
    requirement: str
    title: str


class Grade(Struct, frozen=True):
    """The points of one submission; `percent` is None where nothing could be judged."""

    items: tuple[ItemGrade, ...]
    lost: tuple[LostRequirement, ...]
    earned: float
    possible: float
    percent: float | None
    because: tuple[str, ...] = ()


def grade(
    rubric: Rubric,
    results: Iterable[StageResult],
    checklist: Iterable[ChecklistItem] = (),
    *,
    late: bool = False,
) -> Grade:
    """Return the points for the results of one submission, in whatever order they come."""
    stages = _by_checkpoint(results)
    states = {line.text: line.state for line in checklist}
    errors = {
        number: {finding.rule for finding in result.findings if finding.severity == "error"}
        for number, result in stages.items()
    }
    grades: dict[str, ItemGrade] = {}
    lost: dict[str, LostRequirement] = {}
    for item in rubric.items:
        state = states.get(item.checklist, "not shown")
        if item.checklist and state == "met":
            graded = ItemGrade(item.id, "full", item.points, item.points, 0.0)
        elif item.checklist and state == "not met":
            graded = ItemGrade(item.id, "none", 0.0, item.points, 0.0)
        elif item.checklist:
            graded = ItemGrade(item.id, "open", 0.0, 0.0, 0.0, "for a person to judge")
        else:
            needed = [grades[name] for name in item.needs]
            known = dict(lost) if item.optional else lost
            graded = _by_requirements(rubric, item, stages.get(item.checkpoint), needed, known)
        grades[item.id] = _capped(rubric.caps, item, graded, errors)
    return _total(rubric, grades, tuple(lost.values()), late=late)


def _by_checkpoint(results: Iterable[StageResult]) -> dict[str, StageResult]:
    """Keep one result of each checkpoint: of several files the one that meets the least."""

    def order(result: StageResult) -> tuple[bool, float, str]:
        possible = result.score.possible
        share = result.score.earned / possible if possible else 0.0
        return (result.verdict != "unreadable", share, result.path)

    kept: dict[str, StageResult] = {}
    for result in sorted(results, key=order):
        kept.setdefault(result.checkpoint or "", result)
    return kept


def _by_requirements(
    rubric: Rubric,
    item: Item,
    result: StageResult | None,
    needed: Sequence[ItemGrade],
    lost: dict[str, LostRequirement],
) -> ItemGrade:
    """Weigh the item's requirements; those it loses are added to `lost`.

    A file that is missing or unreadable loses the item and blocks no other: it is not the same
    fault again but work that was not handed in.
    """
    if result is None or result.verdict == "unreadable":
        state: State = "missing" if result is None else "unreadable"
        name = f"checkpoint {item.checkpoint}"
        lost.setdefault(name, LostRequirement(item.id, name, f"{name} is {state}"))
        return ItemGrade(item.id, state, 0.0, item.points, 0.0)
    met = {requirement.id: requirement.met for requirement in result.requirements}
    blocking = [item_grade.id for item_grade in needed if item_grade.state != "full"]
    weights = {"met": 0.0, "lost": 0.0, "blocked": 0.0}
    for requirement in rubric.asked[item.id]:
        fate = "met"
        if not met.get(requirement.id, False):
            fate = "blocked" if blocking or requirement.id in lost else "lost"
        weights[fate] += rubric.weights[requirement.kind]
        if fate == "lost":
            lost[requirement.id] = LostRequirement(item.id, requirement.id, requirement.title)
    graded = _weighed(item, weights)
    if graded.blocked and blocking:
        return replace(graded, because=f"stands on {', '.join(blocking)}")
    return graded


def _weighed(item: Item, weights: Mapping[str, float]) -> ItemGrade:
    counted = weights["met"] + weights["lost"]
    share = counted / (counted + weights["blocked"])
    blocked = round(item.points * (1 - share), 6)
    if not counted:
        return ItemGrade(item.id, "blocked", 0.0, 0.0, blocked)
    possible = item.points * share
    if weights["lost"] and not item.partial:
        return ItemGrade(item.id, "none", 0.0, possible, blocked)
    state: State = "full" if not weights["lost"] and not blocked else "part"
    if not weights["met"]:
        state = "none"
    return ItemGrade(item.id, state, possible * weights["met"] / counted, possible, blocked)


def _capped(
    caps: Iterable[Cap], item: Item, graded: ItemGrade, errors: Mapping[str, set[str]]
) -> ItemGrade:
    """Limit what an item earned, given the rules that found errors in each checkpoint."""
    for cap in caps:
        limit = graded.possible * cap.at_most
        if graded.earned <= limit or (cap.items and item.id not in cap.items):
            continue
        if any(
            not rules.isdisjoint(cap.rules)
            for number, rules in errors.items()
            if cap.looks_at(number, item)
        ):
            state: State = "part" if limit else "none"
            graded = replace(graded, earned=limit, state=state, because=cap.because)
    return graded


def _total(
    rubric: Rubric,
    grades: Mapping[str, ItemGrade],
    lost: tuple[LostRequirement, ...],
    *,
    late: bool,
) -> Grade:
    optional = {item.id for item in rubric.items if item.optional}
    earned = sum(graded.earned for graded in grades.values())
    possible = sum(graded.possible for name, graded in grades.items() if name not in optional)
    because: tuple[str, ...] = ()
    if late and earned > possible * rubric.late.at_most:
        earned = possible * rubric.late.at_most
        because = (f"late: at most {rubric.late.at_most:.0%}",)
    rounded = (
        replace(
            graded,
            earned=round(graded.earned, 2),
            possible=round(graded.possible, 2),
            blocked=round(graded.blocked, 2),
        )
        for graded in grades.values()
    )
    return Grade(
        items=tuple(rounded),
        lost=lost,
        earned=round(earned, 2),
        possible=round(possible, 2),
        percent=round(100 * earned / possible, 2) if possible else None,
        because=because,
    )
