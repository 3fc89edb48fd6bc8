"""The functions by which scripts build graphs: of controllers, of their objects, of prims.

Facts: OmniGraph's own Python, and the helpers of Isaac Sim's core nodes
(python/scripts/utils.py:24-41).
"""

from __future__ import annotations

import ast

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts import omnigraph
from lab3_usd.scripts.lookups import Edit, Names, find_node, path_of
from lab3_usd.scripts.run import Arguments, Run
from lab3_usd.scripts.values import (
    At,
    AttributeHandle,
    Controller,
    External,
    GraphHandle,
    Handles,
    Items,
    Method,
    NodeHandle,
    PrimHandle,
    Text,
    Value,
    as_text,
    lifted,
    place,
    unknown,
)
from lab3_usd.scripts.world import BuiltVariable, World

_CLASSES = ("Controller", "GraphController", "NodeController", "ObjectLookup", "DataView")
_NEW_STAGES = (
    "new_stage", "new_stage_async", "create_new_stage", "create_new_stage_async", "open_stage",
    "open_stage_async",
)  # fmt: skip
_GRAPHS = ("graph", "get_graph_by_path")
_NODES = ("node", "get_node_by_path")
_PRIMS = ("GetPrimAtPath", "get_prim_at_path", "prim", "DefinePrim", "OverridePrim")
_LOOK_UP = (
    "get_attribute", "get_attribute_by_name", "GetAttribute", "GetProperty", "GetRelationship"
)  # fmt: skip
_CREATE = ("create_attribute", "CreateAttribute", "CreateRelationship")
_VALID = ("IsValid", "is_valid", "IsDefined")
_REMOVE = ("RemovePrim", "delete_prim", "DeletePrims", "DeletePrimsCommand")
_TARGETS = ("set_target_prims", "set_targets", "add_target_prims")
NONE_OF_THESE = object()  # what a call gives that is none of these functions


def call_api(function: Value, name: str, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what a function of OmniGraph or of USD does; NONE_OF_THESE for another function."""
    if isinstance(function, External) and function.name.startswith(run.building.module):
        return _call_module(function, given, node, run)
    if isinstance(function, Method) and isinstance(function.own, Controller):
        return _call_controller(name, function.own.names, given, node, run)
    if isinstance(function, Method) and isinstance(function.own, Handles):
        return _call_handle(function.own, name, given, node, run)
    if name in _TARGETS:
        return _set_targets(name, given, node, run)
    return _call_stage(name, given, node, run)


def _call_module(function: External, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what a function or class of the module itself does."""
    rest = function.name.removeprefix(run.building.module).strip(".").split(".")
    if len(rest) == 1 and rest[0] in _CLASSES:
        return Controller()
    name = rest[-1]
    if len(rest) == 2 and rest[0] in _CLASSES:  # noqa: PLR2004 - class and function
        return _call_controller(name, None, given, node, run)
    if name in (*_GRAPHS, *_NODES):
        return _lookup(name, None, given, node)
    return unknown(node)


def _call_controller(
    name: str, names: Names | None, given: Arguments, node: ast.Call, run: Run
) -> Value:
    at = place(node)
    act = Edit(run.world, {} if names is None else names, _ANY, at)
    if name == "edit":
        return omnigraph.edit(run, names, given, node)
    if name == "create_graph":
        return omnigraph.create_graph(run, given, node)
    if name == "create_node":
        return omnigraph.created_node(run, names, given, node)
    if name in ("connect", "disconnect"):
        do = omnigraph.connect if name == "connect" else omnigraph.disconnect
        source, target = given.get(0, "src_spec"), given.get(1, "dst_spec")
        if source is not None and target is not None:
            do(act, source, target, at)
        return None
    if name == "disconnect_all":
        omnigraph.disconnect_all(act, given.get(0, "attribute_spec"), at)
        return None
    if name == "set":
        _set(act, given, at)
        return None
    if name == "create_attribute":
        return _create_attribute(act, given, at)
    if name in _VARIABLES:
        graph = path_of(given.get(0, "graph_id"), at)
        return _call_variables(name, graph, given.given[1:], given.get(0, "variable_id"), run, at)
    if name == "delete_node":
        return _delete_nodes(given.get(0, "node_id"), run, at)
    if name in ("evaluate", "evaluate_sync"):
        _evaluate_graphs(given.get(0, "graph_id"), run, at)
        return None
    return _lookup(name, names, given, node)


def _set(act: Edit, given: Arguments, at: At) -> None:
    spec = given.get(0, "attribute")
    if isinstance(spec, Text):
        spec = AttributeHandle(*_split(spec.text))
    omnigraph.set_value(act, spec, given.get(1, "value"), at, later=True)


def _delete_nodes(value: Value, run: Run, at: At) -> None:
    """Delete nodes; a graph of which none is left is judged as it was before."""
    items = value.items if isinstance(value, Items) else [value]
    paths = {path_of(item, at) for item in items}
    graphs = {run.world.nodes[path].graph for path in paths if path in run.world.nodes}
    rest = {node.path for graph in graphs for node in run.world.nodes_of(graph)} - paths
    if graphs and not rest:
        run.world.past.append(run.world.kept())
    for path in paths:
        run.world.remove_node(path)
    for graph in () if rest else graphs:
        run.world.graphs.pop(graph, None)


_ANY = "/{graph}"


def _split(path: str) -> tuple[str, str]:
    owner, _, port = path.rpartition(".")
    return owner, port


def _create_attribute(act: Edit, given: Arguments, at: At) -> Value:
    owner, name = given.get(0, "node"), given.get(1, "attr_name")
    node = find_node(act, path_of(owner, at), at)
    if node is not None and isinstance(name, Text):
        omnigraph.create_attribute(node, name.text)
        return AttributeHandle(node.path, name.text)
    return Unknown("create_attribute()", at[0])


_VARIABLES = (
    "create_variable", "set_variable_default_value", "find_variable", "get_variables",
    "remove_variable",
)  # fmt: skip


def _call_variables(
    name: str, graph: str, given: list[Value], variable: Value, run: Run, at: At
) -> Value:
    """Give a graph a variable of a name and a type, or look one up, which may set it."""
    if name == "create_variable" and given:
        made = BuiltVariable(given[1] if len(given) > 1 else None, None)
        omnigraph.create_variable(run.world, graph, given[0], made, at)
    elif name == "create_variable":
        run.world.open_graph(graph, Unknown("create_variable()", at[0]))
    else:
        _forget_variables(variable, run.world, at)
    return Unknown(f"{name}()", at[0])


def _forget_variables(value: Value, world: World, at: At) -> None:
    """Take the values of variables that a value names, or of all, for unknown."""
    parts = value.items if isinstance(value, Items) else [value]
    names = {part.text for part in parts if isinstance(part, Text)}
    for graph in world.graphs.values():
        for name, variable in graph.variables.items():
            if not names or name in names:
                variable.value = Unknown(name, at[0])


def _evaluate_graphs(value: Value, run: Run, at: At) -> None:
    path = "" if value is None else path_of(value, at)
    for graph in run.world.graphs.values():
        if not path or graph.path == path or not path.startswith("/") or "{" in path:
            graph.is_evaluated = True


def _lookup(name: str, names: Names | None, given: Arguments, node: ast.Call) -> Value:
    """Return the object that a function looks up."""
    at = place(node)
    spec = given.get(0, f"{name}_id", given.named.get("graph_path", given.named.get("node_path")))
    if name in _GRAPHS:
        path = path_of(spec, at)
        return GraphHandle(path) if path else unknown(node)
    if name in _NODES:
        if isinstance(spec, Items) and len(spec.items) == 2:  # noqa: PLR2004
            return NodeHandle(f"{path_of(spec.items[1], at)}/{as_text(spec.items[0], at).text}")
        if names is not None and isinstance(spec, Text) and spec.text in names:
            return NodeHandle(names[spec.text].path)
        path = path_of(spec, at)
        return NodeHandle(path) if path else unknown(node)
    if name == "attribute":
        return _attribute(spec, names, given, at) or unknown(node)
    if name in ("prim", "prim_path"):
        path = path_of(spec, at)
        return PrimHandle(path) if path else unknown(node)
    return unknown(node)


def _attribute(
    spec: Value, names: Names | None, given: Arguments, at: At
) -> AttributeHandle | None:
    owner = given.get(1, "node")
    if isinstance(spec, Items) and len(spec.items) > 1:
        spec, owner = spec.items[0], spec.items[1]
    if not isinstance(spec, Text):
        return None
    if owner is not None:
        path = path_of(owner, at)
        if names is not None and isinstance(owner, Text) and owner.text in names:
            path = names[owner.text].path
        return AttributeHandle(path, spec.text) if path else None
    path, port = _split(spec.text)
    if names is not None and path in names:
        path = names[path].path
    return AttributeHandle(path, port) if path and port else None


def _call_handle(own: Value, name: str, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what a function of a graph, a node, an attribute or a prim does."""
    at = place(node)
    first = given.given[0] if given.given else None
    if name in _VALID:
        is_known = not isinstance(own, PrimHandle) or run.world.has_prim(own.path)
        return True if is_known else unknown(node)
    if name in ("get_path_to_graph", "get_prim_path", "GetPath", "get_path", "GetPrimPath"):
        path = f"{own.path}.{own.name}" if isinstance(own, AttributeHandle) else own.path
        return Text(path, at, Unknown(path, at[0]) if "{" in path else None, is_path=True)
    if isinstance(own, AttributeHandle):
        return _call_attribute(own, name, given, node, run)
    if isinstance(own, GraphHandle):
        return _call_graph(own, name, given, node, run)
    if not isinstance(first, Text) or name not in (*_LOOK_UP, *_CREATE):
        return unknown(node)
    built = run.world.node(own.path) if name in _CREATE else None
    if built is not None:
        built.port(first.text).is_made = True
    return True if name == "create_attribute" else AttributeHandle(own.path, first.text)


def _call_graph(own: GraphHandle, name: str, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what a function of a graph does."""
    at = place(node)
    first = given.given[0] if given.given else None
    if name == "evaluate":
        _evaluate_graphs(own, run, at)
        return None
    if name == "get_node" and first is not None:
        return NodeHandle(path_of(first, at))
    if name == "create_node" and first is not None:
        return omnigraph.created_node(run, None, given, node)
    if name in _VARIABLES:
        return _call_variables(name, own.path, given.given, first, run, at)
    return unknown(node)


def _call_attribute(
    own: AttributeHandle, name: str, given: Arguments, node: ast.Call, run: Run
) -> Value:
    at = place(node)
    act = Edit(run.world, {}, _ANY, at)
    first, built = given.first, run.world.node(own.path)
    if name in ("set", "Set") and (given.given or given.named):
        omnigraph.set_value(act, own, first, at, later=True)
    elif name in ("SetTargets", "AddTarget") and built is not None:
        before = built.port(own.name).value
        if name == "AddTarget":
            kept = list(before.items) if isinstance(before, Items) else []
            first = Items([*kept, first], at)
        omnigraph.set_value(act, own, first, at)
    elif name == "connect" and given.given:
        omnigraph.connect(act, own, first, at)
    elif name in ("AddConnection", "SetConnections", "ConnectToSource") and built is not None:
        for source in first.items if isinstance(first, Items) else [first]:
            omnigraph.connect(act, source, own, at)
    elif name in ("get_node", "GetPrim"):
        return NodeHandle(own.path) if name == "get_node" else PrimHandle(own.path)
    else:
        return unknown(node)
    return True if name == "set" else None


def _set_targets(name: str, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what makes a relationship of any name, and tells nothing of a wrong one."""
    at = place(node)
    if name == "set_targets":
        prim, port = given.get(0, "prim"), given.get(1, "attribute")
        targets = given.get(2, "target_prim_paths")
    else:
        prim, targets = given.get(0, "primPath"), given.get(1, "targetPrimPaths")
        port = given.get(2, "inputName", lifted(run.building.target, at))
    act = Edit(run.world, {}, _ANY, at)
    path = path_of(prim, at)
    built = find_node(act, path, at) if path.startswith("/") else None
    if built is not None and isinstance(port, Text) and port.unknown is None:
        omnigraph.put(run.world, built.port(port.text), targets, at, quiet=True)
    elif built is not None:
        what = port.unknown if isinstance(port, Text) else None
        run.world.open_graph(built.graph, what or Unknown("inputName", at[0]))
    return None


def _call_stage(name: str, given: Arguments, node: ast.Call, run: Run) -> Value:
    """Do what functions of USD and of the application do with the stage."""
    at = place(node)
    first = given.first
    if name in _NEW_STAGES:
        run.world.clear(is_empty="new" in name)
        return Unknown(f"{name}()", at[0])
    if name == "is_prim_path_valid" and first is not None:
        return True if run.world.has_prim(path_of(first, at)) else unknown(node)
    if name in _PRIMS and first is not None:
        path = path_of(first, at)
        return PrimHandle(path) if path else unknown(node)
    if name in _REMOVE and first is not None:
        for value in first.items if isinstance(first, Items) else [first]:
            run.world.remove(path_of(value, at))
        return True
    if name == "execute" and isinstance(first, Text) and first.text.startswith("DeletePrims"):
        paths = given.named.get("paths")
        for value in paths.items if isinstance(paths, Items) else []:
            run.world.remove(path_of(value, at))
        return None
    if name == "GetAttributeAtPath" and isinstance(first, Text):
        return AttributeHandle(*_split(first.text))
    return NONE_OF_THESE
