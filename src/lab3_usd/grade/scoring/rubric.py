"""What each part of the lab is worth: the rubric as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from lab3_usd.model.finding import Requirement

# The columns of the table of grades that are no items; the last stands behind the items.
COLUMNS = ("student", "name", "status", "late", "earned", "possible", "percent", "remarks")
Visibility = Literal["visible", "hidden", "after_due_date", "after_published"]
Points = Annotated[float, Meta(ge=0.001, le=1e6)]  # so that sums and shares stay sane numbers
Share = Annotated[float, Meta(ge=0, le=1)]


class Item(Struct, frozen=True, forbid_unknown_fields=True):
    """One line of the gradebook: points for requirements of a checkpoint, or for a checklist line.

    `groups` and `requirements` are patterns of requirement groups and ids; `checklist` is the
    text of a line of the handout's checklists. `needs` names the items that this one stands on.
    """

    id: str
    title: str
    points: Points
    checkpoint: str = ""
    groups: tuple[str, ...] = ("*",)
    requirements: tuple[str, ...] = ("*",)
    checklist: str = ""
    partial: bool = True
    optional: bool = False
    needs: tuple[str, ...] = ()
    visibility: Visibility = "visible"

    def asks(self, requirement: Requirement) -> bool:
        """Whether the requirement, of this item's checkpoint, is one of this item's."""
        return any(fnmatchcase(requirement.group, each) for each in self.groups) and any(
            fnmatchcase(requirement.id, each) for each in self.requirements
        )


class Cap(Struct, frozen=True, forbid_unknown_fields=True):
    """An error of one of `rules` limits `items` (all where none is named) to a share.

    `checkpoints` are patterns of those in whose stages an error counts; where there are none it
    is the item's own, and any for an item of the handout's checklists.
    """

    rules: tuple[str, ...]
    at_most: Share
    because: str
    items: tuple[str, ...] = ()
    checkpoints: tuple[str, ...] = ()

    def looks_at(self, number: str, item: Item) -> bool:
        """Whether an error in the stage of this checkpoint limits the item."""
        if self.checkpoints:
            return any(fnmatchcase(number, each) for each in self.checkpoints)
        return item.checkpoint in {"", number}


class Late(Struct, frozen=True, forbid_unknown_fields=True):
    """What a late submission may earn, and who was late beside those that the names tell."""

    at_most: Share = 1.0
    students: tuple[str, ...] = ()


class Rubric(Struct, frozen=True):
    """Everything that a rubric file says.

    `asked` holds the requirements of each item, none of them met. `digest` tells two rubrics
    apart.
    """

    title: str
    digest: str
    weights: Mapping[str, float]
    items: tuple[Item, ...]
    caps: tuple[Cap, ...] = ()
    late: Late = field(default_factory=Late)
    asked: Mapping[str, tuple[Requirement, ...]] = field(default_factory=dict)

    @property
    def points(self) -> float:
        """The points there are without the optional ones."""
        return sum(item.points for item in self.items if not item.optional)
