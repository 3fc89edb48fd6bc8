"""Everything that moves on a stage, and the current pose of each prim."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.dry_run import HERE, Affine, Scene
from lab3_usd.model.physics import FAR, MASS, SCENE, is_down, is_felt, number
from lab3_usd.model.traction import (
    MATERIAL_API,
    Load,
    Surface,
    bound_material,
    pull_of,
    surface_of,
)
from lab3_usd.model.transforms import Vector, cross, minus
from lab3_usd.sim.geometry import cut, height_at, placed
from lab3_usd.sim.robot.bodies import ROOT, Bodies, collides
from lab3_usd.sim.robot.machine import (
    HINGE,
    Joint,
    Machine,
    Posture,
    Wheel,
    solution,
)

_UPRIGHT = 0.5  # an axle that stands steeper rolls nowhere

TOUCH = 5e-3  # metres between the lowest point of all and that of a wheel that still touches
STEP_UP = 0.05  # metres that the ground may be above a robot's origin
SKIRT = 0.05  # metres above the ground at which walls stop a robot
LEVEL = 1e-6  # metres between what carries a wheel and the ground
PROMPT = 2.0  # metres a second squared, from which on a drive is taken to be at its speed at once
SOON = 0.02  # seconds
_SLIDES = 1e-4  # sideways for each unit that a wheel rolls, from which on it slides
STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


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
        known = posture.known.get(self.path)
        if known is None:
            known = posture.known[self.path] = self._place(posture)
        return known

    def _place(self, posture: Posture) -> Affine:
        if self.path == posture.machine.base:
            return posture.base
        offset = posture.offset(self.body)
        return posture.base.then(offset if self.path == self.body else offset.then(self.local))

    def back(self, posture: Posture | None) -> Affine:
        """Return the way from the world into its frame when what it goes with stands so."""
        if posture is None:
            return self._back
        known = posture.backs.get(self.path)
        if known is None:
            known = posture.backs[self.path] = self.place(posture).inverse()
        return known

    @cached_property
    def _back(self) -> Affine:
        return self.local.inverse()


class Machines:
    """Everything that moves on a stage."""

    def __init__(self, scene: Scene, *, has_ground: bool = False) -> None:
        self.scene = scene
        self.has_ground = has_ground
        self._bodies = Bodies(scene)
        self.bodies = self._bodies.prims
        self._solid = {
            prim.path: placed(prim, prim.world)
            for prim in scene.prims.values()
            if collides(prim) and self.body_of(prim.path) == ""
        }
        self.machines = self._bodies.machines()
        self.member = {body: machine for machine in self.machines for body in machine.rest}
        self._spots: dict[str, Spot] = {}
        self._postures: dict[str, Posture] | None = None
        self._awake: dict[str, Machine] = {}  # those that may move, by their bases
        self._articulations: dict[str, Machine | None] = {}
        for machine in self.machines:
            self._set_down(machine)
        self.reset()

    def reset(self) -> None:
        """Put everything where playing starts."""
        self._postures = None
        for machine in self.machines:
            machine.reset()
            self.wake(machine)

    def wake(self, machine: Machine) -> None:
        """Let a machine move from the next step on, as its joints are commanded."""
        self._awake[machine.base] = machine

    def body_of(self, path: str) -> str:
        """Return the body that a prim goes with; '' for the world."""
        return self._bodies.of(path)

    def articulation(self, path: str) -> Machine | None:
        """Return the articulation at or below a prim.

        Its root may be the joint that fixes it to the world (UsdPhysics, ArticulationRootAPI). One
        without joints that move is left out.
        """
        machine = self._articulation(path)
        return machine if machine is not None and machine.joints else None

    def around(self, path: str) -> Machine | None:
        """Return the articulation at or below a prim, or that of which it is a link or a joint.

        NVIDIA-Omniverse/PhysX, BaseSimulationView.cpp, `getArticulationAtPath`.
        """
        found = self._articulation(path)
        if found is not None:
            return found
        joints = (m for m in self.machines for j in m.joints.values() if j.path == path)
        member = self.member.get(path) or next(joints, None)
        roots = (prim.path for prim in self.scene.prims.values() if ROOT in prim.apis)
        return member if any(self._articulation(root) is member for root in roots) else None

    def _articulation(self, path: str) -> Machine | None:
        if path not in self._articulations:
            self._articulations[path] = self._find_articulation(path)
        return self._articulations[path]

    def _find_articulation(self, path: str) -> Machine | None:
        for prim in self.scene.below(path) if path else ():
            enabled = prim.values.get("physxArticulation:articulationEnabled") is not False
            if ROOT in prim.apis and enabled:
                ends = (prim.targets.get(f"physics:body{number}", ()) for number in (1, 0))
                tied = [body for end in ends for body in end]
                bodies = [*tied, *(below.path for below in self.scene.below(prim.path))]
                machines = [self.member[body] for body in bodies if body in self.member]
                moving = (machine for machine in machines if machine.joints)
                return next(moving, next(iter(machines), None))
        return None

    def place(self, path: str) -> Affine:
        """Return where a prim is now, without scale; '' is the world."""
        spot = self.spot(path)
        return spot.place(spot.posture())

    def spot(self, path: str) -> Spot:
        """Return what a prim goes with; '' is the world."""
        spot = self._spots.get(path)
        if spot is None:
            body = self.body_of(path)
            prim = self.scene.prims.get(path)
            local = prim.world.rigid() if prim is not None else HERE
            if body:
                local = self.bodies[body].world.rigid().inverse().then(local)
            spot = self._spots[path] = Spot(path, body, self.member.get(body), local)
        return spot

    def postures(self) -> Mapping[str, Posture]:
        """Return how each machine stands now, by its base; what moves later does not change it."""
        if self._postures is None:
            self._postures = {machine.base: machine.posture() for machine in self.machines}
        return self._postures

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
        for base, machine in [*self._awake.items()]:
            if machine.is_at_rest or (machine.grounded and not machine.joints):
                del self._awake[base]
            else:
                machine.step(dt)
                self._postures = None

    def _set_down(self, machine: Machine) -> None:
        """Let a machine fall on the ground below it, and see which wheels touch."""
        points = {body: self._points(body, machine) for body in machine.rest}
        every = [point for corners in points.values() for point in corners]
        if not every or not machine.joints:
            return
        xs, ys = [corner[0] for corner in every], [corner[1] for corner in every]
        machine.middle = u, v = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        machine.radius = max(math.hypot(x - u, y - v) for x, y in zip(xs, ys, strict=True))
        machine.pulled = is_pulled(self.scene)
        if not machine.pulled:
            return
        unit = 1.0 / self.scene.meters_per_unit
        x, y, z = machine.start.origin
        ground = height_at(self._solid.values(), x, y, z + STEP_UP * unit)
        if ground is None and self.has_ground and not machine.held:
            machine.is_given_ground = True
            ground = z + min(point[2] for point in every)
        if ground is None:
            machine.grounded = machine.held
        else:
            low = min(point[2] for point in every)
            machine.home = 0.0 if machine.held else ground - low - z
            machine.walls = cut(self._solid.values(), ground + SKIRT * unit)
        if machine.grounded and ground is not None:
            low = min(point[2] for point in every)
            for joint in machine.joints.values():
                wheel = _wheel_at(machine, joint, points, low + TOUCH * unit)
                body = machine.link_of(joint)
                if wheel is not None and not self._grips(machine, ground, wheel):
                    machine.smooth = body
                elif wheel is not None:
                    machine.wheels.append(wheel)
            machine.wheels = list(self._pulling(machine))
            machine.solve = solution(machine.wheels)
            machine.is_steered = any(
                above in machine.joints.values()
                for wheel in machine.wheels
                for above in machine.above(wheel.carrier)
            )
            machine.scrubs = any(
                abs(wheel.sideways(motion)) > _SLIDES
                for motion in machine.solve
                for wheel in machine.wheels
            )

    def floors(self, machine: Machine) -> list[str]:
        """Return the paths of the shapes that a robot stands on."""
        x, y, z = machine.start.origin
        step = STEP_UP / self.scene.meters_per_unit
        spots = [(x, y), *((x + u, y + v) for u, v in (wheel.contact for wheel in machine.wheels))]
        return [
            path
            for path, surface in self._solid.items()
            if any(height_at((surface,), u, v, z + step) is not None for u, v in spots)
        ]

    def _grips(self, machine: Machine, ground: float, wheel: Wheel) -> bool:
        """Whether a shape of a wheel, or of its rollers, has friction on what it stands on."""
        (x, y), (u, v, _) = wheel.contact, machine.start.origin
        heights = {
            path: height_at((surface,), x + u, y + v, ground + LEVEL)
            for path, surface in self._solid.items()
        }
        below = [path for path, at in heights.items() if at is not None and at >= ground - LEVEL]
        shapes = [
            prim.path
            for body in machine.rest
            if wheel.joint in machine.above(body)
            for prim in self.scene.below(body)
            if collides(prim) and self.body_of(prim.path) == body
        ]
        floors = list(map(self._surface, below)) or [Surface()]
        return any(self._surface(shape).grips(floor) for shape in shapes for floor in floors)

    def _surface(self, shape: str) -> Surface:
        prims = self.scene.prims
        path = bound_material(shape, lambda at: prims[at].targets if at in prims else {})
        material = prims.get(path)
        is_physical = material is not None and MATERIAL_API in material.apis
        return surface_of(material.values if material is not None and is_physical else None)

    def _pulling(self, machine: Machine) -> Iterator[Wheel]:
        """Yield the wheels of a machine, those of weak drives with how these pull its weight."""
        masses = {
            body: max(0.0, number(self.bodies[body].values.get(MASS)) or 0.0)
            for body in machine.rest
        }
        driven = [wheel for wheel in machine.wheels if wheel.joint.holds]
        for wheel in machine.wheels:
            joint = wheel.joint
            if wheel in driven and joint.damping > 0 and not joint.stiffness:
                own = masses[machine.link_of(joint)]
                load = Load((sum(masses.values()) - own) / len(driven), own, wheel.radius)
                damping = math.degrees(joint.damping)
                pull = pull_of(load, joint.force, damping, is_acceleration=joint.is_acceleration)
                if pull.most * self.scene.meters_per_unit < PROMPT or pull.lag > SOON:
                    wheel = replace(wheel, pull=pull)  # noqa: PLW2901
            yield wheel

    def _points(self, body: str, machine: Machine) -> list[Vector]:
        """Return the corners of a body's collision shapes, with the base turned as at the start."""
        base = Affine(machine.start.rows)
        back = self.bodies[body].world.rigid().inverse()
        corners: list[Vector] = []
        for prim in self.scene.below(body):
            if collides(prim) and self.body_of(prim.path) == body:
                at = base.then(machine.rest[body]).then(back).then(prim.world)
                corners.extend(placed(prim, at).points())
        return corners


def is_pulled(scene: Scene) -> bool:
    """Whether gravity holds what stands on the ground: that of the first physics scene.

    Without one Isaac Sim makes one.
    """
    first = next((prim.values for prim in scene.prims.values() if prim.type == SCENE), {})
    return is_felt(first, scene.meters_per_unit) and is_down(first)


def _wheel_at(
    machine: Machine, joint: Joint, points: dict[str, list[Vector]], touch: float
) -> Wheel | None:
    """Return the wheel at a joint, or None where it does not touch or cannot roll."""
    body = machine.link_of(joint)
    low = min((point[2] for point in points[body]), default=math.inf)
    rollers = joint.rollers
    if joint.kind != HINGE or (rollers is None and low > touch):
        return None
    if joint.stiffness > 0 and joint.reach < math.radians(FAR):
        return None  # a spring holds it between limits: the knee of a leg
    inner = joint.bodies.index(body)
    carrier = joint.bodies[1 - inner]
    if any(above.rollers is not None for above in machine.above(carrier)):
        return None  # a roller of a wheel, which turns it out of the way
    frame = Affine(machine.start.rows).then(machine.rest[body]).then(joint.frames[inner])
    x, y, z = frame.origin
    axle = frame.turn(joint.axis)
    flat = math.hypot(axle[0], axle[1])
    if flat < _UPRIGHT:
        return None
    sign = 1.0 if inner else -1.0
    along, radius = (axle[1] / flat, -axle[0] / flat), (z - low) * flat
    if rollers is None:
        return Wheel(joint, sign, radius, along, (x, y), carrier)
    c, s = math.cos(rollers[0]), math.sin(rollers[0])
    grip = ((c * axle[0] - s * axle[1]) / flat, (s * axle[0] + c * axle[1]) / flat)
    return Wheel(joint, sign, rollers[1], along, (x, y), carrier, grip)
