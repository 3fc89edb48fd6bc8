"""The graphs that a script has built so far, as the dictionaries of its edits say."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy

from lab3_usd.model.build import BuildFault, FaultKind
from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.values import At, Text, Value


class BuiltPort:
    """A port of a node: its value or targets, the sources of its wires, and where each was given.

    `is_made` where the script creates the attribute, `is_quiet` where a value was given in a way
    that reports nothing, `is_late` where it was given after the edit.
    """

    __slots__ = ("at", "is_late", "is_made", "is_quiet", "promoted", "sources", "text", "value")

    def __init__(self) -> None:
        """Start without anything."""
        self.value: Value = None
        self.at: At | None = None
        self.text: Text | None = None
        self.sources: dict[str, tuple[At, Value, Value]] = {}
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

    def port(self, name: str) -> BuiltPort:
        """Return a port, new or not."""
        return self.ports.setdefault(name, BuiltPort())


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
        self.variables: dict[str, Value] = {}


class World:
    """Everything that one way through a script builds.

    `places` are the lines and columns that were come by, `unread` what of the edits is unknown.
    `guarded` are lines whose failure the script expects, from and to, `outside` the nodes of others
    that it wires, and `twice` the calls that made a node again. `past` are the worlds of
    stages that were open before.
    """

    def __init__(self) -> None:
        """Start without graphs."""
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

    def clear(self) -> None:
        """Begin a new stage; what was built is kept as one of the past."""
        if self.graphs:
            old = World()
            for name in (
                "graphs",
                "nodes",
                "faults",
                "unread",
                "values",
                "places",
                "lines",
                "guarded",
            ):
                setattr(old, name, getattr(self, name))
            fresh = World()
            for name in (
                "graphs",
                "nodes",
                "faults",
                "unread",
                "values",
                "places",
                "lines",
                "guarded",
            ):
                setattr(self, name, getattr(fresh, name))
            self.past.append(old)

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
            known.kind == kind and known.at == at and known.name == name for known in self.faults
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
        self.nodes.pop(path, None)
        for node in self.nodes.values():
            for port in node.ports.values():
                for source in [s for s in port.sources if s.startswith(f"{path}.")]:
                    del port.sources[source]

    def kept(self) -> World:
        """Return what is built so far, which later changes leave as it is."""
        old = World()
        for name in ("graphs", "faults", "unread", "values", "places", "lines", "guarded"):
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
        for node in [known for known in self.nodes if f"{known}/".startswith(f"{path}/")]:
            self.remove_node(node)
        for graph in [known for known in self.graphs if f"{known}/".startswith(f"{path}/")]:
            del self.graphs[graph]

    def open_graph(self, path: str, what: Unknown) -> None:
        """Note that a graph may hold more than is known."""
        if path in self.graphs:
            self.graphs[path].rest = self.graphs[path].rest or what
        self.unread[what] = None
