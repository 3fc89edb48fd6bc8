"""What Isaac Sim is, in one release: its node types, how graphs run, and the rules of ROS names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property, lru_cache

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.behaviour import (
    BodyOf,
    Building,
    Door,
    JointsOf,
    Need,
    QuantityOf,
    Scripts,
    SensorOf,
    SingleSignal,
    TargetOf,
    UnitOf,
    WriterPorts,
)
from lab3_usd.isaac.graph_form import GraphForm
from lab3_usd.isaac.names import Names, OtherName
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.isaac.release_changes import ReleaseChanges
from lab3_usd.isaac.releases import BASE, Release, TypeChanges, changed, order
from lab3_usd.isaac.sensor_models import SensorModels


class RosNames(Struct, frozen=True, forbid_unknown_fields=True):
    """What the ROS 2 bridge makes of names.

    The input `namespace` of a node, and the attribute `namespace_attribute` of prims, go before
    topics. The input `domain` of a context names its domain; with that of `domain_by_environment`
    the environment does. `stamp` takes the time of a message. A node that reads it by itself has
    `system_time`, and `restart`; one that only reads simulation time has `reader_restart`. tf2
    listens to the `tree_topics`, which may have several publishers.
    """

    namespace: str
    namespace_attribute: str
    domain: str
    domain_by_environment: str
    stamp: str
    system_time: str
    restart: str
    reader_restart: str
    tree_topics: tuple[str, ...]


class GraphRuns(Struct, frozen=True):
    """How Isaac Sim runs graphs, as `omnigraph.yaml` says it.

    `lookalikes` are no names of types in any release, and which types they likely mean,
    `deprecated` those that Kit may still have, and their successors. `by_hand` are the events that
    need a user at the screen. `once` are the types with outputs that signal a single time after
    Play, `gates` those that block signals while the named input is 0, `passing` those that pass
    every signal. Prims without a parent are below `world_frame`. `writers` change the scene or the
    run. Properties that begin with a prefix of `appearance` change only the look, with one of
    `surfaces` they move what lies on a body.
    """

    lookalikes: Mapping[str, str]
    deprecated: Mapping[str, str]
    by_hand: frozenset[str]
    once: Mapping[str, SingleSignal]
    passing: frozenset[str]
    gates: Mapping[str, str]
    doors: Mapping[str, Door]
    scripts: Scripts
    building: Building
    world_frame: str
    writers: Mapping[str, WriterPorts]
    appearance: tuple[str, ...]
    surfaces: tuple[str, ...]


class Platform(GraphRuns, frozen=True, eq=False, dict=True):
    """What Isaac Sim is in one release, apart from any lab.

    `types` are the node types by their names in this release, `base` those of the release that all
    others are told apart from, and `releases` what those have otherwise; `changes` are what else
    differs. `names` are those of other releases.

    `events` maps each type that starts execution by itself to the pipeline stage of the graphs in
    which it fires, '' if the stage file does not decide that; `deltas` are the outputs with the
    length of a step. `placed` are the types of prims, apart from bodies, whose pose matters;
    `attributes` are read in addition to the usual ones. `recipes` are graphs that can be added to a
    stage, by kind.
    """

    release: str
    types: Mapping[str, NodeType]
    base: Mapping[str, NodeType]
    releases: Mapping[str, Release]
    usd_types: Mapping[str, str]
    graph: GraphForm
    names: Names
    changes: ReleaseChanges
    events: Mapping[str, str]
    deltas: Mapping[str, str]
    ros: RosNames
    transform_messages: frozenset[str]
    needs: Mapping[str, tuple[Need, ...]]
    sensors: Mapping[str, SensorOf]
    sensor_models: SensorModels
    bodies: Mapping[str, BodyOf]
    joints: Mapping[str, JointsOf]
    units: Mapping[str, UnitOf]
    targets: Mapping[str, TargetOf]
    quantities: Mapping[str, QuantityOf]
    application_prims: tuple[str, ...]
    placed: frozenset[str] = frozenset()
    attributes: frozenset[str] = frozenset()
    recipes: Mapping[str, Recipe] = {}

    def type_name(self, written: str) -> str:
        """Return the name of the type that a file's `node:type` means, whichever release wrote it.

        A type that is there keeps its name, whatever that means elsewhere. A name that nobody knows
        comes back unchanged.
        """
        return written if written in self.types else self.names.modern(written)

    def written_name(self, node_type: str) -> str:
        """Return the name that a file of this release has for a type."""
        is_early = order(self.release) < order(self.names.before)
        return (self.names.former(node_type) if is_early else None) or node_type

    def get(self, written: str) -> NodeType | None:
        """Return the type that a file's `node:type` means, whichever release wrote it."""
        return self.types.get(self.type_name(written))

    def other_ports(self, type_name: str) -> Mapping[str, OtherName]:
        """Return what other releases call ports of a type, by full name."""
        return self.names.ports.get(type_name, {})

    def is_own(self, release: str) -> bool:
        """Whether names of a release are those that this one has, too."""
        return bool(release) and order(BASE) < order(release) <= order(self.release)

    @cached_property
    def known_releases(self) -> tuple[str, ...]:
        """All releases that are known, the oldest first."""
        return tuple(sorted({*self.releases, *self.names.releases, BASE}, key=order))

    def named(self, releases: Iterable[str]) -> str:
        """Name releases in words: those in a row as from the first to the last."""
        rows: list[list[str]] = []
        for name in sorted(releases, key=order):
            at = self.known_releases.index(name)
            if rows and self.known_releases.index(rows[-1][-1]) == at - 1:
                rows[-1].append(name)
            else:
                rows.append([name])
        spans = [
            f"{row[0]} to {row[-1]}" if len(row) > 2 else " and ".join(row)  # noqa: PLR2004
            for row in rows
        ]
        return f"Isaac Sim {' and '.join(spans)}"

    def releases_of(self, node_type: str) -> tuple[str, ...]:
        """Return the releases that have a type, the oldest first."""
        return tuple(name for name in self.known_releases if self._has(name, node_type))

    def _has(self, name: str, node_type: str) -> bool:
        release = self.releases.get(name)
        if release is None:
            return node_type in self.base
        is_kept = node_type in self.base and node_type not in release.lacks
        return is_kept or node_type in release.has

    def releases_with(self, node_type: str, port: str) -> tuple[str, ...]:
        """Return the releases in which a type has a port that it lacks in 6.0."""
        described = ((name, self.releases.get(name)) for name in self.known_releases)
        return tuple(
            name
            for name, release in described
            if release is not None and port in release.types.get(node_type, TypeChanges()).ports
        )

    def versions(self, node_type: str) -> Mapping[str, int]:
        """Return the version that a type has in each release."""
        return _versions(self, node_type)

    def newest_version(self, node_type: NodeType) -> int:
        """Return the newest version of a type in any release."""
        return max(self.versions(node_type.type).values(), default=node_type.version)

    def in_release(self, name: str) -> Platform:
        """Return Isaac Sim as it is in a release: its types, ports, defaults and tokens."""
        # Of some releases names alone are known: they are as the last described one before them.
        later = [each for each in self.releases if order(BASE) < order(each) <= order(name)]
        described = name if name in self.releases or not later else max(later, key=order)
        release = self.releases.get(described)
        if release is None:
            return self if name == self.release else replace(self, release=name, types=self.base)
        types = {
            type_name: changed(node_type, release.types.get(type_name))
            for type_name, node_type in self.base.items()
            if type_name not in release.lacks
        }
        return replace(self, release=name, types={**types, **release.has})


@lru_cache(maxsize=1024)
def _versions(platform: Platform, node_type: str) -> Mapping[str, int]:
    base = platform.base.get(node_type)
    versions: dict[str, int] = {}
    for name in platform.releases_of(node_type):
        release = platform.releases.get(name)
        kind = base if release is None else release.has.get(node_type, base)
        changes = None if release is None else release.types.get(node_type)
        if changes is not None and changes.version is not None:
            versions[name] = changes.version
        elif kind is not None:
            versions[name] = kind.version
    return versions
