"""Compiles the graphs of a stage, with the wires that Kit would keep.

A node with execution inputs computes when it is reached; one without is computed when its outputs
are read, once a frame. Push graphs compute every node in every frame.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from msgspec import Struct, field

from lab3_usd.facts.likely_names import is_unregistered
from lab3_usd.isaac.messages import with_named_message
from lab3_usd.isaac.node_types import (
    INPUT,
    OUTPUT,
    NodeType,
    Port,
    can_connect,
    drops_wire,
)
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import are_alike
from lab3_usd.model.dry_run import Input, Scene, SceneGraph, SceneNode
from lab3_usd.sim.execution.node_instance import (
    FRAME,
    STEP,
    Failure,
    NodeInstance,
    event_of,
    function_of,
    initial,
    last_name,
    push,
)
from lab3_usd.sim.execution.world import World

_STAGES = {FRAME: "pipelineStageSimulation", STEP: "pipelineStageOnDemand"}
PUSH = ("push", "dirty_push")
READ_VARIABLE, WRITE_VARIABLE = "ReadVariable", "WriteVariable"
# Of types of which not all is known: the outputs that are computed, the inputs that are not.
_KNOWN_OUTPUTS = {"GetTimeline": ("time", "isPlaying")}
_UNKNOWN_INPUTS = {"ForLoop": "breakLoop"}
_UNSAVED = Input("")


class Program(Struct):
    """All graphs of a stage that are evaluated, and what cannot be run.

    `unwritten` are the nodes that no function is written for, with their types where the platform
    has them; `dead` is what Kit does not run of the graphs. `guessed` are the inputs of which it is
    not public what reaches them, and what is taken.
    """

    events: dict[str, list[NodeInstance]]
    pushed: list[NodeInstance]
    nodes: dict[str, NodeInstance]
    not_simulated: dict[str, str]
    idle: dict[str, str]  # graphs that are not evaluated in the frame loop, and why
    unwritten: dict[str, NodeType | None]
    dead: list[tuple[str, Failure]] = field(default_factory=list)
    before: dict[str, list[NodeInstance]] = field(default_factory=dict)  # what triggers each node
    guessed: dict[str, str] = field(default_factory=dict)

    def run(self, what: str, world: World, *, again: bool = False) -> None:
        """Run what an event starts; push graphs run with each frame.

        What was read before is read `again` where time went on within a frame.
        """
        world.reading += again
        for running in self.events.get(what, ()):
            push(running, world, len(self.nodes))
        if what == FRAME:
            for running in self.pushed:
                if running.computed != world.reading:
                    running.computed = world.reading
                    running.compute(world)

    def reset(self) -> None:
        """Reset the state of the nodes, as on Stop."""
        for node in self.nodes.values():
            node.reset()


def compile_graphs(scene: Scene, platform: Platform) -> Program:
    """Make the graphs of a scene ready to run."""
    program = Program({}, [], {}, {}, {}, {})
    evaluated = [
        (graph, dict(_running(graph, platform, program)))
        for graph in scene.graphs
        if _is_evaluated(graph, scene, platform, program)
    ]
    for _, nodes in evaluated:
        program.nodes.update(nodes)
    for graph, nodes in evaluated:
        for node in nodes.values():
            _connect(node, program)
            program.dead += _dropped(node, program.nodes, platform)
        _schedule(graph, nodes, program)
    for node in program.nodes.values():
        followers = (follower for some in node.follows.values() for follower in some)
        for path in dict.fromkeys(follower.path for follower in followers):
            program.before.setdefault(path, []).append(node)
    unsure = depending(program, ())
    for node in program.nodes.values():
        node.unknown_name = _unknown_name(node, unsure, platform)
    return program


def _unknown_name(node: NodeInstance, unsure: Collection[str], platform: Platform) -> str:
    """Return the input of a topic or frame to which something unknown is wired, '' for none."""
    frames = () if node.type.tf is None else node.type.tf.names
    for name in (*node.type.topics[:1], *frames, INPUT + platform.ros.namespace):
        state = node.node.inputs.get(name) or _UNSAVED
        if any(wire.rpartition(".")[0] in unsure for wire in state.sources):
            return name
    return ""


def _is_evaluated(graph: SceneGraph, scene: Scene, platform: Platform, program: Program) -> bool:
    """Whether a graph runs once a frame; an instanced one runs once for each prim that names it."""
    evaluation, reason = platform.graph.evaluation, ""
    is_known = graph.pipeline in _STAGES.values()
    if graph.instanced:
        reason = "Isaac Sim should load no graph of an instance"
    elif graph.evaluator not in ("execution", *PUSH) or not is_known:
        what = f"evaluator {graph.evaluator}" if is_known else f"stage {graph.pipeline}"
        reason = f"what is evaluated by the {what}"
    elif graph.mode in evaluation.by_reference:
        targets = (prim.targets.get(evaluation.reference, ()) for prim in scene.prims.values())
        count = sum(graph.path in paths for paths in targets)
        if not count:
            text = f"it is {graph.mode}, and no prim refers to it by {evaluation.reference}"
            program.dead.append((graph.path, Failure(text, "graph-not-evaluated")))
            return False
        reason = f"it runs for {count} prims" if count > 1 else ""
    if reason:
        program.not_simulated[graph.path] = reason
        program.unwritten.update((node.path, platform.get(node.type)) for node in graph.nodes)
    return not reason


def _dropped(
    node: NodeInstance, nodes: dict[str, NodeInstance], platform: Platform
) -> Iterator[tuple[str, Failure]]:
    """Yield the wires of a node that Kit drops: the ports do not exist, or do not fit."""
    for name, state in node.node.inputs.items():
        yield from _refused(node, name, state, nodes)
        if not state.sources or name.partition(":")[2] in node.fed:
            continue
        if _is_described(node, platform) and node.type.port(name) is None:
            yield node.path, Failure(f"its type has no {name}", "unknown-port")
        for path, _, output in (wire.rpartition(".") for wire in state.sources):
            source = nodes.get(path)
            if source is None or not _is_described(source, platform):
                continue
            if source.type.port(output) is None:
                text = f"{name} is connected to {path}, whose type has no {output}"
                yield node.path, Failure(text, "unknown-port")


def _refused(
    node: NodeInstance, name: str, state: Input, nodes: dict[str, NodeInstance]
) -> Iterator[tuple[str, Failure]]:
    """Yield the wires into a port that cannot take what comes; of roles that is not known."""
    port = node.type.port(name)
    for path, _, output in (wire.rpartition(".") for wire in state.sources):
        out = nodes[path].type.port(output) if path in nodes else None
        if port is None or out is None or not drops_wire(out, port):
            continue
        text = f"{name} expects {port.ogn_type}, but {path} provides {out.ogn_type}"
        yield node.path, Failure(text, "refused-wire")


def _is_described(node: NodeInstance, platform: Platform) -> bool:
    """Whether the platform has every port of a node's type."""
    node_type = platform.get(node.node.type)
    return node_type is not None and not node_type.may_have_more


def depending(program: Program, missing: Collection[str]) -> frozenset[str]:
    """Return the nodes that depend on unknown values, also through other nodes.

    Unknown are nodes without a function, inputs with several sources, and targets in missing
    assets.
    """
    unsure = {*program.unwritten, *(name.rpartition(".")[0] for name in program.guessed)}
    for node in program.nodes.values():
        targets = (path for paths in node.node.targets.values() for path in paths)
        if any(is_within(path, missing) for path in targets):
            unsure.add(node.path)
    spreading = True
    while spreading:
        spreading = False
        for node in program.nodes.values():
            sources = (wire for state in node.node.inputs.values() for wire in state.sources)
            if node.path not in unsure and any(w.rpartition(".")[0] in unsure for w in sources):
                unsure.add(node.path)
                spreading = True
    return frozenset(unsure)


def _schedule(graph: SceneGraph, nodes: dict[str, NodeInstance], program: Program) -> None:
    """Note what runs the nodes of a graph: each frame, or an event."""
    if graph.pipeline != _STAGES[FRAME]:
        program.idle[graph.path] = f"its graph is of {graph.pipeline}"
    if graph.evaluator in PUSH and graph.pipeline == _STAGES[FRAME]:
        program.pushed += _in_order(nodes)
    elif graph.evaluator == "execution":
        events = {node.path: event_of(node.type) for node in nodes.values()}
        is_evaluated = any(event and graph.pipeline == _STAGES[event] for event in events.values())
        for node in nodes.values():
            event = events[node.path]
            if event is not None and graph.pipeline == _STAGES[event]:
                program.events.setdefault(event, []).append(node)
            elif event is not None and is_evaluated:
                program.not_simulated[node.path] = f"whether it fires in {graph.pipeline}"
                program.unwritten[node.path] = node.type


def type_of(node: SceneNode, platform: Platform) -> NodeType | None:
    """Return the type of a node, with the ports of the message that it names."""
    node_type = platform.get(node.type)
    if node_type is None:
        return None
    return with_named_message(node_type, node.inputs)


def _running(
    graph: SceneGraph, platform: Platform, program: Program
) -> Iterator[tuple[str, NodeInstance]]:
    read = {source for n in graph.nodes for state in n.inputs.values() for source in state.sources}
    is_written = any(last_name(node.type) == WRITE_VARIABLE for node in graph.nodes)
    for node in graph.nodes:
        node_type = type_of(node, platform)
        function = function_of(node_type) if node_type is not None else None
        again = INPUT + (platform.once[node.type].again if node.type in platform.once else "")
        is_begun_anew = bool((node.inputs.get(again) or _UNSAVED).sources)
        if (
            _is_partly_known(node, read)
            or is_begun_anew
            or (last_name(node.type) == READ_VARIABLE and is_written)
        ):
            function = None
        is_direct = node.path.rpartition("/")[0] in (graph.path, *graph.inner)
        if node_type is None and is_direct and is_unregistered(node.type, platform):
            # Isaac Sim opens the stage without it.
            reason = f"its type '{node.type}' is not one of Isaac Sim {platform.release}"
            reason = reason if node.type else "it has no type"
            program.dead.append((node.path, Failure(reason, "unknown-type")))
            continue
        if node_type is None or function is None or not is_direct:
            reason = f"node type {node.type or 'none'}"
            if not is_direct:
                reason = "whether a node runs that is not a direct child of its graph, is unknown"
            program.not_simulated[node.path] = reason
            program.unwritten[node.path] = node_type
            continue
        running = NodeInstance(node.path, node_type, function, initial(node_type), node)
        running.pulled = (
            not any(
                port.is_execution
                for port in node_type.ports.values()
                if port.name.startswith(INPUT)
            )
            and event_of(node_type) is None
        )
        yield node.path, running


def _is_partly_known(node: SceneNode, read: Collection[str]) -> bool:
    """Whether something is asked of a node that its function does not compute."""
    name = last_name(node.type)
    outputs, unknown = _KNOWN_OUTPUTS.get(name), _UNKNOWN_INPUTS.get(name, "")
    own = f"{node.path}.{OUTPUT}"
    asks_more = outputs is not None and any(
        source.startswith(f"{node.path}.") and source.removeprefix(own) not in outputs
        for source in read
    )
    return asks_more or bool((node.inputs.get(INPUT + unknown) or _UNSAVED).sources)


def _connect(node: NodeInstance, program: Program) -> None:
    """Find what reaches each input: a wire that can be, else the value, else the default."""
    declared = {name: state for name, state in node.node.inputs.items() if node.type.port(name)}
    for name in dict.fromkeys((*node.type.ports, *declared)):
        port = node.type.port(name)
        if port is None or not name.startswith(INPUT) or port.is_target:
            continue
        state = declared.get(name) or _UNSAVED
        if port.is_execution:
            for path, _, output in (wire.rpartition(".") for wire in state.sources):
                source = program.nodes.get(path)
                out = source.type.ports.get(output) if source is not None else None
                if out is None and source is not None and source.type.may_have_more:
                    out = Port(output, "execution", "uint")
                if source is not None and out is not None and can_connect(out, port):
                    source.follows.setdefault(out.short, []).append(node)
                    node.fed.add(port.short)
        else:
            count = _feed(node, port, state, program.nodes)
            if count > 1:
                text = f"which of its {count} sources counts is not public; the first is taken"
                program.guessed[f"{node.path}.{name}"] = text


def _feed(node: NodeInstance, port: Port, state: Input, nodes: dict[str, NodeInstance]) -> int:
    """Let the value or the first source reach an input; return how many sources Kit keeps."""
    count = 0
    node.values[port.short] = value_of(port, state, node)
    for path, _, name in (wire.rpartition(".") for wire in state.sources):
        source = nodes.get(path)
        out = source.type.port(name) if source is not None else None
        if source is None or out is None or drops_wire(out, port):
            continue  # Kit drops such a wire when it opens the stage
        node.fed.add(port.short)
        count += 1
        if count > 1:
            continue
        if name.startswith(OUTPUT):
            node.wires[port.short] = (source, out.short)
        else:
            node.values[port.short] = value_of(
                out, source.node.inputs.get(name) or _UNSAVED, source
            )
    return count


def value_of(port: Port, state: Input, node: NodeInstance) -> Any:
    """Return the value of an input without a wire: as saved, else the default."""
    if port.is_union:
        return state.literal if state.literal is not None else state.value
    if state.value is not None and (not state.type or are_alike(state.type, port.usd_type)):
        return state.value
    return node.type.default(port.name, node.node.version or None)


def is_within(path: str, tops: Collection[str]) -> bool:
    """Whether a prim is one of these or stands below one."""
    return any(f"{path}/".startswith(f"{top}/") for top in tops)


def _in_order(nodes: dict[str, NodeInstance]) -> list[NodeInstance]:
    """Return the nodes in topological order, as far as there is no cycle."""
    before: dict[str, set[str]] = {path: set() for path in nodes}
    for node in nodes.values():
        before[node.path].update(source.path for source, _ in node.wires.values())
        for followers in node.follows.values():
            for follower in followers:
                before[follower.path].add(node.path)
    ordered: dict[str, NodeInstance] = {}
    while len(ordered) < len(nodes):
        waiting = [path for path in nodes if path not in ordered]
        ready = [path for path in waiting if before[path] <= ordered.keys()]
        ordered |= {path: nodes[path] for path in ready or waiting[:1]}
    return list(ordered.values())
