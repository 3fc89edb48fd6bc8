"""What the nodes compute that neither publish nor sense: events, time, numbers, and the drive.

After Isaac Sim 6.0.1; the source is named at each function: CN is isaacsim.core.nodes, RN
isaacsim.ros2.nodes, WR isaacsim.robot.wheeled_robots.nodes.
"""

from __future__ import annotations

from typing import Any

from executor.execution import FRAME, STEP, Running, computes
from executor.ros import numeric, open_endpoint

_LIMITS = ("maxAcceleration", "maxDeceleration", "maxAngularAcceleration")
_NO_LIMIT = float("inf")


@computes("omni.graph.action.OnPlaybackTick", "omni.graph.action.OnTick", on=FRAME)
def on_tick(node: Running, world: Any) -> bool:
    """Kit's playback tick: once an update while the timeline plays."""
    node.outputs.update(deltaSeconds=world.dt, time=world.since_play, frame=float(world.frame))
    node.enabled.append("tick")
    return True


@computes("isaacsim.core.nodes.OnPhysicsStep", on=STEP)
def on_physics_step(node: Running, world: Any) -> bool:
    """CN/nodes/OgnOnPhysicsStep.cpp:72-149."""
    node.outputs.update(deltaSimulationTime=world.dt)
    node.enabled.append("step")
    return True


@computes("isaacsim.core.nodes.IsaacReadSimulationTime")
def read_simulation_time(node: Running, world: Any) -> bool:
    """CN/nodes/OgnIsaacReadSimulationTime.cpp:52-74."""
    reset = node.get("resetOnStop", world)
    node.outputs["simulationTime"] = world.since_play if reset else world.simulated
    return True


@computes("isaacsim.core.nodes.IsaacReadSystemTime")
def read_system_time(node: Running, world: Any) -> bool:
    """CN/nodes/OgnIsaacReadSystemTime.cpp."""
    node.outputs["systemTime"] = world.wall
    return True


@computes("isaacsim.ros2.bridge.ROS2Context")
def context(node: Running, world: Any) -> bool:
    """RN/nodes/OgnROS2Context.cpp:41-120."""
    if "handle" not in node.memory:
        domain = int(node.get("domain_id", world) or 0)
        if node.get("useDomainIDEnvVar", world):
            from_outside = numeric(world.network.environment)
            domain = domain if from_outside is None else from_outside
        handle = len(world.network.contexts) + 1
        world.network.contexts[handle] = domain
        node.memory["handle"] = handle
    node.outputs["context"] = node.memory["handle"]
    return True


@computes("isaacsim.ros2.bridge.ROS2SubscribeTwist")
def subscribe_twist(node: Running, world: Any) -> bool:
    """RN/nodes/OgnROS2SubscribeTwist.cpp:56-163: outputs hold the last message."""
    network = world.network
    endpoint = node.memory.get("endpoint")
    if endpoint is None:
        node.memory["endpoint"] = open_endpoint(node, world)
        node.memory["heard"] = network.command[0]
        return node.memory["endpoint"] is not None
    if endpoint.topic != network.command_endpoint.topic or endpoint.domain:
        return False
    number, twist = network.command
    if twist is None or number == node.memory["heard"]:
        return False
    node.memory["heard"] = number
    node.outputs["linearVelocity"], node.outputs["angularVelocity"] = twist
    node.enabled.append("execOut")
    return True


@computes("isaacsim.core.nodes.OgnIsaacScaleToFromStageUnit")
def scale(node: Running, world: Any) -> bool:
    """CN/python/nodes/OgnIsaacScaleToFromStageUnit.py:37-51."""
    unit = world.scene.meters_per_unit
    factors = {"Convert to stage units": 1.0 / unit, "Convert to meters": unit}
    factor = factors.get(str(node.get("conversion", world)))
    value = node.get("value", world)
    if factor is None or value is None or isinstance(value, str):
        return False
    numbers = isinstance(value, tuple)
    node.outputs["result"] = tuple(x * factor for x in value) if numbers else value * factor
    return True


@computes("omni.graph.nodes.BreakVector3")
def break_vector(node: Running, world: Any) -> bool:
    """Kit's Break 3-Vector: one output for each component."""
    value = node.get("tuple", world)
    if not isinstance(value, tuple) or len(value) != 3:
        return False
    node.outputs["x"], node.outputs["y"], node.outputs["z"] = value
    return True


@computes("omni.graph.nodes.ConstantToken")
def constant(_: Running, __: Any) -> bool:
    """Kit's constants: the value is an input, from which wires leave."""
    return True


@computes("omni.graph.nodes.ConstructArray")
def construct_array(node: Running, world: Any) -> bool:
    """Kit's Make Array: as many elements as its size says, of the type of its array."""
    kind = str(node.get("arrayType", world) or "auto")
    size = int(node.get("arraySize", world) or 0)
    values = [node.get(f"input{each}", world) for each in range(size)]
    texts = [isinstance(each, str) for each in values if each is not None]
    is_token = all(texts) if kind == "auto" else kind == "token[]"
    if not is_token and (kind != "auto" or any(texts)):
        node.outputs["array"] = ()
        return False
    empty = "" if is_token else 0.0
    node.outputs["array"] = tuple(empty if each is None else each for each in values)
    return True


@computes("isaacsim.robot.wheeled_robots.DifferentialController")
def differential_controller(node: Running, world: Any) -> bool:
    """WR/nodes/OgnDifferentialController.cpp:36-140."""
    known = node.memory
    if not known and not _read_parameters(node, world):
        return False
    dt = float(node.get("dt", world) or 0.0)
    if dt <= 0 and any(known[each] for each in _LIMITS):
        return False
    v = _within(known["maxLinearSpeed"], float(node.get("linearVelocity", world) or 0.0))
    w = _within(known["maxAngularSpeed"], float(node.get("angularVelocity", world) or 0.0))
    v = _linear_ramp(known, v, dt)
    turn = known["maxAngularAcceleration"]
    if turn:
        w = max(known["w"] - turn * dt, min(w, known["w"] + turn * dt))
    known["v"], known["w"] = v, w
    r, distance = known["wheelRadius"], known["wheelDistance"]
    wheels = ((2 * v - w * distance) / (2 * r), (2 * v + w * distance) / (2 * r))
    node.outputs["velocityCommand"] = tuple(_within(known["maxWheelSpeed"], x) for x in wheels)
    return True


def _read_parameters(node: Running, world: Any) -> bool:
    sizes = {each: float(node.get(each, world) or 0.0) for each in ("wheelRadius", "wheelDistance")}
    if min(sizes.values()) <= 0:
        return False
    node.memory.update(sizes, v=0.0, w=0.0)
    for each in _LIMITS:
        node.memory[each] = abs(float(node.get(each, world) or 0.0))
    for each in ("maxLinearSpeed", "maxAngularSpeed", "maxWheelSpeed"):
        node.memory[each] = abs(float(node.get(each, world) or 0.0)) or _NO_LIMIT
    return True


def _within(limit: float, value: float) -> float:
    return max(-limit, min(limit, value))


def _linear_ramp(known: dict[str, Any], v: float, dt: float) -> float:
    before, up, down = known["v"], known["maxAcceleration"], known["maxDeceleration"]
    if not up or not down:
        return v
    step = (up if abs(v) > abs(before) and v * before >= 0 else down) * dt
    return float(max(before - step, min(v, before + step)))


@computes("isaacsim.core.nodes.IsaacArticulationController")
def articulation_controller(node: Running, world: Any) -> bool:
    """CN/python/nodes/OgnIsaacArticulationController.py:41-300."""
    known = node.memory
    if "machine" not in known:
        targets = node.targets("targetPrim")
        path = str(node.get("robotPath", world) or "") or (targets[0] if targets else "")
        known["machine"] = world.machines.articulation(path)
        known["names"], known["joints"] = None, None
    machine = known["machine"]
    if machine is None:
        known.clear()  # it is looked for again at the next tick
        return False
    names = node.get("jointNames", world) or ()
    if names and names != known["names"]:
        known["names"] = names
        found = [machine.joints.get(str(each)) for each in names]
        known["joints"] = None if None in found else found
    indices = node.get("jointIndices", world) or ()
    if any(indices) and not known["names"]:
        every = list(machine.joints.values())
        known["joints"] = [every[int(each)] for each in indices if int(each) < len(every)]
    joints = known["joints"]
    if joints is None and not known["names"]:
        joints = list(machine.joints.values())
    return joints is not None and _command(node, world, joints)


def _command(node: Running, world: Any, joints: list[Any]) -> bool:
    commands = {
        name: tuple(node.get(f"{name}Command", world) or ())
        for name in ("position", "velocity", "effort")
    }
    if any(each and len(each) != len(joints) for each in commands.values()):
        return False
    for name, values in commands.items():
        for joint, value in zip(joints, values, strict=False):
            setattr(joint, f"target_{name}", float(value))
    return True
