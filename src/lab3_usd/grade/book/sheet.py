"""A grade in words for the student: what each item earned, and why it lost what it lost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.grade.scoring.rubric import Item, Rubric
from lab3_usd.grade.scoring.scoring import Grade, ItemGrade, State
from lab3_usd.report.html.grade_summary import GradeItem, GradeSummary

MOST_LOST = 12  # requirements named at one item: the findings name the rest


def grade_sheet(rubric: Rubric, points: Grade, student: str, name: str) -> GradeSummary:
    """Return the grade as the student's page shows it."""
    graded = {each.id: each for each in points.items}
    lost: dict[str, list[str]] = {}
    for each in points.lost:
        part, slash, _ = each.requirement.partition("/")
        lost.setdefault(each.item, []).append(f"{part}: {each.title}" if slash else "")
    items = (
        _item(item, graded, rubric, list(filter(None, lost.get(item.id, ()))))
        for item in rubric.items
    )
    return GradeSummary(
        title=rubric.title,
        student=student,
        name=name,
        earned=points.earned,
        possible=points.possible,
        percent=points.percent,
        because=points.because,
        items=tuple(items),
    )


def _item(
    item: Item, graded: Mapping[str, ItemGrade], rubric: Rubric, lost: list[str]
) -> GradeItem:
    own = graded[item.id]
    return GradeItem(
        title=item.title,
        state=own.state,
        earned=own.earned,
        possible=own.possible,
        points=item.points,
        why=tuple(_why(item, graded, rubric)),
        lost=tuple(lost[:MOST_LOST]),
        more=max(len(lost) - MOST_LOST, 0),
    )


def _why(item: Item, graded: Mapping[str, ItemGrade], rubric: Rubric) -> Iterator[str]:
    own = graded[item.id]
    if item.optional:
        yield "extra points: nothing is lost where they are missing"
    yield from _of_state(item, own.state)
    if own.blocked:
        yield _blocked(item, graded, rubric)
    if own.because in {cap.because for cap in rubric.caps}:
        yield f"limited: {own.because}"


def _of_state(item: Item, state: State) -> Iterator[str]:
    if state == "missing":
        yield f"no stage of checkpoint {item.checkpoint} was found"
    elif state == "unreadable":
        yield f"the stage of checkpoint {item.checkpoint} cannot be opened"
    elif state == "open":
        yield f"for a person to judge: {item.checklist}"
    elif state == "none" and item.checklist:
        yield f"not met: {item.checklist}"
    elif state == "none" and not item.partial:
        yield "all or nothing"


def _blocked(item: Item, graded: Mapping[str, ItemGrade], rubric: Rubric) -> str:
    """Say how much of the item does not count, and which item has cost points for it already."""
    titles = {each.id: each.title for each in rubric.items if graded[each.id].state != "full"}
    stands_on = ", ".join(titles[name] for name in item.needs if name in titles)
    amount = f"{graded[item.id].blocked:g} of {item.points:g} points do not count"
    if stands_on:
        return f"blocked by {stands_on}: {amount}"
    return f"blocked by faults that cost points above: {amount}"
