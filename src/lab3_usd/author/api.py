"""The Python API: a stage to which graphs are added, by recipes or node by node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.author.adding import Addition, AddOptions, add_one, new_findings, with_frames
from lab3_usd.author.choosing import robot_line
from lab3_usd.author.editing import Editing
from lab3_usd.author.places import graph_to_extend, refuse_place
from lab3_usd.author.request import Request, options_of
from lab3_usd.errors import AmbiguousError, GraphError, NewFindingsError, UsageError
from lab3_usd.facts.planned_graphs import free_name, graph_at
from lab3_usd.facts.robots import Robot, Sensor, robots
from lab3_usd.files import refuse_existing, replace_files, write_whole
from lab3_usd.isaac.graph import (
    Graph,
    Node,
    Wire,
    checked_path,
    graph_node,
    make_graph,
    make_wire,
    near_name,
    type_named,
)
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.changes import AddGraph, Connect, wire_edit
from lab3_usd.stage.read.opening import quiet

_BY_HAND = "python"  # the kind of a graph that no recipe brought


class PortOf:
    """A port of a node that is being added; `str` names both."""

    def __init__(self, node: NodeOf, name: str) -> None:
        """Name a port."""
        self.node = node
        self.name = name

    def __str__(self) -> str:
        """Return `node.port`."""
        return f"{self.node.name}.{self.name}"


class NodeOf:
    """A node of a graph that is being made; its attributes are its ports."""

    def __init__(self, made: Node) -> None:
        """Hold a node that was checked."""
        self._made = made

    @property
    def name(self) -> str:
        """The name of its prim."""
        return self._made.role

    def __getattr__(self, name: str) -> PortOf:
        """Return a port by its short name.

        Raises:
            GraphError: the node has no such port.
        """
        if name.startswith("__"):
            raise AttributeError(name)
        kind = self._made.type
        if any(kind.port(side + name) for side in (INPUT, OUTPUT)):
            return PortOf(self, name)
        ports = [port.rpartition(":")[2] for port in kind.ports]
        raise GraphError(f"{self.name}.{name}: no port '{name}'{near_name(name, ports)}")

    def __dir__(self) -> list[str]:
        """Name the ports."""
        return sorted({port.rpartition(":")[2] for port in self._made.type.ports} | {"name"})


class GraphOf:
    """An Action Graph that is being made or extended."""

    def __init__(self, editing: Editing, path: str) -> None:
        """Begin a graph at a path, or extend the one that stands there."""
        self._editing = editing
        self.path = path
        self.extends = graph_at(path, editing.model) is not None
        self._nodes: dict[str, NodeOf] = {}
        self._wires: list[Wire] = []
        self._there: dict[str, NodeOf] = {}
        if self.extends:
            graph = graph_to_extend(path, editing.model)
            self._there = {
                node.name: NodeOf(Node(node.name, node.type))
                for node in graph.nodes
                if node.type is not None
            }

    def __getitem__(self, name: str) -> NodeOf:
        """Return a node by the name of its prim, new or there already.

        Raises:
            GraphError: there is none.
        """
        node = self._nodes.get(name) or self._there.get(name)
        if node is None:
            names = [*self._nodes, *self._there]
            raise GraphError(f"{self.path} has no node '{name}'{near_name(name, names)}")
        return node

    def node(self, kind: str, name: str = "", /, **values: Any) -> NodeOf:
        """Add a node of a type, by its whole or short name, with values of its inputs.

        Paths of prims are the values of relationships.

        Raises:
            GraphError: there is no such type, no such input, or the value does not fit.
        """
        node_type = type_named(kind, self._editing.platform)
        role = name or free_name(node_type.prim_name, {*self._nodes, *self._there})
        if role in self._nodes or role in self._there:
            raise GraphError(f"{self.path}/{role}: there is a node of this name already")
        targets = {}
        for port in [*values]:
            port_type = node_type.input(port)
            if port_type is not None and port_type.is_target:
                paths = values.pop(port)
                targets[port] = (paths,) if isinstance(paths, str) else tuple(paths)
        try:
            made = NodeOf(graph_node(role, node_type, values, targets))
        except GraphError as error:
            raise GraphError(f"{role}: {error}") from error
        self._nodes[role] = made
        return made

    def wire(self, source: PortOf, target: PortOf) -> None:
        """Connect an output, or a constant, to an input.

        Raises:
            GraphError: there is no such port, the two do not fit, or the input is connected.
        """
        start, end = (port.node._made for port in (source, target))  # noqa: SLF001 - of this module
        try:
            wire = make_wire(start, source.name, end, target.name)
        except GraphError as error:
            raise GraphError(f"{source} -> {target}: {error}") from error
        if any(other.target == wire.target for other in self._wires):
            raise GraphError(f"{source} -> {target}: that input is connected already")
        self._wires.append(wire)

    def made(self) -> Graph:
        """Return the new nodes of the graph, and the wires that end at them."""
        nodes = [node._made for node in self._nodes.values()]  # noqa: SLF001 - of this module
        wires = [wire for wire in self._wires if wire.target.role in self._nodes]
        return make_graph(self.path, nodes, wires)

    def connections(self) -> list[Connect]:
        """Return the wires that end at nodes that were there before."""
        return [
            wire_edit(self.path, wire, self[wire.target.role]._made)  # noqa: SLF001 - of this module
            for wire in self._wires
            if wire.target.role not in self._nodes
        ]


class Added(Struct, frozen=True):
    """A graph that was added: its path, and what was filled in, each with what it rests on."""

    path: str
    facts: dict[str, tuple[str, str]]


class Stage:
    """A stage to which graphs are added in memory, until it is saved."""

    def __init__(self, editing: Editing) -> None:
        """Hold an open stage; use `open`."""
        self.path = editing.path
        self._editing = editing
        self._before = editing.findings()
        self._additions: list[Addition] = []
        self._graphs: dict[str, GraphOf] = {}

    @classmethod
    @quiet()
    def open(cls, path: Path | str, isaac: str = BASE) -> Stage:
        """Open a stage to add graphs for a release of Isaac Sim.

        Raises:
            StageError: it cannot be opened.
            UsageError: the release is not known.
        """
        return cls(Editing.begin(Path(path), isaac))

    def robots(self) -> tuple[Robot, ...]:
        """Return the robots of the stage, measured in metres."""
        return robots(self._editing.model)

    def robot(self, path: str = "") -> Robot:
        """Return the robot at a path, or the only one.

        Raises:
            AmbiguousError: there are several; `candidates` names them.
            UsageError: there is none.
        """
        candidates = self.robots()
        fitting = [r for r in candidates if not path or path in (r.path, r.root, r.base)]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            raise AmbiguousError("robot", [robot_line(robot) for robot in fitting], "its path")
        there = ", ".join(robot.path for robot in candidates) or "none"
        raise UsageError(f"{self.path}: there is no robot{f' {path}' if path else ''}: {there}")

    @quiet()
    def add(
        self, kind: str, *, replace: bool = False, force: bool = False, **options: Any
    ) -> Added:
        """Add a graph by a recipe, with the options of `lab3 add` as keywords.

        Raises:
            AmbiguousError: several answers fit; `candidates` names them.
            UsageError: an option is wrong, or something does already what is asked for.
        """
        self._write_graphs()
        values = {name: _plain(value) for name, value in options.items()}
        request = Request(kind, options_of(values, kind))
        settings = AddOptions(self._editing.platform.release, force=force, replaces=replace)
        made = [
            add_one(self._editing, wanted, settings)
            for wanted in with_frames(request, self._editing.model)
        ]
        self._additions += made
        return Added(made[0].graph, {h.label: (h.shown, h.source) for h in made[0].holes})

    def graph(self, path: str) -> GraphOf:
        """Begin an Action Graph at a path, or extend the one that stands there.

        Raises:
            GraphError: the path is none.
            UsageError: no graph runs there, or another prim stands there.
        """
        if path not in self._graphs:
            checked_path(path)
            self._write_graphs()
            model = self._editing.model
            if graph_at(path, model) is None:
                refuse_place(path, model)
                if model.prims.get(path) is not None:
                    raise UsageError(f"{path} is taken: a prim is there")
            self._graphs[path] = GraphOf(self._editing, path)
        return self._graphs[path]

    @quiet()
    def layer(self) -> Any:
        """Return the root layer with all that was added, for those who want pxr."""
        self._write_graphs()
        return self._editing.session.stage.GetRootLayer()

    @quiet()
    def save(
        self, path: Path | str | None = None, *, check: bool = True, force: bool = False
    ) -> Path:
        """Write the stage, in place of itself or to another file, and return the file.

        Raises:
            NewFindingsError: the linter finds something new in what was added; `findings` has it.
            UsageError: the file is there already, was changed meanwhile, or cannot be written.
        """
        self._write_graphs()
        target = self.path if path is None else Path(path)
        if check:
            after = self._editing.findings()
            _, new = new_findings(self._before, after, self._additions, self._editing.platform)
            if new:
                raise NewFindingsError(self.path, new)
        state = self._editing.state
        content = self._editing.new_root() or state.content
        if target.resolve() == self.path.resolve():
            replace_files({target: content}, {target: state})
        else:
            refuse_existing(target, force=force)
            write_whole(target, content, force=force)
        return target

    def _write_graphs(self) -> None:
        """Write the graphs that were made by hand, which the facts then know."""
        for path, graph in self._graphs.items():
            made, wires = graph.made(), graph.connections()
            if made.nodes or wires:
                new = AddGraph.of(made, _BY_HAND)
                self._editing.edit([*(new.contents if graph.extends else (new,)), *wires])
                request = Request(_BY_HAND)
                self._additions.append(Addition(request, path, len(made.nodes)))
        self._graphs.clear()


def _plain(value: Any) -> Any:
    """Return an option as a request has it: robots and sensors by their paths, lists as tuples."""
    if isinstance(value, Robot):
        return value.path
    if isinstance(value, Sensor):
        return value.prim.path
    return tuple(value) if isinstance(value, list) else value
