"""Commands to wheel speeds. RN is ROS 2 nodes, WR wheeled robots."""

from __future__ import annotations

from typing import Any

from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.ros import open_endpoint
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World

_LIMITS = ("maxAcceleration", "maxDeceleration", "maxAngularAcceleration")
_NO_LIMIT = float("inf")


@computes("ROS2SubscribeTwist")
def subscribe_twist(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2SubscribeTwist.cpp:56-163: outputs hold the last message."""
    network = world.network
    endpoint = node.memory.get("endpoint")
    if endpoint is None:
        node.memory["endpoint"] = open_endpoint(node, world)
        node.memory["heard"] = network.command[0]
        return node.memory["endpoint"] is not None
    if endpoint.topic != network.commands.topic:
        return node.fails(f"it listens to {endpoint.topic}, not {network.commands.topic}", "P01")
    if endpoint.domain != network.commands.domain:
        return node.fails(f"it listens in domain {endpoint.domain}", "P02")
    number, twist = network.command
    if twist is None or number == node.memory["heard"]:
        return False
    node.memory["heard"] = number
    node.outputs["linearVelocity"], node.outputs["angularVelocity"] = twist
    node.enabled.append("execOut")
    return True


@computes("DifferentialController")
def differential_controller(node: Running, world: World) -> bool:
    """WR/nodes/OgnDifferentialController.cpp:36-140."""
    known = node.memory
    if not known and not _read_parameters(node, world):
        return False
    dt = node.number("dt", world)
    if dt <= 0 and any(known[each] for each in _LIMITS):
        return node.fails("an acceleration limit is set and no time step reaches it", "P11")
    v = _within(known["maxLinearSpeed"], node.number("linearVelocity", world))
    w = _within(known["maxAngularSpeed"], node.number("angularVelocity", world))
    v = _linear_ramp(known, v, dt)
    turn = known["maxAngularAcceleration"]
    if turn:
        w = max(known["w"] - turn * dt, min(w, known["w"] + turn * dt))
    known["v"], known["w"] = v, w
    r, distance = known["wheelRadius"], known["wheelDistance"]
    wheels = ((2 * v - w * distance) / (2 * r), (2 * v + w * distance) / (2 * r))
    node.outputs["velocityCommand"] = tuple(_within(known["maxWheelSpeed"], x) for x in wheels)
    return True


def _read_parameters(node: Running, world: World) -> bool:
    sizes = {each: node.number(each, world) for each in ("wheelRadius", "wheelDistance")}
    for each, size in sizes.items():
        if size <= 0:
            return node.fails(f"its {each} is {size:g}", "P02")
    node.memory.update(sizes, v=0.0, w=0.0)
    for each in _LIMITS:
        node.memory[each] = abs(node.number(each, world))
    for each in ("maxLinearSpeed", "maxAngularSpeed", "maxWheelSpeed"):
        node.memory[each] = abs(node.number(each, world)) or _NO_LIMIT
    return True


def _within(limit: float, value: float) -> float:
    return max(-limit, min(limit, value))


def _linear_ramp(known: dict[str, Any], v: float, dt: float) -> float:
    before, up, down = known["v"], known["maxAcceleration"], known["maxDeceleration"]
    if not up or not down:
        return v
    step = (up if abs(v) > abs(before) and v * before >= 0 else down) * dt
    return float(max(before - step, min(v, before + step)))
