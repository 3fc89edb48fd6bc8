"""Controllers of cars and of robots on wheels with rollers, and commands to steer.

WC is the extension of experimental wheeled robots, RN ROS 2 nodes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from lab3_usd.model.dry_run import AXES, Affine, about, rotation, turned
from lab3_usd.model.transforms import Vector, length, minus
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.recording import Message, Steering
from lab3_usd.sim.execution.world import World, opened_endpoint, send
from lab3_usd.sim.nodes.robot import received, within

_STRAIGHT = 0.0157  # radians of steering that count as none
_REACHED = (1e-4, 0.00174533)  # m/s and radians from which on nothing changes


@computes("ROS2SubscribeAckermannDrive")
def subscribe_ackermann(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2SubscribeAckermann.cpp:30-175: outputs hold the last message."""
    is_open = node.memory.get("endpoint") is not None
    steering = received(node, world, Steering)
    if not isinstance(steering, Steering):
        return not is_open and node.memory["endpoint"] is not None
    node.outputs.update(speed=steering.speed, steeringAngle=steering.angle)
    node.outputs.update(acceleration=0.0, steeringAngleVelocity=0.0, jerk=0.0)
    return node.goes_on()


@computes("ROS2PublishAckermannDrive")
def publish_ackermann(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishAckermann.cpp:30-130."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None or not ready:
        return endpoint is not None
    data = Steering(node.number("speed", world), node.number("steeringAngle", world))
    frame, stamp = node.text("frameId", world), node.number("timeStamp", world)
    kind = node.type.message[""]
    send(node, world, endpoint, Message(kind, stamp, frame, data))
    return True


@computes("AckermannController")
def ackermann_controller(node: NodeInstance, world: World) -> bool:
    """WC/controllers/ackermann_controller.py:67-180: sizes are read once."""
    memory = node.memory
    if not memory:
        for name in ("wheelBase", "trackWidth", "frontWheelRadius", "backWheelRadius"):
            memory[name] = node.number(name, world)
        for name in ("maxWheelVelocity", "maxWheelRotation", "maxAcceleration"):
            memory[name] = abs(node.number(name, world)) or math.inf
        memory["maxTurn"] = abs(node.number("maxSteeringAngleVelocity", world)) or math.inf
        memory.update(inverts=node.flag("invertSteering", world), v=0.0, angle=0.0)
    front = memory["frontWheelRadius"] or memory["backWheelRadius"]
    back = memory["backWheelRadius"] or front
    if not front:
        memory.clear()
        return node.fails("its wheels have no radius", "invalid-wheel-size")
    fastest = memory["maxWheelVelocity"] * max(front, back)
    v = within(fastest, node.number("speed", world))
    angle = within(memory["maxWheelRotation"], node.number("steeringAngle", world))
    gain, turn = node.number("acceleration", world), node.number("steeringAngleVelocity", world)
    gain = (
        min(abs(gain), memory["maxAcceleration"]) if memory["maxAcceleration"] < math.inf else gain
    )
    turn = min(abs(turn), memory["maxTurn"]) if memory["maxTurn"] < math.inf else turn
    dt = abs(node.number("dt", world))
    if not dt and (gain or turn):
        return node.fails("no time step reaches it, and it has a ramp", "ramp-without-time-step")
    v = _ramped(memory["v"], v, gain * dt, _REACHED[0]) if gain else v
    angle = _ramped(memory["angle"], angle, turn * dt, _REACHED[1]) if turn else angle
    memory["v"], memory["angle"] = v, angle
    if not memory["wheelBase"] and abs(angle) >= _STRAIGHT:
        # Isaac Sim divides by 0 here: the speeds that it gives are no numbers (:154-173).
        return node.fails("its wheelBase is 0, with which it cannot turn", "invalid-wheel-size")
    angles, speeds = _wheels(node, v, angle, (front, back))
    most, widest = memory["maxWheelVelocity"], memory["maxWheelRotation"]
    node.outputs["wheelAngles"] = tuple(within(widest, a) for a in angles)
    node.outputs["wheelRotationVelocity"] = tuple(within(most, w) for w in speeds)
    return node.goes_on()


def _ramped(before: float, wanted: float, step: float, reached: float) -> float:
    """Return the value after a step towards another one."""
    if abs(wanted - before) <= reached:
        return before
    return min(before + step, wanted) if wanted > before else max(before - step, wanted)


def _wheels(
    node: NodeInstance, v: float, angle: float, radii: tuple[float, float]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the angles of the front wheels, and how fast all four turn: front, then back."""
    base, half = node.memory["wheelBase"], node.memory["trackWidth"] / 2
    front, back = radii
    if abs(angle) < _STRAIGHT:
        return (0.0, 0.0), (v / front, v / front, v / back, v / back)
    is_inverted = node.memory["inverts"]
    r = (-base if is_inverted else base) / math.tan(angle)
    angles = tuple(math.copysign(math.atan2(base, abs(r + k)), r + k) for k in (-half, half))
    side = half if angle > 0 else -half
    inner, outer = abs(r) - side, abs(r) + side
    near = (inner, outer)
    far = (math.hypot(inner, base), math.hypot(outer, base))
    turn = v / abs(r)
    ahead, behind = (near, far) if is_inverted else (far, near)
    return angles, (
        *(turn * way / front for way in ahead),
        *(turn * way / back for way in behind),
    )


@computes("HolonomicController")
def holonomic_controller(node: NodeInstance, world: World) -> bool:
    """WC/controllers/holonomic_controller.py:52-190: the least speeds that add up to a command.

    Its optimization has only equality constraints, so it is solved in closed form. A limit of 0
    counts: wheels stop. With a maxLinearSpeed of 0 the speeds are NaN (:172-190), and the joints
    stay as they are.
    """
    columns: list[_Roller] | None = node.memory.get("columns")
    if columns is None:
        columns = _columns(node, world)
        if columns is None:
            return False
        node.memory["columns"] = columns
        world.gives.setdefault(node.path, _given_motion(node, columns, world))
    names = [f"max{n}Speed" for n in ("Linear", "Angular", "Wheel")]
    limits = [node.number(name, world) for name in names]
    x, y, turn = node.vector("inputVelocity", world)
    x, y = (k * node.number("linearGain", world) for k in (x, y))
    turn *= node.number("angularGain", world)
    size = math.hypot(x, y)
    stopped = next((names[k] for k in (0, 2) if (size or turn) and limits[k] <= 0), "")
    if stopped:
        node.outputs["jointVelocityCommand"] = (0.0,) * len(columns)
        return node.fails(f"its {stopped} is 0, with which no wheel turns", "wrong-speed-limit")
    if size > limits[0]:
        x, y = x / size * limits[0], y / size * limits[0]
    speeds = _speeds(columns, (x, y, within(limits[1], turn)))
    most = max(map(abs, speeds))
    scale = limits[2] / most if most and most > limits[2] else 1.0
    if scale < 1.0 or size > limits[0] or abs(turn) > limits[1]:
        world.gives[node.path] = ()
    node.outputs["jointVelocityCommand"] = tuple(speed * scale for speed in speeds)
    return True


class _Roller(NamedTuple):
    """What a wheel adds to a motion (x, y, turn), its weight, and the part of its way it passes."""

    column: Vector
    weight: float
    share: float


def _speeds(rollers: Sequence[_Roller], command: Vector) -> list[float]:
    """Return the least speeds of wheels that add up to a motion."""
    rows = [(each.column, 1.0 / each.weight) for each in rollers]
    part = _inverse(rows).turn(command)
    return [sum(a * b for a, b in zip(row, part, strict=True)) * k for row, k in rows]


def _inverse(rows: Sequence[tuple[Vector, float]]) -> Affine:
    """Return the inverse of the sum of rows by themselves, each with its weight."""
    matrix = [[sum(c[i] * c[j] * k for c, k in rows) for j in range(3)] for i in range(3)]
    return Affine(tuple(map(tuple, matrix))).inverse()  # type: ignore[arg-type]


def _given_motion(
    node: NodeInstance, rollers: Sequence[_Roller], world: World
) -> tuple[Vector, ...]:
    """Return what motion comes of 1 m/s ahead, 1 m/s to the left and 1 rad/s, without slipping.

    Wheels as the controller has them turn as it tells them to; the way is in metres.
    """
    unit = world.scene.meters_per_unit
    linear, angular = (node.number(f"{name}Gain", world) for name in ("linear", "angular"))
    way = unit / node.unit(unit)
    sizes = [math.hypot(*each.column[:2]) for each in rollers]
    if not all(sizes):  # a wheel about an upright axis goes nowhere
        return ()
    rows = [(x / r, y / r, -z / r) for ((x, y, z), _, _), r in zip(rollers, sizes, strict=True)]
    back = _inverse([(row, 1.0) for row in rows])
    made: list[Vector] = []
    for command in ((linear, 0.0, 0.0), (0.0, linear, 0.0), (0.0, 0.0, angular)):
        speeds = _speeds(rollers, command)
        rims = [e.share * r * w for e, r, w in zip(rollers, sizes, speeds, strict=True)]
        sums = [sum(row[i] * rim for row, rim in zip(rows, rims, strict=True)) for i in range(3)]
        x, y, turn = back.turn((sums[0], sums[1], sums[2]))
        made.append((x * way, y * way, turn))
    return tuple(made)


def _columns(node: NodeInstance, world: World) -> list[_Roller] | None:
    """Return the wheels as the controller has them."""
    radii, angles = (node.numbers(name, world) for name in ("wheelRadius", "mecanumAngles"))
    places = node.vectors("wheelPositions", world, 3)
    turns = node.vectors("wheelOrientations", world, 4)
    if not (radii and places and turns and angles):
        node.fails("its wheels are not set", "invalid-wheel-size")
        return None
    count = len(places)
    radii, angles = (a * count if len(a) == 1 else a for a in (radii, angles))
    if not len(radii) == len(turns) == len(angles) == count:
        node.fails("its settings name different numbers of wheels", "invalid-wheel-size")
        return None
    # No radius is no weight in what is solved, with a negative one there is no least (:127-144).
    if not all(0 < radius < math.inf for radius in radii) or not all(map(math.isfinite, angles)):
        node.fails("a wheel has no radius, or no angle", "invalid-wheel-size")
        return None
    up = node.vector("upAxis", world)
    largest = max(radii)
    made: list[_Roller] = []
    for radius, place, (w, *turn), angle in zip(radii, places, turns, angles, strict=True):
        axle = turned(rotation((w, turn[0], turn[1], turn[2])), node.vector("wheelAxis", world))
        way = turned(about(up, math.radians(angle)), axle)
        k = radius / (length(way) or 1.0)
        x, y = way[0] * k, way[1] * k
        flat = math.hypot(axle[0], axle[1]) * math.hypot(x, y) or 1.0
        share = (axle[1] * x - axle[0] * y) / flat
        made.append(_Roller((x, y, x * place[1] - y * place[0]), radius / largest, share))
    return made


@computes("HolonomicRobotUsdSetup")
def holonomic_setup(node: NodeInstance, world: World) -> bool:
    """WC/robots/holonomic_robot_usd_setup.py:40-90: the joints that IsaacMecanumWheelAPI marks."""
    paths = [node.text(f"{name}PrimPath", world) for name in ("robot", "com")]
    if not node.flag("usePath", world):
        targets = [node.targets(f"{name}Prim") for name in ("robot", "com")]
        paths = [path[0] if path else "" for path in targets]
        if not all(paths):
            return node.fails("it has no robot, or no centre of mass", "invalid-wheel-size")
    prims = world.scene.prims
    joints = [
        prim
        for prim in world.scene.below(paths[0])
        if prim.values.get("isaacmecanumwheel:angle") is not None
    ]
    if not joints:
        return node.fails(f"no joint below {paths[0]} has rollers", "invalid-wheel-size")
    centre = world.machines.place(paths[1] if paths[1] in prims else paths[0])
    frames = []
    for joint in joints:
        chassis = world.machines.place(joint.ends[0])
        turn = rotation(joint.values.get("physics:localRot0") or (1.0, 0.0, 0.0, 0.0))
        at = joint.values.get("physics:localPos0") or (0.0, 0.0, 0.0)
        frames.append(chassis.then(Affine(turn, at)))
    back = Affine(centre.inverse().rows)
    axes = {"X": AXES[0], "Y": AXES[1], "Z": AXES[2]}
    node.outputs.update(
        wheelRadius=tuple(joint.values.get("isaacmecanumwheel:radius") for joint in joints),
        wheelPositions=tuple(minus(frame.origin, centre.origin) for frame in frames),
        wheelOrientations=tuple(back.then(frame).quaternion() for frame in frames),
        mecanumAngles=tuple(joint.values["isaacmecanumwheel:angle"] for joint in joints),
        wheelAxis=axes.get(str(joints[-1].values.get("physics:axis")), AXES[0]),
        upAxis=axes[world.scene.up],
        wheelDofNames=tuple(joint.path.rpartition("/")[2] for joint in joints),
    )
    return True
