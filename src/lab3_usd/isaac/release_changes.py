"""What a stage meets in another release beside types, ports, defaults and tokens."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from typing import Any, Literal

from msgspec import Struct

from lab3_usd.isaac.releases import is_release_within, order

ANY = "*"


class Successor(Struct, frozen=True, forbid_unknown_fields=True):
    """What takes the place of types: a type of the name `by`, with other ports as `notes` say.

    A star in both names stands for the same. `values` carry over to the ports named there.
    """

    types: tuple[str, ...]
    by: str
    source: str
    notes: str = ""
    values: Mapping[str, str] = {}

    def of(self, kind: str) -> str | None:
        """Return the type in place of one, None where it is about others."""
        for pattern in self.types:
            if fnmatchcase(kind, pattern):
                return self.by.replace(ANY, kind[len(pattern.partition(ANY)[0]) :])
        return None


class Fold(Struct, frozen=True, forbid_unknown_fields=True):
    """A node that one of the type `into` does without: its `targets` become those of that one."""

    into: str
    targets: Mapping[str, str]


class GonePort(Struct, frozen=True, forbid_unknown_fields=True):
    """What became of a port that a release lacks.

    It has the name `to` now, or a wire to it can go (`drop`), or something else does its work
    (`by`). While it was off, the input `off_for` counted for nothing. Its values are lost until the
    input `prim` names a prim, where there is one.
    """

    to: str = ""
    drop: bool = False
    by: str = ""
    off_for: str = ""
    prim: str = ""


class Breaks(Struct, frozen=True, forbid_unknown_fields=True):
    """Old types at which the renaming of a stage ends when it is opened, in some releases."""

    types: tuple[str, ...]
    since: str
    until: str
    source: str

    def ends_at(self, written: str, release: str) -> bool:
        """Whether the renaming ends at a node of this type in a release."""
        return written in self.types and is_release_within(release, self.since, self.until)


class Skips(Struct, frozen=True, forbid_unknown_fields=True):
    """The input that leaves out readings of a sensor, and since when it counts ticks of that."""

    input: str
    since: str
    source: str


class Since(Struct, frozen=True, forbid_unknown_fields=True):
    """A change, by the first release that has it."""

    since: str
    source: str


class Meaning(Struct, frozen=True, forbid_unknown_fields=True):
    """Something that means another thing from the release `since` on.

    It concerns nodes of `types` that have a `value` (a star: any authored one), a target or wire at
    a `port` except those in `but`, or a sensor whose `attributes` differ from its schema's. Or it
    concerns prims with a `schema` and without `lacks`, or missing assets with `asset` in their
    path. It is reported from `least` places on: with the text `up` for a stage that moves to that
    release, `down` for one that moves back.
    """

    id: str
    since: str
    source: str
    up: str
    down: str = ""
    severity: Literal["warning", "note"] = "warning"
    types: tuple[str, ...] = ()
    value: Mapping[str, Any] = {}
    port: str = ""
    but: tuple[str, ...] = ()
    attributes: tuple[str, ...] = ()
    schema: str = ""
    lacks: str = ""
    asset: str = ""
    least: int = 1

    def between(self, before: str, after: str) -> str:
        """Say what changes between two releases, '' where nothing does."""
        if leads_past(self.since, before, after):
            return self.up
        return self.down if leads_past(self.since, after, before) else ""


class ReleaseChanges(Struct, frozen=True, forbid_unknown_fields=True):
    """All of them.

    `tokens` are the nearest ones of tokens that a release lacks. `defaults` say what a default does
    by port, for True and for False. Changed defaults of `ignored` ports do nothing from a release,
    and those of `idle` ones while other inputs have these values.
    """

    successors: tuple[Successor, ...]
    folds: Mapping[str, Fold]
    ports: Mapping[str, Mapping[str, GonePort]]
    tokens: Mapping[str, Mapping[str, Mapping[str, str]]]
    ignored: Mapping[str, Mapping[str, str]]
    idle: Mapping[str, Mapping[str, Mapping[str, str]]]
    defaults: Mapping[str, tuple[str, str]]
    breaks: Breaks
    skips: Skips
    sensors: Since
    meanings: tuple[Meaning, ...]

    def successor(self, kind: str) -> tuple[str, Successor] | None:
        """Return the type in place of one, and what is known of it."""
        named = ((each.of(kind), each) for each in self.successors)
        return next(((name, each) for name, each in named if name), None)

    def gone(self, kind: str, port: str) -> GonePort | None:
        """Return what became of a port of a type, None where that is not known."""
        change_of = self.ports.get(kind, {})
        return change_of.get(port, change_of.get(ANY))

    def does_nothing(self, kind: str, port: str, release: str) -> bool:
        """Whether the value of a port does nothing in a release."""
        since = self.ignored.get(kind, {}).get(port)
        return since is not None and order(release) >= order(since)

    def told(self, before: str, after: str) -> Iterator[tuple[Meaning, str]]:
        """Yield what changes its meaning between two releases, with what is to be said."""
        for meaning in self.meanings:
            text = meaning.between(before, after)
            if text:
                yield meaning, text


def leads_past(since: str, before: str, after: str) -> bool:
    """Whether the way from one release to another leads up to `since` or later."""
    return order(before) < order(since) <= order(after)
