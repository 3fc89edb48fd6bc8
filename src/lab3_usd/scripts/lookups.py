"""How nodes and attributes are looked up by name: what a call knows, and what it does not."""

from __future__ import annotations

from difflib import get_close_matches

from msgspec import Struct

from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.values import (
    At,
    AttributeHandle,
    External,
    GraphHandle,
    Items,
    NodeHandle,
    PrimHandle,
    Text,
    Value,
    as_text,
    reason,
)
from lab3_usd.scripts.world import BuiltNode, World

Names = dict[str, BuiltNode]
STATE = "state:"
_BUNDLE = "outputs_"  # how the output of a bundle is called


class Edit(Struct, eq=False):
    """One call: the world that it changes, the names that it knows, and its graph.

    `number` is how many nodes there were before it, `compound` the node whose graph it is.
    """

    world: World
    names: Names
    graph: str
    at: At
    may_exist: bool = False
    forgiven: set[str] = set()
    number: int = 0
    compound: BuiltNode | None = None

    def pass_over(self, value: Value, at: At) -> None:
        """Note that a part of the call is unknown: its graph may hold more."""
        self.world.open_graph(self.graph, reason(value, at[0]))


def normal(path: str) -> str:
    """Return a path of a prim from the root on."""
    return "/" + path.strip("/") if path else ""


def rooted(name: str) -> str:
    """Return a name or path; one that begins with something unknown and goes on is a path."""
    return f"/{name}" if name.startswith("{") and "}/" in name else name


def path_of(value: Value, at: At) -> str:
    """Return the path of what stands for a graph, a node or a prim, with stand-ins; '' for none."""
    if isinstance(value, (GraphHandle, NodeHandle, PrimHandle)):
        return value.path
    if isinstance(value, (Text, Unknown, External)):
        return normal(as_text(value, at).text)
    return ""


def resolve(
    act: Edit, spec: Value, at: At, *, prefix: str = ""
) -> tuple[BuiltNode | None, str] | None:
    """Return the node and the port that a specification names.

    The node is None where it is not one that the script makes, and the port its whole path. None
    is what names nothing that is known, which is noted where it is surely wrong.
    """
    if isinstance(spec, AttributeHandle):
        node = act.world.node(spec.path)
        return (node, spec.name) if node else (None, f"{spec.path}.{spec.name}")
    if isinstance(spec, Items) and len(spec.items) > 1:
        return _resolve_pair(act, spec, at, prefix)
    if not isinstance(spec, Text):
        act.pass_over(spec, at)
        return None
    owner, dot, port = rooted(spec.text).rpartition(".")
    if spec.text.startswith("{") and not dot:
        act.world.open_graph(act.graph, spec.unknown or Unknown(spec.text, at[0]))
        return None
    if not dot:
        act.world.fault("no-port-name", at, act.graph, spec.text)
        return None
    return _with_port(act, find_node(act, owner, at), owner, port, prefix)


def _with_port(
    act: Edit, node: BuiltNode | None, owner: str, port: str, prefix: str
) -> tuple[BuiltNode | None, str] | None:
    if prefix and not port.startswith((INPUT, OUTPUT, STATE)):
        port = prefix + port
    if port.startswith(_BUNDLE):
        port = OUTPUT + port.removeprefix(_BUNDLE)
    if "{" in port:  # which of its ports is not known
        if node is not None:
            act.world.open_graph(node.graph, Unknown(port, act.at[0]))
        return None
    if node is not None:
        return node, port
    if owner.startswith("/"):
        return None, f"{owner}.{port}"
    return None


def _resolve_pair(
    act: Edit, spec: Items, at: At, prefix: str
) -> tuple[BuiltNode | None, str] | None:
    """Resolve (name of the port, node), with a graph behind or not."""
    name, owner = spec.items[0], spec.items[1]
    if isinstance(name, NodeHandle):
        name, owner = owner, name
    if isinstance(owner, (NodeHandle, PrimHandle)):
        node, shown = act.world.node(owner.path), owner.path
    elif isinstance(owner, Text):
        if len(spec.items) > 2:  # noqa: PLR2004 - the graph
            shown = f"{path_of(spec.items[2], at)}/{owner.text}"
            node = act.world.node(shown)
        else:
            shown, node = owner.text, find_node(act, owner.text, at)
    else:
        act.pass_over(owner, at)
        return None
    if not isinstance(name, Text) or name.unknown:
        act.pass_over(name, at)
        return None
    return _with_port(act, node, shown, name.text, prefix)


def find_node(act: Edit, name: str, at: At) -> BuiltNode | None:
    """Return the node of a name or path, None for one that the script does not make.

    A short name is known to the call, or to the controller, that made the node. What is not found
    in a graph that may have more nodes is no fault.
    """
    if name in act.names:
        node = act.names[name]
        return node if node.path in act.world.nodes else None
    if "{" in name and name not in act.world.nodes:
        _open_unknown(act, name, at)
        return None
    if name.startswith("/"):
        built = act.world.node(name)
        if built is not None:
            return built
        graph = act.world.graphs.get(name.rpartition("/")[0])
        if graph is not None and graph.is_ours and graph.rest is None:
            _note_unknown(act, name, graph.path, at, only_near=True)
        return None
    graph = act.world.graphs.get(act.graph)
    is_open = graph is None or graph.rest is not None
    forgotten = [node for node in act.world.named(name) if node.graph == act.graph]
    if forgotten:
        first = forgotten[0]
        if not is_open and act.graph not in act.forgiven:
            act.forgiven.add(act.graph)
            act.world.fault("forgotten-node", at, first.path, name, earlier=f"line {first.at[0]}")
        return first
    if not is_open and graph is not None and graph.is_ours:
        unnamed = any("{" in node.name for node in act.world.nodes_of(act.graph))
        _note_unknown(act, name, act.graph, at, only_near=unnamed)
    return None


def _open_unknown(act: Edit, name: str, at: At) -> None:
    """Note that an unknown name may be any node: of its graph, or of one with such nodes."""
    graph = name.rpartition("/")[0]
    what = Unknown(name, at[0])
    unnamed = {node.graph for node in act.world.nodes.values() if "{" in node.name}
    for path in sorted({graph if graph in act.world.graphs else act.graph, *unnamed}):
        if path in act.world.graphs:
            act.world.open_graph(path, what)


def _note_unknown(act: Edit, name: str, graph: str, at: At, *, only_near: bool) -> None:
    """Note a name of no node; where there may be others, only one that is near to a known one."""
    short = name.rpartition("/")[2]
    node_names = [node.name for node in act.world.nodes_of(graph)]
    near = get_close_matches(short, node_names, 1, 0.8 if only_near else 0.6)
    same = [other for other in node_names if other.lower() == short.lower()]
    if near or same or not only_near:
        act.world.fault("unknown-node", at, graph, name, meant=(same or near or [""])[0])
