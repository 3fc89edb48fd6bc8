"""How a machine stands on the ground: what of it touches, which of that are wheels, what drags."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from msgspec import Struct

from lab3_usd.model.dry_run import AXES, HERE, Affine, Scene
from lab3_usd.model.physics import CENTRE, FAR, MASS, UNSET, number, vector
from lab3_usd.model.solids import Solid, solid_of
from lab3_usd.model.statics import Stand, standing
from lab3_usd.model.transforms import Vector, cross, dot, length, minus
from lab3_usd.physics.bodies import Bodies
from lab3_usd.physics.machine import FIXED, HINGE, SLIDER, Joint, Machine, Wheel

SPHERICAL = "PhysicsSphericalJoint"
UPRIGHT = 0.5  # of the flat part of an axle: one that stands steeper rolls nowhere
SWIVEL = 0.9  # of the upright part of an axis about which a wheel is steered or swivels
SPRUNG = 5e-3  # metres between wheels on springs and the lowest point of all
OFF_AXLE = 5e-3  # metres by which a tyre may be off its axle
ACROSS = math.cos(math.radians(10.0))  # between the axis of a tyre and its axle
ROUND = 0.9  # part of the largest radius of a tyre that its least is
SECTORS = 8  # in which a tyre of points is measured
DENSITY = 1000.0  # of a body without a mass, kilograms a cubic metre (UsdPhysics)
DENSITY_NAME = "physics:density"


class Stance(Struct, frozen=True):
    """How a machine stands.

    `solids` are its shapes by body, at the start with the base turned as it is; `stand` says what
    touches the ground, None where springs or the world carry it. `weights` are the parts of its
    weight by body.
    """

    solids: Mapping[str, Sequence[Solid]]
    stand: Stand | None
    centre: Vector
    masses: Mapping[str, float]
    centres: Mapping[str, Vector]  # of mass, by body, in the frame of `solids`

    @property
    def turn(self) -> Affine:
        """How it leans."""
        return HERE if self.stand is None else self.stand.turn

    def weight_on(self, bodies: Sequence[str]) -> float:
        """Return the part of the weight that is on the shapes of bodies."""
        if self.stand is None:
            return 0.0
        return sum(self.stand.loads.get(s.path, 0.0) for b in bodies for s in self.solids[b])


def shapes_of(bodies: Bodies, machine: Machine) -> dict[str, list[Solid]]:
    """Return the collision shapes of each body, with the base turned as at the start."""
    solids_of: dict[str, list[Solid]] = {}
    for body in machine.rest:
        place = bodies.authored_to_start(machine, body)
        solids = (solid_of(prim, place.then(prim.world)) for prim in bodies.shapes[body])
        solids_of[body] = [solid for solid in solids if solid is not None]
    return solids_of


def masses_of(
    scene: Scene, machine: Machine, solids: Mapping[str, Sequence[Solid]]
) -> tuple[dict[str, float], dict[str, Vector]]:
    """Return the mass of each body in kilograms, and its centre in the turned frame.

    What has no mass has that of its shapes, and without shapes 1 kg (PhysX).
    """
    unit = scene.meters_per_unit
    base = Affine(machine.start.rows)
    masses: dict[str, float] = {}
    centres: dict[str, Vector] = {}
    for body in machine.rest:
        values, own = scene.prims[body].values, solids[body]
        volumes = [each.volume * unit**3 for each in own]
        mass = number(values.get(MASS)) or 0.0
        density = number(values.get(DENSITY_NAME)) or 0.0
        if mass <= 0:
            mass = sum(volumes) * (density if density > 0 else DENSITY) if any(volumes) else 1.0
        at = base.then(machine.rest[body]).origin
        centre = vector(values.get(CENTRE))
        if CENTRE in values and max(map(abs, centre)) < UNSET:
            at = base.then(machine.rest[body]).point(centre)
        elif any(volumes):
            whole = sum(volumes)
            x, y, z = (
                sum(v * each.centre[k] for v, each in zip(volumes, own, strict=True)) / whole
                for k in range(3)
            )
            at = (x, y, z)
        masses[body] = mass
        centres[body] = at
    return masses, centres


def stance_of(scene: Scene, bodies: Bodies, machine: Machine) -> Stance:
    """Return how a machine stands on level ground."""
    solids = shapes_of(bodies, machine)
    masses, centres = masses_of(scene, machine, solids)
    total = sum(masses.values()) or 1.0
    x, y, z = (sum(m * centres[body][k] for body, m in masses.items()) / total for k in range(3))
    centre = (x, y, z)
    stand = None
    every = [shape for own in solids.values() for shape in own]
    if every and not machine.held and not _is_sprung(machine):
        stand = standing(every, centre, 1.0 / scene.meters_per_unit)
    return Stance(solids, stand, centre, masses, centres)


def _is_sprung(machine: Machine) -> bool:
    """Whether a wheel hangs on a joint that lets it go up and down."""
    start = Affine(machine.start.rows)
    for joint in machine.joints.values():
        if joint.kind != HINGE or not joint.holds or _is_spring(joint):
            continue
        carrier = joint.bodies[1 - joint.bodies.index(machine.link_of(joint))]
        for above in machine.above(carrier):
            inner = above.bodies.index(machine.link_of(above)) if above.kind != FIXED else 0
            frame = start.then(machine.rest[above.bodies[inner]]).then(above.frames[inner])
            lifts = abs(frame.turn(above.axis)[2])
            goes_up = above.kind == SLIDER and lifts > 1 - SWIVEL
            if goes_up or (above.kind == HINGE and lifts < SWIVEL and not above.locked):
                return above.limits[0] != above.limits[1]
    return False


def _is_spring(joint: Joint) -> bool:
    """Whether a drive holds a joint between limits, as the knee of a leg."""
    return joint.stiffness > 0 and joint.reach < math.radians(FAR)


class Contact(Struct, frozen=True):
    """A wheel, the shapes by which it touches, and what of them is no wheel's ('' for nothing)."""

    wheel: Wheel
    shapes: Sequence[Solid]
    odd: str = ""


def contact_of(machine: Machine, joint: Joint, stance: Stance, unit: float) -> Contact | None:
    """Return the wheel on a joint by which a machine touches the ground, None for none.

    `unit` is metres of the stage.
    """
    if joint.kind != HINGE or _is_spring(joint):
        return None
    link = machine.link_of(joint)
    inner = joint.bodies.index(link)
    carrier = joint.bodies[1 - inner]
    on_wheel = (
        j.rollers is not None or (j.damping > 0 >= j.stiffness) for j in machine.above(carrier)
    )
    if not joint.holds and any(on_wheel):
        return None  # a roller of a wheel, which turns it out of the way
    frame = Affine(machine.start.rows).then(machine.rest[link]).then(joint.frames[inner])
    axle = frame.turn(joint.axis)
    flat = math.hypot(axle[0], axle[1])
    if flat < UPRIGHT:
        return None
    parts = _parts(machine, joint, link)
    rollers = [body for body in machine.rest if body not in parts and joint in machine.above(body)]
    # A wheel without a shape of its own stands on what turns freely on it.
    is_bare = joint.holds and not any(stance.solids[body] for body in parts)
    hanging = [body for body in rollers if not machine.parents[body].holds]
    bodies = [*parts, *(rollers if joint.rollers is not None else hanging if is_bare else ())]
    shapes = [shape for body in bodies for shape in stance.solids[body]]
    touching = _touching(shapes, stance, unit)
    if not touching:
        return None
    sign = 1.0 if inner else -1.0
    x, y, _ = frame.origin
    if joint.rollers is not None and rollers:
        along = (axle[1] / flat, -axle[0] / flat)
        c, s = math.cos(joint.rollers[0]), math.sin(joint.rollers[0])
        grip = ((c * axle[0] - s * axle[1]) / flat, (s * axle[0] + c * axle[1]) / flat)
        wheel = Wheel(joint, sign, joint.rollers[1], along, (x, y), carrier, grip=grip)
        return Contact(wheel, [shape for shape, _ in touching])
    points = [point for _, at in touching for point in at]
    u, v, w = (sum(column) / len(points) for column in zip(*points, strict=True))
    leaning = stance.turn.then(frame)
    spin = cross(leaning.turn(joint.axis), minus((u, v, w), leaning.origin))
    radius = math.hypot(spin[0], spin[1])
    way = (-spin[0] / radius, -spin[1] / radius) if radius else (axle[1] / flat, -axle[0] / flat)
    wheel = Wheel(joint, sign, radius, way, (x, y), carrier)
    own = [shape for shape, _ in touching]
    rigid = [shape for shape in own if any(shape in stance.solids[body] for body in parts)]
    reasons = (_oddness(shape, frame.origin, axle, unit) for shape in rigid)
    odd = next(filter(None, reasons), "")
    return Contact(wheel, own, odd)


def _parts(machine: Machine, joint: Joint, link: str) -> list[str]:
    """Return the bodies that turn with a wheel: its link, and what is fixed to that."""
    bodies = [link]
    for body in bodies:
        bodies += [
            other
            for other, parent in machine.parents.items()
            if parent is not joint and parent.kind == FIXED and body in parent.bodies
            if other not in bodies and other != body
        ]
    return [body for body in bodies if body == link or joint in machine.above(body)]


def _touching(
    shapes: Sequence[Solid], stance: Stance, unit: float
) -> list[tuple[Solid, Sequence[Vector]]]:
    """Return the shapes that touch the ground, with the points at which they do."""
    if stance.stand is not None:
        at = stance.stand.touching
        return [(shape, at[shape.path]) for shape in shapes if shape.path in at]
    low = min((s.low for own in stance.solids.values() for s in own), default=0.0)
    near = low + SPRUNG / unit
    lowest: list[tuple[Solid, Sequence[Vector]]] = []
    for shape in shapes:
        if shape.low <= near:
            least = shape.low + 1e-4 / unit
            lowest.append((shape, [point for point in shape.lowest() if point[2] <= least]))
    return lowest


def _oddness(shape: Solid, at: Vector, axle: Vector, unit: float) -> str:
    """Say why a shape does not roll about an axle as a wheel does, '' where it does."""
    size = length(axle) or 1.0
    axle = (axle[0] / size, axle[1] / size, axle[2] / size)
    if shape.kind == "Cube":
        return "is a box, which does not roll as a wheel"
    if shape.kind in {"Cylinder", "Cone", "Capsule"}:
        ends = minus(shape.points[1], shape.points[0])
        far = length(ends)
        if far and abs(dot(ends, axle)) < ACROSS * far:
            return "lies across its axle"
    if shape.kind == "Mesh":
        return _unround(shape, at, axle)
    off = minus(shape.centre, at)
    along = dot(off, axle)
    aside = length(minus(off, (along * axle[0], along * axle[1], along * axle[2]))) * unit
    return f"is {1000 * aside:.3g} mm off its axle" if aside >= OFF_AXLE else ""


def _unround(shape: Solid, at: Vector, axle: Vector) -> str:
    """Say that a hull of points is not round about an axle, '' where it is."""
    aside = minus(AXES[2], (axle[2] * axle[0], axle[2] * axle[1], axle[2] * axle[2]))
    across = cross(axle, aside)
    radii = [0.0] * SECTORS
    for point in shape.points:
        off = minus(point, at)
        u, v = dot(off, aside), dot(off, across)
        sector = int((math.atan2(v, u) / math.tau % 1.0) * SECTORS) % SECTORS
        radii[sector] = max(radii[sector], math.hypot(u, v))
    if min(radii) < ROUND * max(radii):
        return "is not round about its axle"
    return ""


def moment_of(
    wheels: Sequence[Wheel],
    stance: Stance,
    machine: Machine,
    driven: Sequence[Wheel],
    *,
    is_along: bool,
) -> float:
    """Return the moment of the weight on wheels about the middle of the driven ones.

    It is that of what they push along their way, or of what holds them across it.
    """
    if not driven:
        return 0.0
    x, y = (sum(wheel.contact[k] for wheel in driven) / len(driven) for k in (0, 1))
    moment = 0.0
    for wheel in wheels:
        (dx, dy), (u, v) = (wheel.contact[0] - x, wheel.contact[1] - y), wheel.along
        arm = abs(dx * v - dy * u) if is_along else abs(dx * u + dy * v)
        moment += arm * stance.weight_on([machine.link_of(wheel.joint)])
    return moment
