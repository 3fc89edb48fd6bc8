"""Inertia, commands to steer, and messages of any type. RN is ROS 2 nodes."""

from __future__ import annotations

import math

from lab3_usd.isaac.messages import why_no_message
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.dry_run import Affine, column
from lab3_usd.model.physics import GRAVITY_DIRECTION, down, number, vector
from lab3_usd.model.transforms import Vector, cross, length, scaled
from lab3_usd.sim.execution.node_instance import NO_VECTOR, NodeInstance, computes
from lab3_usd.sim.execution.recording import Fields, Inertia, Message
from lab3_usd.sim.execution.world import World, opened_endpoint, send
from lab3_usd.sim.nodes.core import wxyz, xyzw

_EARTH = 9.80665  # m/s2, where the scene names no gravity


@computes("IsaacReadIMU")
def read_imu(node: NodeInstance, world: World) -> bool:
    """OgnIsaacReadIMU.cpp:40-130, ImuSensorImpl.cpp:106-160, 745-850 of the physics sensors.

    The acceleration is that of the velocity of the sensor's body, seen from the sensor, without
    the smoothing that a sensor may ask for.
    """
    prim = world.scene.prims.get(node.target("imuPrim"))
    body = world.machines.body_of(prim.path.rpartition("/")[0]) if prim is not None else ""
    is_off = prim is not None and prim.values.get("enabled") is False
    if prim is None or not body or is_off:
        node.outputs.update(linAcc=NO_VECTOR, angVel=NO_VECTOR, orientation=(0.0, 0.0, 0.0, 1.0))
        fault = "is disabled" if is_off else "is not below a rigid body"
        return node.fails(f"its prim {fault}", "no-inertial-sensor")
    place, now = world.machines.place(prim.path), world.machines.place(body)
    back = place.inverse()
    before: Affine | None = node.memory.get("place")
    velocity, turning = _motion(before, now, world.dt)
    seen = back.turn(velocity)
    last: Vector = node.memory.get("velocity", seen)
    node.memory.update(place=now, velocity=seen)
    pull = NO_VECTOR
    if node.flag("readGravity", world):
        if "gravity" not in node.memory:
            node.memory["gravity"] = _gravity(world)
        pull = back.turn(node.memory["gravity"])
    node.outputs.update(
        linAcc=tuple((v - u) / world.dt + g for v, u, g in zip(seen, last, pull, strict=True)),
        angVel=back.turn(turning),
        orientation=xyzw(place),
        sensorTime=world.since_play,
    )
    return node.goes_on()


def _motion(before: Affine | None, now: Affine, dt: float) -> tuple[Vector, Vector]:
    """Return how fast something moved and turned in the last step."""
    if before is None or before == now:
        return NO_VECTOR, NO_VECTOR
    x, y, z = ((n - b) / dt for n, b in zip(now.origin, before.origin, strict=True))
    turns = (cross(column(before.rows, axis), column(now.rows, axis)) for axis in range(3))
    sums = tuple(map(sum, zip(*turns, strict=True)))
    sine = length((sums[0], sums[1], sums[2])) / 2.0
    k = math.asin(min(1.0, sine)) / sine / 2.0 / dt if sine else 0.0
    return (x, y, z), (sums[0] * k, sums[1] * k, sums[2] * k)


def _gravity(world: World) -> Vector:
    """Return what a sensor at rest feels: the pull of the first physics scene, turned around."""
    values = world.scene.physics
    size = abs(number(values.get("physics:gravityMagnitude")) or 0.0)
    size = size if 0 < size < math.inf else _EARTH
    pull = vector(values.get(GRAVITY_DIRECTION))
    direction = pull if any(pull) else down("Z")  # of any length (UsdPhysics schema)
    return scaled(direction, -size / world.scene.meters_per_unit / length(direction))


_MEASURED = ("orientation", "angularVelocity", "linearAcceleration")


def _is_on(node: NodeInstance, name: str, world: World) -> bool:
    return node.flag(f"publish{name[0].upper()}{name[1:]}", world)


def _unmeasured(node: NodeInstance, world: World) -> list[str]:
    """Return what is published without that it comes from anywhere: zeros, or no rotation."""
    on = [name for name in _MEASURED if _is_on(node, name, world)]
    values = {name: node.numbers(name, world) for name in on if name not in node.fed}
    return [
        name for name, value in values.items() if sum(map(bool, value)) <= (len(value) > len("xyz"))
    ]


@computes("ROS2PublishImu")
def publish_imu(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishImu.cpp:30-150: what is not published says so by a covariance.

    What nothing measures is sent all the same.
    """
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        node.memory["frame"] = node.text("frameId", world)
        node.memory["unmeasured"] = ", ".join(_unmeasured(node, world))
        return True
    turn = wxyz(node, "orientation", world) if _is_on(node, "orientation", world) else None
    angular, linear = (
        node.vector(name, world) if _is_on(node, name, world) else None for name in _MEASURED[1:]
    )
    data, stamp = Inertia(turn, angular, linear), node.number("timeStamp", world)
    send(node, world, endpoint, Message("sensor_msgs/msg/Imu", stamp, node.memory["frame"], data))
    lost = node.memory["unmeasured"]
    return not lost or node.fails(f"{lost} never changes: nothing reaches it", "no-vector-input")


_NAMED = ("messagePackage", "messageSubfolder", "messageName")
_OWN = (*_NAMED, "context", "nodeNamespace", "topicName", "qosProfile", "queueSize", "execIn")


@computes("ROS2Publisher")
def publish_any(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2Publisher.cpp:44-190: the first compute makes the message, the second opens.

    The fields of the message are inputs of the node. Without a header it is stamped now.
    """
    kind = "/".join(node.text(name, world) for name in _NAMED)
    if not all(kind.split("/")):
        return node.fails("it names no type of message", "unknown-output")
    wrong = why_no_message(*(node.text(name, world) for name in _NAMED))
    if wrong:  # RN/nodes/OgnROS2Publisher.cpp:551-561
        return node.fails(f"{kind} does not exist: {wrong}", "unknown-output")
    if node.memory.get("kind") != kind:
        node.memory["kind"] = kind
        return False
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None or not ready:
        return endpoint is not None
    names = [name.removeprefix(INPUT) for name in node.node.inputs]
    names = [name for name in names if node.type.input(name) or node.type.grows_by_message]
    fields = {name: node.get(name, world) for name in names if name not in _OWN}
    send(node, world, endpoint, Message(kind, world.since_play, data=Fields(fields)))
    return node.goes_on()
