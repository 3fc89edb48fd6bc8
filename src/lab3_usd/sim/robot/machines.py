"""Everything that moves on a stage, and where each prim is now, on which wheels."""

from __future__ import annotations

import math

from lab3_usd.model.dry_run.affine import HERE, Affine
from lab3_usd.model.dry_run.scene import Scene
from lab3_usd.model.physics import SCENE, is_down, is_felt
from lab3_usd.model.transform_math import Vector, cross, minus
from lab3_usd.sim.geometry.cuts import cut, height_at
from lab3_usd.sim.geometry.shapes import placed
from lab3_usd.sim.robot.assembly import ROOT, Bodies, collides
from lab3_usd.sim.robot.joints import HINGE, Joint, Wheel
from lab3_usd.sim.robot.machine import Machine

_UPRIGHT = 0.5  # an axle that stands steeper rolls nowhere

TOUCH = 5e-3  # metres between the lowest point of all and that of a wheel that still touches
STEP_UP = 0.05  # metres that the ground may be above a robot's origin
SKIRT = 0.05  # metres above the ground at which walls stop a robot
STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Machines:
    """Everything that moves on a stage."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._bodies = Bodies(scene)
        self.bodies = self._bodies.prims
        self.static = [
            triangle
            for each in scene.prims.values()
            if collides(each) and self.body_of(each.path) == ""
            for triangle in placed(each, each.world)
        ]
        self.machines = self._bodies.machines()
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
        return self._bodies.of(path)

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
            return STILL
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

    def _set_down(self, machine: Machine) -> None:
        """Let a machine fall on the ground below it, and see which wheels touch."""
        points = {body: self._points(body, machine) for body in machine.rest}
        every = [each for some in points.values() for each in some]
        if not every or not machine.joints:
            return
        _bound(machine, every)
        machine.pulled = is_pulled(self.scene)
        if not machine.pulled:
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
        if machine.grounded and ground is not None:
            low = min(each[2] for each in every)
            for joint in machine.joints.values():
                wheel = _wheel_at(machine, joint, points, low + TOUCH * unit)
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


def is_pulled(scene: Scene) -> bool:
    """Whether gravity holds what stands on the ground: that of the first physics scene.

    Without one Isaac Sim makes one.
    """
    first = next((each.values for each in scene.prims.values() if each.type == SCENE), {})
    return is_felt(first, scene.meters_per_unit) and is_down(first)


def _bound(machine: Machine, points: list[Vector]) -> None:
    """Note the circle that a machine takes up on the ground."""
    xs, ys = [each[0] for each in points], [each[1] for each in points]
    machine.middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
    u, v = machine.middle
    machine.radius = max(math.hypot(x - u, y - v) for x, y in zip(xs, ys, strict=True))


def _wheel_at(
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
    if flat < _UPRIGHT:
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
