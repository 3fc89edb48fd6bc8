"""What a stage changed of its starter, as plain data: what the rules about the starter look at."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lab3_usd.spec.submission import StarterRules

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
