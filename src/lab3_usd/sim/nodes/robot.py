"""Commands to wheels and joints, clock and odometry.

CN is core nodes, RN ROS 2 nodes, WR wheeled robots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from lab3_usd.isaac.pure_nodes import are_numbers
from lab3_usd.model.dry_run import Affine, ScenePrim
from lab3_usd.model.joint_drives import DRIVEN_AXES
from lab3_usd.model.qos import unmatched
from lab3_usd.model.transforms import Vector, cross, dot, length
from lab3_usd.physics.machine import Joint, Machine
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.recording import Message, Odometry
from lab3_usd.sim.execution.world import World, open_endpoint, opened_endpoint, send
from lab3_usd.sim.nodes.core import wxyz, xyzw

_LIMITS = ("maxAcceleration", "maxDeceleration", "maxAngularAcceleration")
_COMMANDS = ("positionCommand", "velocityCommand", "effortCommand")


@computes("ROS2SubscribeTwist")
def subscribe_twist(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2SubscribeTwist.cpp:56-163: outputs hold the last message."""
    is_open = node.memory.get("endpoint") is not None
    twist = received(node, world, tuple)
    if not isinstance(twist, tuple):
        return not is_open and node.memory["endpoint"] is not None
    node.outputs["linearVelocity"], node.outputs["angularVelocity"] = twist
    return node.goes_on()


def received(node: NodeInstance, world: World, kind: type) -> object:
    """Return the command that came since the last look, None where none of its kind did.

    The first look opens the subscriber.
    """
    network = world.network
    endpoint = node.memory.get("endpoint")
    if endpoint is None:
        endpoint = open_endpoint(node, world)
        node.memory.update(endpoint=endpoint, heard=network.heard(endpoint)[0] if endpoint else 0)
        return None
    number, command = network.heard(endpoint)
    asked = endpoint if network.is_open else network.commands
    unmatched_by = unmatched("subscribes", node.type.message.get("", ""), endpoint.profile)
    if endpoint.topic != asked.topic:
        node.fails(f"it listens to {endpoint.topic}, not {asked.topic}", "wrong-topic")
    elif endpoint.domain != asked.domain:
        node.fails(f"it listens in domain {endpoint.domain}", "wrong-domain")
    elif unmatched_by and not network.is_open:
        node.fails(unmatched_by, "unmatched-peer")
    elif number != node.memory["heard"] and isinstance(command, kind):
        node.memory["heard"] = number
        return command
    return None


@computes("DifferentialController")
def differential_controller(node: NodeInstance, world: World) -> bool:
    """WR/nodes/OgnDifferentialController.cpp:36-140."""
    memory = node.memory
    if not memory and not _read_parameters(node, world):
        return False
    dt = node.number("dt", world)
    if dt <= 0 and memory["ramps"]:
        return node.fails(
            "an acceleration limit is set and no time step reaches it", "ramp-without-time-step"
        )
    v = within(memory["maxLinearSpeed"], node.number("linearVelocity", world))
    w = within(memory["maxAngularSpeed"], node.number("angularVelocity", world))
    before, up, down = memory["v"], memory["maxAcceleration"], memory["maxDeceleration"]
    if up and down:
        step = (up if abs(v) > abs(before) and v * before >= 0 else down) * dt
        v = float(max(before - step, min(v, before + step)))
    turn = memory["maxAngularAcceleration"]
    if turn:
        w = max(memory["w"] - turn * dt, min(w, memory["w"] + turn * dt))
    memory["v"], memory["w"] = v, w
    r, distance = memory["wheelRadius"], memory["wheelDistance"]
    most, left, right = memory["maxWheelSpeed"], 2 * v - w * distance, 2 * v + w * distance
    node.outputs["velocityCommand"] = (
        within(most, left / (2 * r)),
        within(most, right / (2 * r)),
    )
    return True


def _read_parameters(node: NodeInstance, world: World) -> bool:
    sizes = {name: node.number(name, world) for name in ("wheelRadius", "wheelDistance")}
    for name, size in sizes.items():
        if size <= 0:
            return node.fails(f"its {name} is {size:g}", "invalid-wheel-size")
    node.memory.update(sizes, v=0.0, w=0.0)
    for limit in _LIMITS:
        node.memory[limit] = abs(node.number(limit, world))
    node.memory["ramps"] = any(node.memory[limit] for limit in _LIMITS)
    for name in ("maxLinearSpeed", "maxAngularSpeed", "maxWheelSpeed"):
        node.memory[name] = abs(node.number(name, world)) or math.inf
    return True


def within(limit: float, value: float) -> float:
    """Return a value cut down to a limit both ways."""
    return max(-limit, min(limit, value))


@computes("IsaacArticulationController")
def articulation_controller(node: NodeInstance, world: World) -> bool:
    """CN/python/nodes/OgnIsaacArticulationController.py:41-300."""
    memory = node.memory
    if "machine" not in memory:
        memory["machine"] = articulated(node, world)
        memory["names"], memory["joints"] = None, None
        if memory["machine"] is None:
            memory.clear()  # it is looked for again at the next tick
            path = robot_path(node, world)
            place = f"at or below {path}" if path else "without a target"
            return node.fails(f"there is no articulation with joints {place}", "no-articulation")
    joints = _joints(node, world, memory["machine"])
    return joints is not None and _command(node, world, joints)


def articulated(node: NodeInstance, world: World) -> Machine | None:
    """Return the articulation of a controller, None where there is none."""
    return world.machines.articulation(robot_path(node, world))


def robot_path(node: NodeInstance, world: World) -> str:
    """Return the prim of the articulation that a node names, '' for none."""
    return node.text("robotPath", world) or node.target("targetPrim")


def _joints(node: NodeInstance, world: World, machine: Machine) -> list[Joint] | None:
    memory = node.memory
    names = node.items("jointNames", world)
    if names and names != memory["names"]:
        memory["names"] = names
        named = [machine.articulated.get(str(name)) for name in names]
        memory["joints"] = None if None in named else named
        if memory["joints"] is None:
            place = named.index(None)
            name = str(names[place])
            stem = machine.articulated.get(name.rpartition(":")[0])
            if stem is not None and stem.kind not in DRIVEN_AXES:
                world.not_simulated[node.path] = f"it moves one axis of several, {name}"
            elif not name:
                message = f"element {place + 1} of its array of joint names is empty"
                node.fails(message, "empty-joint-name")
            elif name in machine.joints:
                node.fails(f"'{name}' is excluded from the articulation", "excluded-joint")
            else:
                node.fails(f"the robot has no joint '{name}' that turns", "unknown-joint")
    indices = node.numbers("jointIndices", world)
    if any(indices) and not memory["names"]:
        memory["joints"] = joints_at(node, [*machine.articulated.values()], indices)
        if memory["joints"] is None:
            return None
    joints: list[Joint] | None = memory["joints"]
    if joints is None and not memory["names"]:
        return [*machine.articulated.values()]
    return joints


def joints_at(
    node: NodeInstance, joints: Sequence[Joint], indices: Iterable[float]
) -> list[Joint] | None:
    """Return the joints of these numbers; None where there is no such joint."""
    beyond = [index for index in indices if not 0 <= index < len(joints)]
    if beyond:
        node.fails(f"the robot has no joint number {beyond[0]:g}", "unknown-joint")
        return None
    return [joints[int(index)] for index in indices]


def _command(node: NodeInstance, world: World, joints: list[Joint]) -> bool:
    position, velocity, effort = (node.items(name, world) for name in _COMMANDS)
    if not node.memory["joints"] and not node.memory["names"]:  # one value is for all of them
        position, velocity, effort = (
            given * len(joints) if len(given) == 1 else given
            for given in (position, velocity, effort)
        )
    for targets in (position, velocity, effort):
        if targets and len(targets) != len(joints):
            return node.fails(
                f"{len(targets)} command{'s come' if len(targets) > 1 else ' comes'} for "
                f"{len(joints)} joint{'s' if len(joints) != 1 else ''}",
                "wrong-command-count",
            )
        if not are_numbers(targets):
            return node.fails("its commands are not numbers", "non-numeric-command")
    if not (position or velocity or effort or not node.fed.isdisjoint(_COMMANDS)):
        return node.fails("nothing is connected to its command inputs", "no-vector-input")
    world.machines.wake(node.memory["machine"])
    # What is no number leaves the target as it is (:138-162).
    for joint, value in zip(joints, position, strict=False):
        joint.target_position = joint.target_position if math.isnan(value) else float(value)
    for joint, value in zip(joints, velocity, strict=False):
        joint.is_told_speeds = True
        joint.target_velocity = joint.target_velocity if math.isnan(value) else float(value)
    for joint, value in zip(joints, effort, strict=False):
        joint.effort = joint.effort if math.isnan(value) else float(value)
        if joint.effort and not joint.damping and not joint.stiffness:
            place = f"{joint.name} is moved by an effort, and nothing slows it down"
            world.not_simulated[node.path] = place
    return True


@computes("ROS2PublishClock")
def publish_clock(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishClock.cpp:40-110."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None or not ready:
        return endpoint is not None
    stamp = node.number("timeStamp", world)
    send(node, world, endpoint, Message("rosgraph_msgs/msg/Clock", stamp, data=stamp))
    return True


@computes("IsaacComputeOdometry")
def compute_odometry(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacComputeOdometry.cpp:77-360: the way since Play, seen from its start."""
    path: str | None = node.memory.get("path") or _chassis(node, world)
    if path is None:
        return node.fails("its chassis is neither a body nor an articulation", "no-chassis-body")
    now = world.machines.place(path)
    if "path" not in node.memory:
        node.memory.update(path=path, start=now.inverse())
    start: Affine = node.memory["start"]
    velocity, turning = world.machines.velocity(path)
    pose = start.then(now)
    x, y, z = pose.origin
    unit = world.scene.meters_per_unit
    back = now.inverse()
    node.outputs.update(
        position=(x * unit, y * unit, z * unit),
        orientation=xyzw(pose),
        linearVelocity=back.turn(velocity),
        globalLinearVelocity=velocity,
        angularVelocity=turning,
    )
    return node.goes_on()


def _chassis(node: NodeInstance, world: World) -> str | None:
    """Return the body that is watched, or None where there is none."""
    prim = world.scene.prims.get(node.target("chassisPrim"))
    body, root = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"
    if prim is not None and not prim.apis & {body, root} and "IsaacRobotAPI" in prim.apis:
        prim = next(_links(prim, world), None)
    if prim is None or not prim.apis & {body, root}:
        return None
    if body in prim.apis:
        return str(prim.path)
    machine = world.machines.articulation(prim.path)
    return machine.base if machine is not None else None


def _links(robot: ScenePrim, world: World, depth: int = 8) -> Iterator[ScenePrim]:
    """Yield the links of a robot and of those that it lists (utils.h:121-164 of robot.schema)."""
    if "IsaacLinkAPI" in robot.apis:
        yield robot
    elif "IsaacRobotAPI" in robot.apis and depth:
        for path in robot.targets.get("isaac:physics:robotLinks", ()):
            if path in world.scene.prims:
                yield from _links(world.scene.prims[path], world, depth - 1)


@computes("ROS2PublishOdometry")
def publish_odometry(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishOdometry.cpp:69-145."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        for name in ("odomFrameId", "chassisFrameId"):
            node.memory[name] = node.text(name, world)
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


def _velocities(node: NodeInstance, world: World) -> tuple[Vector, Vector]:
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
