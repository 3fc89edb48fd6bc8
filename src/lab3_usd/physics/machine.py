"""Bodies that hang together by joints and wheels, and how they roll.

Links stand where their joints put them, not where they are authored. A wheel is a link with a
free hinge that touches the ground; it rolls without slipping in its plane.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.model.dry_run import AXES, Affine, Segment, about
from lab3_usd.model.joint_drives import JointCommand
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.traction import GRAVITY, Pull
from lab3_usd.model.transforms import Vector
from lab3_usd.physics.overlaps import Overlap
from lab3_usd.physics.surfaces import Surface, distance_to_segments, height_at

HINGE, SLIDER = "PhysicsRevoluteJoint", "PhysicsPrismaticJoint"
FIXED = "PhysicsFixedJoint"
JOINTS = (HINGE, SLIDER, FIXED, "PhysicsSphericalJoint", "PhysicsJoint")


class Joint(Struct, eq=False):
    """A joint between two bodies ('' is the world), and where its motion has come to."""

    name: str
    kind: str
    bodies: tuple[str, str]
    frames: tuple[Affine, Affine]  # in the bodies, their scale included
    axis: Vector
    stiffness: float
    damping: float
    target_velocity: float  # rad/s
    target_position: float = 0.0
    position: float = 0.0
    velocity: float = 0.0
    effort: float = 0.0  # that is applied beside the drive
    locked: bool = False  # by another joint between its bodies
    excluded: bool = False  # from the articulation, whose controller does not know it
    authored: tuple[float, float] = (0.0, 0.0)  # the targets that the stage gives
    limits: tuple[float, float] = (-math.inf, math.inf)  # of its position
    kinematic: str = ""  # the body at its end that nothing moves, which counts as the world
    force: float = math.inf  # the drive's largest
    is_acceleration: bool = False  # whether the drive's damping is for a unit of inertia
    rollers: tuple[float, float] | None = None  # of its wheel: their angle to the axle, the radius
    path: str = ""
    is_told_speeds: bool = False  # whether a controller has given it a velocity
    # why it cannot follow commands, by their kind
    hindrances: dict[JointCommand, str] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether the drive says how fast the joint turns; else it turns freely."""
        return self.locked or self.stiffness > 0 or self.damping > 0

    @property
    def reach(self) -> float:
        """How far the joint turns at least one way."""
        return min(-self.limits[0], self.limits[1])

    def reset(self) -> None:
        """Turn back, with the targets of the stage."""
        self.target_velocity, self.target_position = self.authored
        self.position = self.velocity = self.effort = 0.0

    def speed(self, dt: float) -> float:
        """Return the speed that the drive settles at, implicitly over a step, within the limits."""
        away = self.target_position - self.position
        if self.locked or not (self.damping or self.stiffness):
            return 0.0
        if not self.damping:  # nothing slows it down on its way
            return away / dt if dt else 0.0
        pull = self.stiffness / self.damping
        # A file has the damping of a hinge by degrees.
        pushed = self.effort / (math.degrees(self.damping) if self.kind == HINGE else self.damping)
        speed = (self.target_velocity + pull * away + pushed) / (1.0 + pull * dt)
        if not dt:
            return speed
        low, high = self.limits
        return max((low - self.position) / dt, min((high - self.position) / dt, speed))


class Wheel(Struct, frozen=True):
    """A wheel that touches the ground: its joint, radius, and axle in the frame of the base."""

    joint: Joint
    sign: float
    radius: float
    along: tuple[float, float]  # where its contact goes when the joint turns forward
    contact: tuple[float, float]
    carrier: str = ""  # the body that its joint hangs on
    trails: bool = False  # it turns freely, and lets the robot go to its side
    grip: tuple[float, float] | None = None  # of a wheel of rollers: the one way it does not slip
    pull: Pull = Pull()  # of its drive; as a rule it is at its speed at once

    @property
    def share(self) -> float:
        """How much of its rolling a wheel of rollers passes on the way that it grips."""
        if self.grip is None:
            return 1.0
        return self.along[0] * self.grip[0] + self.along[1] * self.grip[1]

    def reached(self, wanted: float, dt: float) -> float:
        """Return the speed of its joint after a step."""
        start = self.joint.velocity
        change = (wanted - start) * dt / (dt + self.pull.lag)
        most = self.pull.most / self.radius * dt if self.radius else math.inf
        return start + max(-most, min(most, change))

    def sideways(self, motion: Vector) -> float:
        """Return how much a motion of the base (x, y, turn) moves its contact along its axle."""
        if self.grip is not None or self.trails:
            return 0.0
        (x, y), (u, v), (ahead, left, turn) = self.contact, self.along, motion
        return u * (left + turn * x) - v * (ahead - turn * y)


def solution(wheels: Sequence[Wheel]) -> list[tuple[float, float, float]]:
    """Return for each wheel what a unit of rolling adds to the base's motion (x, y, turn).

    Driven wheels roll at the speed of their drives, and no wheel slides along its axle. Unknown
    components are minimal, contradictions are averaged (least squares).
    """
    lines = []
    for index, wheel in enumerate(wheels):
        (x, y), (u, v) = wheel.contact, wheel.along
        if wheel.grip is not None:
            g, h = wheel.grip
            if wheel.joint.holds:
                lines.append(((g, h, x * h - y * g), index))
            continue
        if wheel.joint.holds:
            lines.append(((u, v, x * v - y * u), index))
        if not wheel.trails:
            lines.append(((-v, u, x * u + y * v), -1))
    matrix = [[1e-9 * (i == j) for j in range(3)] for i in range(3)]
    for row, _ in lines:
        for i in range(3):
            for j in range(3):
                matrix[i][j] += row[i] * row[j]
    back = Affine(tuple(map(tuple, matrix))).inverse()  # type: ignore[arg-type]
    motions = [(0.0, 0.0, 0.0)] * len(wheels)
    for row, index in lines:
        if index >= 0:
            x, y, turn = back.turn(row)
            k = wheels[index].share
            motions[index] = (k * x, k * y, k * turn)
    return motions


STEP, HIGH = 0.01, 0.05  # metres from which on a step stops a wheel, and to which one is looked for
LOOKS = 0.01  # metres after which the ground below the wheels is looked at again
_PROMPT = Pull()  # of a wheel that is at its speed at once


class Posture(Struct, eq=False, dict=True):
    """How a machine stands at a moment: the place of its base, and how far its joints have moved.

    `place` is x, y, drop and yaw from its start, `positions` are by the body that hangs on a joint.
    """

    machine: Machine
    place: tuple[float, float, float, float]
    positions: dict[str, float]
    known: dict[str, Affine] = field(default_factory=dict)  # where prims are
    backs: dict[str, Affine] = field(default_factory=dict)  # the ways into their frames

    @cached_property
    def base(self) -> Affine:
        """Where its base is."""
        start, (x, y, drop, yaw) = self.machine.start, self.place
        turned = Affine(about(AXES[2], yaw)).then(start).rows
        u, v, w = start.origin
        return Affine(turned, (u + x, v + y, w + drop))


class Floor(Struct, frozen=True):
    """What a robot may come to a step on, or to the end of: surfaces near its ground.

    `unit` is how many units are a metre, `goes_on` whether the ground has no end.
    """

    surfaces: Sequence[Surface]
    height: float
    unit: float
    goes_on: bool

    def obstacle(self, x: float, y: float) -> str:
        """Return what stops a wheel at a place, '' for nothing."""
        step = STEP * self.unit
        top = height_at(self.surfaces, x, y, self.height + HIGH * self.unit)
        if top is None or top < self.height - step:
            return "" if self.goes_on else "the end of the ground"
        rise = (top - self.height) / self.unit
        return f"a step of {100 * rise:.2g} cm" if rise > STEP else ""


class Machine(Struct):
    """Bodies that hang together: `rest` is where each stands in the base's frame."""

    base: str
    start: Affine
    rest: dict[str, Affine]
    parents: dict[str, Joint]  # which of its joints a body hangs on
    joints: dict[str, Joint]  # those that move, by name, in the order of the articulation
    held: bool
    kinematic: str = ""  # the body at a joint of it that nothing moves
    wheels: list[Wheel] = field(default_factory=list)
    falls: bool = False  # as nothing carries its centre of mass
    lean: float = 0.0  # radians by which it stands otherwise than authored
    carrier: tuple[str, str] | None = None  # what carries it in place of its wheels, and in words
    # What it stands on that is modelled as a wheel, or does not hold it, and may be neither.
    unclear: dict[str, str] = field(default_factory=dict)
    inside: tuple[Overlap, ...] = ()  # what it is inside of where it starts
    smooth: str = ""  # a wheel that touches the ground and has no friction on it
    solve: list[tuple[float, float, float]] = field(default_factory=list)
    middle: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    grounded: bool = True
    no_ground: tuple[str, str] | None = None  # what is below it and carries nothing, and why
    is_given_ground: bool = False  # as the stage has none below it
    pulled: bool = True  # down, by gravity
    home: float = 0.0  # how far it drops when playing starts
    x: float = 0.0
    y: float = 0.0
    drop: float = 0.0
    yaw: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the base, in its own frame
    fall: float = 0.0
    blocked: str = ""  # what stops it
    barriers: dict[str, list[Segment]] = field(default_factory=dict)  # bodies in its way
    floor: Floor | None = None  # None where its ground is flat and endless
    unchecked: float = 0.0  # how far it went since its wheels were last looked at
    clearance: float = 0.0
    is_steered: bool = False  # whether joints turn what a wheel hangs on
    scrubs: bool = False  # whether wheels slide in a turn, as four that do not steer
    walls: list[Segment] = field(default_factory=list)
    # Where each body rests in its parent, and the way back from the frame of its joint.
    steps: dict[str, tuple[Affine, Affine]] = field(default_factory=dict)
    firm: dict[str, Affine] = field(default_factory=dict)  # the bodies that never move in the base
    now: Posture | None = None  # as it stands, once somebody asked
    articulated: dict[str, Joint] = field(default_factory=dict)  # those that its controllers know

    def link_of(self, joint: Joint) -> str:
        """Return the body that hangs on a joint."""
        return next(link for link, parent in self.parents.items() if parent is joint)

    def is_named_by(self, prims: Collection[str]) -> bool:
        """Whether any of some prims is a part of it, is below one, or holds one."""
        return any(
            is_at_or_below(body, prim) or is_at_or_below(prim, body)
            for body in self.rest
            for prim in prims
        )

    def between(self, first: str, second: str) -> set[Joint]:
        """Return the joints that lie between two bodies."""
        return {*self.above(first)} ^ {*self.above(second)}

    def know(self, root: str) -> None:
        """Let the articulation begin at a body: what lies behind an excluded joint is not in it."""
        for body, joint in self.parents.items():
            is_moving = joint.kind != FIXED
            if is_moving and not any(each.excluded for each in self.between(root, body)):
                self.articulated[joint.name] = joint

    def reset(self) -> None:
        """Go back to where playing starts."""
        self.x = self.y = self.yaw = self.fall = self.clearance = 0.0
        self.drop, self.velocity, self.blocked = self.home, (0.0, 0.0, 0.0), ""
        self.unchecked = 0.0
        self.now = None
        for joint in self.joints.values():
            joint.reset()

    @property
    def is_at_rest(self) -> bool:
        """Whether it stands on the ground, and nothing moves it."""
        return (
            self.grounded
            and not any(self.velocity)
            and all(
                not (joint.velocity or joint.target_velocity or joint.effort)
                and joint.target_position == joint.position
                and joint.limits[0] <= joint.position <= joint.limits[1]
                for joint in self.joints.values()
            )
        )

    def posture(self) -> Posture:
        """Return how it stands now; what moves later does not change it."""
        if self.now is None:
            positions = {}
            for body, joint in self.parents.items():
                if joint.position:
                    positions[body] = joint.position
            place = (self.x, self.y, self.drop, self.yaw)
            self.now = Posture(self, place, positions)
        return self.now

    def offset(self, body: str, positions: Mapping[str, float]) -> Affine:
        """Return where a body is in the base's frame, the joints above it turned as given."""
        joint = self.parents.get(body)
        if joint is None:
            return self.rest[body]
        if body in self.firm:
            return self.firm[body]
        inner = 1 if joint.bodies[1] == body else 0
        parent = joint.bodies[1 - inner]
        if body not in self.steps:
            rests = self.rest[parent].inverse().then(self.rest[body])
            self.steps[body] = rests, joint.frames[inner].inverse()
        own, back = self.steps[body]
        position = positions.get(body)
        if position:
            way = position if inner else -position
            moved = Affine(about(joint.axis, way))
            if joint.kind == SLIDER:
                x, y, z = joint.axis
                moved = Affine(AXES, (x * way, y * way, z * way))
            own = own.then(joint.frames[inner]).then(moved).then(back)
        offset = self.offset(parent, positions).then(own)
        if joint.kind == FIXED and (parent == self.base or parent in self.firm):
            self.firm[body] = offset
        return offset

    def step(self, dt: float) -> None:
        """Move on by a step."""
        if self.grounded:
            self._drive(dt)
        elif not self.held:
            self.fall += GRAVITY * dt
            self.drop -= self.fall * dt
        self.now = None

    def _drive(self, dt: float) -> None:
        speeds = {name: joint.speed(dt) for name, joint in self.joints.items()}
        for wheel in self.wheels:
            if wheel.pull != _PROMPT:
                speeds[wheel.joint.name] = wheel.reached(speeds[wheel.joint.name], dt)
        vx = vy = w = 0.0
        wheels, solve = self.wheels, self.solve
        if self.is_steered:
            wheels = [self._steered(wheel) for wheel in wheels]
            solve = solution(wheels)
        for wheel, (a, b, c) in zip(wheels, solve, strict=True):
            rolled = wheel.sign * speeds[wheel.joint.name] * wheel.radius
            vx, vy, w = vx + a * rolled, vy + b * rolled, w + c * rolled
        if self.held:
            vx = vy = w = 0.0
        self.velocity = self._move(vx, vy, w, dt)
        self._turn_joints(wheels, speeds, dt)

    def above(self, body: str) -> Iterator[Joint]:
        """Yield the joints from a body up to the base."""
        while body in self.parents:
            joint = self.parents[body]
            yield joint
            body = joint.bodies[0] if joint.bodies[1] == body else joint.bodies[1]

    def _steered(self, wheel: Wheel) -> Wheel:
        """Return a wheel in the present posture of the link that carries it."""
        start = Affine(self.start.rows)
        stands = self.offset(wheel.carrier, self.posture().positions)
        moved = stands.then(self.rest[wheel.carrier].inverse())
        moved = start.then(moved).then(start.inverse())
        x, y, _ = moved.point((*wheel.contact, 0.0))
        u, v, _ = moved.turn((*wheel.along, 0.0))
        grip = wheel.grip
        if grip is not None:
            g, h, _ = moved.turn((*grip, 0.0))
            grip = (g, h)
        return replace(wheel, along=(u, v), contact=(x, y), grip=grip)

    def _move(self, vx: float, vy: float, w: float, dt: float) -> tuple[float, float, float]:
        """Go along the exact arc, unless a wall is in the way."""
        middle = self.yaw + w * dt / 2
        half = w * dt / 2
        chord = math.sin(half) / half if half else 1.0
        c, s = math.cos(middle) * chord * dt, math.sin(middle) * chord * dt
        dx, dy = vx * c - vy * s, vx * s + vy * c
        self.blocked = self._meets(dx, dy)
        if self.blocked:
            return (0.0, 0.0, 0.0)
        self.x, self.y, self.yaw = self.x + dx, self.y + dy, self.yaw + w * dt
        return (vx, vy, w)

    def _meets(self, dx: float, dy: float) -> str:
        """Return what is in the way of a motion, '' for nothing."""
        if step := self._step_ahead(dx, dy):
            return step
        self.clearance -= math.hypot(dx, dy)
        if self.clearance > 0 or not (self.walls or self.barriers):
            return ""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        u, v = self.middle
        x = self.start.origin[0] + self.x + c * u - s * v
        y = self.start.origin[1] + self.y + s * u + c * v
        self.clearance = math.inf
        for what, segments in (("a wall", self.walls), *self.barriers.items()):
            gap = distance_to_segments(segments, x + dx, y + dy) - self.radius
            self.clearance = min(self.clearance, gap)
            if gap < 0 and gap + self.radius < distance_to_segments(segments, x, y):
                return what
        return ""

    def _step_ahead(self, dx: float, dy: float) -> str:
        """Return the step, or the end of the ground, to which a wheel comes, '' for none."""
        if self.floor is None:
            return ""
        self.unchecked += math.hypot(dx, dy) / self.floor.unit
        if self.unchecked < LOOKS:
            return ""
        self.unchecked = 0.0
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y, _ = self.start.origin
        for wheel in self.wheels:
            u, v = wheel.contact
            at = x + self.x + dx + c * u - s * v, y + self.y + dy + s * u + c * v
            step = self.floor.obstacle(*at)
            if step:
                self.unchecked = LOOKS  # and it is there at the next step as well
                return step
        return ""

    def _turn_joints(self, wheels: Sequence[Wheel], speeds: dict[str, float], dt: float) -> None:
        vx, vy, w = self.velocity
        free = {}
        for wheel in wheels:
            if not wheel.joint.holds and wheel.radius:
                (x, y), (u, v) = wheel.contact, wheel.along
                free[wheel.joint.name] = wheel.sign * ((vx - w * y) * u + (vy + w * x) * v)
                free[wheel.joint.name] /= wheel.radius
        for name, joint in self.joints.items():
            joint.velocity = free.get(name, speeds[name])
            joint.position += joint.velocity * dt


class Spot(Struct, frozen=True, dict=True):
    """A prim, and where it is in the frame of the body that it goes with, or in the world."""

    path: str
    body: str
    machine: Machine | None
    local: Affine

    @property
    def base(self) -> str:
        """The base of what it goes with; '' for the world."""
        return "" if self.machine is None else self.machine.base

    def posture(self) -> Posture | None:
        """Return how what it goes with stands now; None where it goes with nothing."""
        return None if self.machine is None else self.machine.posture()

    def place(self, posture: Posture | None) -> Affine:
        """Return where it is when what it goes with stands so."""
        if posture is None:
            return self.local
        stored = posture.known.get(self.path)
        if stored is None:
            stored = posture.known[self.path] = self._place(posture)
        return stored

    def _place(self, posture: Posture) -> Affine:
        if self.path == posture.machine.base:
            return posture.base
        offset = posture.machine.offset(self.body, posture.positions)
        return posture.base.then(offset if self.path == self.body else offset.then(self.local))

    def back(self, posture: Posture | None) -> Affine:
        """Return the way from the world into its frame when what it goes with stands so."""
        if posture is None:
            return self._back
        stored = posture.backs.get(self.path)
        if stored is None:
            stored = posture.backs[self.path] = self.place(posture).inverse()
        return stored

    @cached_property
    def _back(self) -> Affine:
        return self.local.inverse()
