"""The graphs that a script has built so far, as the dictionaries of its edits say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy

from msgspec import Struct

from lab3_usd.model.build import BuildFault, FaultKind
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import Node, Unknown
from lab3_usd.scripts.values import At, Text, Value

_CHANGING = ("graphs", "faults", "unread", "values", "places", "lines", "guarded")


class SceneGraphs(Struct, frozen=True, eq=False):
    """The graphs of the scene that a script loads, and their nodes, by path."""

    graphs: frozenset[str] = frozenset()
    nodes: Mapping[str, Node] = {}


class BuiltPort:
    """A port of a node: its value or targets, the sources of its wires, and where each was given.

    `is_made`: the script creates the attribute; `is_quiet`: its value was set by a call that
    reports no wrong name; `is_late`: it was set after the edit. `cut` are the sources whose wires
    are removed, '' for all.
    """

    __slots__ = (
        "at", "cut", "is_late", "is_made", "is_quiet", "promoted", "sources", "text", "value"
    )  # fmt: skip

    def __init__(self) -> None:
        """Start without anything."""
        self.value: Value = None
        self.at: At | None = None
        self.text: Text | None = None
        self.sources: dict[str, tuple[At, Value, Value]] = {}
        self.cut: set[str] = set()
        self.is_made = False
        self.is_quiet = False
        self.is_late = False
        self.promoted: set[str] = set()

    def is_promoted(self, source: str) -> bool:
        """Whether a source is only the name of a compound for the port, and no wire."""
        return source in self.promoted


class BuiltNode:
    """A node: the text of its type, and its ports by name."""

    __slots__ = ("at", "graph", "is_compound", "path", "ports", "promoted", "type")

    def __init__(self, path: str, graph: str, kind: Value, at: At) -> None:
        """Start without ports."""
        self.path = path
        self.graph = graph
        self.type = kind
        self.at = at
        self.ports: dict[str, BuiltPort] = {}
        self.is_compound = False
        self.promoted: set[str] = set()

    @property
    def name(self) -> str:
        """The name of its prim."""
        return self.path.rpartition("/")[2]

    @property
    def places(self) -> Iterator[At]:
        """Where it is made, and its ports get their values and wires."""
        yield self.at
        for port in self.ports.values():
            yield from (at for at, _, _ in port.sources.values())
            if port.at is not None:
                yield port.at

    def port(self, name: str) -> BuiltPort:
        """Return a port, new or not."""
        return self.ports.setdefault(name, BuiltPort())


class BuiltVariable(Struct):
    """A variable of a graph: what its type and its value at the start are, None for no value."""

    type: Value
    value: Value


class BuiltGraph:
    """A graph: how it is evaluated, and what is unknown of what it holds.

    What is None of how it is evaluated was not said. One that `is_ours` is made by the script, and
    one that `is_evaluated` is evaluated by it.
    """

    __slots__ = (
        "at",
        "evaluator",
        "is_evaluated",
        "is_ours",
        "mode",
        "path",
        "rest",
        "stage",
        "variables",
    )

    def __init__(self, path: str, at: At, *, is_ours: bool) -> None:
        """Start without nodes."""
        self.path = path
        self.at = at
        self.is_ours = is_ours
        self.evaluator: str | Unknown | None = None
        self.stage: str | Unknown | None = None
        self.mode: str | Unknown | None = None
        self.rest: Unknown | None = None
        self.is_evaluated = False
        self.variables: dict[str, BuiltVariable] = {}


class World:
    """Everything that one way through a script builds.

    `places` are the lines and columns that were come by, `unread` what of the edits is unknown.
    `guarded` are lines whose failure the script expects, from and to, `outside` the nodes of others
    that it wires, and `twice` the calls that made a node again. `past` are the worlds of
    stages that were open before. `changed` are nodes of the `scene` that the script changes,
    `removed` prims of it that it removes.
    """

    def __init__(self, scene: SceneGraphs | None = None) -> None:
        """Start without graphs of one's own."""
        self.scene = scene or SceneGraphs()
        self.changed: dict[str, BuiltNode] = {}
        self.removed: set[str] = set()
        self.graphs: dict[str, BuiltGraph] = {}
        self.nodes: dict[str, BuiltNode] = {}
        self.faults: list[BuildFault] = []
        self.unread: dict[Unknown, None] = {}
        self.values = 0
        self.places: set[At] = set()
        self.past: list[World] = []
        self.lines: set[int] = set()
        self.guarded: list[tuple[int, int]] = []
        self.outside: set[str] = set()
        self.twice: set[object] = set()

    def clear(self, *, is_empty: bool) -> None:
        """Open a stage, new or the scene; what was built is kept as one of the past."""
        if self.graphs or self.changed:
            old, fresh = World(self.scene), World()
            for name in (*_CHANGING, "nodes", "changed", "removed"):
                setattr(old, name, getattr(self, name))
                setattr(self, name, getattr(fresh, name))
            self.past.append(old)
        if is_empty:
            self.scene = SceneGraphs()

    def node(self, path: str) -> BuiltNode | None:
        """Return the node at a path, one of the scene as well."""
        if path in self.nodes:
            return self.nodes[path]
        scene_node = None if self._is_removed(path) else self.scene.nodes.get(path)
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
        return (
            path in self.graphs
            or path in self.nodes
            or (is_of_scene and not self._is_removed(path))
        )

    def has_scene_node(self, path: str) -> bool:
        """Whether a node of the scene is still there."""
        return not self._is_removed(path)

    def has_scene_graph(self, path: str) -> bool:
        """Whether the scene has a graph at a path, as long as the script leaves it there."""
        return path in self.scene.graphs and not self._is_removed(path)

    def _is_removed(self, path: str) -> bool:
        return any(is_at_or_below(path, top) for top in self.removed)

    def fault(
        self,
        kind: FaultKind,
        at: At,
        prim: str,
        name: str,
        *,
        property: str | None = None,  # noqa: A002 - as a Problem calls it
        meant: str = "",
        others: tuple[str, ...] = (),
    ) -> None:
        """Note what ends the script at a place, or goes wrong there without a word."""
        fault = BuildFault(kind, prim, property, name, at, meant, others)
        if not any(
            earlier.kind == kind and earlier.at == at and earlier.name == name
            for earlier in self.faults
        ):
            self.faults.append(fault)

    def graph(self, path: str, at: At, *, is_ours: bool) -> BuiltGraph:
        """Return the graph at a path, new or not."""
        if path not in self.graphs:
            self.graphs[path] = BuiltGraph(path, at, is_ours=is_ours)
        return self.graphs[path]

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
        for name in (*_CHANGING, "changed", "removed"):
            setattr(old, name, copy(getattr(self, name)))
        old.outside, old.twice = set(self.outside), set(self.twice)
        for path, node in self.nodes.items():
            old.nodes[path] = same = copy(node)
            same.ports = {name: copy(port) for name, port in node.ports.items()}
            for port in same.ports.values():
                port.sources = dict(port.sources)
        return old

    def remove(self, path: str) -> None:
        """Take a prim out with all below it; what was there is judged as one of the past."""
        if any(f"{node}/".startswith(f"{path}/") for node in self.nodes):
            self.past.append(self.kept())
        for node in [
            other_path for other_path in self.nodes if f"{other_path}/".startswith(f"{path}/")
        ]:
            self.remove_node(node)
        for graph in [
            other_path for other_path in self.graphs if f"{other_path}/".startswith(f"{path}/")
        ]:
            del self.graphs[graph]
        if path and any(is_at_or_below(other_path, path) for other_path in self.scene.graphs):
            self.removed.add(path)

    def open_graph(self, path: str, what: Unknown) -> None:
        """Note that a graph may hold more than is known."""
        if path in self.graphs:
            self.graphs[path].rest = self.graphs[path].rest or what
        self.unread[what] = None
