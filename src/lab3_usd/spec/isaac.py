"""All public node types of Isaac Sim: what they need, and what earlier releases had otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.spec.catalog import Catalog

NEWEST = "6.0"


class Need(Struct, frozen=True, forbid_unknown_fields=True):
    """Inputs of which a node needs one that is wired or set, or else works on zeros.

    With `when` it needs it only where that input is wired or set, or switched on, with
    `when_wired` where it is wired, and with `unless` where it is not switched on. With
    `zero_counts`, zeros that somebody wrote are as good as other values. `effect` says what
    happens without, `source` names the file of Isaac Sim that shows it.
    """

    inputs: tuple[str, ...]
    effect: str
    source: str
    when: str = ""
    when_wired: str = ""
    unless: str = ""
    zero_counts: bool = False
    severity: Literal["error", "warning"] = "error"


class TypeChanges(Struct, frozen=True, forbid_unknown_fields=True):
    """What a node type of an earlier release has otherwise: ports by full name, and defaults."""

    gone: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    defaults: Mapping[str, Any] = {}


class Release(Struct, frozen=True, forbid_unknown_fields=True):
    """What an earlier release has otherwise than the newest one.

    `gone` are types that only the earlier one has, `added` those that only the newest one has.
    """

    gone: tuple[str, ...]
    added: tuple[str, ...]
    types: Mapping[str, TypeChanges]


class SensorOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The sensors whose render product a node reads: prims of these types, or with these schemas.

    `needs` is a schema that such a prim must carry, '' where it needs none.
    """

    types: tuple[str, ...]
    source: str
    schemas: tuple[str, ...] = ()
    needs: str = ""


class BodyOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The body that a node follows: the prim of the input `prim`, with one of these schemas.

    A prim without them that carries the schema `robot` stands for the first link that it lists in
    the relationship `links`: a prim with the schema `link`, or that of a robot that it lists.
    `gives` are the outputs that change as the body moves.
    """

    prim: str
    schemas: tuple[str, ...]
    robot: str
    links: str
    link: str
    gives: tuple[str, ...]
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
    it carries the schema `inside`; it or a prim below it carries `holds`.
    """

    input: str
    what: str
    effect: str
    source: str
    types: tuple[str, ...] = ()
    schemas: tuple[str, ...] = ()
    inside: str = ""
    holds: str = ""


class QuantityOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The quantities that outputs give, and those that inputs are meant for."""

    source: str
    gives: Mapping[str, str] = {}
    takes: Mapping[str, tuple[str, ...]] = {}


class IsaacTypes(Struct, frozen=True, eq=False):
    """The catalog of all public node types, with what the linter must know beside it."""

    catalog: Catalog
    needs: Mapping[str, tuple[Need, ...]]
    releases: Mapping[str, Release]
    sensors: Mapping[str, SensorOf]
    bodies: Mapping[str, BodyOf]
    units: Mapping[str, UnitOf]
    targets: Mapping[str, TargetOf]
    quantities: Mapping[str, QuantityOf]
    application_prims: tuple[str, ...]

    def releases_with(self, node_type: str, port: str) -> list[str]:
        """Return the earlier releases in which a type has a port that the newest one lacks."""
        return [
            name
            for name, release in self.releases.items()
            if node_type in release.types and port in release.types[node_type].gone
        ]

    def releases_of(self, node_type: str) -> list[str]:
        """Return the earlier releases that have a type which the newest one lacks."""
        return [name for name, release in self.releases.items() if node_type in release.gone]

    def is_later(self, node_type: str, release: str) -> bool:
        """Whether the newest release has a type that an earlier one did not have yet."""
        return release in self.releases and node_type in self.releases[release].added

    def in_release(self, name: str) -> Catalog:
        """Return the catalog as it was in a release: its types, ports and defaults."""
        release = self.releases.get(name)
        if release is None:
            return self.catalog
        types = {
            type_name: node_type
            for type_name, node_type in self.catalog.types.items()
            if type_name not in release.added
        }
        for type_name in types.keys() & release.types.keys():
            node_type, changes = types[type_name], release.types[type_name]
            ports = {
                key: replace(port, default=changes.defaults[key], former=None)
                if key in changes.defaults
                else port
                for key, port in node_type.ports.items()
                if key not in changes.lacks
            }
            tf = node_type.tf
            if tf is not None and set(tf.arrays) & set(changes.lacks):
                tf = replace(tf, arrays=())
            types[type_name] = replace(node_type, ports=ports, tf=tf)
        return replace(self.catalog, types=types)
