"""Events, time, contexts, arrays, variables, and what `isaac/pure_nodes.py` says how to compute.

CN is core nodes, RN ROS 2 nodes.
"""

from __future__ import annotations

import json
from functools import partial

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.pure_nodes import PURE_NODES, NoOutputError, are_numbers, last_part
from lab3_usd.model.dry_run import Affine, Quaternion
from lab3_usd.sim.execution.node_instance import CONSTANT, FRAME, STEP, NodeInstance, computes
from lab3_usd.sim.execution.world import World, domain_number

NO_TURN = (0.0, 0.0, 0.0, 1.0)


def xyzw(place: Affine) -> Quaternion:
    """Return the rotation of a place in OGN's order."""
    w, x, y, z = place.quaternion()
    return (x, y, z, w)


def wxyz(node: NodeInstance, name: str, world: World) -> Quaternion:
    """Return the rotation that reaches an input, w first; a file's literal has w first already."""
    value = node.numbers(name, world)
    if len(value) != len(NO_TURN):
        value = NO_TURN
    elif name not in node.wires:
        saved = node.node.inputs.get(INPUT + name)
        if saved is not None and saved.value == value:
            return (value[0], value[1], value[2], value[3])
    x, y, z, w = value
    return (w, x, y, z)


@computes("OnPlaybackTick", "OnTick", on=FRAME)
def on_tick(node: NodeInstance, world: World) -> bool:
    """Kit's ticks: once an update while the timeline plays, or less often (OgnOnTick.html)."""
    if world.frame % (max(node.whole("framePeriod", world), 0) + 1):
        return False
    outputs = node.outputs
    outputs["deltaSeconds"], outputs["time"] = world.dt, world.since_play
    outputs["frame"] = float(world.frame)
    node.enabled.append("tick")
    return True


@computes("GetTimeline")
def get_timeline(node: NodeInstance, world: World) -> bool:
    """OgnGetTimeline.html: the time of the timeline, which plays from its start."""
    node.outputs.update(time=world.since_play, isPlaying=True)
    return True


@computes("OnPhysicsStep", on=STEP)
def on_physics_step(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnOnPhysicsStep.cpp:72-149."""
    node.outputs.update(deltaSimulationTime=world.dt)
    node.enabled.append("step")
    return True


@computes("IsaacSimulationGate")
def simulation_gate(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacSimulationGate.cpp:46-66: every so many signals; it counts on over Stop."""
    step = node.whole("step", world)
    if step <= 0:
        return node.fails("its step is 0", "zero-gate-step")
    return bool(node.count % step) or node.goes_on()


@computes("StopTimeline", "ExitApplication")
def stop_timeline(node: NodeInstance, world: World) -> bool:
    """Kit's Stop playback and Exit Application: no frame is played after this one."""
    world.stopped_by = world.stopped_by or node.path
    return True


@computes("IsaacReadSimulationTime")
def read_simulation_time(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacReadSimulationTime.cpp:52-74."""
    reset = node.flag("resetOnStop", world)
    node.outputs["simulationTime"] = world.since_play if reset else world.simulated
    return True


@computes("IsaacReadSystemTime")
def read_system_time(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacReadSystemTime.cpp."""
    node.outputs["systemTime"] = world.wall
    return True


@computes("ROS2Context")
def context(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2Context.cpp:41-120."""
    if "handle" not in node.memory:
        domain = node.whole("domain_id", world)
        if node.flag("useDomainIDEnvVar", world):
            from_outside = domain_number(world.network.environment)
            domain = domain if from_outside is None else from_outside
        handle = len(world.network.contexts) + 1
        world.network.contexts[handle] = domain
        node.memory["handle"] = handle
    node.outputs["context"] = node.memory["handle"]
    return True


_PUBLISHERS = ("keepLast", 10, "reliable", "volatile", "systemDefault")
_PRESETS = {  # RN/nodes/OgnROS2QoSProfile.cpp:135-192
    "Default for publishers/subscribers": _PUBLISHERS,
    "Services": _PUBLISHERS,
    "System Default": ("systemDefault", 0, "systemDefault", "systemDefault", "systemDefault"),
    "Sensor Data": ("keepLast", 5, "bestEffort", "volatile", "systemDefault"),
}
_POLICIES = ("history", "depth", "reliability", "durability", "liveliness")
_TIMES = ("deadline", "lifespan", "leaseDuration")


@computes("ROS2QoSProfile")
def qos_profile(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2QoSProfile.cpp:58-79: a profile in JSON, made once after Play.

    A preset that the file names is applied when the node is made; its saved policies do not count.
    """
    if "profile" not in node.memory:
        preset = _PRESETS.get(node.text("createProfile", world))
        policies: dict[str, object] = {
            name: node.whole(name, world) if name == "depth" else node.text(name, world)
            for name in _POLICIES
        }
        times = {name: node.number(name, world) for name in _TIMES}
        if preset is not None:
            policies, times = dict(zip(_POLICIES, preset, strict=True)), dict.fromkeys(_TIMES, 0.0)
        node.memory["profile"] = json.dumps(policies | times)
    node.outputs["qosProfile"] = node.memory["profile"]
    return True


MOST = 1000  # elements of an array that is made
_CONVERSIONS = {"Convert to stage units": True, "Convert to meters": False}  # whether to the unit


@computes("OgnIsaacScaleToFromStageUnit")
def scale(node: NodeInstance, world: World) -> bool:
    """CN/python/nodes/OgnIsaacScaleToFromStageUnit.py:37-51."""
    unit = world.scene.meters_per_unit
    conversion, value = node.text("conversion", world), node.get("value", world)
    if conversion not in _CONVERSIONS:
        return node.fails("its conversion is invalid", "invalid-conversion")
    factor = 1.0 / unit if _CONVERSIONS[conversion] else unit
    if isinstance(value, tuple) and are_numbers(value):
        node.outputs["result"] = tuple([x * factor for x in value])
    elif isinstance(value, (int, float)):
        node.outputs["result"] = value * factor
    else:
        return node.fails("no number reaches it", "no-number-input")
    return True


@computes(CONSTANT)
def constant(_: NodeInstance, __: World) -> bool:
    """Kit's constants: the value is an input, from which wires leave."""
    return True


@computes("ConstructArray")
def construct_array(node: NodeInstance, world: World) -> bool:
    """Kit's Make Array: as many elements as its size says, of the type of its array."""
    kind = node.text("arrayType", world) or "auto"
    size = min(node.whole("arraySize", world), MOST)
    values = [node.get(f"input{number}", world) for number in range(size)]
    texts = [isinstance(value, str) for value in values if value is not None]
    is_token = all(texts) if kind == "auto" else kind == "token[]"
    if any(text != is_token for text in texts):
        node.outputs["array"] = ()
        return node.fails(f"its elements are not {kind}", "wrong-array-type")
    empty = "" if is_token else 0.0
    node.outputs["array"] = tuple([empty if value is None else value for value in values])
    return True


@computes(*PURE_NODES)
def pure(node: NodeInstance, world: World) -> bool:
    """Give what the node makes of its inputs."""
    function = PURE_NODES[last_part(node.type.type)]
    try:
        node.outputs.update(function(partial(node.get, world=world), node.values))
    except NoOutputError as error:
        return node.fails(error.reason, error.kind)
    return True


@computes("ReadVariable")
def read_variable(node: NodeInstance, world: World) -> bool:
    """omni-graph-core/readvariable-2.html: what a variable of the graph holds."""
    name = node.text("variableName", world)
    path = node.target("graph") or node.path.rpartition("/")[0]
    graph = next((graph for graph in world.scene.graphs if graph.path == path), None)
    if graph is None or name not in graph.variables:
        return node.fails(f"the graph has no variable '{name}'", "no-number-input")
    node.outputs["value"] = graph.variables[name]
    return True
