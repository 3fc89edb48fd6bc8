"""Clock and odometry. RN is ROS 2 nodes, CN core nodes."""

from __future__ import annotations

from lab3_usd.model.dry_run.affine import Affine
from lab3_usd.model.transform_math import Vector, cross, dot, length
from lab3_usd.sim.execution.record import Message, Odometry
from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.ros import opened_endpoint, send
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World
from lab3_usd.sim.nodes.quaternions import wxyz, xyzw


@computes("ROS2PublishClock")
def publish_clock(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2PublishClock.cpp:40-110."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None or not ready:
        return endpoint is not None
    stamp = node.number("timeStamp", world)
    send(node, world, endpoint, Message("rosgraph_msgs/msg/Clock", stamp, data=stamp))
    return True


@computes("IsaacComputeOdometry")
def compute_odometry(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacComputeOdometry.cpp:77-360: the way since Play, seen from its start."""
    path: str | None = node.memory.get("path") or _chassis(node, world)
    if path is None:
        return node.fails("its chassis is no body and no articulation", "R02")
    now = world.machines.place(path)
    if "path" not in node.memory:
        node.memory.update(path=path, start=now.inverse())
    start: Affine = node.memory["start"]
    velocity, turning = world.machines.velocity(path)
    there = start.then(now)
    unit = world.scene.meters_per_unit
    back = now.inverse()
    node.outputs.update(
        position=tuple(x * unit for x in there.origin),
        orientation=xyzw(there),
        linearVelocity=back.turn(velocity),
        globalLinearVelocity=velocity,
        angularVelocity=turning,
    )
    node.enabled.append("execOut")
    return True


def _chassis(node: Running, world: World) -> str | None:
    """Return the body that is watched, or None where there is none."""
    targets = node.targets("chassisPrim")
    prim = world.scene.prims.get(targets[0]) if targets else None
    body, root = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"
    if prim is not None and not prim.apis & {body, root} and "IsaacRobotAPI" in prim.apis:
        links = prim.targets.get("isaac:physics:robotLinks", ())
        prim = world.scene.prims.get(links[0]) if links else None
    if prim is None or not prim.apis & {body, root}:
        return None
    if body in prim.apis:
        return str(prim.path)
    machine = world.machines.articulation(prim.path)
    return machine.base if machine is not None else None


@computes("ROS2PublishOdometry")
def publish_odometry(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2PublishOdometry.cpp:69-145."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        for each in ("odomFrameId", "chassisFrameId"):
            node.memory[each] = node.text(each, world)
        x, y, _ = node.vector("robotFront", world)
        size = length((x, y, 0.0)) or 1.0
        node.memory["front"] = (x / size, y / size, 0.0)
        return True
    linear, angular = _velocities(node, world)
    data = Odometry(
        node.memory["chassisFrameId"],
        node.vector("position", world),
        wxyz(node, "orientation", world),
        linear,
        angular,
    )
    stamp = node.number("timeStamp", world)
    frame = node.memory["odomFrameId"]
    send(node, world, endpoint, Message("nav_msgs/msg/Odometry", stamp, frame, data))
    return True


def _velocities(node: Running, world: World) -> tuple[Vector, Vector]:
    linear = node.vector("linearVelocity", world)
    angular = node.vector("angularVelocity", world)
    if node.flag("publishRawVelocities", world):
        return linear, angular
    front: Vector = node.memory["front"]
    up = (0.0, 0.0, 1.0) if world.scene.up == "Z" else (0.0, 1.0, 0.0)
    unit = world.scene.meters_per_unit
    along = (
        dot(front, linear) * unit,
        dot(cross(up, front), linear) * unit,
        dot(up, linear) * unit,
    )
    return along, (0.0, 0.0, dot(up, angular))
