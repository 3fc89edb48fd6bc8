"""Builds graphs as the controller of OmniGraph does: the commands of an edit, in its own order.

Facts: OmniGraph's own Python (controller, graph controller, object lookup) and NVIDIA's
documentation of them.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from difflib import get_close_matches

from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.lookups import STATE, Edit, Names, normal, path_of, resolve, rooted
from lab3_usd.scripts.operations import as_unknown
from lab3_usd.scripts.run import Arguments, Run
from lab3_usd.scripts.values import (
    At,
    AttributeHandle,
    External,
    GraphHandle,
    Items,
    NodeHandle,
    PrimHandle,
    Table,
    Text,
    Value,
    as_text,
    place,
    reason,
    same,
    truth,
    unknown,
)
from lab3_usd.scripts.world import BuiltGraph, BuiltNode, BuiltPort, BuiltVariable, World

PARAMETERS = (
    "graph_id", "edit_commands", "path_to_object_map", "update_usd", "undoable",
    "allow_exists_node", "allow_exists_prim", "allow_exists_attr",
)  # fmt: skip
ORDER = (
    "delete_nodes", "create_variables", "create_nodes", "create_prims", "expose_prims",
    "create_attributes", "connect", "disconnect", "disconnect_all", "promote_attributes",
    "set_values",
)  # fmt: skip
_INNER = "Graph"  # what the graph within a compound is called


def edit(run: Run, names: Names | None, given: Arguments, node: ast.Call) -> Value:
    """Do what one call of `edit` does, and return the graph, its nodes, prims and names."""
    at = place(node)
    values = dict(zip(PARAMETERS, given.given, strict=False)) | given.named
    graph_id, commands = values.get("graph_id"), values.get("edit_commands")
    by_name: Names = {} if names is None else names
    graph = _graph_of(graph_id, commands, run.world, at)
    may_exist = truth(values.get("allow_exists_node", False)) is not False
    act = Edit(run.world, by_name, graph.path, at, may_exist, number=len(run.world.nodes))
    given_map = values.get("path_to_object_map")
    if given_map is not None and truth(given_map) is not False:
        # Names of an earlier call come with it.
        by_name.update(
            {each.name: each for each in run.world.nodes.values() if each.name not in by_name}
        )
    made = _commands(act, commands) if isinstance(commands, Table) else []
    if not isinstance(commands, Table) and (commands is not None or given.is_open):
        run.world.open_graph(graph.path, as_unknown(commands, node))
    nodes = Items([NodeHandle(each.path) for each in made], at, "list", graph.rest)
    prims = Items([], at, "list", unknown(node))
    return Items([GraphHandle(graph.path), nodes, prims, Table(at)], at, "tuple")


def _graph_of(graph_id: Value, commands: Value, world: World, at: At) -> BuiltGraph:
    """Return the graph of a call: a dictionary creates it, a path finds or creates it."""
    if isinstance(graph_id, Table):
        return _created_graph(graph_id, world, at)
    path = path_of(graph_id, at)
    if not path:
        return world.graph("/{graph}", at, is_ours=False)
    is_text = isinstance(graph_id, Text)
    creates = isinstance(commands, Table) and "create_nodes" in commands.values
    graph = world.graphs.get(path)
    if graph is None:
        is_new = is_text and creates and not world.has_scene_graph(path)
        graph = world.graph(path, at, is_ours=is_new)
        if not is_text:
            graph.evaluator = reason(graph_id, at[0])
    return graph


def _created_graph(table: Table, world: World, at: At) -> BuiltGraph:
    path = table.values.get("graph_path", table.rest)
    if path is None:
        world.fault("no-graph-path", table.at, "/", "graph_path")
        path = Unknown("graph_path", at[0])
    graph = world.graph(normal(as_text(path, at).text), table.at, is_ours=True)
    graph.is_ours = True

    def setting(name: str, before: str | Unknown | None) -> str | Unknown | None:
        value = table.values.get(name)
        if value is None:
            return table.rest or before
        if isinstance(value, External):
            return value.last
        if isinstance(value, Text) and value.unknown is None:
            return value.text
        return Unknown(as_text(value, at).text.strip("{}"), at[0])

    graph.evaluator = setting("evaluator_name", graph.evaluator)
    graph.stage = setting("pipeline_stage", graph.stage)
    graph.mode = setting("evaluation_mode", graph.mode)
    return graph


def create_graph(run: Run, given: Arguments, node: ast.Call) -> Value:
    """Create a graph of its own."""
    value = given.get(0, "graph_id")
    at = place(node)
    if isinstance(value, Table):
        return GraphHandle(_created_graph(value, run.world, at).path)
    path = path_of(value, at)
    return GraphHandle(run.world.graph(path, at, is_ours=True).path) if path else unknown(node)


def _commands(act: Edit, commands: Table) -> list[BuiltNode]:
    """Do the commands of a dictionary, and return the nodes that it makes."""
    if commands.rest is not None:
        act.world.open_graph(act.graph, commands.rest)
    _note_unknown_keys(act, commands)
    for key, value in commands.lost:
        _note_lost(act, key, value, commands)
    made: list[BuiltNode] = []
    for name in ORDER:
        if name not in commands.values:
            continue
        value = commands.values[name]
        items = _as_list(value, name, act)
        if items is None:
            what = value if isinstance(value, Unknown) else Unknown(name, act.at[0])
            act.world.open_graph(act.graph, what)
            continue
        if items.rest is not None:
            act.world.open_graph(act.graph, items.rest)
        for item in items.items:
            result = _COMMANDS[name](act, item)
            if isinstance(result, BuiltNode):
                made.append(result)
    return made


def _note_unknown_keys(act: Edit, commands: Table) -> None:
    for key, written in commands.keys.items():
        if not isinstance(key, str) or key not in ORDER:
            near = get_close_matches(str(key), ORDER, 1, 0.6)
            at = written.at if isinstance(written, Text) else commands.at
            act.world.fault("unknown-key", at, act.graph, str(key), meant=near[0] if near else "")


def _note_lost(act: Edit, key: Value, value: Value, commands: Table) -> None:
    """Note a list that a later one of the same key replaces, if that lacks something of it."""
    name = key.text if isinstance(key, Text) else ""
    later = commands.values.get(name)
    if isinstance(value, Items) and isinstance(later, Items) and value.items:
        kept = {_shown(item) for item in later.items}
        if any(_shown(item) not in kept for item in value.items):
            at = key.at if isinstance(key, Text) else commands.at
            act.world.fault("key-twice", at, act.graph, name)


def _shown(value: Value) -> str:
    if isinstance(value, Items):
        return "(" + ", ".join(_shown(item) for item in value.items[:8]) + ")"
    return value.text if isinstance(value, Text) else repr(value)


def _as_list(value: Value, name: str, act: Edit) -> Items | None:
    """Return the items of a command: only a list is one, anything else is a single item."""
    if not isinstance(value, Items):
        single = isinstance(value, (Text, NodeHandle, AttributeHandle))
        return Items([value], act.at) if single else None
    if value.kind == "list":
        return value
    pairs = [item for item in value.items if isinstance(item, Items) and len(item.items) > 1]
    is_list_of_pairs = len(pairs) == len(value.items) > 0 and (
        name != "set_values"
        or (isinstance(pairs[-1].items[0], Text) and "." in pairs[-1].items[0].text)
    )
    if value.kind == "generator" or is_list_of_pairs:
        act.world.fault("not-a-list", value.at, act.graph, name, meant=value.kind)
        return Items(value.items, value.at, "list", value.rest)
    return Items([value], value.at)


def _at(item: Value, act: Edit) -> At:
    return item.at if isinstance(item, (Items, Text)) else act.at


def _parts(item: Value, act: Edit, least: int) -> list[Value] | None:
    """Return the parts of an item, None where they are unknown."""
    if isinstance(item, Items) and item.rest is None and len(item.items) >= least:
        return item.items
    act.pass_over(item, _at(item, act))
    return None


def _create_node(act: Edit, item: Value) -> BuiltNode | None:
    parts = _parts(item, act, 2)
    if parts is None:
        return None
    at = _at(item, act)
    name, kind = parts[0], parts[1]
    shown = name.path if isinstance(name, (NodeHandle, PrimHandle)) else as_text(name, at).text
    shown = rooted(shown)
    path = shown if shown.startswith("/") else f"{act.graph}/{shown}"
    graph = act.graph if not shown.startswith("/") else path.rpartition("/")[0]
    node = make_node(
        act.world, path, graph, kind, at, may_exist=act.may_exist, call=(act.at, act.number)
    )
    act.names[shown] = node
    if isinstance(kind, Table):
        _fill_compound(act, node, kind)
    return node


def make_node(
    world: World, path: str, graph: str, kind: Value, at: At, *, may_exist: bool, call: object
) -> BuiltNode:
    """Make a node, or return the one that is there."""
    earlier = world.nodes.get(path)
    if earlier is not None:
        if not may_exist and "{" not in path and call not in world.twice:
            world.twice.add(call)
            world.fault("node-twice", at, path, earlier.name, earlier=f"line {earlier.at[0]}")
        return earlier
    node = world.nodes[path] = BuiltNode(path, graph, kind, at)
    world.places.add(at)
    return node


def _fill_compound(act: Edit, node: BuiltNode, commands: Table) -> None:
    """Do the commands of a compound: its nodes stand in a graph below it, and its names count."""
    node.is_compound = True
    outer = act.world.graphs[act.graph]
    inner = act.world.graph(f"{node.path}/{_INNER}", node.at, is_ours=True)
    inner.evaluator, inner.stage, inner.mode = outer.evaluator, outer.stage, outer.mode
    within = Edit(act.world, act.names, inner.path, node.at, act.may_exist, compound=node)
    within.number = len(act.world.nodes)
    _commands(within, commands)


def _promote(act: Edit, item: Value) -> None:
    """Give a port within a compound a name of the compound; elsewhere that changes no wire."""
    compound, parts = act.compound, _parts(item, act, 2)
    if compound is None or parts is None:
        return
    at = _at(item, act)
    place = resolve(act, parts[0], at)
    name = as_text(parts[1], at).text
    inner, port = place if place is not None else (None, "")
    if inner is None:
        return
    prefix = OUTPUT if port.startswith(OUTPUT) else INPUT
    full = name if name.startswith((INPUT, OUTPUT)) else prefix + name
    compound.promoted.add(full)
    if full.startswith(INPUT):
        end, source = inner.port(port), f"{compound.path}.{full}"
    else:
        end, source = compound.port(full), f"{inner.path}.{port}"
    end.sources[source] = at
    end.promoted.add(source)


def _delete_node(act: Edit, item: Value) -> None:
    at = _at(item, act)
    shown = item.path if isinstance(item, NodeHandle) else as_text(item, at).text
    node = act.names.pop(shown, None)
    path = node.path if node else shown if shown.startswith("/") else f"{act.graph}/{shown}"
    if "{" in path:
        act.world.open_graph(act.graph, Unknown(path, at[0]))
    act.world.remove_node(path)


def _create_variable(act: Edit, item: Value) -> None:
    parts = _parts(item, act, 2)
    if parts is not None:
        value = parts[2] if len(parts) > 2 else None  # noqa: PLR2004
        create_variable(
            act.world, act.graph, parts[0], BuiltVariable(parts[1], value), _at(item, act)
        )


def create_variable(world: World, graph: str, name: Value, variable: BuiltVariable, at: At) -> None:
    """Give a graph a variable; of one whose name is unknown the graph may have any."""
    text = as_text(name, at)
    if text.unknown is not None:
        world.open_graph(graph, text.unknown)
    elif graph in world.graphs:
        world.graphs[graph].variables[text.text] = variable


def _pass_over(act: Edit, item: Value) -> None:
    """Do nothing: prims that are made or shown are no nodes of a known type."""
    del act, item


def _create_attribute(act: Edit, item: Value) -> None:
    parts = _parts(item, act, 1)
    if parts is None:
        return
    at = _at(item, act)
    spec = parts[0]
    if isinstance(spec, Items) and spec.items and isinstance(spec.items[0], Items):
        spec = Items([spec.items[0].items[0], *spec.items[1:]], spec.at, "tuple")
    place = resolve(act, spec, at, prefix=INPUT)
    if place is not None and place[0] is not None:
        place[0].port(place[1]).is_made = True


def create_attribute(node: BuiltNode, name: str) -> None:
    """Create a port of a node; without a prefix it is an input."""
    full = name if name.startswith((INPUT, OUTPUT, STATE)) else INPUT + name
    node.port(full).is_made = True


def _of_pair(change: Callable[[Edit, Value, Value, At], None]) -> Callable[[Edit, Value], None]:
    """Return what makes a change for an item of two parts."""

    def read(act: Edit, item: Value) -> None:
        parts = _parts(item, act, 2)
        if parts is not None:
            change(act, parts[0], parts[1], _at(item, act))

    return read


def connect(act: Edit, source: Value, target: Value, at: At) -> None:
    """Wire an output to an input."""
    start, end = resolve(act, source, at), resolve(act, target, at)
    act.world.places.add(at)
    node, port = end if end is not None else (None, "")
    if node is None:
        return
    if start is None:
        if isinstance(source, Text) and source.unknown is None:
            node.port(port).value = node.port(port).value or Unknown(source.text, at[0])
            node.port(port).at = at
        return
    path = start[1] if start[0] is None else f"{start[0].path}.{start[1]}"
    if start[0] is None:
        act.world.outside.add(path.rpartition(".")[0])
    node.port(port).sources[path] = at


def disconnect(act: Edit, source: Value, target: Value, at: At) -> None:
    """Take a wire away."""
    start, end = resolve(act, source, at), resolve(act, target, at)
    if start is None or end is None or end[0] is None:
        return
    path = start[1] if start[0] is None else f"{start[0].path}.{start[1]}"
    end[0].port(end[1]).sources.pop(path, None)
    end[0].port(end[1]).cut.add(path)


def disconnect_all(act: Edit, spec: Value, at: At) -> None:
    """Take all wires of a port away."""
    single = isinstance(spec, Items) and len(spec.items) == 1
    place = resolve(act, spec.items[0] if single else spec, at)
    node, port = place if place is not None else (None, "")
    if node is None:
        return
    node.port(port).sources.clear()
    node.port(port).cut.add("")
    for other in act.world.nodes.values():
        for entry in other.ports.values():
            entry.sources.pop(f"{node.path}.{port}", None)


def set_value(act: Edit, spec: Value, value: Value, at: At, *, later: bool = False) -> None:
    """Give an input a value, or targets; one that is set `later` may change while it runs."""
    place = resolve(act, spec, at)
    if place is None or place[0] is None:
        return
    put(act.world, place[0].port(place[1]), value, at, later=later)


def put(
    world: World, port: BuiltPort, value: Value, at: At, *, quiet: bool = False, later: bool = False
) -> None:
    """Give a port a value."""
    is_given = port.is_late or port.value is not None
    if later and is_given and same(port.value, value) is not True:
        value = Unknown("a value that changes", at[0])
    port.is_late |= later
    port.value, port.at = value, at
    port.is_quiet = quiet
    world.places.add(at)


def created_node(run: Run, names: Names | None, given: Arguments, node: ast.Call) -> Value:
    """Create one node: an absolute path, or a name and its graph, and its type."""
    at = place(node)
    spec, kind = given.get(0, "node_id"), given.get(1, "node_type_id")
    if isinstance(spec, Items) and len(spec.items) == 2:  # noqa: PLR2004
        graph, shown = path_of(spec.items[1], at), as_text(spec.items[0], at).text
        path = f"{graph}/{shown}"
    else:
        path = path_of(spec, at)
        graph, shown = path.rpartition("/")[0], path.rpartition("/")[2]
    if not path or kind is None:
        return unknown(node)
    if graph not in run.world.graphs:
        run.world.graph(graph, at, is_ours=False).evaluator = Unknown("...", at[0])
    may_exist = truth(given.get(2, "allow_exists", False)) is not False
    made = make_node(run.world, path, graph, kind, at, may_exist=may_exist, call=at)
    if names is not None:
        names[shown] = made
    return NodeHandle(made.path)


_COMMANDS: dict[str, Callable[[Edit, Value], BuiltNode | None]] = {
    "delete_nodes": _delete_node,
    "create_variables": _create_variable,
    "create_nodes": _create_node,
    "create_prims": _pass_over,
    "expose_prims": _pass_over,
    "create_attributes": _create_attribute,
    "connect": _of_pair(connect),
    "disconnect": _of_pair(disconnect),
    "disconnect_all": lambda act, item: disconnect_all(act, item, _at(item, act)),
    "promote_attributes": _promote,
    "set_values": _of_pair(set_value),
}
