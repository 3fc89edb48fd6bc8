"""The graphs that a script has built so far, as the dictionaries of its edits say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy

from msgspec import Struct

from lab3_usd.model.build import BuildFault, FaultKind
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import Node, Unknown, UnresolvedAsset
from lab3_usd.scripts.values import At, Text, Value

# What belongs to the stage that is open.
_OF_STAGE = ("graphs", "nodes", "faults", "unread", "places", "guarded", "changed", "removed")


class SceneGraphs(Struct, frozen=True, eq=False):
    """The graphs of the scene that a script loads, and their nodes, by path."""

    graphs: frozenset[str] = frozenset()
    nodes: Mapping[str, Node] = {}


class BuiltPort(Struct, eq=False):
    """A port of a node: its value or targets, the sources of its wires, and where each was given.

    `is_made`: the script creates the attribute; `is_quiet`: its value was set by a call that
    reports no wrong name; `is_late`: it was set after the edit. `cut` are the sources whose wires
    are removed, '' for all. `promoted` are those that are only the names of a compound for the
    port, and no wires.
    """

    value: Value = None
    at: At | None = None
    sources: dict[str, At] = {}
    cut: set[str] = set()
    promoted: set[str] = set()
    is_made: bool = False
    is_quiet: bool = False
    is_late: bool = False


class BuiltNode(Struct, eq=False):
    """A node: the text of its type, and its ports by name."""

    path: str
    graph: str
    type: Value
    at: At
    ports: dict[str, BuiltPort] = {}
    is_compound: bool = False
    promoted: set[str] = set()

    @property
    def name(self) -> str:
        """The name of its prim."""
        return self.path.rpartition("/")[2]

    @property
    def places(self) -> Iterator[At]:
        """Where it is made, and its ports get their values and wires."""
        yield self.at
        for port in self.ports.values():
            yield from port.sources.values()
            if port.at is not None:
                yield port.at

    def port(self, name: str) -> BuiltPort:
        """Return a port, new or not."""
        return self.ports.setdefault(name, BuiltPort())


class BuiltVariable(Struct):
    """A variable of a graph: what its type and its value at the start are, None for no value."""

    type: Value
    value: Value


class BuiltGraph(Struct, eq=False):
    """A graph: how it is evaluated, and what is unknown of what it holds.

    What is None of how it is evaluated was not said. One that `is_ours` is made by the script, and
    one that `is_evaluated` is evaluated by it.
    """

    path: str
    at: At
    is_ours: bool
    evaluator: str | Unknown | None = None
    stage: str | Unknown | None = None
    mode: str | Unknown | None = None
    rest: Unknown | None = None
    is_evaluated: bool = False
    variables: dict[str, BuiltVariable] = {}


class World(Struct, eq=False):
    """Everything that one way through a script builds.

    `places` are the lines and columns that were come by, `unread` what of the edits is
    unknown, `missing` the prims that are so.
    `guarded` are lines whose failure the script expects, from and to, `outside` the nodes of others
    that it wires, and `twice` the calls that made a node again. `past` are the worlds of
    stages that were open before. `changed` are nodes of the `scene` that the script changes,
    `removed` prims of it that it removes.
    """

    scene: SceneGraphs = SceneGraphs()
    changed: dict[str, BuiltNode] = {}
    removed: set[str] = set()
    graphs: dict[str, BuiltGraph] = {}
    nodes: dict[str, BuiltNode] = {}
    faults: list[BuildFault] = []
    unread: dict[Unknown, None] = {}
    missing: dict[str, UnresolvedAsset] = {}
    places: set[At] = set()
    past: list[World] = []
    guarded: list[tuple[int, int]] = []
    outside: set[str] = set()
    twice: set[object] = set()

    def clear(self, *, is_empty: bool) -> None:
        """Open a stage, new or the scene; what was built is kept as one of the past."""
        if self.graphs or self.changed:
            self.past.append(self.kept())
            fresh = World()
            for name in _OF_STAGE:
                setattr(self, name, getattr(fresh, name))
        if is_empty:
            self.scene = SceneGraphs()

    def node(self, path: str) -> BuiltNode | None:
        """Return the node at a path, one of the scene as well."""
        if path in self.nodes:
            return self.nodes[path]
        scene_node = None if self.is_removed(path) else self.scene.nodes.get(path)
        if scene_node is None:
            return None
        if path not in self.changed:
            nowhere = (0, 0, 0, 0)
            kind = Text(scene_node.type_name, nowhere)
            self.changed[path] = BuiltNode(path, path.rpartition("/")[0], kind, nowhere)
        return self.changed[path]

    def has_prim(self, path: str) -> bool:
        """Whether a prim is surely there: a graph or a node."""
        is_of_scene = path in self.scene.graphs or path in self.scene.nodes
        is_built = path in self.graphs or path in self.nodes
        return is_built or (is_of_scene and not self.is_removed(path))

    def has_scene_graph(self, path: str) -> bool:
        """Whether the scene has a graph at a path, as long as the script leaves it there."""
        return path in self.scene.graphs and not self.is_removed(path)

    def is_removed(self, path: str) -> bool:
        """Whether the script removes a prim of the scene."""
        return any(is_at_or_below(path, top) for top in self.removed)

    def fault(
        self, kind: FaultKind, at: At, prim: str, name: str, *, meant: str = "", earlier: str = ""
    ) -> None:
        """Note what ends the script at a place, or goes wrong there without a word."""
        if (kind, at, name) not in {(fault.kind, fault.at, fault.name) for fault in self.faults}:
            self.faults.append(BuildFault(kind, prim, name, at, meant, earlier))

    def graph(self, path: str, at: At, *, is_ours: bool) -> BuiltGraph:
        """Return the graph at a path, new or not."""
        return self.graphs.setdefault(path, BuiltGraph(path, at, is_ours))

    def nodes_of(self, graph: str) -> Iterator[BuiltNode]:
        """Yield the nodes of a graph."""
        return (node for node in self.nodes.values() if node.graph == graph)

    def named(self, name: str) -> list[BuiltNode]:
        """Return the nodes of this name, in any graph."""
        return [node for node in self.nodes.values() if node.name == name.rpartition("/")[2]]

    def remove_node(self, path: str) -> None:
        """Take a node out, and the wires from it."""
        node = self.nodes.pop(path, None)
        if node is not None:
            self.places -= set(node.places)
        elif path in self.scene.nodes:
            self.removed.add(path)
        for node in self.nodes.values():
            for port in node.ports.values():
                for source in [s for s in port.sources if s.startswith(f"{path}.")]:
                    del port.sources[source]

    def kept(self) -> World:
        """Return what is built so far, which later changes leave as it is."""
        old = World(self.scene)
        for name in (*_OF_STAGE, "outside", "twice"):
            setattr(old, name, copy(getattr(self, name)))
        for path, node in self.nodes.items():
            old.nodes[path] = same = copy(node)
            same.ports = {name: copy(port) for name, port in node.ports.items()}
            for port in same.ports.values():
                port.sources = dict(port.sources)
        return old

    def remove(self, path: str) -> None:
        """Take a prim out with all below it; what was there is judged as one of the past."""
        nodes = [node for node in self.nodes if is_at_or_below(node, path)]
        if nodes:
            self.past.append(self.kept())
        for node in nodes:
            self.remove_node(node)
        for graph in [graph for graph in self.graphs if is_at_or_below(graph, path)]:
            del self.graphs[graph]
        if path and any(is_at_or_below(graph, path) for graph in self.scene.graphs):
            self.removed.add(path)

    def open_graph(self, path: str, what: Unknown) -> None:
        """Note that a graph may hold more than is known."""
        if path in self.graphs:
            self.graphs[path].rest = self.graphs[path].rest or what
        self.unread[what] = None
