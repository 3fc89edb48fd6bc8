"""Everything that moves on a stage, and the current pose of each prim."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import product
from operator import itemgetter

from msgspec.structs import replace

from lab3_usd.model.dry_run import HERE, Affine, Scene
from lab3_usd.model.physics import (
    CENTRE,
    MASS,
    SLIDES_OFF,
    TILT,
    WEIGHTLESS,
    is_felt,
    number,
    slant,
)
from lab3_usd.model.statics import CONTACT, Stand
from lab3_usd.model.traction import (
    GRAVITY,
    MATERIAL_API,
    Load,
    Surface,
    bound_material,
    pull_of,
    surface_of,
)
from lab3_usd.model.transforms import Vector, cross, length, minus
from lab3_usd.physics.bodies import ROOT, Bodies, of_another_scene
from lab3_usd.physics.machine import FIXED, HINGE, Machine, Posture, Spot, Wheel, solution
from lab3_usd.physics.stance import (
    SPHERICAL,
    Contact,
    Stance,
    contact_of,
    moment_of,
    shapes_of,
    stance_of,
)
from lab3_usd.physics.surfaces import cut, ground_of, height_at, is_mirrored, placed_surface
from lab3_usd.physics.surroundings import AROUND, LEVEL, SKIRT, STEP_UP, note_obstacles, overlaps_of
from lab3_usd.physics.unmodelled import filters_of

_NOISE = 1e-5  # metres by which a robot may be above or below the ground at the start
_LIGHT = 1e-3  # part of the weight that is too little to hold anything
_HOLDS = 0.5  # part of what the wheels pull, from which on what drags may hold the robot
PROMPT = 2.0  # metres a second squared, from which on a drive is taken to be at its speed at once
SOON = 0.02  # seconds
_TURNS_TYRE = 0.6  # part of what turns a tyre on the spot, below which a drive may not steer it
_TURNS = (0.7, 1.3)  # of what the driven wheels can turn: what surely slides, and what surely holds
_SLIDES = 1e-4  # sideways for each unit that a wheel rolls, from which on it slides
STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Machines:
    """Everything that moves on a stage."""

    def __init__(self, scene: Scene, *, has_ground: bool = False) -> None:
        self.scene = scene
        self.has_ground = has_ground
        self.bodies = Bodies(scene)
        self._elsewhere = of_another_scene(scene, self.bodies)
        self.filters = tuple(filters_of(scene))
        self.solid = {
            prim.path: ground_of(prim, prim.world)
            for prim in self.bodies.shapes[""]
            if prim.path not in self._elsewhere
        }
        self.machines = self.bodies.machines()
        self.member = {body: machine for machine in self.machines for body in machine.rest}
        self._spots: dict[str, Spot] = {}
        self._postures: dict[str, Posture] | None = None
        self._awake: dict[str, Machine] = {}  # those that may move, by their bases
        self._articulations: dict[str, Machine | None] = {}
        self.stances: dict[str, Stance] = {}  # how each machine stands, by its base
        for machine in self.machines:
            self._set_down(machine)
        for machine in self.machines:
            self._look_inside(machine)
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
        return self.bodies.of(path)

    def articulation(self, path: str) -> Machine | None:
        """Return the articulation at or below a prim.

        Its root may be the joint that fixes it to the world (UsdPhysics, ArticulationRootAPI). One
        without joints that move is left out.
        """
        machine = self._articulation(path)
        return machine if machine is not None and machine.joints else None

    def viewed(self, path: str) -> Machine | None:
        """Return the articulation at or below a prim, or of which that is a link or a joint.

        NVIDIA-Omniverse/PhysX, BaseSimulationView.cpp, `getArticulationAtPath`. Of a prim above the
        root lint says that a view may not find it.
        """
        machine = self._articulation(path)
        if machine is not None:
            return machine
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
                bodies = [
                    *reversed(prim.ends),
                    *(below.path for below in self.scene.below(prim.path)),
                ]
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
                local = self.bodies.prims[body].world.rigid().inverse().then(local)
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
        every: list[Vector] = []
        for body in machine.rest:
            place = self.bodies.authored_to_start(machine, body)
            for prim in self.bodies.shapes[body]:
                every += placed_surface(prim, place.then(prim.world)).points()
        if not every or not machine.joints:
            return
        xs, ys = [corner[0] for corner in every], [corner[1] for corner in every]
        machine.middle = u, v = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        machine.radius = max(math.hypot(x - u, y - v) for x, y in zip(xs, ys, strict=True))
        # Without a physics scene Isaac Sim makes one.
        gravity = self.scene.physics
        is_felt_here = is_felt(gravity, self.scene.meters_per_unit)
        machine.pulled = is_felt_here and slant(gravity) <= SLIDES_OFF
        if not machine.pulled:
            return
        unit = 1.0 / self.scene.meters_per_unit
        x, y, z = machine.start.origin
        low = min(point[2] for point in every)
        ground = height_at(self.solid.values(), x, y, z + STEP_UP * unit)
        if ground is None:
            machine.no_ground = self._no_ground(x, y, z + STEP_UP * unit)
        if ground is None and self.has_ground and not machine.held and machine.no_ground is None:
            machine.is_given_ground = True
            ground = z + low
        if ground is None:
            machine.grounded = machine.held
        else:
            stance = stance_of(self.scene, self.bodies, machine)
            self.stances[machine.base] = stance
            high = -low if stance.stand is None else stance.stand.height
            home = ground + high - z
            is_level = machine.held or abs(home) < _NOISE * unit
            machine.home = 0.0 if is_level else home
            machine.walls = cut(self.solid.values(), ground + SKIRT * unit)
            if machine.grounded:
                self._stand(machine, stance, ground)
                note_obstacles(self, machine, stance, ground)

    def _look_inside(self, machine: Machine) -> None:
        """See whether a robot starts inside of something, which throws it out."""
        if not machine.joints:
            return
        stance = self.stances.get(machine.base)
        shapes = shapes_of(self.bodies, machine) if stance is None else stance.solids
        machine.inside = tuple(overlaps_of(self, machine, shapes))
        for overlap in machine.inside:
            text = f"it starts {100 * overlap.depth:.2g} cm inside {overlap.other}"
            machine.unclear[overlap.own] = f"{text}, and is thrown out of there"

    def _no_ground(self, x: float, y: float, below: float) -> tuple[str, str] | None:
        """Return the shape that is below a place and carries nothing, and why; None for none."""
        for path, surface in self.solid.items():
            if height_at((replace(surface, side=0),), x, y, below) is not None:
                return path, "has its faces turned down: a mesh or a plane has one side"
        for path, why in self._elsewhere.items():
            prim = self.scene.prims[path]
            if height_at((placed_surface(prim, prim.world),), x, y, below) is not None:
                return path, why
        return None

    def _stand(self, machine: Machine, stance: Stance, ground: float) -> None:
        """See by which wheels a machine stands on the ground, and what else carries it."""
        unit = self.scene.meters_per_unit
        rolling: list[str] = []
        touching = (contact_of(machine, joint, stance, unit) for joint in machine.joints.values())
        for contact in filter(None, touching):
            wheel, body = contact.wheel, machine.link_of(contact.wheel.joint)
            rolling += [shape.path for shape in contact.shapes]
            if contact.odd:
                machine.unclear[body] = f"{contact.shapes[0].path.rpartition('/')[2]} {contact.odd}"
            self._steered_weakly(machine, contact, stance)
            if not self._grips(machine, ground, wheel):
                machine.smooth = body
            else:
                machine.wheels.append(wheel)
        for path in self.floors(machine):
            prim = self.scene.prims[path]
            if prim.type == "Mesh" and is_mirrored(prim.world):
                machine.unclear[path] = "it is mirrored: which side of it carries is not known"
        aside = slant(self.scene.physics)
        if aside > TILT:
            machine.unclear[machine.base] = f"gravity pulls {aside:.0f} degrees aside"
        machine.falls = stance.stand is not None and stance.stand.falls
        weightless = next(self._unweighed(machine, stance), "") if machine.falls else ""
        if weightless:
            machine.unclear[weightless] = (
                f"no collider and no {MASS} tells its weight, and the robot may tip over by it"
            )
            machine.falls = False
        if stance.stand is not None:
            machine.lean = stance.stand.lean
            self._weigh(machine, stance, stance.stand, rolling)
        if machine.falls:
            machine.wheels = []
        machine.wheels = list(self._trailing(machine, stance))
        machine.wheels = list(self._pulling(machine))
        machine.solve = solution(machine.wheels)
        machine.is_steered = any(
            above in machine.joints.values() and above.holds and not wheel.trails
            for wheel in machine.wheels
            for above in machine.above(wheel.carrier)
        )
        machine.scrubs = machine.scrubs or any(
            abs(wheel.sideways(motion)) > _SLIDES
            for motion in machine.solve
            for wheel in machine.wheels
        )

    def _unweighed(self, machine: Machine, stance: Stance) -> Iterator[str]:
        """Yield the bodies of which no mass, centre or collider says what they weigh, and where."""
        for body in machine.rest:
            values = self.bodies.prims[body].values
            is_told = bool(stance.solids[body]) or bool({MASS, CENTRE} & values.keys())
            if values.get(WEIGHTLESS) is True or not is_told:
                yield body

    def _trailing(self, machine: Machine, stance: Stance) -> Iterator[Wheel]:
        """Yield the wheels, those without a drive by what they do in a turn.

        A castor swivels or is a ball, and a steered wheel rules the turn. A free wheel that stands
        still in its carrier slides where the driven ones have the longer lever.
        """
        free = [wheel for wheel in machine.wheels if not wheel.joint.holds]
        driven = [wheel for wheel in machine.wheels if wheel.joint.holds]
        fixed = [w for w in free if not any(j.kind != FIXED for j in machine.above(w.carrier))]
        lever = moment_of(driven, stance, machine, driven, is_along=True)
        brake = moment_of(fixed, stance, machine, driven, is_along=False)
        slides = bool(fixed and driven) and brake < _TURNS[0] * lever
        if fixed and driven and not slides and brake < _TURNS[1] * lever:
            path = fixed[0].joint.path
            machine.unclear[path] = "its wheel is dragged aside in a turn, by about what drives it"
        machine.scrubs = slides
        for wheel in machine.wheels:
            castors = [joint for joint in machine.above(wheel.carrier) if not joint.holds]
            swivels = any(j.kind != FIXED for j in castors)
            is_free = not wheel.joint.holds
            trails = is_free and (swivels or (slides and wheel in fixed))
            yield replace(wheel, trails=True) if trails else wheel

    def _steered_weakly(self, machine: Machine, contact: Contact, stance: Stance) -> None:
        """See whether a joint that steers a wheel could turn its tyre on the spot."""
        shape = contact.shapes[0]
        link = machine.link_of(contact.wheel.joint)
        ends = (shape.points[0], shape.points[-1]) if shape.radii else ()
        width = length(minus(*ends)) if len(ends) > 1 else 0.0
        weight = stance.weight_on([link]) * sum(stance.masses.values()) * GRAVITY
        scrub = self._surface(shape.path).friction * weight * width * self.scene.meters_per_unit / 4
        for joint in machine.above(contact.wheel.carrier):
            if joint.kind == HINGE and joint.stiffness > 0 and not joint.locked:
                force = joint.force * self.scene.meters_per_unit**2
                if force < _TURNS_TYRE * scrub:
                    text = f"its drive has {force:.2g} N m to steer a tyre that takes about"
                    machine.unclear[joint.path] = f"{text} {scrub:.2g}"

    def _weigh(self, machine: Machine, stance: Stance, stand: Stand, rolling: list[str]) -> None:
        """See whether what does not roll carries so much that it holds the wheels."""
        loads = {path: load for path, load in stand.loads.items() if load > _LIGHT}
        on_balls = {
            shape.path
            for body, own in stance.solids.items()
            for shape in own
            if any(joint.kind == SPHERICAL for joint in machine.above(body))
        }
        driven = {
            shape.path
            for wheel in machine.wheels
            if wheel.joint.holds
            for body, own in stance.solids.items()
            if wheel.joint in machine.above(body)
            for shape in own
        }
        floors = [self._surface(path) for path in self.floors(machine)] or [Surface()]
        grip = {
            path: max(self._surface(path).combined(floor) for floor in floors) for path in loads
        }
        pulls = sum(loads[path] * grip[path] for path in loads if path in driven)
        dragged = {path: loads[path] for path in loads if path not in {*rolling, *on_balls}}
        drags = sum(load * grip[path] for path, load in dragged.items())
        if not drags or drags < _HOLDS * pulls:
            return
        path, load = max(dragged.items(), key=itemgetter(1))
        whole = f"{100 * load:.0f} % of the weight"
        low = self._below_wheels(path, stance, machine)
        text = f"{path.rpartition('/')[2]}{low} carries {whole} and does not roll"
        if drags >= pulls:
            machine.carrier, machine.wheels = (path, text), []
        else:
            machine.unclear[path] = text

    def _below_wheels(self, path: str, stance: Stance, machine: Machine) -> str:
        """Say how far a shape reaches below the driven wheels, '' where it does not."""
        lows = {shape.path: shape.low for own in stance.solids.values() for shape in own}
        wheels = [
            shape.low
            for joint in machine.joints.values()
            if joint.kind == HINGE and joint.holds
            for shape in stance.solids[machine.link_of(joint)]
        ]
        below = (min(wheels) - lows[path]) * self.scene.meters_per_unit if wheels else 0.0
        return f", {1000 * below:.2g} mm below the wheels," if below > CONTACT else ""

    def near(self, machine: Machine) -> Iterator[Machine]:
        """Yield the other machines that may be in the way of one, in their order."""
        x, y = _square(machine, self.scene)
        squares = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        places = (place for square in squares for place in self._squares.get(square, ()))
        for other in (self.machines[place] for place in sorted(places)):
            away = length(minus(machine.start.origin, other.start.origin))
            if other is not machine and away < AROUND / self.scene.meters_per_unit:
                yield other

    @cached_property
    def _squares(self) -> Mapping[tuple[int, int], Sequence[int]]:
        """The machines by where they start, in squares as wide as others may be in the way."""
        squares: dict[tuple[int, int], list[int]] = {}
        for place, machine in enumerate(self.machines):
            squares.setdefault(_square(machine, self.scene), []).append(place)
        return squares

    def floors(self, machine: Machine) -> list[str]:
        """Return the paths of the shapes that a robot stands on."""
        x, y, z = machine.start.origin
        step = STEP_UP / self.scene.meters_per_unit
        spots = [(x, y), *((x + u, y + v) for u, v in (wheel.contact for wheel in machine.wheels))]
        return [
            path
            for path, surface in self.solid.items()
            if any(height_at((surface,), u, v, z + step) is not None for u, v in spots)
        ]

    def _grips(self, machine: Machine, ground: float, wheel: Wheel) -> bool:
        """Whether a shape of a wheel, or of its rollers, has friction on what it stands on."""
        (x, y), (u, v, _) = wheel.contact, machine.start.origin
        heights = {
            path: height_at((surface,), x + u, y + v, ground + LEVEL)
            for path, surface in self.solid.items()
        }
        below = [path for path, at in heights.items() if at is not None and at >= ground - LEVEL]
        turning = (body for body in machine.rest if wheel.joint in machine.above(body))
        shapes = [prim.path for body in turning for prim in self.bodies.shapes[body]]
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
            body: max(0.0, number(self.bodies.prims[body].values.get(MASS)) or 0.0)
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


def _square(machine: Machine, scene: Scene) -> tuple[int, int]:
    x, y, _ = machine.start.origin
    side = AROUND / scene.meters_per_unit
    return math.floor(x / side), math.floor(y / side)
