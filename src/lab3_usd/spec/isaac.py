"""All public node types of Isaac Sim: what they need, and what other releases have otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.spec.catalog import Catalog, NodeType, Port

_KIND = "inputs:type"
BASE = "6.0"  # the release that the catalog describes, and by which a stage is judged by default


class Need(Struct, frozen=True, forbid_unknown_fields=True):
    """Inputs of which a node needs one that is wired or set, or else works on zeros.

    With `when` it needs it only where that input is wired or set, or switched on, with
    `when_wired` where it is wired, and with `unless` where it is not switched on. With
    `zero_counts`, zeros that somebody wrote are as good as other values. `effect` says what
    happens without, `source` names the file of Isaac Sim that shows it. `until` is the last release
    in which it does, '' where all do.
    """

    inputs: tuple[str, ...]
    effect: str
    source: str
    when: str = ""
    when_wired: str = ""
    unless: str = ""
    zero_counts: bool = False
    severity: Literal["error", "warning"] = "error"
    until: str = ""


class TypeChanges(Struct, frozen=True):
    """What a node type of another release has otherwise: ports by full name, defaults and tokens.

    `ports` are those that only that release has, `message` kinds of messages. A release that offers
    other kinds and has none of its own takes no others.
    """

    version: int | None = None
    ports: Mapping[str, Port] = {}
    lacks: tuple[str, ...] = ()
    defaults: Mapping[str, Any] = {}
    allowed: Mapping[str, tuple[str, ...]] = {}
    message: Mapping[str, str] = {}


class Release(Struct, frozen=True):
    """What another release has otherwise than the one that the catalog describes.

    `has` are types that only the other one has, `lacks` those that it does not have.
    """

    has: Mapping[str, NodeType]
    lacks: tuple[str, ...]
    types: Mapping[str, TypeChanges]


class SensorOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The sensors whose render product a node reads: prims of these types.

    `schemas_until` are schemas that also made a prim such a sensor, each with the last release in
    which it did. `needs` is a schema that a prim of the types must carry, '' where it needs none.
    """

    types: tuple[str, ...]
    source: str
    schemas_until: Mapping[str, str] = {}
    needs: str = ""

    def schemas_in(self, release: str) -> set[str]:
        """Return the schemas that make a prim such a sensor in a release."""
        return {name for name, last in self.schemas_until.items() if is_within(release, "", last)}


class BodyOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The body that a node follows: the prim of the input `prim`, with one of these schemas.

    A prim without them that carries the schema `robot` stands for the first link that it lists in
    the relationship `links`: a prim with the schema `link`, or that of a robot that it lists. It
    does so from the release `robot_since` on. `gives` are the outputs that change as the body
    moves.
    """

    prim: str
    schemas: tuple[str, ...]
    robot: str
    links: str
    link: str
    gives: tuple[str, ...]
    source: str
    robot_since: str = ""


class JointsOf(Struct, frozen=True, forbid_unknown_fields=True):
    """How a node picks the joints that it moves, each with the last release in which it does so.

    Until `zeros_until` numbers of joints that are all 0 are ignored, so that all joints move. Until
    `spreads_until` one command counts for all joints named.
    """

    zeros_until: str
    spreads_until: str
    source: str


class UnitOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The unit of length of what a node gives.

    `metres` are outputs in metres. Others keep the unit of the input `passes`; where the input `by`
    says so, metres become units of the stage (`to_stage`) or the other way (`to_metres`).
    """

    source: str
    metres: tuple[str, ...] = ()
    passes: str = ""
    by: str = ""
    to_stage: str = ""
    to_metres: str = ""


class TargetOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The prims that a node can read by its input `input`.

    Such a prim has one of these types and one of these schemas, where any are listed. A prim above
    it carries the schema `inside`; it or a prim below it carries `holds`. `since` is the first
    release in which that holds.
    """

    input: str
    what: str
    effect: str
    source: str
    types: tuple[str, ...] = ()
    schemas: tuple[str, ...] = ()
    inside: str = ""
    holds: str = ""
    since: str = ""


class QuantityOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The quantities that outputs give, and those that inputs are meant for."""

    source: str
    gives: Mapping[str, str] = {}
    takes: Mapping[str, tuple[str, ...]] = {}


def is_within(release: str, since: str, until: str) -> bool:
    """Whether a release is one of those from `since` to `until`, '' for no bound."""
    return (not since or order(since) <= order(release)) and (
        not until or order(release) <= order(until)
    )


@lru_cache(maxsize=64)
def order(release: str) -> tuple[int, ...]:
    """Return what sorts releases."""
    return tuple(int(part) for part in release.split("."))


class IsaacTypes(Struct, frozen=True, eq=False):
    """The catalog of all public node types, with what the linter must know beside it."""

    catalog: Catalog
    needs: Mapping[str, tuple[Need, ...]]
    releases: Mapping[str, Release]
    sensors: Mapping[str, SensorOf]
    bodies: Mapping[str, BodyOf]
    joints: Mapping[str, JointsOf]
    units: Mapping[str, UnitOf]
    targets: Mapping[str, TargetOf]
    quantities: Mapping[str, QuantityOf]
    application_prims: tuple[str, ...]

    @property
    def known_releases(self) -> tuple[str, ...]:
        """All releases that are known, the oldest first."""
        return tuple(sorted((*self.releases, BASE), key=order))

    def releases_of(self, node_type: str) -> tuple[str, ...]:
        """Return the releases that have a type, the oldest first."""
        return tuple(name for name in self.known_releases if self._has(name, node_type))

    def _has(self, name: str, node_type: str) -> bool:
        release = self.releases.get(name)
        if release is None:
            return node_type in self.catalog.types
        is_kept = node_type in self.catalog.types and node_type not in release.lacks
        return is_kept or node_type in release.has

    def releases_with(self, node_type: str, port: str) -> tuple[str, ...]:
        """Return the releases in which a type has a port that the catalog lacks."""
        return tuple(
            name
            for name in self.known_releases
            if name in self.releases
            and node_type in self.releases[name].types
            and port in self.releases[name].types[node_type].ports
        )

    def versions(self, node_type: str) -> dict[str, int]:
        """Return the version that a type has in each release."""
        known = self.catalog.types.get(node_type)
        found: dict[str, int] = {}
        for name in self.releases_of(node_type):
            release = self.releases.get(name)
            kind = known if release is None else release.has.get(node_type, known)
            changes = None if release is None else release.types.get(node_type)
            if changes is not None and changes.version is not None:
                found[name] = changes.version
            elif kind is not None:
                found[name] = kind.version
        return found

    def in_release(self, name: str) -> Catalog:
        """Return the catalog as it is in a release: its types, ports, defaults and tokens."""
        release = self.releases.get(name)
        if release is None:
            return self.catalog
        types = {
            type_name: _changed(node_type, release.types.get(type_name))
            for type_name, node_type in self.catalog.types.items()
            if type_name not in release.lacks
        }
        return replace(self.catalog, types={**types, **release.has})


def _changed(node_type: NodeType, changes: TypeChanges | None) -> NodeType:
    """Return a type as another release has it."""
    if changes is None:
        return node_type
    ports = {
        key: _other_port(port, changes)
        for key, port in node_type.ports.items()
        if key not in changes.lacks
    }
    tf = node_type.tf
    if tf is not None and set(tf.arrays) & set(changes.lacks):
        tf = replace(tf, arrays=())
    kinds = () if changes.message else changes.allowed.get(_KIND, ())
    message = {kind: name for kind, name in node_type.message.items() if not kinds or kind in kinds}
    return replace(
        node_type,
        version=changes.version or node_type.version,
        ports={**ports, **changes.ports},
        tf=tf,
        message={**message, **changes.message},
    )


def _other_port(port: Port, changes: TypeChanges) -> Port:
    if port.name in changes.defaults:
        port = replace(port, default=changes.defaults[port.name], former=None)
    if port.name in changes.allowed:
        port = replace(port, allowed=changes.allowed[port.name])
    return port
