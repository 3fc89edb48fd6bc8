"""Loads what a lab adds to node types and graphs of Isaac Sim."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.isaac.behaviour import Scripts, SingleSignal, WriterPorts
from lab3_usd.isaac.graph_form import Evaluation, GraphForm
from lab3_usd.isaac.load.graph_form import GraphEntry, attribute_over, graph_form
from lab3_usd.isaac.load.node_types import TypeEntry, parse_types, type_over
from lab3_usd.isaac.load.platform import (
    EventEntry,
    other_ports,
    other_types,
    transform_messages,
)
from lab3_usd.isaac.names import Names, OtherName
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.yaml_file import as_record


class LabAttribute(Struct, forbid_unknown_fields=True):
    """What a lab says of an attribute of graphs: what differs, or all of it."""

    type: str = ""
    value: Any = None
    accepted: tuple[Any, ...] | None = None
    required: bool = False
    unwritten: Any = None
    handout: str | None = None


class LabGraph(Struct, forbid_unknown_fields=True):
    """What a lab says of graphs: of their attributes, or with a `type` all of it."""

    type: str = ""
    node_type: str = ""
    gui_api: str = ""
    attributes: dict[str, LabAttribute] = {}
    evaluation: Evaluation | None = None
    ignored_below: tuple[str, ...] = ()


class LabTypesFile(Struct, forbid_unknown_fields=True):
    """What a lab adds to the node types and graphs of Isaac Sim, or changes.

    Tables are extended key by key. `type_names` gives a type, and `port_names` a `TYPE.PORT`, the
    name that it has in a release, by release; `renamed` are other names of types. An entry of a
    type with a `version` is the whole type, one without holds what differs; a `graph` with a `type`
    is whole, too.
    """

    FORMER: ClassVar[Mapping[str, str]] = {"looks": "appearance"}

    usd_types: dict[str, str] = {}
    prefixes: dict[str, str] = {}
    renamed: dict[str, str] = {}
    type_names: dict[str, dict[str, str]] = {}
    port_names: dict[str, dict[str, str]] = {}
    lookalikes: dict[str, str] = {}
    events: dict[str, EventEntry] = {}
    once: dict[str, SingleSignal] = {}
    gates: dict[str, str] = {}
    scripts: Scripts | None = None
    world_frame: str = ""
    graph: LabGraph | None = None
    types: dict[str, TypeEntry] = {}
    writers: dict[str, WriterPorts] = {}
    appearance: tuple[str, ...] = ()


def with_lab_types(platform: Platform, data: Mapping[str, Any], file: str) -> Platform:
    """Return a platform with what the file of a lab adds to it.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    content = as_record(data, LabTypesFile, file)
    usd_types = {**platform.usd_types, **content.usd_types}
    types = {**platform.base}
    for name, entry in data.get("types", {}).items():
        kind = None if "version" in entry else types.get(name)
        if kind is None:
            types.update(parse_types({name: entry}, usd_types, file))
        else:
            types[name] = type_over(kind, entry, usd_types, file)
    events = content.events
    return replace(
        platform,
        types=types,
        base=types,
        usd_types=usd_types,
        graph=_graph_over(platform.graph, data.get("graph", {}), file),
        names=_names_over(platform.names, content, types, file),
        lookalikes={**platform.lookalikes, **content.lookalikes},
        events={**platform.events, **{name: event.stage for name, event in events.items()}},
        deltas={
            **platform.deltas,
            **{name: event.delta for name, event in events.items() if event.delta},
        },
        once={**platform.once, **content.once},
        gates={**platform.gates, **content.gates},
        scripts=content.scripts or platform.scripts,
        world_frame=content.world_frame or platform.world_frame,
        writers={**platform.writers, **content.writers},
        appearance=content.appearance or platform.appearance,
        transform_messages=transform_messages(types),
    )


def _names_over(
    names: Names, content: LabTypesFile, types: Mapping[str, NodeType], file: str
) -> Names:
    """Return the names of other releases with those that a lab declares."""
    declared = {other: OtherName(name) for other, name in content.renamed.items()}
    ports = other_ports(content.port_names, types, f"{file}: port_names")
    both = {*names.ports, *ports}
    return replace(
        names,
        prefixes={**names.prefixes, **content.prefixes},
        types={**names.types, **declared, **other_types(content.type_names)},
        ports={kind: {**names.ports.get(kind, {}), **ports.get(kind, {})} for kind in both},
    )


def _graph_over(form: GraphForm, data: Mapping[str, Any], file: str) -> GraphForm:
    """Return the form of graphs with what a lab says of its attributes."""
    where = f"{file}: graph"
    if not data or "type" in data:
        return graph_form(as_record(data, GraphEntry, where), where) if data else form
    said = data.get("attributes", {})
    for name in said:
        if form.value(name) is None:
            raise SpecError(f"{where}: '{name}' is not an attribute of a graph")
    return replace(
        form,
        attributes=tuple(
            attribute_over(attribute, said.get(attribute.name, {}), f"{where}: {attribute.name}")
            for attribute in form.attributes
        ),
    )
