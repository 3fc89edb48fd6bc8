"""Loads what Isaac Sim is from the files of `graphs/isaac/`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.isaac.behaviour import (
    BodyOf,
    JointsOf,
    Need,
    QuantityOf,
    SensorOf,
    TargetOf,
    UnitOf,
)
from lab3_usd.isaac.graph import WIRE
from lab3_usd.isaac.load.graph_form import GraphEntry, graph_form
from lab3_usd.isaac.load.node_types import PortEntry, parse_port, parse_types
from lab3_usd.isaac.names import Names, OtherName
from lab3_usd.isaac.node_types import INPUT, NodeType
from lab3_usd.isaac.platform import GraphRuns, Platform, RosNames
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.isaac.release_changes import ANY, ReleaseChanges
from lab3_usd.isaac.releases import BASE, Release, TypeChanges, both_changes, order
from lab3_usd.isaac.sensor_models import (
    LidarNames,
    LongList,
    SchemaAttribute,
    SchemaRules,
    SensorModels,
    SensorSchema,
)
from lab3_usd.yaml_file import as_record, read_record, read_yaml


class EventEntry(Struct, forbid_unknown_fields=True):
    """The pipeline stage in which an event fires, and its output with the length of a step."""

    stage: str = ""
    delta: str = ""


class _SystemFile(GraphRuns, frozen=True, forbid_unknown_fields=True):
    """How Isaac Sim saves and runs graphs."""

    usd_types: dict[str, str]
    events: dict[str, EventEntry]
    graph: GraphEntry
    types: dict[str, Any]


def transform_messages(types: Mapping[str, NodeType]) -> frozenset[str]:
    """Return the types of the messages that nodes which publish transforms send."""
    senders = (kind for kind in types.values() if kind.tf and kind.role)
    return frozenset(message for kind in senders if (message := kind.message.get("")))


SYSTEM = "omnigraph.yaml"
TYPES = "node_types.yaml"
KIT_TYPES = "kit_types.json"
ROLES = "roles.yaml"
NEEDS = "needs.yaml"
VERSIONS = "versions.yaml"
LATER = "later_releases.yaml"
EARLY = "early_releases.yaml"
RENAMES = "renames.yaml"
CHANGES = "release_changes.yaml"
RECIPES = "recipes"


class _Renames(Struct, forbid_unknown_fields=True):
    before: str
    prefixes: dict[str, str]
    renamed: dict[str, str]
    types: dict[str, dict[str, str]] = {}
    ports: dict[str, dict[str, str]] = {}


class _ChangesEntry(Struct, forbid_unknown_fields=True):
    version: int | None = None
    ports: dict[str, str | PortEntry] = {}
    lacks: tuple[str, ...] = ()
    defaults: dict[str, Any] = {}
    allowed: dict[str, tuple[str, ...]] = {}
    message: dict[str, str] = {}


class _ReleaseEntry(Struct, forbid_unknown_fields=True):
    has: dict[str, Any] = {}
    lacks: tuple[str, ...] = ()
    types: dict[str, _ChangesEntry] = {}


class _Gone(Struct, forbid_unknown_fields=True):
    """Types that are gone, with the first and the last release that has them."""

    since: str
    until: str
    types: dict[str, Any]


class _EarlyEntry(_ReleaseEntry, forbid_unknown_fields=True):
    like: str = ""


class _EarlyReleases(Struct, forbid_unknown_fields=True):
    """What early releases have otherwise; of all else one is `like` another."""

    gone: tuple[_Gone, ...]
    releases: dict[str, _EarlyEntry]


class _LaterReleases(Struct, forbid_unknown_fields=True):
    usd_types: dict[str, str]
    types: dict[str, Any]
    releases: dict[str, _ReleaseEntry]


class _KitFile(Struct, forbid_unknown_fields=True):
    about: str
    releases: dict[str, dict[str, str]]
    usd_types: dict[str, str]
    events: tuple[str, ...]
    types: dict[str, dict[str, Any]]


class _Application(Struct, forbid_unknown_fields=True):
    prims: tuple[str, ...]


class _SchemaFile(Struct, forbid_unknown_fields=True):
    about: str
    schemas: dict[str, SensorSchema]


class _ModelFile(Struct, forbid_unknown_fields=True):
    lidar: LidarNames
    renamed: dict[str, str]
    any_type: tuple[str, ...]
    schemas: dict[str, SchemaRules]


def assemble_platform(folder: Path) -> Platform:
    """Read the files of `folder`.

    Raises:
        SpecError: a file is missing or wrong.
    """
    name = folder.name
    system = read_record(folder / SYSTEM, _SystemFile)
    data = read_yaml(folder / TYPES)
    later = read_record(folder / LATER, _LaterReleases)
    usd_types = {**system.usd_types, **data["usd_types"], **later.usd_types}
    kit = read_record(folder / KIT_TYPES, _KitFile)
    usd_types = {**kit.usd_types, **usd_types}
    library = {
        kind: {**entry, "is_documented": True}
        for kind, entry in kit.types.items()
        if kind not in system.types
    }
    files = {KIT_TYPES: library, TYPES: {**data["types"], **later.types}, SYSTEM: system.types}
    types = {
        kind: node_type
        for file, entries in _with_roles(files, folder).items()
        for kind, node_type in parse_types(entries, usd_types, f"{name}/{file}").items()
    }
    names = read_record(folder / RENAMES, _Renames)
    earlier = read_record(folder / VERSIONS, dict[str, _ReleaseEntry])
    releases = {
        release: _release(entry, usd_types, f"{name}: {release}")
        for release, entry in {**earlier, **later.releases}.items()
    }
    early = read_record(folder / EARLY, _EarlyReleases)
    releases |= _early(early, releases, usd_types, f"{name}/{EARLY}")
    recipes = _load_recipes(folder, types)
    sensors = read_record(folder / "sensors.yaml", dict[str, SensorOf])
    targets = read_record(folder / "targets.yaml", dict[str, TargetOf])
    marks = (recipe.joint_mark for recipe in recipes.values())
    switches = (target.switch for target in targets.values())
    return Platform(
        release=BASE,
        types=types,
        base=types,
        releases=releases,
        usd_types=usd_types,
        graph=graph_form(system.graph, f"{name}/{SYSTEM}: graph"),
        names=Names(
            before=names.before,
            prefixes=names.prefixes,
            renamed=names.renamed,
            types=other_types(names.types),
            ports=other_ports(names.ports, types, f"{name}/{RENAMES}: ports"),
        ),
        changes=_changes_of(folder, types, releases),
        **{name: getattr(system, name) for name in GraphRuns.__struct_fields__},
        events={
            **dict.fromkeys(kit.events, ""),
            **{name: event.stage for name, event in system.events.items()},
        },
        deltas={name: event.delta for name, event in system.events.items() if event.delta},
        ros=read_record(folder / "ros.yaml", RosNames),
        transform_messages=transform_messages(types),
        needs=_needs(folder, types, releases),
        sensors=sensors,
        sensor_models=_sensor_models(folder),
        bodies=read_record(folder / "bodies.yaml", dict[str, BodyOf]),
        joints=read_record(folder / "joints.yaml", dict[str, JointsOf]),
        units=read_record(folder / "units.yaml", dict[str, UnitOf]),
        targets=targets,
        attributes=frozenset(filter(None, (*marks, *switches))),
        quantities=read_record(folder / "quantities.yaml", dict[str, QuantityOf]),
        application_prims=read_record(folder / "application.yaml", _Application).prims,
        placed=frozenset(kind for sensor in sensors.values() for kind in sensor.types),
        recipes=recipes,
    )


def other_types(said: Mapping[str, Mapping[str, str]]) -> dict[str, OtherName]:
    """Return the names of types that single releases have, of names by type and release."""
    return {
        other: OtherName(name, release)
        for name, name_of in said.items()
        for release, other in name_of.items()
    }


def other_ports(
    said: Mapping[str, Mapping[str, str]], types: Mapping[str, NodeType], where: str
) -> dict[str, dict[str, OtherName]]:
    """Return the names of ports that single releases have, by type.

    `said` has `TYPE.PORT` and by release the name that the port has there.

    Raises:
        SpecError: a type or a port is not known; the line opens with `where`.
    """
    named: dict[str, dict[str, OtherName]] = {}
    for path, name_of in said.items():
        kind, _, port = path.rpartition(".")
        if kind not in types or port not in types[kind].ports:
            raise SpecError(f"{where}: '{path}' is not a port of a node type")
        for release, other in name_of.items():
            named.setdefault(kind, {})[other] = OtherName(port, release)
    return named


def _with_roles(files: Mapping[str, Mapping[str, Any]], folder: Path) -> dict[str, dict[str, Any]]:
    """Return the types of each file with the facts about their ports that are written by hand.

    Raises:
        SpecError: a type is not there.
    """
    roles = read_yaml(folder / ROLES)
    for name in roles:
        if not any(name in types for types in files.values()):
            raise SpecError(f"{folder.name}/{ROLES}: '{name}' is not a node type")
    return {
        file: {name: {**entry, **roles.get(name, {})} for name, entry in types.items()}
        for file, types in files.items()
    }


def _release(entry: _ReleaseEntry, usd_types: Mapping[str, str], where: str) -> Release:
    changes = {
        name: TypeChanges(
            version=node.version,
            ports={
                full: parse_port(full, port, usd_types, f"{where}: {name}")
                for full, port in node.ports.items()
            },
            lacks=node.lacks,
            defaults=_tuples(node.defaults),
            allowed=node.allowed,
            message=node.message,
        )
        for name, node in entry.types.items()
    }
    return Release(parse_types(entry.has, usd_types, where), entry.lacks, changes)


def _early(
    file: _EarlyReleases, described: Mapping[str, Release], usd_types: Mapping[str, str], where: str
) -> dict[str, Release]:
    """Return the early releases, each with the types that are gone since.

    The interfaces of those are known of the first release that has them alone.
    """
    early = {}
    for name, entry in file.releases.items():
        own = _release(entry, usd_types, f"{where}: {name}")
        like = described.get(entry.like, Release({}, (), {}))
        gone = {
            kind: node_type if name == part.since else replace(node_type, is_open=True)
            for part in file.gone
            if order(part.since) <= order(name) <= order(part.until)
            for kind, node_type in parse_types(part.types, usd_types, where).items()
        }
        types = {
            kind: both_changes(like.types.get(kind), own.types.get(kind))
            for kind in {**like.types, **own.types}
        }
        has = {**like.has, **own.has, **gone}
        early[name] = Release(has, (*like.lacks, *own.lacks), types)
    return early


def _changes_of(
    folder: Path, types: Mapping[str, NodeType], releases: Mapping[str, Release]
) -> ReleaseChanges:
    """Return what stages meet in other releases.

    Raises:
        SpecError: it names a type that no release has.
    """
    where = f"{folder.name}/{CHANGES}"
    changes = as_record(_tuples(read_yaml(folder / CHANGES)), ReleaseChanges, where)
    type_names = {*types, *(kind for release in releases.values() for kind in release.has)}
    named = [*changes.folds, *changes.ports, *changes.ignored, *changes.idle]
    named += [kind for meaning in changes.meanings for kind in meaning.types]
    named += [each.by for each in changes.successors if ANY not in each.by]
    for kind in named:
        if kind not in type_names:
            raise SpecError(f"{where}: '{kind}' is not a node type")
    return changes


def _tuples(data: Any) -> Any:
    """Make lists of values comparable with the values of ports."""
    if isinstance(data, dict):
        return {key: _tuples(entry) for key, entry in data.items()}
    return tuple(_tuples(entry) for entry in data) if isinstance(data, list) else data


def _needs(
    folder: Path, types: Mapping[str, NodeType], releases: Mapping[str, Release]
) -> dict[str, tuple[Need, ...]]:
    where = f"{folder.name}/{NEEDS}"
    needs = read_record(folder / NEEDS, dict[str, tuple[Need, ...]])
    for name, entries in needs.items():
        kind = types.get(name)
        if kind is None:
            raise SpecError(f"{where}: '{name}' is not a node type")
        ports = set(kind.ports)
        for release in releases.values():
            ports |= set(release.types[name].ports if name in release.types else ())
        for need in entries:
            for short in (*need.inputs, need.when, need.when_wired, need.unless):
                if short and INPUT + short not in ports:
                    raise SpecError(f"{where}: {name} has no input '{short}'")
    return needs


def _sensor_models(folder: Path) -> SensorModels:
    """Read the schemas of sensors, and what their values must be.

    Raises:
        SpecError: a file is missing or wrong.
    """
    schemas = read_record(folder / "sensor_schemas.json", _SchemaFile).schemas
    said = read_record(folder / "sensor_models.yaml", _ModelFile)
    return SensorModels(
        {name: replace(schema, attributes=_read(schema)) for name, schema in schemas.items()},
        said.schemas,
        said.lidar,
        said.renamed,
        frozenset(said.any_type),
    )


def _read(schema: SensorSchema) -> dict[str, SchemaAttribute]:
    return {
        name: replace(said, default=_default(said.default))
        for name, said in schema.attributes.items()
    }


def _default(said: Any) -> Any:
    """Return a default as values of stages are: lists become tuples."""
    if isinstance(said, dict):
        return LongList(said["length"], _default(said["low"]), _default(said["high"]))
    return tuple(map(_default, said)) if isinstance(said, list) else said


def _load_recipes(folder: Path, types: Mapping[str, NodeType]) -> dict[str, Recipe]:
    """Return the recipes of a folder by kind, in the order of their files' names.

    Raises:
        SpecError: a file is wrong; the line names file, role and port.
    """
    recipes = {}
    for file in sorted((folder / RECIPES).glob("*.yaml")):
        recipe = as_record(read_yaml(file), Recipe, file.name)
        _check_recipe(recipe, types, file.name)
        recipes[recipe.kind] = recipe
    return recipes


def _check_recipe(recipe: Recipe, types: Mapping[str, NodeType], file: str) -> None:
    for role, node in recipe.nodes.items():
        if node.type not in types:
            raise SpecError(f"{file}: {role}: '{node.type}' is not a node type")
        kind = types[node.type]
        for port in (*node.set, *node.targets, *node.ports):
            if kind.input(port) is None and not kind.grows_by_message:
                raise SpecError(f"{file}: {role}: {node.type} has no input '{port}'")
    for text in recipe.wires:
        match = WIRE.match(text)
        ends = (match[1], match[3]) if match else ()
        if match is None or any(role not in recipe.nodes for role in ends):
            raise SpecError(f"{file}: wire '{text}': is not written 'role.port -> role.port'")
