"""Loads node types: their ports as `name: type = default`, and what a type does with them."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Literal, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.isaac.node_types import (
    INPUT,
    OUTPUT,
    Choice,
    DrivePorts,
    Dynamic,
    JointList,
    NodeType,
    Port,
    ProductPorts,
    TfPorts,
)
from lab3_usd.isaac.values import Value, is_known_type, typed_value
from lab3_usd.yaml_file import as_record

_RELATIONSHIP = "rel"
_NO_PORT = "attribute"  # of prims, in a record of ports
Fact = TypeVar("Fact")
_Ports = TypeVar("_Ports", TfPorts, DrivePorts, JointList, ProductPorts, Choice)


class PortEntry(Struct, forbid_unknown_fields=True):
    """The long form of a port; most are written `TYPE = DEFAULT`."""

    type: str
    default: Any = None
    allowed: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    output_only: bool = False
    deprecated: bool = False
    former: Any = None
    literal_only: bool = False


class TypeEntry(Struct, forbid_unknown_fields=True):
    """A node type, as in its `.ogn` file or a saved stage.

    A port is written `name: type = default`. `execution` ports carry signals, `target` ports name
    prims, `union` ports take the type of their connection. A publisher has a `role`, a `message`,
    and ports with `topics` and `frames`. Of a type of Isaac Sim what differs is enough; another one
    has a `version`, a `name`, and the name `prim` that the editor gives to its prims.
    """

    version: int | None = None
    name: str = ""
    prim: str = ""
    handout: str = ""
    inputs: dict[str, str | PortEntry] = {}
    outputs: dict[str, str | PortEntry] = {}
    former: dict[str, Any] = {}
    dynamic: Dynamic | None = None
    role: Literal["", "publisher", "subscriber", "helper", "service"] = ""
    topics: tuple[str, ...] = ()
    only_of: dict[str, tuple[str, ...]] = {}
    other_messages: dict[str, str] = {}
    services: tuple[str, ...] = ()
    message: str | dict[str, str] = {}
    moved: dict[str, str] = {}
    frames: tuple[str, ...] = ()
    tf: TfPorts | None = None
    articulation: tuple[str, ...] = ()
    time_step: tuple[str, ...] = ()
    step_limits: tuple[str, ...] = ()
    sizes: dict[str, int] = {}
    drives: DrivePorts | None = None
    lists_joints: JointList | None = None
    product: ProductPorts | None = None
    same_in_metres: tuple[str, ...] = ()
    variable: tuple[str, ...] = ()
    choice: Choice | None = None
    grows_by_message: bool = False
    grows: dict[str, str | PortEntry] = {}
    is_open: bool = False
    is_documented: bool = False


_FIELDS = {
    "inputs": "ports",
    "outputs": "ports",
    "former": "ports",
    "name": "ui_name",
    "prim": "prim_name",
}


def type_over(
    base: NodeType, entry: Mapping[str, Any], usd_types: Mapping[str, str], file: str
) -> NodeType:
    """Return a type with what an entry has otherwise."""
    needed = {"version": base.version, "name": base.ui_name, "prim": base.prim_name}
    content = as_record({**needed, **entry}, TypeEntry, f"{file}: {base.type}")
    made = _node_type(base.type, content, usd_types, file, base.ports)
    fields = {_FIELDS.get(key, key) for key in entry if key not in ("handout", "name")}
    if "handout" in entry or base.handout_name == base.ui_name:
        fields |= {"handout_name"} if {"handout", "name"} & set(entry) else set()
    fields |= {"ui_name"} if "name" in entry else set()
    return replace(base, **{field: getattr(made, field) for field in fields})


def parse_types(
    data: Mapping[str, Any], usd_types: Mapping[str, str], file: str
) -> dict[str, NodeType]:
    """Build node types that are written as those of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    content = as_record(data, dict[str, TypeEntry], file)
    return {
        name: _node_type(name, type_entry, usd_types, file) for name, type_entry in content.items()
    }


def _node_type(
    name: str,
    entry: TypeEntry,
    usd_types: Mapping[str, str],
    file: str,
    base_ports: Mapping[str, Port] = {},
) -> NodeType:
    where = f"{file}: {name}"
    for key in ("version", "name", "prim"):
        if not getattr(entry, key):
            raise SpecError(f"{where}: lacks '{key}'")
    ports = {
        prefix + short: parse_port(prefix + short, port_entry, usd_types, where)
        for prefix, side in ((INPUT, entry.inputs), (OUTPUT, entry.outputs))
        for short, port_entry in side.items()
    }
    ports = {**base_ports, **ports}
    for port in _named(entry.former, INPUT, ports, f"{where}: former"):
        place, usd_type = f"{where}: {port}: former", ports[port].usd_type
        ports[port] = replace(
            ports[port], former=_value(entry.former[port[len(INPUT) :]], usd_type, place)
        )
    if entry.dynamic is not None:
        asked = (f"{entry.dynamic.prefix}0", entry.dynamic.count, entry.dynamic.array)
        grown = tuple(filter(None, asked))
        _named(grown, INPUT, ports, f"{where}: dynamic")
    return NodeType(
        type=name,
        version=entry.version or 0,
        ui_name=entry.name,
        handout_name=entry.handout or entry.name,
        prim_name=entry.prim,
        ports=ports,
        dynamic=entry.dynamic,
        role=entry.role,
        topics=_named(entry.topics, INPUT, ports, f"{where}: topics"),
        only_of=_by_port(entry.only_of, INPUT, ports, f"{where}: only_of"),
        other_messages=_by_port(entry.other_messages, INPUT, ports, f"{where}: other_messages"),
        services=_named(entry.services, INPUT, ports, f"{where}: services"),
        frames=_named(entry.frames, INPUT, ports, f"{where}: frames"),
        message={"": entry.message} if isinstance(entry.message, str) else entry.message,
        moved=entry.moved,
        tf=_with_names(entry.tf, ports, f"{where}: tf", outputs=("gives",)),
        articulation=_named(entry.articulation, INPUT, ports, f"{where}: articulation"),
        time_step=_named(entry.time_step, INPUT, ports, f"{where}: time_step"),
        step_limits=_named(entry.step_limits, INPUT, ports, f"{where}: step_limits"),
        sizes=_by_port(entry.sizes, OUTPUT, ports, f"{where}: sizes"),
        drives=_with_names(entry.drives, ports, f"{where}: drives"),
        lists_joints=_with_names(
            entry.lists_joints, ports, f"{where}: lists_joints", outputs=("output",)
        ),
        product=_with_names(entry.product, ports, f"{where}: product"),
        same_in_metres=_named(entry.same_in_metres, INPUT, ports, f"{where}: same_in_metres"),
        variable=_named(entry.variable, INPUT, ports, f"{where}: variable"),
        choice=_with_names(entry.choice, ports, f"{where}: choice", outputs=("outputs",)),
        grows_by_message=entry.grows_by_message,
        grows={
            pattern: parse_port(pattern, port, usd_types, f"{where}: grows")
            for pattern, port in entry.grows.items()
        },
        is_open=entry.is_open,
        is_documented=entry.is_documented,
    )


def parse_port(
    name: str, written: str | PortEntry, usd_types: Mapping[str, str], where: str
) -> Port:
    """Return a port that is written as those of types.

    Raises:
        SpecError: its type or its default is wrong; the line opens with `where`.
    """
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
        literal_only=entry.literal_only,
    )


def _value(default: Any, usd_type: str, place: str) -> Value | None:
    return None if default is None else typed_value(default, usd_type, place)


def _short_form(text: str, place: str) -> PortEntry:
    """Read `TYPE = JSON`."""
    ogn_type, equals, default = text.partition(" = ")
    if not equals:
        return PortEntry(ogn_type)
    try:
        return PortEntry(ogn_type, json.loads(default))
    except ValueError as error:
        raise SpecError(f"{place}: default '{default}' is not JSON") from error


def _named(
    names: Iterable[str], prefix: str, ports: Mapping[str, Port], where: str
) -> tuple[str, ...]:
    """Return the full names of ports, which the type must have."""
    full_names = tuple(prefix + short for short in names)
    for name in full_names:
        if name not in ports:
            raise SpecError(f"{where} names the port '{name}', which the type does not have")
    return full_names


def _by_port(
    facts: Mapping[str, Fact], prefix: str, ports: Mapping[str, Port], where: str
) -> dict[str, Fact]:
    """Return the entries of ports by their full names."""
    return dict(zip(_named(facts, prefix, ports, where), facts.values(), strict=True))


def _with_names(
    entry: _Ports | None, ports: Mapping[str, Port], where: str, outputs: Collection[str] = ()
) -> _Ports | None:
    """Return a record of ports with their full names, those of outputs in the fields `outputs`."""
    if entry is None:
        return None
    full: dict[str, str | tuple[str, ...]] = {}
    for field in entry.__struct_fields__:
        written = getattr(entry, field)
        if written is None or field == _NO_PORT:
            continue
        names = (written,) if isinstance(written, str) else written
        named = _named(names, OUTPUT if field in outputs else INPUT, ports, where)
        full[field] = named[0] if isinstance(written, str) else named
    return replace(entry, **full)
