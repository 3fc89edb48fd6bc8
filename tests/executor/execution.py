"""Runs graphs as they are wired: events push execution, data is pulled.

A node with execution inputs computes when it is reached; one without is computed when its outputs
are read, once a frame. Push graphs compute every node in every frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from msgspec import Struct, field

from executor.scene import Graph, Input, Node, Scene
from executor.types import type_of
from lab3_usd.spec.catalog import INPUT, OUTPUT, Catalog, NodeType, Port
from lab3_usd.spec.compatible import compatible

Function = Callable[["Running", Any], bool]
FUNCTIONS: dict[str, Function] = {}  # by node type
EVENTS: dict[str, str] = {}  # of the types that start an execution: what they wait for
FRAME, STEP = "frame", "physics step"
_STAGES = {FRAME: "pipelineStageSimulation", STEP: "pipelineStageOnDemand"}
_PUSH = ("push", "dirty_push")
_MODES = ("Automatic", "Standalone")


def computes(*types: str, on: str = "") -> Callable[[Function], Function]:
    """Make a function the compute of node types; it says whether it succeeded.

    `on` names what starts an execution at such nodes.
    """

    def register(function: Function) -> Function:
        for each in types:
            FUNCTIONS[each] = function
            if on:
                EVENTS[each] = on
        return function

    return register


class Running(Struct):
    """A node that runs: where its inputs come from, its outputs, and what it remembers."""

    path: str
    type: NodeType
    function: Function
    outputs: dict[str, Any]
    node: Node
    values: dict[str, Any] = field(default_factory=dict)
    wires: dict[str, tuple[Running, str]] = field(default_factory=dict)
    follows: dict[str, list[Running]] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict)
    enabled: list[str] = field(default_factory=list)
    pulled: bool = False  # has no execution input: computed when it is read
    computed: int = -1  # the frame in which it was pulled last
    busy: bool = False
    count: int = 0  # how often it computed

    def get(self, name: str, world: Any) -> Any:
        """Return what reaches an input, by its name without `inputs:`."""
        wire = self.wires.get(name)
        if wire is None:
            return self.values.get(name)
        source, port = wire
        if source.pulled and source.computed != world.frame and not source.busy:
            source.computed = world.frame
            source.compute(world)
        return source.outputs.get(port)

    def targets(self, name: str) -> tuple[str, ...]:
        """Return the prims that an input refers to."""
        return self.node.targets.get(INPUT + name, ())

    def compute(self, world: Any) -> bool:
        """Compute once; execution outputs that are enabled stay so for the caller to follow."""
        self.enabled.clear()
        self.busy = True
        self.count += 1
        done = self.function(self, world)
        self.busy = False
        return done

    def reset(self) -> None:
        """Forget everything, as on Stop."""
        self.memory.clear()
        self.outputs.clear()
        self.outputs.update(_initial(self.type))
        self.computed = -1


class Program(Struct):
    """All graphs of a stage that are evaluated, and what cannot be run."""

    events: dict[str, list[Running]]
    pushed: list[Running]
    nodes: dict[str, Running]
    not_simulated: dict[str, str]

    def run(self, what: str, world: Any) -> None:
        """Run what an event starts; push graphs run with each frame."""
        for each in self.events.get(what, ()):
            push(each, world)
        if what == FRAME:
            for each in self.pushed:
                if each.computed != world.frame:
                    each.computed = world.frame
                    each.compute(world)

    def reset(self) -> None:
        """Forget what the nodes remember, as on Stop."""
        for each in self.nodes.values():
            each.reset()


def push(node: Running, world: Any) -> None:
    """Compute a node and what follows it over enabled execution outputs, depth first."""
    waiting = [node]
    seen: dict[int, int] = {}
    while waiting:
        each = waiting.pop()
        again = seen.get(id(each), 0)
        if again > len(world.program.nodes):  # a ring of execution wires
            continue
        seen[id(each)] = again + 1
        if each.compute(world):
            for port in reversed(each.enabled):
                waiting.extend(reversed(each.follows.get(port, ())))


def compile_graphs(scene: Scene, catalog: Catalog) -> Program:
    """Make the graphs of a scene ready to run."""
    program = Program({}, [], {}, {})
    for graph in scene.graphs:
        if graph.mode not in _MODES:
            program.not_simulated[graph.path] = f"evaluation mode {graph.mode}"
            continue
        nodes = dict(_running(graph, catalog, program))
        for node in nodes.values():
            _connect(node, nodes)
        program.nodes.update(nodes)
        if graph.evaluator in _PUSH and graph.pipeline == _STAGES[FRAME]:
            program.pushed += _in_order(nodes)
        elif graph.evaluator == "execution":
            for node in nodes.values():
                event = EVENTS.get(node.type.type)
                if event is not None and graph.pipeline == _STAGES[event]:
                    program.events.setdefault(event, []).append(node)
    return program


def _running(graph: Graph, catalog: Catalog, program: Program) -> Iterator[tuple[str, Running]]:
    for node in graph.nodes:
        known = type_of(node, catalog)
        function = function_of(known) if known is not None else None
        if known is None or function is None:
            program.not_simulated[node.path] = f"node type {node.type or 'none'}"
            continue
        running = Running(node.path, known, function, _initial(known), node)
        running.pulled = (
            not any(
                port.is_execution for port in known.ports.values() if port.name.startswith(INPUT)
            )
            and known.type not in EVENTS
        )
        yield node.path, running


def function_of(node_type: NodeType) -> Function | None:
    """Return what a type computes; all constants are alike."""
    constant = node_type.type.startswith("omni.graph.nodes.Constant")
    return FUNCTIONS.get("omni.graph.nodes.ConstantToken" if constant else node_type.type)


def _initial(node_type: NodeType) -> dict[str, Any]:
    return {
        port.short: port.default
        for port in node_type.ports.values()
        if port.name.startswith(OUTPUT) and not port.is_execution
    }


def _connect(node: Running, nodes: dict[str, Running]) -> None:
    """Find what reaches each input: a wire that can be, else the value, else the default."""
    declared = {name: each for name, each in node.node.inputs.items() if node.type.port(name)}
    for name in {*node.type.ports, *declared}:
        port = node.type.port(name)
        if port is None or not name.startswith(INPUT) or port.is_target:
            continue
        state = declared.get(name) or Input("")
        if port.is_execution:
            _follow(node, port, state, nodes)
        else:
            _feed(node, port, state, nodes)


def _follow(node: Running, port: Port, state: Input, nodes: dict[str, Running]) -> None:
    for path, _, name in (each.rpartition(".") for each in state.sources):
        source = nodes.get(path)
        out = source.type.ports.get(name) if source is not None else None
        if source is not None and out is not None and compatible(out, port):
            source.follows.setdefault(out.short, []).append(node)


def _feed(node: Running, port: Port, state: Input, nodes: dict[str, Running]) -> None:
    node.values[port.short] = value_of(port, state, node)
    for path, _, name in (each.rpartition(".") for each in state.sources):
        source = nodes.get(path)
        out = source.type.port(name) if source is not None else None
        if source is None or out is None or not compatible(out, port):
            continue  # Kit drops such a wire when it opens the stage
        if name.startswith(OUTPUT):
            node.wires[port.short] = (source, out.short)
        else:
            node.values[port.short] = value_of(
                out, source.node.inputs.get(name) or Input(""), source
            )
        return


def value_of(port: Port, state: Input, node: Running) -> Any:
    """Return the value of an input without a wire: as saved, else the default."""
    if port.is_union:
        return state.literal if state.literal is not None else state.value
    if state.value is not None and state.type in {port.usd_type, ""}:
        return state.value
    return old_defaults(node.node).get(port.short, port.default)


def old_defaults(node: Node) -> dict[str, Any]:
    """Return what an older version of a type means where nothing is saved.

    A ROS 2 context of version 1 does not look at the environment.
    """
    older = node.type.endswith(".ROS2Context") and node.version == 1
    return {"useDomainIDEnvVar": False} if older else {}


def _in_order(nodes: dict[str, Running]) -> list[Running]:
    """Return nodes after those that feed them, as far as there is no ring."""
    before: dict[str, set[str]] = {path: set() for path in nodes}
    for node in nodes.values():
        before[node.path].update(source.path for source, _ in node.wires.values())
        for followers in node.follows.values():
            for each in followers:
                before[each.path].add(node.path)
    found: dict[str, Running] = {}
    while len(found) < len(nodes):
        ready = [each for each in nodes if each not in found and before[each] <= found.keys()]
        for path in ready or [next(each for each in nodes if each not in found)]:
            found[path] = nodes[path]
    return list(found.values())
