"""The grade of one submission, as reports show it."""

from __future__ import annotations

from msgspec import Struct

ADJUSTED, REMARK = "adjusted by hand: ", "remark: "  # what the words of a grader follow


class LostPoints(Struct, frozen=True):
    """Points that an item lost, and why: none where nothing was left to lose.

    The lines `below` add up to its points. What a grader adds by hand is less than nothing.
    """

    points: float
    title: str
    rule: str = ""
    place: str = ""
    below: tuple[LostPoints, ...] = ()

    @property
    def text(self) -> str:
        """The points, why, the rule and the place, in one line."""
        points = f"{-self.points:+.2f} " if self.points else ""
        where = " ".join(filter(None, (self.rule, self.place)))
        return f"{points}{self.title}{f' ({where})' if where else ''}"

    @property
    def is_shown(self) -> bool:
        """Whether it says where points went, or what a grader wrote."""
        return bool(self.points) or self.title.startswith((ADJUSTED, REMARK))


class GradeItem(Struct, frozen=True):
    """One item of the rubric: what it earned, of how many points, and why not of all.

    `state` is that of the gradebook. `possible` is what counts of the item's `points`. What it
    `lost` adds up to what it did not earn; `more` of what cost nothing more are not named. `groups`
    are the groups of requirements that it is about, each after its checkpoint. `visibility` says
    when Gradescope shows it.
    """

    title: str
    state: str
    earned: float
    possible: float
    points: float
    why: tuple[str, ...] = ()
    lost: tuple[LostPoints, ...] = ()
    more: int = 0
    groups: tuple[str, ...] = ()
    visibility: str = "visible"


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
