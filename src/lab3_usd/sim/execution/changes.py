"""Nodes that may change a stage or its run, and that no function is written for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from lab3_usd.isaac.behaviour import WriterPorts
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import Scene, SceneNode
from lab3_usd.sim.execution.program import PUSH, Program, is_within

_PHYSICS = "Phys"  # how the names of types and schemas of physics begin


def unplayed_change(scene: Scene, program: Program, platform: Platform) -> str:
    """Return what may change what is played and is not simulated; '' for nothing."""
    nodes = {node.path: node for graph in scene.graphs for node in graph.nodes}
    for graph in scene.graphs:
        for node in graph.nodes:
            ports = platform.writers.get(node.type)
            runs_code = platform.scripts.runs(node.type)
            if not runs_code and (ports is None or not _matters(node, ports, scene, platform)):
                continue
            ahead: set[str] = set()
            may_run = _may_run(node, graph.pipeline, nodes, platform, ahead)
            # One that is played may wait for a signal of one that is not.
            unwritten = [nodes[path] for path in program.unwritten if path in ahead]
            if (may_run or graph.evaluator in PUSH) and any(
                each is node or _may_run(each, graph.pipeline, nodes, platform, set())
                for each in unwritten
            ):
                return f"not simulated: {node.path} ({node.type}) may change what happens"
    return ""


def _may_run(
    node: SceneNode, pipeline: str, nodes: dict[str, SceneNode], platform: Platform, seen: set[str]
) -> bool:
    """Whether a signal of an event that nobody at the screen causes may reach a node."""
    seen.add(node.path)
    if node.type in platform.events:
        is_fired = platform.events[node.type] in ("", pipeline)
        return is_fired and node.type not in platform.by_hand
    for source, port in _signals(node, nodes, platform):
        node_type = platform.get(source.type)
        out = None if node_type is None else node_type.listed(port)
        is_signal = out is None or out.is_execution
        is_new = is_signal and source.path not in seen
        if is_new and _may_run(source, pipeline, nodes, platform, seen):
            return True
    return False


def _signals(
    node: SceneNode, nodes: dict[str, SceneNode], platform: Platform
) -> Iterator[tuple[SceneNode, str]]:
    """Yield what is wired into the execution inputs of a node, and into those not known."""
    node_type = platform.get(node.type)
    for name, state in node.inputs.items():
        port = None if node_type is None else node_type.listed(name)
        if port is None or port.is_execution:
            for path, _, source_port in (wire.rpartition(".") for wire in state.sources):
                if path in nodes:
                    yield nodes[path], source_port


def _matters(node: SceneNode, ports: WriterPorts, scene: Scene, platform: Platform) -> bool:
    """Whether a node may change the run, or a prim that a dry run plays."""
    if ports.run:
        by, value = _saved(node, ports.by, platform), _saved(node, ports.value, platform)
        is_other = bool(ports.by) and by is not None and by not in ports.only
        return not is_other and not (bool(ports.value) and value is ports.usual)
    name = _saved(node, ports.property, platform) if ports.property else None
    if isinstance(name, str) and name and name.startswith(platform.appearance):
        return False
    written = [path for short in ports.prims for path in node.targets.get(INPUT + short, ())]
    for short in (*ports.paths, *ports.wires):
        state = node.inputs.get(INPUT + short)
        if state is not None and state.sources:
            return True
        value = _saved(node, short, platform)
        texts = value if isinstance(value, tuple) else (value,)
        written += [text for text in texts if isinstance(text, str) and text.startswith("/")]
    return any(_is_played(path, scene, platform) for path in written)


def _saved(node: SceneNode, short: str, platform: Platform) -> Any:
    """Return the value of an input as saved, else its default; None for what a wire brings."""
    state, node_type = node.inputs.get(INPUT + short), platform.get(node.type)
    if state is not None and state.sources:
        return None
    for value in (state.literal, state.value) if state is not None else ():
        if value is not None:
            return value
    return None if node_type is None else node_type.default(INPUT + short, node.version or None)


def _is_played(path: str, scene: Scene, platform: Platform) -> bool:
    """Whether a prim or one below it is a node, a sensor that a node names, or of physics."""
    nodes = [node for graph in scene.graphs for node in graph.nodes]
    if any(is_within(node.path, (path,)) for node in nodes):
        return True
    named = {target for node in nodes for targets in node.targets.values() for target in targets}
    return any(
        prim.type.startswith(_PHYSICS)
        or any(api.startswith(_PHYSICS) for api in prim.apis)
        or (prim.path in named and (prim.path == path or prim.type in platform.placed))
        for prim in scene.below(path)
    )
