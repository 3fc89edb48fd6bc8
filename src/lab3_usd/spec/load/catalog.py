"""Loads the node types of the lab and of Isaac Sim."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import (
    INPUT,
    OUTPUT,
    Catalog,
    DrivePorts,
    Dynamic,
    GraphEntry,
    NodeType,
    Port,
    ProductPorts,
    Scripts,
    SingleSignal,
    TfPorts,
    WriterPorts,
    graph_form,
)
from lab3_usd.spec.isaac import (
    BodyOf,
    IsaacTypes,
    JointsOf,
    Need,
    QuantityOf,
    Release,
    SensorOf,
    TargetOf,
    TypeChanges,
    UnitOf,
)
from lab3_usd.spec.lab import CATALOG
from lab3_usd.spec.values import Value, is_known_type, typed_value
from lab3_usd.spec.yaml_file import read_yaml, record

_RELATIONSHIP = "rel"
_Fact = TypeVar("_Fact")


class _PortEntry(Struct, forbid_unknown_fields=True):
    """The long form of a port; most are written `TYPE = DEFAULT`."""

    type: str
    default: Any = None
    allowed: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    output_only: bool = False
    deprecated: bool = False
    former: Any = None


class _DrivesEntry(Struct, forbid_unknown_fields=True):
    robot: tuple[str, str]
    joints: str
    indices: str
    commands: tuple[str, ...]


class _ProductEntry(Struct, forbid_unknown_fields=True):
    named: str
    camera: str
    size: tuple[str, str]


class _TypeEntry(Struct, forbid_unknown_fields=True):
    """A node type, as in its `.ogn` file or a saved stage.

    A port is written `name: type = default`. `execution` ports carry signals, `target` ports name
    prims, `union` ports take the type of their connection. A publisher has a `role`, a `message`,
    and ports with `topics` and `frames`.
    """

    version: int
    name: str
    prim: str
    handout: str = ""
    inputs: dict[str, str | _PortEntry] = {}
    outputs: dict[str, str | _PortEntry] = {}
    dynamic: Dynamic | None = None
    role: Literal["", "publisher", "subscriber", "helper", "service"] = ""
    topics: tuple[str, ...] = ()
    only_of: dict[str, tuple[str, ...]] = {}
    services: tuple[str, ...] = ()
    message: str | dict[str, str] = {}
    moved: dict[str, str] = {}
    frames: tuple[str, ...] = ()
    tf: TfPorts | None = None
    articulation: tuple[str, ...] = ()
    time_step: tuple[str, ...] = ()
    step_limits: tuple[str, ...] = ()
    sizes: dict[str, int] = {}
    drives: _DrivesEntry | None = None
    product: _ProductEntry | None = None
    same_in_metres: tuple[str, ...] = ()
    grows_by_message: bool = False
    is_open: bool = False


class _EventEntry(Struct, forbid_unknown_fields=True):
    stage: str = ""
    delta: str = ""


class CatalogFile(Struct, forbid_unknown_fields=True):
    """Node types, and the way in which Isaac Sim saves and runs graphs."""

    usd_types: dict[str, str]
    prefixes: dict[str, str]
    renamed: dict[str, str]
    lookalikes: dict[str, str]
    events: dict[str, _EventEntry]
    once: dict[str, SingleSignal]
    gates: dict[str, str]
    scripts: Scripts
    world_frame: str
    graph: GraphEntry
    types: dict[str, _TypeEntry]
    writers: dict[str, WriterPorts] = {}
    looks: tuple[str, ...] = ()


def parse_catalog(data: Mapping[str, Any]) -> Catalog:
    """Build the catalog from the data of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    content = record(data, CatalogFile, CATALOG)
    return Catalog(
        types={
            name: _node_type(name, type_entry, content.usd_types)
            for name, type_entry in content.types.items()
        },
        graph=graph_form(content.graph, f"{CATALOG}: graph"),
        prefixes=content.prefixes,
        renamed=content.renamed,
        lookalikes=content.lookalikes,
        events={name: event.stage for name, event in content.events.items()},
        deltas={name: event.delta for name, event in content.events.items() if event.delta},
        once=content.once,
        gates=content.gates,
        writers=content.writers,
        looks=content.looks,
        scripts=content.scripts,
        world_frame=content.world_frame,
    )


def parse_types(
    data: Mapping[str, Any], usd_types: Mapping[str, str], file: str
) -> dict[str, NodeType]:
    """Build node types that are written as those of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    content = record(data, dict[str, _TypeEntry], file)
    return {
        name: _node_type(name, type_entry, usd_types, file) for name, type_entry in content.items()
    }


def _node_type(
    name: str, entry: _TypeEntry, usd_types: Mapping[str, str], file: str = CATALOG
) -> NodeType:
    where = f"{file}: {name}"
    ports = {
        prefix + short: _port(prefix + short, port_entry, usd_types, where)
        for prefix, side in ((INPUT, entry.inputs), (OUTPUT, entry.outputs))
        for short, port_entry in side.items()
    }
    if entry.dynamic is not None:
        grown = (f"{entry.dynamic.prefix}0", entry.dynamic.count)
        _named(grown, INPUT, ports, f"{where}: dynamic")
    return NodeType(
        type=name,
        version=entry.version,
        ui_name=entry.name,
        handout_name=entry.handout or entry.name,
        prim_name=entry.prim,
        ports=ports,
        dynamic=entry.dynamic,
        role=entry.role,
        topics=_named(entry.topics, INPUT, ports, f"{where}: topics"),
        only_of=_by_port(entry.only_of, INPUT, ports, f"{where}: only_of"),
        services=_named(entry.services, INPUT, ports, f"{where}: services"),
        frames=_named(entry.frames, INPUT, ports, f"{where}: frames"),
        message={"": entry.message} if isinstance(entry.message, str) else entry.message,
        moved=entry.moved,
        tf=_tf_ports(entry.tf, ports, f"{where}: tf"),
        articulation=_named(entry.articulation, INPUT, ports, f"{where}: articulation"),
        time_step=_named(entry.time_step, INPUT, ports, f"{where}: time_step"),
        step_limits=_named(entry.step_limits, INPUT, ports, f"{where}: step_limits"),
        sizes=_by_port(entry.sizes, OUTPUT, ports, f"{where}: sizes"),
        drives=_drive_ports(entry.drives, ports, f"{where}: drives"),
        product=_product_ports(entry.product, ports, f"{where}: product"),
        same_in_metres=_named(entry.same_in_metres, INPUT, ports, f"{where}: same_in_metres"),
        grows_by_message=entry.grows_by_message,
        is_open=entry.is_open,
    )


def _port(name: str, written: str | _PortEntry, usd_types: Mapping[str, str], where: str) -> Port:
    place = f"{where}: {name}"
    entry = _short_form(written, place) if isinstance(written, str) else written
    usd_type = usd_types.get(entry.type, entry.type)
    if usd_type != _RELATIONSHIP and not is_known_type(usd_type):
        raise SpecError(f"{place}: '{entry.type}' is not a type of a port")
    # The default need not be an allowed token: Isaac Sim's own QoS profile node breaks that.
    return Port(
        name=name,
        ogn_type=entry.type,
        usd_type=usd_type,
        default=_value(entry.default, usd_type, f"{place}: default"),
        allowed=entry.allowed,
        accepts=entry.of,
        output_only=entry.output_only,
        deprecated=entry.deprecated,
        former=_value(entry.former, usd_type, f"{place}: former"),
    )


def _value(default: Any, usd_type: str, place: str) -> Value | None:
    return None if default is None else typed_value(default, usd_type, place)


def _short_form(text: str, place: str) -> _PortEntry:
    """Read `TYPE = JSON`."""
    ogn_type, equals, default = text.partition(" = ")
    if not equals:
        return _PortEntry(ogn_type)
    try:
        return _PortEntry(ogn_type, json.loads(default))
    except ValueError as error:
        raise SpecError(f"{place}: default '{default}' is not JSON") from error


def _named(
    names: Iterable[str], prefix: str, ports: Mapping[str, Port], where: str
) -> tuple[str, ...]:
    """Return the full names of ports, which the type must have."""
    found = tuple(prefix + short for short in names)
    for name in found:
        if name not in ports:
            raise SpecError(f"{where} names the port '{name}', which the type does not have")
    return found


def _by_port(
    facts: Mapping[str, _Fact], prefix: str, ports: Mapping[str, Port], where: str
) -> dict[str, _Fact]:
    """Return the entries of ports by their full names."""
    return dict(zip(_named(facts, prefix, ports, where), facts.values(), strict=True))


def _tf_ports(entry: TfPorts | None, ports: Mapping[str, Port], where: str) -> TfPorts | None:
    if entry is None:
        return None
    static = () if entry.static is None else (entry.static,)
    return TfPorts(
        names=_named(entry.names, INPUT, ports, where),
        arrays=_named(entry.arrays, INPUT, ports, where),
        prims=_named(entry.prims, INPUT, ports, where),
        gives=_named(entry.gives, OUTPUT, ports, where),
        static=next(iter(_named(static, INPUT, ports, where)), None),
    )


def _drive_ports(
    entry: _DrivesEntry | None, ports: Mapping[str, Port], where: str
) -> DrivePorts | None:
    if entry is None:
        return None
    path, target, joints, indices, *commands = _named(
        (*entry.robot, entry.joints, entry.indices, *entry.commands), INPUT, ports, where
    )
    return DrivePorts(path, target, joints, indices, tuple(commands))


def _product_ports(
    entry: _ProductEntry | None, ports: Mapping[str, Port], where: str
) -> ProductPorts | None:
    if entry is None:
        return None
    named, camera, width, height = _named(
        (entry.named, entry.camera, *entry.size), INPUT, ports, where
    )
    return ProductPorts(named, camera, (width, height))


TYPES = "node_types.yaml"
KIT_TYPES = "kit_types.yaml"
ROLES = "roles.yaml"
NEEDS = "needs.yaml"
VERSIONS = "versions.yaml"
WHEELS = "wheels.yaml"
RENAMES = "renames.yaml"
SENSORS = "sensors.yaml"
BODIES = "bodies.yaml"
JOINTS = "joints.yaml"
UNITS = "units.yaml"
TARGETS = "targets.yaml"
QUANTITIES = "quantities.yaml"
APPLICATION = "application.yaml"


class _Renames(Struct, forbid_unknown_fields=True):
    prefixes: dict[str, str]
    renamed: dict[str, str]


class _ChangesEntry(Struct, forbid_unknown_fields=True):
    version: int | None = None
    ports: dict[str, str | _PortEntry] = {}
    lacks: tuple[str, ...] = ()
    defaults: dict[str, Any] = {}
    allowed: dict[str, tuple[str, ...]] = {}
    message: dict[str, str] = {}


class _ReleaseEntry(Struct, forbid_unknown_fields=True):
    has: dict[str, Any] = {}
    lacks: tuple[str, ...] = ()
    types: dict[str, _ChangesEntry] = {}


class _Wheels(Struct, forbid_unknown_fields=True):
    usd_types: dict[str, str]
    types: dict[str, Any]
    releases: dict[str, _ReleaseEntry]


class _Application(Struct, forbid_unknown_fields=True):
    prims: tuple[str, ...]


def assemble_types(folder: Path) -> IsaacTypes:
    """Read the files of `folder`, and the lab's node types beside it, which win.

    Raises:
        SpecError: a file is missing or wrong.
    """
    lab_data = read_yaml(folder.parent / CATALOG)
    lab = parse_catalog(lab_data)
    data = read_yaml(folder / TYPES)
    wheels = record(read_yaml(folder / WHEELS), _Wheels, f"{folder.name}/{WHEELS}")
    usd_types = {**lab_data["usd_types"], **data["usd_types"], **wheels.usd_types}
    public = _with_roles({**data["types"], **wheels.types}, folder)
    types = parse_types(public, usd_types, f"{folder.name}/{TYPES}")
    kit = read_yaml(folder / KIT_TYPES)["types"]
    kit_types = parse_types(kit, usd_types, f"{folder.name}/{KIT_TYPES}")
    names = record(read_yaml(folder / RENAMES), _Renames, f"{folder.name}/{RENAMES}")
    catalog = replace(
        lab,
        types={**kit_types, **types, **lab.types},
        prefixes={**names.prefixes, **lab.prefixes},
        renamed={**names.renamed, **lab.renamed},
    )
    where = f"{folder.name}/{VERSIONS}"
    earlier = record(_tuples(read_yaml(folder / VERSIONS)), dict[str, _ReleaseEntry], where)
    releases = {
        name: _release(entry, usd_types, f"{folder.name}: {name}")
        for name, entry in {**earlier, **wheels.releases}.items()
    }
    needs = _needs(folder, catalog, releases)
    sensors = record(read_yaml(folder / SENSORS), dict[str, SensorOf], f"{folder.name}/{SENSORS}")
    bodies = record(read_yaml(folder / BODIES), dict[str, BodyOf], f"{folder.name}/{BODIES}")
    joints = record(read_yaml(folder / JOINTS), dict[str, JointsOf], f"{folder.name}/{JOINTS}")
    units = record(read_yaml(folder / UNITS), dict[str, UnitOf], f"{folder.name}/{UNITS}")
    targets = record(read_yaml(folder / TARGETS), dict[str, TargetOf], f"{folder.name}/{TARGETS}")
    where = f"{folder.name}/{QUANTITIES}"
    quantities = record(read_yaml(folder / QUANTITIES), dict[str, QuantityOf], where)
    where = f"{folder.name}/{APPLICATION}"
    made = record(read_yaml(folder / APPLICATION), _Application, where)
    return IsaacTypes(
        catalog, needs, releases, sensors, bodies, joints, units, targets, quantities, made.prims
    )


def _with_roles(types: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the entries of types with the facts about their ports that are written by hand.

    Raises:
        SpecError: a type is not there.
    """
    roles = read_yaml(folder / ROLES)
    for name in roles:
        if name not in types:
            raise SpecError(f"{folder.name}/{ROLES}: '{name}' is not a node type")
    return {name: {**entry, **roles.get(name, {})} for name, entry in types.items()}


def _release(entry: _ReleaseEntry, usd_types: Mapping[str, str], where: str) -> Release:
    changes = {
        name: TypeChanges(
            version=node.version,
            ports={
                full: _port(full, port, usd_types, f"{where}: {name}")
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


def _tuples(data: Any) -> Any:
    """Make lists of values comparable with the values of ports."""
    if isinstance(data, dict):
        return {key: _tuples(entry) for key, entry in data.items()}
    return tuple(_tuples(entry) for entry in data) if isinstance(data, list) else data


def _needs(
    folder: Path, catalog: Catalog, releases: Mapping[str, Release]
) -> dict[str, tuple[Need, ...]]:
    where = f"{folder.name}/{NEEDS}"
    needs = record(read_yaml(folder / NEEDS), dict[str, tuple[Need, ...]], where)
    for name, entries in needs.items():
        kind = catalog.types.get(name)
        if kind is None:
            raise SpecError(f"{where}: '{name}' is not a node type")
        known = set(kind.ports)
        for release in releases.values():
            known |= set(release.types[name].ports if name in release.types else ())
        for short in (port_name for need in entries for port_name in _isaac_named(need)):
            if INPUT + short not in known:
                raise SpecError(f"{where}: {name} has no input '{short}'")
    return needs


def _isaac_named(need: Need) -> Iterator[str]:
    """Yield the inputs that an entry names."""
    yield from need.inputs
    yield from filter(None, (need.when, need.when_wired, need.unless))
