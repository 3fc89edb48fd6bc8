"""What a student reads of lost points: each fault once, in its own words.

The rows of a gradebook have a deduction for each requirement, which is what a rubric weighs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lab3_usd.grade.scoring import Deduction
from lab3_usd.model.grade import LostPoints
from lab3_usd.report.entries import plural


def reasons(lost: Iterable[Deduction]) -> list[LostPoints]:
    """Return what one item lost, in order: one line for each fault with what rests on it.

    What was carried over from earlier parts is the last line, with its own lines below it.
    """
    lines: dict[tuple[str, str, str], list[Deduction]] = {}
    again: list[Deduction] = []
    for number, line in enumerate(lost):
        if line.again:
            again.append(line)
        else:
            key = (line.found, line.rule, line.place) if line.found else ("", "", str(number))
            lines.setdefault(key, []).append(line)
    told = [_of_one_fault(group) for group in lines.values()]
    points = round(sum(line.points for line in again), 2)
    if again:
        below = tuple(
            LostPoints(
                line.points, f"{line.again}: {line.found or line.title}", line.rule, line.place
            )
            for line in again
        )
        told.append(LostPoints(points, "carried over from earlier parts", below=below))
    return told


def _of_one_fault(group: Sequence[Deduction]) -> LostPoints:
    first, points = group[0], round(sum(line.points for line in group), 2)
    text = first.title
    if first.found:
        part = first.title.partition(": ")[0] if ": " in first.title else ""
        is_named = not part or part in first.found or len(group) > 1
        text = first.found if is_named else f"{part}: {first.found}"
    further = len({line.requirement for line in group}) - 1
    if further:
        text += f" ({plural(further, 'more requirement')} not met by it)"
    return LostPoints(points, text, first.rule, first.place)


def carried_text(lost: Iterable[Deduction]) -> str:
    """Say what a student lost in all by faults of earlier parts; '' for nothing."""
    again = [line for line in lost if line.again]
    items = plural(len({line.item for line in again}), "item")
    points = sum(line.points for line in again)
    return f"carried over into {items}: -{points:.2f}" if again else ""
