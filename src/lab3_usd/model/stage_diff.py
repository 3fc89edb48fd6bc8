"""What differs between two stages, as plain data."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

# In the order of reports. What comes over ROS follows from what stands above it.
Part = Literal["graph", "node", "value", "wire", "target", "robot", "scene", "topic", "frame"]
PARTS: tuple[Part, ...] = (
    "graph", "node", "value", "wire", "target", "robot", "scene", "topic", "frame",
)  # fmt: skip
Edit = Literal["added", "removed", "changed"]
EDITS: tuple[Edit, ...] = ("removed", "changed", "added")


class StageChange(Struct, frozen=True):
    """One thing in which the second stage is not as the first.

    `path` is a prim, named as the second stage names it where both have it; of a topic it is the
    name, of a transform the child frame. `was` and `now` are words for people, '' for nothing.
    """

    part: Part
    edit: Edit
    path: str
    property: str = ""
    was: str = ""
    now: str = ""


class StageDiff(Struct, frozen=True):
    """Two stages by the names they were given, and everything in which they differ."""

    before: str
    after: str
    changes: tuple[StageChange, ...] = ()
