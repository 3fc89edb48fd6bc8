"""A grade as the page shows it: the points, and a row for each item of the rubric."""

from __future__ import annotations

from msgspec import Struct


class GradeItem(Struct, frozen=True):
    """One item of the rubric: what it earned, of how many points, and why not of all.

    `state` is that of the gradebook. `possible` is what counts of the item's `points`; `lost` are
    the requirements that cost points here, of which `more` are not named.
    """

    title: str
    state: str
    earned: float
    possible: float
    points: float
    why: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    more: int = 0


class GradeSummary(Struct, frozen=True):
    """The grade of one student; `percent` is None where nothing could be judged.

    `title` is that of the rubric, `because` says what limits the grade as a whole.
    """

    title: str
    student: str
    name: str
    earned: float
    possible: float
    percent: float | None
    because: tuple[str, ...] = ()
    items: tuple[GradeItem, ...] = ()

    @property
    def heading(self) -> str:
        """Whose grade it is: the name, or where none is known the student's number."""
        return self.name or self.student
