"""The catalog out of `node_types.yaml`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import (
    INPUT,
    OUTPUT,
    Catalog,
    Dynamic,
    Evaluation,
    GraphAttribute,
    GraphForm,
    NodeType,
    Port,
    TfPorts,
    Value,
)
from lab3_usd.spec.values import known_type, typed
from lab3_usd.spec.yaml_file import expect, known_keys, need, parts, texts

FILE = "node_types.yaml"
_TYPE_KEYS = (
    *("version", "name", "handout", "prim", "inputs", "outputs", "dynamic"),
    *("role", "topics", "services", "message", "frames", "tf"),
)
_RELATIONSHIP = "rel"
_ATTRIBUTE_KEYS = ("type", "value", "accepted", "required", "unwritten", "handout")
_EVALUATION_NAMES = ("mode", "reference", "stage", "evaluator")
_EVALUATION_LISTS = ("by_reference", "on_demand", "all_nodes")
_PORT_KEYS = ("type", "default", "allowed", "of", "output_only", "deprecated")
_DYNAMIC_KEYS = ("prefix", "count", "metadata")
_ROLES = ("publisher", "subscriber", "helper", "service")


def parse_catalog(data: Mapping[str, Any]) -> Catalog:
    """Build the catalog from the data of `node_types.yaml`.

    Raises:
        SpecError: names the file, the type and the port that are wrong.
    """
    usd_types = parts(data, "usd_types", str, FILE)
    types = need(data, "types", dict, FILE)
    return Catalog(
        types={name: _node_type(name, spec, usd_types) for name, spec in types.items()},
        graph=_graph_form(need(data, "graph", dict, FILE)),
        prefixes=parts(data, "prefixes", str, FILE),
        renamed=parts(data, "renamed", str, FILE),
        lookalikes=parts(data, "lookalikes", str, FILE),
        events={
            name: _stage(name, spec) for name, spec in parts(data, "events", dict, FILE).items()
        },
        scripts=texts(data, "scripts", FILE),
    )


def _stage(name: str, spec: Mapping[str, Any]) -> str:
    where = f"{FILE}: events: {name}"
    known_keys(spec, ("stage",), where)
    return str(expect(spec.get("stage", ""), str, f"{where}: 'stage'"))


def _graph_form(data: Mapping[str, Any]) -> GraphForm:
    where = f"{FILE}: graph"
    attributes = parts(data, "attributes", dict, where)
    return GraphForm(
        type=need(data, "type", str, where),
        node_type=need(data, "node_type", str, where),
        gui_api=need(data, "gui_api", str, where),
        attributes=tuple(_graph_attribute(name, spec) for name, spec in attributes.items()),
        evaluation=_evaluation(need(data, "evaluation", dict, where), f"{where}: evaluation"),
        ignored_below=texts(data, "ignored_below", where),
    )


def _evaluation(data: Mapping[str, Any], where: str) -> Evaluation:
    known_keys(data, (*_EVALUATION_NAMES, *_EVALUATION_LISTS), where)
    names = (need(data, key, str, where) for key in _EVALUATION_NAMES)
    lists = (texts(data, key, where) for key in _EVALUATION_LISTS)
    return Evaluation(*names, *lists)


def _graph_attribute(name: str, spec: Mapping[str, Any]) -> GraphAttribute:
    where = f"{FILE}: graph: {name}"
    known_keys(spec, _ATTRIBUTE_KEYS, where)
    usd_type = need(spec, "type", str, where)
    accepted = expect(spec.get("accepted", [spec.get("value")]), list, f"{where}: 'accepted'")
    unwritten = spec.get("unwritten")
    return GraphAttribute(
        name=name,
        usd_type=usd_type,
        value=typed(spec.get("value"), usd_type, where),
        accepted=tuple(typed(value, usd_type, where) for value in accepted),
        required=expect(spec.get("required", False), bool, f"{where}: 'required'"),
        unwritten=None if unwritten is None else typed(unwritten, usd_type, where),
        handout=spec.get("handout"),
    )


def _node_type(name: str, spec: Any, usd_types: Mapping[str, str]) -> NodeType:  # noqa: ANN401
    where = f"{FILE}: {name}"
    expect(spec, dict, where)
    known_keys(spec, _TYPE_KEYS, where)
    ports = _ports(spec, usd_types, where)
    ui_name = need(spec, "name", str, where)
    role = spec.get("role", "")
    if role and role not in _ROLES:
        message = f"{where}: role '{role}' is not one of {', '.join(_ROLES)}"
        raise SpecError(message)
    node_type = NodeType(
        type=name,
        version=need(spec, "version", int, where),
        ui_name=ui_name,
        handout_name=spec.get("handout", ui_name),
        prim_name=need(spec, "prim", str, where),
        ports=ports,
        dynamic=_dynamic(spec["dynamic"], ports, where) if "dynamic" in spec else None,
        role=role,
        topics=_inputs_named(spec, "topics", ports, where),
        services=_inputs_named(spec, "services", ports, where),
        frames=_inputs_named(spec, "frames", ports, where),
        message=_message(spec, where),
        tf=_tf_ports(expect(spec["tf"], dict, f"{where}: 'tf'"), where) if "tf" in spec else None,
    )
    _check_tf(node_type, where)
    return node_type


def _dynamic(spec: Any, ports: Mapping[str, Port], where: str) -> Dynamic:  # noqa: ANN401
    place = f"{where}: dynamic"
    known_keys(expect(spec, dict, place), ("prefix", "count", "type", "metadata"), place)
    prefix, count, metadata = (need(spec, key, str, place) for key in _DYNAMIC_KEYS)
    for name in (f"{INPUT}{prefix}0", INPUT + count):
        if name not in ports:
            message = f"{place}: there is no port '{name}'"
            raise SpecError(message)
    return Dynamic(prefix, count, metadata)


def _ports(spec: Mapping[str, Any], usd_types: Mapping[str, str], where: str) -> dict[str, Port]:
    ports = {}
    for side, prefix in (("inputs", INPUT), ("outputs", OUTPUT)):
        for short, text in expect(spec.get(side, {}), dict, f"{where}: {side}").items():
            port = _port(prefix + short, text, usd_types, where)
            ports[port.name] = port
    return ports


def _port(name: str, spec: Any, usd_types: Mapping[str, str], where: str) -> Port:  # noqa: ANN401
    place = f"{where}: {name}"
    if isinstance(spec, str):
        spec = _short_form(spec, place)
    expect(spec, dict, place)
    known_keys(spec, _PORT_KEYS, place)
    ogn_type = need(spec, "type", str, place)
    usd_type = usd_types.get(ogn_type, ogn_type)
    if usd_type != _RELATIONSHIP and not known_type(usd_type):
        message = f"{place}: '{ogn_type}' is no type of a port"
        raise SpecError(message)
    # The default need not be an allowed token: Isaac Sim's own QoS profile node breaks that.
    return Port(
        name=name,
        ogn_type=ogn_type,
        usd_type=usd_type,
        default=_default(spec, usd_type, place),
        allowed=texts(spec, "allowed", place, optional=True),
        accepts=texts(spec, "of", place, optional=True),
        output_only=expect(spec.get("output_only", False), bool, f"{place}: 'output_only'"),
        deprecated=expect(spec.get("deprecated", False), bool, f"{place}: 'deprecated'"),
    )


def _default(spec: Mapping[str, Any], usd_type: str, place: str) -> Value | None:
    return typed(spec["default"], usd_type, f"{place}: default") if "default" in spec else None


def _short_form(text: str, place: str) -> dict[str, Any]:
    """Read `TYPE = JSON`."""
    ogn_type, equals, default = text.partition(" = ")
    if not equals:
        return {"type": ogn_type}
    try:
        return {"type": ogn_type, "default": json.loads(default)}
    except ValueError as error:
        message = f"{place}: default '{default}' is not JSON"
        raise SpecError(message) from error


def _inputs_named(
    spec: Mapping[str, Any], key: str, ports: Mapping[str, Port], where: str
) -> tuple[str, ...]:
    names = tuple(INPUT + short for short in texts(spec, key, where, optional=True))
    for name in names:
        if name not in ports:
            message = f"{where}: {key} names the port '{name}', which the type does not have"
            raise SpecError(message)
    return names


def _message(spec: Mapping[str, Any], where: str) -> Mapping[str, str]:
    if isinstance(spec.get("message"), str):
        return {"": spec["message"]}
    return parts(spec, "message", str, where, optional=True)


def _tf_ports(spec: Mapping[str, Any], where: str) -> TfPorts:
    place = f"{where}: tf"
    known_keys(spec, ("names", "arrays", "prims", "gives", "static"), place)
    static = need(spec, "static", str, place) if "static" in spec else None
    return TfPorts(
        names=tuple(INPUT + short for short in texts(spec, "names", place, optional=True)),
        arrays=tuple(INPUT + short for short in texts(spec, "arrays", place, optional=True)),
        prims=tuple(INPUT + short for short in texts(spec, "prims", place, optional=True)),
        gives=tuple(OUTPUT + short for short in texts(spec, "gives", place, optional=True)),
        static=None if static is None else INPUT + static,
    )


def _check_tf(node_type: NodeType, where: str) -> None:
    tf = node_type.tf
    if tf is None:
        return
    static = () if tf.static is None else (tf.static,)
    for name in (*tf.names, *tf.arrays, *tf.prims, *tf.gives, *static):
        if name not in node_type.ports:
            message = f"{where}: tf names the port '{name}', which the type does not have"
            raise SpecError(message)
