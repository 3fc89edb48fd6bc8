"""Loads the catalog of node types from `node_types.yaml`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Literal, TypeVar

from msgspec import Struct

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import INPUT, OUTPUT, Catalog, NodeType, Port, Scripts, SingleSignal
from lab3_usd.spec.files import CATALOG
from lab3_usd.spec.graph_form import GraphEntry, graph_form
from lab3_usd.spec.load.records import record
from lab3_usd.spec.port_groups import DrivePorts, Dynamic, TfPorts
from lab3_usd.spec.values import Value, is_known_type, typed_value

_RELATIONSHIP = "rel"
_Fact = TypeVar("_Fact")


class _PortEntry(Struct, forbid_unknown_fields=True):
    """A port in its long form; most are written `TYPE = DEFAULT`."""

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
    commands: tuple[str, ...]


class _TypeEntry(Struct, forbid_unknown_fields=True):
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
    frames: tuple[str, ...] = ()
    tf: TfPorts | None = None
    articulation: tuple[str, ...] = ()
    time_step: tuple[str, ...] = ()
    step_limits: tuple[str, ...] = ()
    sizes: dict[str, int] = {}
    drives: _DrivesEntry | None = None
    same_in_metres: tuple[str, ...] = ()
    grows_by_message: bool = False


class _EventEntry(Struct, forbid_unknown_fields=True):
    stage: str = ""


class _CatalogFile(Struct, forbid_unknown_fields=True):
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


def parse_catalog(data: Mapping[str, Any]) -> Catalog:
    """Build the catalog from the data of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    said = record(data, _CatalogFile, CATALOG)
    return Catalog(
        types={name: _node_type(name, each, said.usd_types) for name, each in said.types.items()},
        graph=graph_form(said.graph, f"{CATALOG}: graph"),
        prefixes=said.prefixes,
        renamed=said.renamed,
        lookalikes=said.lookalikes,
        events={name: event.stage for name, event in said.events.items()},
        once=said.once,
        gates=said.gates,
        scripts=said.scripts,
        world_frame=said.world_frame,
    )


def parse_types(
    data: Mapping[str, Any], usd_types: Mapping[str, str], file: str
) -> dict[str, NodeType]:
    """Build node types that are written as those of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    said = record(data, dict[str, _TypeEntry], file)
    return {name: _node_type(name, each, usd_types, file) for name, each in said.items()}


def _node_type(
    name: str, entry: _TypeEntry, usd_types: Mapping[str, str], file: str = CATALOG
) -> NodeType:
    where = f"{file}: {name}"
    ports = {
        prefix + short: _port(prefix + short, said, usd_types, where)
        for prefix, side in ((INPUT, entry.inputs), (OUTPUT, entry.outputs))
        for short, said in side.items()
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
        tf=_tf_ports(entry.tf, ports, f"{where}: tf"),
        articulation=_named(entry.articulation, INPUT, ports, f"{where}: articulation"),
        time_step=_named(entry.time_step, INPUT, ports, f"{where}: time_step"),
        step_limits=_named(entry.step_limits, INPUT, ports, f"{where}: step_limits"),
        sizes=_by_port(entry.sizes, OUTPUT, ports, f"{where}: sizes"),
        drives=_drive_ports(entry.drives, ports, f"{where}: drives"),
        same_in_metres=_named(entry.same_in_metres, INPUT, ports, f"{where}: same_in_metres"),
        grows_by_message=entry.grows_by_message,
    )


def _port(name: str, said: str | _PortEntry, usd_types: Mapping[str, str], where: str) -> Port:
    place = f"{where}: {name}"
    entry = _short_form(said, place) if isinstance(said, str) else said
    usd_type = usd_types.get(entry.type, entry.type)
    if usd_type != _RELATIONSHIP and not is_known_type(usd_type):
        message = f"{place}: '{entry.type}' is no type of a port"
        raise SpecError(message)
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


def _value(said: Any, usd_type: str, place: str) -> Value | None:  # noqa: ANN401
    return None if said is None else typed_value(said, usd_type, place)


def _short_form(text: str, place: str) -> _PortEntry:
    """Read `TYPE = JSON`."""
    ogn_type, equals, default = text.partition(" = ")
    if not equals:
        return _PortEntry(ogn_type)
    try:
        return _PortEntry(ogn_type, json.loads(default))
    except ValueError as error:
        message = f"{place}: default '{default}' is not JSON"
        raise SpecError(message) from error


def _named(
    names: Iterable[str], prefix: str, ports: Mapping[str, Port], where: str
) -> tuple[str, ...]:
    """Return the full names of ports, which the type must have."""
    found = tuple(prefix + short for short in names)
    for name in found:
        if name not in ports:
            message = f"{where} names the port '{name}', which the type does not have"
            raise SpecError(message)
    return found


def _by_port(
    said: Mapping[str, _Fact], prefix: str, ports: Mapping[str, Port], where: str
) -> dict[str, _Fact]:
    """Return what is said of ports by their full names."""
    return dict(zip(_named(said, prefix, ports, where), said.values(), strict=True))


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
    path, target, joints, *commands = _named(
        (*entry.robot, entry.joints, *entry.commands), INPUT, ports, where
    )
    return DrivePorts(path, target, joints, tuple(commands))
