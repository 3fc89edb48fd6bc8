"""The robots of a stage: root, base, links, joints, wheels and sensors, measured, commanded or not.

Left and right, front and rear are told by place, never by name: as REP 103 has it, the X axis of
the base points ahead; where that is the axle's own, a wheel that turns forward rolls ahead.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.articulations import articulations
from lab3_usd.facts.endpoints import namespaces_above
from lab3_usd.facts.frame_targets import ROBOT_API, frame_of_prim
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.wheels import axis_of_joint, rolling_radius
from lab3_usd.model.joint_drives import DRIVEN_AXES, read_drive
from lab3_usd.model.physics import (
    FAR,
    FIXED,
    REVOLUTE,
    SCENE,
    bodies,
    bodies_below,
    is_excluded,
    joint_limits,
    joints,
    number,
    rigid_bodies,
    vector,
)
from lab3_usd.model.prims import Prim, is_at_or_below, upwards
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import (
    AXES,
    Vector,
    cross,
    decompose,
    dot,
    length,
    minus,
    rotate_vector,
    scaled,
    transform_point,
)

Side = Literal["left", "right", "middle"]
MIMIC = "Mimic"
ROLLER_ANGLE, _ROLLER_RADIUS = "isaacmecanumwheel:angle", "isaacmecanumwheel:radius"
_LEVEL = 0.3  # sine of the angle up to which an axle counts as level
_MIDDLE = 0.005  # metres from the middle of a robot


class RobotJoint(Struct, frozen=True, eq=False):
    """A joint of a robot that can move: the bodies nearer to and farther from the base.

    `stiffness`, `damping`, `force` and the targets are those of its drive, as files have them
    (degrees of revolute joints, units of the stage of prismatic ones); `low` and `high` the limits.
    """

    prim: Prim
    near: str
    link: str
    has_drive: bool
    stiffness: float
    damping: float
    force: float | None
    position: float
    velocity: float
    low: float
    high: float

    @property
    def name(self) -> str:
        """The name by which commands and messages call it."""
        return self.prim.name

    @property
    def is_angular(self) -> bool:
        """Whether it turns, so that files have degrees and messages radians."""
        return self.prim.type == REVOLUTE

    @property
    def has_limits(self) -> bool:
        """Whether it cannot turn on and on."""
        return self.high - self.low <= FAR


class Wheel(Struct, frozen=True, eq=False):
    """A wheel: a round link that turns about a level axle without end.

    `place` is that of its joint ahead, to the left and above the base, in metres; `radius` is None
    where no round collider tells it. `axle` is about what a positive speed turns it, in the same
    axes. `steering` is the joint that turns its axle, None for a wheel that is not steered. A
    mecanum wheel, of IsaacMecanumWheelAPI, has the `roller_angle` and the radius of its joint.
    """

    joint: RobotJoint
    place: Vector
    axle: Vector
    radius: float | None
    shape: str
    steering: RobotJoint | None = None

    @property
    def roller_angle(self) -> float | None:
        """How the rollers stand to the axle, in degrees; None for a wheel without any."""
        return number(self.joint.prim.attributes.get(ROLLER_ANGLE))

    @property
    def side(self) -> Side:
        """On which side of the robot it is."""
        across = self.place[1]
        if abs(across) <= _MIDDLE:
            return "middle"
        return "left" if across > 0 else "right"


class Sensor(Struct, frozen=True, eq=False):
    """A sensor: its prim, the kind of graph that publishes it, its frame, the link below it."""

    prim: Prim
    kind: str
    frame: str
    carrier: str


class Robot(Struct, frozen=True, eq=False):
    """Bodies that joints hold together.

    `path` stands for it, `root` carries its articulation ('' where none does), `base` is the link
    that all else hangs on. `links` begin with the base. `is_fixed` tells whether it is tied to the
    world.
    """

    path: str
    root: str
    base: str
    links: tuple[str, ...]
    joints: tuple[RobotJoint, ...]
    is_fixed: bool
    namespace: str = ""
    wheels: tuple[Wheel, ...] = ()
    sensors: tuple[Sensor, ...] = ()

    @property
    def name(self) -> str:
        """The name of its prim."""
        return self.path.rpartition("/")[2]

    @property
    def driven_wheels(self) -> tuple[Wheel, ...]:
        """The wheels with a drive, or all where none has one."""
        return tuple(w for w in self.wheels if w.joint.has_drive) or self.wheels

    @property
    def arm_joints(self) -> tuple[RobotJoint, ...]:
        """The driven joints that are no wheels and steer none."""
        rolling = {
            joint.prim.path
            for wheel in self.wheels
            for joint in (wheel.joint, wheel.steering)
            if joint is not None
        }
        return tuple(j for j in self.joints if j.has_drive and j.prim.path not in rolling)


@once_per_stage
def robots(stage: StageModel) -> tuple[Robot, ...]:
    """Return the robots of a stage: those with an articulation in its order, then the others."""
    all_robots: list[Robot] = []
    for root in articulations("/", stage):
        links = [root] if root in rigid_bodies(stage) else bodies_below(stage, root)
        all_robots.append(_robot(root, root, links, stage))
    articulated = {link for robot in all_robots for link in robot.links}
    joined = joined_bodies(stage)
    groups: dict[str, list[str]] = {}
    for path, first in joined.robots.items():
        groups.setdefault(first, []).append(path)
    for first, paths in groups.items():
        if len(paths) > 1 and articulated.isdisjoint(paths):
            all_robots.append(_robot("", first, paths, stage))
    return tuple(replace(robot, sensors=tuple(_sensors_of(robot, stage))) for robot in all_robots)


class _Tie(Struct, frozen=True, eq=False):
    """A joint between two bodies; '' stands for the world."""

    joint: Prim
    ends: tuple[str, str]


@once_per_stage
def _ties(stage: StageModel) -> Mapping[str, list[_Tie]]:
    """Map each body to the joints that tie it, those left out of articulations aside."""
    joined, ties = joined_bodies(stage), dict[str, list[_Tie]]()
    for joint in joints(stage):
        if is_excluded(joint):
            continue
        one, other = (joined.carrier(end) for end in bodies(joint))
        for body in dict.fromkeys((one, other)):
            if body:
                ties.setdefault(body, []).append(_Tie(joint, (one, other)))
    return ties


def _robot(root: str, start: str, own: Sequence[str], stage: StageModel) -> Robot:
    ties = _ties(stage)
    links = dict.fromkeys(own or [start])
    ahead = deque(links)
    while ahead:
        for tie in ties.get(ahead.popleft(), ()):
            for end in tie.ends:
                if end and end not in links:
                    links[end] = None
                    ahead.append(end)
    base = _base(root, list(links), ties)
    order, by_link = _hanging(base, ties)
    moving = tuple(
        _robot_joint(tie.joint, near, link)
        for link, (tie, near) in by_link.items()
        if tie.joint.type != FIXED and near
    )
    in_stage = {joint.path: place for place, joint in enumerate(joints(stage))}
    moving = tuple(sorted(moving, key=lambda joint: in_stage[joint.prim.path]))
    path = _robot_prim(root, base, list(links), stage)
    spaces = namespaces_above(path, stage)
    robot = Robot(
        path=path,
        root=root,
        base=base,
        links=(*order, *(link for link in links if link not in order)),
        joints=moving,
        is_fixed=any("" in tie.ends for link in links for tie in ties.get(link, ())),
        namespace="/".join(value for _, value in spaces),
    )
    return replace(robot, wheels=tuple(_wheels(robot, by_link, stage)))


def _base(root: str, links: Sequence[str], ties: Mapping[str, list[_Tie]]) -> str:
    """Return the link to which all others are connected.

    The candidates in order: the root if it is a body, unless a joint turns it like a single wheel;
    the link that is connected to the world; the only link that carries others and is carried by
    none; the link with the most joints, since a wheel may have more rollers than the base wheels.
    """
    own = ties.get(root, [])
    is_wheel = len(own) == 1 and own[0].joint.type != FIXED and len(links) > len(own) + 1
    if root in links and not is_wheel:
        return root
    tied = [link for link in links if any("" in tie.ends for tie in ties.get(link, ()))]
    if tied:
        return tied[0]
    hanging = {tie.ends[1] for link in links for tie in ties.get(link, ())}
    heads = [link for link in links if link not in hanging]
    if len(heads) == 1 and len(ties.get(heads[0], ())) > 1:
        return heads[0]
    return max(links, key=lambda link: len(ties.get(link, ())))


def _hanging(
    base: str, ties: Mapping[str, list[_Tie]]
) -> tuple[list[str], dict[str, tuple[_Tie, str]]]:
    """Return the links from the base on, and of each the joint and the link on which it hangs."""
    order, by_link = [base], dict[str, tuple[_Tie, str]]()
    for link in order:  # which grows
        for tie in ties.get(link, ()):
            for end in tie.ends:
                if end and end != base and end not in by_link:
                    by_link[end] = tie, link
                    order.append(end)
    return order, by_link


def _robot_joint(joint: Prim, near: str, link: str) -> RobotJoint:
    drive = read_drive(joint.type, joint.apis, joint.attributes)
    low, high = joint_limits(joint.attributes)
    return RobotJoint(
        prim=joint,
        near=near,
        link=link,
        has_drive=joint.type in DRIVEN_AXES and drive.api != "",
        stiffness=drive.stiffness or 0.0,
        damping=drive.damping or 0.0,
        force=drive.force,
        position=drive.position or 0.0,
        velocity=drive.velocity or 0.0,
        low=low,
        high=high,
    )


def _robot_prim(root: str, base: str, links: Sequence[str], stage: StageModel) -> str:
    """Return the prim that stands for a robot: with the robot schema, else above all its links."""
    start = root or base
    for path in upwards(start):
        prim = stage.prim(path)
        if prim is not None and ROBOT_API in prim.apis:
            return path
    holding = [path for path in upwards(start) if all(is_at_or_below(p, path) for p in links)]
    top = next(iter(holding), start)
    has_more = any(other != root for other in articulations(top, stage))
    has_more |= any(is_at_or_below(prim.path, top) for prim in stage.of_type(SCENE))
    return start if has_more else top


def _wheels(
    robot: Robot, by_link: Mapping[str, tuple[_Tie, str]], stage: StageModel
) -> Iterator[Wheel]:
    up = AXES["XYZ".index(stage.up_axis)] if stage.up_axis in "XYZ" else AXES[2]
    rolling = []
    hubs = {
        j.link: j for j in robot.joints if number(j.prim.attributes.get(ROLLER_ANGLE)) is not None
    }
    for joint in robot.joints:
        axle = _axle(joint, stage)
        is_level = axle is not None and abs(dot(axle, up)) <= _LEVEL
        if joint.near in hubs:
            continue  # a roller
        if joint.link in hubs and axle is not None:
            size = number(joint.prim.attributes.get(_ROLLER_RADIUS))
            radius = None if size is None else size * stage.meters_per_unit
            rolling.append((joint, axle, radius, "rollers"))
        elif joint.prim.type == REVOLUTE and not joint.has_limits and axle is not None and is_level:
            radius, shape = rolling_radius(joint.link, axle, stage)
            if shape:
                rolling.append((joint, axle, radius, shape))
    joints_of = {joint.link: joint for joint in robot.joints}
    wheels = []
    for joint, axle, radius, shape in rolling:
        pivots = [*_pivots(joint, joints_of, by_link)]
        if any(
            _is_upright(pivot, up, stage) and not pivot.has_limits and pivot.stiffness <= 0.0
            for pivot in pivots
        ):
            continue  # a castor: it turns freely about an upright axis
        steering = next((pivot for pivot in pivots if _is_upright(pivot, up, stage)), None)
        wheels.append((joint, axle, radius, shape, steering))
    base = stage.prim(robot.base)
    if base is None or base.world is None or not wheels:
        return
    straight = [axle for _, axle, _, _, steering in wheels if steering is None]
    ahead = _ahead(decompose(base.world).rotation[0], (straight or [wheels[0][1]])[0], up)
    axes = (ahead, cross(up, ahead), up)
    centre = decompose(base.world).translation
    for joint, axle, radius, shape, steering in wheels:
        point = _anchor(joint, stage)
        if point is None:
            continue
        away = minus(point, centre)
        place = (dot(away, axes[0]), dot(away, axes[1]), dot(away, axes[2]))
        turned = (dot(axle, axes[0]), dot(axle, axes[1]), dot(axle, axes[2]))
        yield Wheel(joint, scaled(place, stage.meters_per_unit), turned, radius, shape, steering)


def _pivots(
    joint: RobotJoint,
    joints_of: Mapping[str, RobotJoint],
    by_link: Mapping[str, tuple[_Tie, str]],
) -> Iterator[RobotJoint]:
    """Yield the joints between a wheel and the base, the nearest first."""
    link = joint.near
    while link in by_link:
        if link in joints_of:
            yield joints_of[link]
        link = by_link[link][1]


def _is_upright(joint: RobotJoint, up: Vector, stage: StageModel) -> bool:
    axis = _axle(joint, stage)
    return joint.prim.type == REVOLUTE and axis is not None and abs(dot(axis, up)) > _LEVEL


def _axle(joint: RobotJoint, stage: StageModel) -> Vector | None:
    """Return about what a positive speed turns the far body in the world, None where unknown."""
    side = _near_side(joint, stage)
    local = axis_of_joint(joint.prim, side)
    holder = stage.prim(bodies(joint.prim)[side])
    if local is None or holder is None or holder.world is None:
        return None
    return rotate_vector(local, decompose(holder.world).rotation)


def _near_side(joint: RobotJoint, stage: StageModel) -> int:
    carriers = [joined_bodies(stage).carrier(end) for end in bodies(joint.prim)]
    return 0 if carriers[0] == joint.near else 1


def _anchor(joint: RobotJoint, stage: StageModel) -> Vector | None:
    """Return where a joint sits, in the world and in units of the stage."""
    side = _near_side(joint, stage)
    holder = stage.prim(bodies(joint.prim)[side])
    if holder is None or holder.world is None:
        return None
    return transform_point(
        vector(joint.prim.attributes.get(f"physics:localPos{side}")), holder.world
    )


def _ahead(base_x: Vector, axle: Vector, up: Vector) -> Vector:
    """Return where ahead is: along the X axis of the base, unless the axle lies there."""
    level = minus(base_x, scaled(up, dot(base_x, up)))
    axis = minus(axle, scaled(up, dot(axle, up)))
    if length(level) > _LEVEL and abs(dot(level, axis)) <= _LEVEL * length(level) * length(axis):
        return scaled(level, 1 / length(level))
    rolled = cross(axis, up)
    return scaled(rolled, 1 / (length(rolled) or 1.0))


@once_per_stage
def sensors(stage: StageModel) -> tuple[Sensor, ...]:
    """Return the sensors of a stage that a graph can publish, in its order."""
    joined = joined_bodies(stage)
    kinds = {
        kind: recipe.kind
        for recipe in stage.platform.recipes.values()
        if recipe.sensor is not None
        for kind in recipe.sensor.types
    }
    prims = stage.of_type(kinds.__contains__)
    tops = stage.platform.application_prims
    return tuple(
        Sensor(prim, kinds[prim.type], frame_of_prim(prim.path, stage), joined.carrier(prim.path))
        for prim in prims
        if prim.present and not any(is_at_or_below(prim.path, top) for top in tops)
    )


def _sensors_of(robot: Robot, stage: StageModel) -> Iterable[Sensor]:
    links = set(robot.links)
    for sensor in sensors(stage):
        if sensor.carrier in links or (
            not sensor.carrier and is_at_or_below(sensor.prim.path, robot.path)
        ):
            yield sensor


def robot_of(path: str, stage: StageModel) -> Robot | None:
    """Return the robot that a prim is part of, None for none."""
    carrier = joined_bodies(stage).carrier(path)
    return next((robot for robot in robots(stage) if carrier and carrier in robot.links), None)


def wheel_pairs(wheels: Iterable[Wheel]) -> list[tuple[Wheel, Wheel]]:
    """Return the wheels in pairs of left and right, the foremost first; none where they are not."""
    left, right = (
        sorted((w for w in wheels if w.side == side), key=lambda w: -w.place[0])
        for side in ("left", "right")
    )
    return list(zip(left, right, strict=True)) if len(left) == len(right) else []


def is_mimic(joint: RobotJoint) -> bool:
    """Whether a joint moves as another one does."""
    return any(MIMIC in api for api in joint.prim.apis)
