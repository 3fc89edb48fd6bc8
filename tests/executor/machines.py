"""Bodies that joints hold together, and how they roll: exact kinematics, no forces.

Links stand where their joints put them, not where they are authored. A wheel is a link with a
free hinge that touches the ground; it rolls without slipping in its plane.
"""

from __future__ import annotations

import math
from collections import deque

from msgspec import Struct, field

from executor.affine import (
    AXES,
    HERE,
    Affine,
    Vector,
    about,
    cross,
    minus,
    rotation,
)
from executor.scene import Prim, Scene
from executor.shapes import Segment, cut, distance, height_at, placed

BODY, ROOT, COLLIDER = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI", "PhysicsCollisionAPI"
HINGE, SLIDER = "PhysicsRevoluteJoint", "PhysicsPrismaticJoint"
FIXED = "PhysicsFixedJoint"
JOINTS = (HINGE, SLIDER, FIXED, "PhysicsSphericalJoint", "PhysicsJoint")
DRIVE = {HINGE: "drive:angular:physics:", SLIDER: "drive:linear:physics:"}
TOUCH = 5e-3  # metres between the lowest point of all and that of a wheel that still touches
STEP_UP = 0.05  # metres that the ground may be above a robot's origin
UPRIGHT = 0.5  # an axle that stands steeper rolls nowhere
SKIRT = 0.05  # metres above the ground at which walls stop a robot
GRAVITY = 9.81


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
    target_effort: float = 0.0
    position: float = 0.0
    locked: bool = False  # by another joint between its bodies
    authored: tuple[float, float] = (0.0, 0.0)  # the targets that the stage gives

    @property
    def holds(self) -> bool:
        """Whether the drive says how fast the joint turns; else it turns freely."""
        return self.locked or self.stiffness > 0 or self.damping > 0

    def reset(self) -> None:
        """Turn back, with the targets of the stage."""
        self.target_velocity, self.target_position = self.authored
        self.target_effort = self.position = 0.0

    def speed(self, dt: float) -> float:
        """Return the speed that the drive settles at, implicitly over a step."""
        if self.locked or not self.damping:
            return 0.0
        pull = self.stiffness / self.damping
        wanted = self.target_velocity + pull * (self.target_position - self.position)
        return wanted / (1.0 + pull * dt)


class Wheel(Struct, frozen=True):
    """A wheel that touches the ground: its joint, radius, and axle in the frame of the base."""

    joint: Joint
    sign: float
    radius: float
    along: tuple[float, float]  # where its contact goes when the joint turns forward
    contact: tuple[float, float]


class Machine(Struct):
    """Bodies that hang together: `rest` is where each stands in the base's frame."""

    base: str
    start: Affine
    rest: dict[str, Affine]
    parents: dict[str, Joint]
    joints: dict[str, Joint]  # those that move, by name, in the order of the articulation
    held: bool
    wheels: list[Wheel] = field(default_factory=list)
    solve: list[tuple[float, float, float]] = field(default_factory=list)
    middle: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    grounded: bool = True
    home: float = 0.0  # how far it drops when playing starts
    x: float = 0.0
    y: float = 0.0
    drop: float = 0.0
    yaw: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the base, in its own frame
    fall: float = 0.0
    blocked: bool = False
    clearance: float = 0.0
    walls: list[Segment] = field(default_factory=list)

    def reset(self) -> None:
        """Go back to where playing starts."""
        self.x = self.y = self.yaw = self.fall = self.clearance = 0.0
        self.drop, self.velocity, self.blocked = self.home, (0.0, 0.0, 0.0), False
        for joint in self.joints.values():
            joint.reset()

    def pose(self) -> Affine:
        """Return where the base is now."""
        spin = about(AXES[2], self.yaw)
        x, y, z = self.start.origin
        turned = Affine(spin).then(Affine(self.start.rows)).rows
        return Affine(turned, (x + self.x, y + self.y, z + self.drop))

    def offset(self, body: str) -> Affine:
        """Return where a body is in the base's frame, its joints turned as they are."""
        joint = self.parents.get(body)
        if joint is None or not joint.position:
            return self.rest[body]
        inner = 1 if joint.bodies[1] == body else 0
        sign = 1.0 if inner else -1.0
        turn = Affine(about(joint.axis, sign * joint.position))
        frame = joint.frames[inner]
        return self.rest[body].then(frame).then(turn).then(frame.inverse())

    def step(self, dt: float) -> None:
        """Move on by a step."""
        if not self.grounded:
            if not self.held:
                self.fall += GRAVITY * dt
                self.drop -= self.fall * dt
            return
        speeds = {each: joint.speed(dt) for each, joint in self.joints.items()}
        vx = vy = w = 0.0
        for wheel, (a, b, c) in zip(self.wheels, self.solve, strict=True):
            rolled = wheel.sign * speeds[wheel.joint.name] * wheel.radius
            vx, vy, w = vx + a * rolled, vy + b * rolled, w + c * rolled
        if self.held:
            vx = vy = w = 0.0
        self.velocity = self._move(vx, vy, w, dt)
        self._turn_joints(speeds, dt)

    def _move(self, vx: float, vy: float, w: float, dt: float) -> tuple[float, float, float]:
        """Go along the exact arc, unless a wall is in the way."""
        middle = self.yaw + w * dt / 2
        half = w * dt / 2
        chord = math.sin(half) / half if half else 1.0
        c, s = math.cos(middle) * chord * dt, math.sin(middle) * chord * dt
        dx, dy = vx * c - vy * s, vx * s + vy * c
        if self._meets(dx, dy):
            self.blocked = True
            return (0.0, 0.0, 0.0)
        self.x, self.y, self.yaw = self.x + dx, self.y + dy, self.yaw + w * dt
        return (vx, vy, w)

    def _meets(self, dx: float, dy: float) -> bool:
        self.clearance -= math.hypot(dx, dy)
        if self.clearance > 0 or not self.walls:
            return False
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        u, v = self.middle
        x = self.start.origin[0] + self.x + c * u - s * v
        y = self.start.origin[1] + self.y + s * u + c * v
        gap = distance(self.walls, x + dx, y + dy) - self.radius
        self.clearance = gap
        return gap < 0 and gap + self.radius < distance(self.walls, x, y)

    def _turn_joints(self, speeds: dict[str, float], dt: float) -> None:
        vx, vy, w = self.velocity
        free = {}
        for wheel in self.wheels:
            if not wheel.joint.holds and wheel.radius:
                (x, y), (u, v) = wheel.contact, wheel.along
                free[wheel.joint.name] = wheel.sign * ((vx - w * y) * u + (vy + w * x) * v)
                free[wheel.joint.name] /= wheel.radius
        for name, joint in self.joints.items():
            joint.position += free.get(name, speeds[name]) * dt


class Machines:
    """Everything that moves on a stage."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.bodies = {each.path: each for each in scene.prims.values() if is_dynamic(each)}
        self.static = [
            triangle
            for each in scene.prims.values()
            if collides(each) and self.body_of(each.path) == ""
            for triangle in placed(each, each.world)
        ]
        joints = [joint for joint in map(self._joint, scene.prims.values()) if joint is not None]
        self.machines = _assembled(self.bodies, joints)
        self.member = {body: each for each in self.machines for body in each.rest}
        self._local: dict[str, tuple[str, Affine]] = {}
        self._now: dict[str, Affine] = {}
        self._back: dict[str, Affine] = {}
        for each in self.machines:
            self._set_down(each)
        self.reset()

    def reset(self) -> None:
        """Put everything where playing starts."""
        self._now.clear()
        self._back.clear()
        for each in self.machines:
            each.reset()

    def body_of(self, path: str) -> str:
        """Return the body that a prim goes with; '' for the world."""
        for each in self.scene.above(path):
            if each.path in self.bodies:
                return each.path
            if each.loose:
                break
        return ""

    def articulation(self, path: str) -> Machine | None:
        """Return the articulation at or below a prim."""
        for prim in self.scene.below(path) if path else ():
            enabled = prim.values.get("physxArticulation:articulationEnabled") is not False
            if ROOT in prim.apis and enabled:
                bodies = [each.path for each in self.scene.below(prim.path)]
                bodies = [each for each in bodies if each in self.member]
                found = [self.member[each] for each in bodies if self.member[each].joints]
                return found[0] if found else None
        return None

    def place(self, path: str) -> Affine:
        """Return where a prim is now, without scale; '' is the world."""
        now = self._now.get(path)
        if now is None:
            now = self._now[path] = self._place(path)
        return now

    def inverse(self, path: str) -> Affine:
        """Return the way from the world into the frame of a prim."""
        back = self._back.get(path)
        if back is None:
            back = self._back[path] = self.place(path).inverse()
        return back

    def _place(self, path: str) -> Affine:
        if path not in self._local:
            body = self.body_of(path)
            prim = self.scene.prims.get(path)
            world = prim.world.rigid() if prim is not None else HERE
            if body:
                world = self.bodies[body].world.rigid().inverse().then(world)
            self._local[path] = (body, world)
        body, local = self._local[path]
        if not body:
            return local
        machine = self.member[body]
        if path == machine.base:
            return machine.pose()
        offset = machine.offset(body)
        return self.place(machine.base).then(offset if path == body else offset.then(local))

    def velocity(self, path: str) -> tuple[Vector, Vector]:
        """Return how fast a body moves and turns, in the world."""
        body = self.body_of(path)
        machine = self.member.get(body)
        if machine is None:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        vx, vy, w = machine.velocity
        c, s = math.cos(machine.yaw), math.sin(machine.yaw)
        turning = (0.0, 0.0, w)
        around = cross(turning, minus(self.place(body).origin, self.place(machine.base).origin))
        moving = (vx * c - vy * s, vx * s + vy * c, -machine.fall)
        linear = (moving[0] + around[0], moving[1] + around[1], moving[2] + around[2])
        return linear, turning

    def step(self, dt: float) -> None:
        """Move everything on."""
        self._now.clear()
        self._back.clear()
        for each in self.machines:
            if each.joints or not each.grounded:
                each.step(dt)

    def _joint(self, prim: Prim) -> Joint | None:
        on = prim.values.get("physics:jointEnabled") is not False
        if prim.type not in JOINTS or not on:
            return None
        ends = [prim.targets.get(f"physics:body{each}", ()) for each in (0, 1)]
        if any(each and each[0] not in self.scene.prims for each in ends):
            return None  # PhysX makes no joint to a prim that is not there
        bodies = [self.body_of(each[0]) if each else "" for each in ends]
        drive = DRIVE.get(prim.type, "")
        kind = drive.split(":")[1] if drive else ""
        driven = f"PhysicsDriveAPI:{kind}" in prim.apis

        def said(name: str) -> float:
            return float(prim.values.get(drive + name) or 0.0) if driven else 0.0

        unit = math.radians(1.0) if prim.type == HINGE else 1.0
        return Joint(
            prim.path.rpartition("/")[2],
            prim.type,
            (bodies[0], bodies[1]),
            (self._frame(prim, 0, ends[0], bodies[0]), self._frame(prim, 1, ends[1], bodies[1])),
            AXES[{"Y": 1, "Z": 2}.get(str(prim.values.get("physics:axis")), 0)],
            said("stiffness"),
            said("damping"),
            0.0,
            authored=(said("targetVelocity") * unit, said("targetPosition") * unit),
        )

    def _frame(self, prim: Prim, number: int, ends: tuple[str, ...], body: str) -> Affine:
        """Return the frame of a joint in its body, without scale."""
        at = prim.values.get(f"physics:localPos{number}") or (0.0, 0.0, 0.0)
        turn = rotation(prim.values.get(f"physics:localRot{number}") or (1.0, 0.0, 0.0, 0.0))
        target = self.scene.prims[ends[0]].world if ends else HERE
        inside = target.then(Affine(turn, at))
        owner = self.bodies[body].world.rigid() if body else HERE
        return owner.inverse().then(inside).rigid()

    def _set_down(self, machine: Machine) -> None:
        """Let a machine fall on the ground below it, and see which wheels touch."""
        points = {body: self._points(body, machine) for body in machine.rest}
        every = [each for some in points.values() for each in some]
        if not every or not machine.joints:
            return
        unit = 1.0 / self.scene.meters_per_unit
        x, y, z = machine.start.origin
        ground = height_at(self.static, x, y, z + STEP_UP * unit)
        if ground is None:
            machine.grounded = machine.held
        else:
            low = min(each[2] for each in every)
            machine.home = 0.0 if machine.held else ground - low - z
            machine.walls = cut(self.static, ground + SKIRT * unit)
        _bounds(machine, every)
        if machine.grounded and ground is not None:
            low = min(each[2] for each in every)
            for joint in machine.joints.values():
                wheel = _wheel(machine, joint, points, low + TOUCH * unit)
                machine.wheels += [wheel] if wheel is not None else []
            machine.solve = _solution(machine.wheels)

    def _points(self, body: str, machine: Machine) -> list[Vector]:
        """Return the corners of a body's collision shapes, with the base turned as at the start."""
        base = Affine(machine.start.rows)
        back = self.bodies[body].world.rigid().inverse()
        found: list[Vector] = []
        for prim in self.scene.below(body):
            if collides(prim) and self.body_of(prim.path) == body:
                at = base.then(machine.rest[body]).then(back).then(prim.world)
                found.extend(point for each in placed(prim, at) for point in each)
        return found


def is_dynamic(prim: Prim) -> bool:
    """Whether a prim is a body that moves."""
    on = prim.values.get("physics:rigidBodyEnabled") is not False
    return BODY in prim.apis and on and not prim.values.get("physics:kinematicEnabled")


def collides(prim: Prim) -> bool:
    """Whether a prim is a collision shape."""
    return COLLIDER in prim.apis and prim.values.get("physics:collisionEnabled") is not False


def _assembled(bodies: dict[str, Prim], joints: list[Joint]) -> list[Machine]:
    """Sort bodies into machines; each is placed from its root over its joints."""
    ends: dict[str, list[Joint]] = {each: [] for each in bodies}
    for joint in joints:
        for body in {*joint.bodies} - {""}:
            ends[body].append(joint)
    roots = [each for each in bodies if ROOT in bodies[each].apis]
    second = {joint.bodies[1] for joint in joints if joint.bodies[0]}
    firsts = [each for each in bodies if each not in second]
    found: list[Machine] = []
    taken: set[str] = set()
    for base in (*roots, *firsts, *bodies):
        if base not in taken:
            machine = _machine(base, bodies, ends)
            taken |= machine.rest.keys()
            found.append(machine)
    return found


def _machine(base: str, bodies: dict[str, Prim], ends: dict[str, list[Joint]]) -> Machine:
    rest, waiting, held = {base: HERE}, deque([base]), False
    parents: dict[str, Joint] = {}
    moving: dict[str, Joint] = {}
    closing: list[Joint] = []
    while waiting:
        body = waiting.popleft()
        for joint in ends[body]:
            number = joint.bodies.index(body)
            other = joint.bodies[1 - number]
            held = held or not other
            if not other or other in rest:
                tree = (parents.get(body), parents.get(other))
                closing += [joint] if joint.kind == FIXED and joint not in tree else []
                continue
            outer, inner = joint.frames[number], joint.frames[1 - number]
            rest[other] = rest[body].then(outer).then(inner.inverse())
            parents[other] = joint
            waiting.append(other)
            if joint.kind != FIXED:
                moving[joint.name] = joint
    _lock(closing, parents)
    return Machine(base, bodies[base].world.rigid(), rest, parents, moving, held)


def _lock(closing: list[Joint], parents: dict[str, Joint]) -> None:
    """Lock the joints of bodies that another, fixed joint holds as well."""
    for joint in closing:
        for body in joint.bodies:
            if body in parents and parents[body] is not joint:
                parents[body].locked = True


def _bounds(machine: Machine, points: list[Vector]) -> None:
    xs, ys = [each[0] for each in points], [each[1] for each in points]
    machine.middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
    u, v = machine.middle
    machine.radius = max(math.hypot(x - u, y - v) for x, y in zip(xs, ys, strict=True))


def _wheel(
    machine: Machine, joint: Joint, points: dict[str, list[Vector]], touch: float
) -> Wheel | None:
    """Return the wheel at a joint, or None where it does not touch or cannot roll."""
    body = next(each for each, parent in machine.parents.items() if parent is joint)
    low = min((each[2] for each in points[body]), default=math.inf)
    if joint.kind != HINGE or low > touch:
        return None
    inner = joint.bodies.index(body)
    frame = Affine(machine.start.rows).then(machine.rest[body]).then(joint.frames[inner])
    x, y, z = frame.origin
    axle = frame.turn(joint.axis)
    flat = math.hypot(axle[0], axle[1])
    if flat < UPRIGHT:
        return None
    sign = 1.0 if inner else -1.0
    return Wheel(joint, sign, (z - low) * flat, (axle[1] / flat, -axle[0] / flat), (x, y))


def _solution(wheels: list[Wheel]) -> list[tuple[float, float, float]]:
    """Return for each wheel what a unit of rolling adds to the base's motion (x, y, turn).

    Each wheel rolls as its drive says, if it has one, and none slides along its axle; what is
    left open stays as small as it can be, what contradicts is evened out.
    """
    lines = []
    for number, wheel in enumerate(wheels):
        (x, y), (u, v) = wheel.contact, wheel.along
        if wheel.joint.holds:
            lines.append(((u, v, x * v - y * u), number))
        lines.append(((-v, u, x * u + y * v), -1))
    matrix = [[1e-9 * (i == j) for j in range(3)] for i in range(3)]
    for row, _ in lines:
        for i in range(3):
            for j in range(3):
                matrix[i][j] += row[i] * row[j]
    back = Affine(tuple(map(tuple, matrix))).inverse()  # type: ignore[arg-type]
    found = [(0.0, 0.0, 0.0)] * len(wheels)
    for row, number in lines:
        if number >= 0:
            found[number] = back.turn(row)
    return found
