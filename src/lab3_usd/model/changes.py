"""What a stage changed of its starter, and what differs between any two stages, as plain data."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lab3_usd.spec.submission import StarterRules

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


# What a difference is about, the gravest first.
Kind = Literal["type", "schema", "physics", "place", "look", "added"]
KINDS: tuple[Kind, ...] = ("type", "schema", "physics", "place", "look", "added")
Site = tuple[str, str | None]


class Difference(Struct, frozen=True):
    """One thing that is not as the starter has it; `property` is empty for types and schemas."""

    kind: Kind
    property: str
    was: str
    now: str
    physics: bool


class Change(Struct, frozen=True):
    """One prim of the starter that is not as it was.

    `absent` says why the prim is not in the stage, empty where it is: then `count` prims went
    with it, and `physics` tells whether any of them collides, moves or joins. `related` are the
    prims that its relationships name, `body` the rigid body it belongs to, '' for none.
    """

    prim: str
    type: str
    differences: tuple[Difference, ...] = ()
    absent: str = ""
    count: int = 1
    physics: bool = False
    related: tuple[str, ...] = ()
    body: str = ""


class StarterSubject(Struct, frozen=True):
    """A stage beside the starter it was made from.

    `faulty_sites` holds the sites where other rules have found an error already, `related_prims`
    the prims that an error relates to: one of them that is absent is reported as moved.
    """

    rules: StarterRules
    changes: tuple[Change, ...]
    faulty_sites: frozenset[Site] = frozenset()
    related_prims: frozenset[str] = frozenset()
