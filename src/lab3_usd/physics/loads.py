"""Whether the drives of joints hold the weight that hangs on them, by statics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from lab3_usd.model.dry_run import Affine, Scene
from lab3_usd.model.physics import EARTH, GRAVITY, WEIGHTLESS, number, slant
from lab3_usd.model.traction import GRAVITY as EARTHS
from lab3_usd.model.transforms import cross, dot, minus
from lab3_usd.physics.bodies import Bodies
from lab3_usd.physics.machine import HINGE, SLIDER, Joint, Machine
from lab3_usd.physics.stance import Stance, stance_of

FAR = {HINGE: 0.3, SLIDER: 0.05}  # radians and metres to which joints are taken to have gone
HELD = {HINGE: 0.05, SLIDER: 0.01}  # by which the weight may pull one off its place
SPARE = 0.5  # part of its force that a drive may need to hold the weight: it also moves it
SURELY = 2.0  # times that, from which on it is a fault


class Burden(NamedTuple):
    """A joint whose drive does not hold what hangs on it, why, and whether that is sure."""

    joint: Joint
    text: str
    is_sure: bool


def burdens(scene: Scene, machine: Machine, names: Iterable[str]) -> Iterator[Burden]:
    """Yield the joints of these names that the weight on them pulls off their places.

    The weight is taken where all joints have gone a little, one way or the other.
    """
    bodies = Bodies(scene)
    stance = stance_of(scene, bodies, machine)
    joints = [machine.joints[name] for name in names if name in machine.joints]
    held = [j for j in joints if j.kind in FAR and j.stiffness > 0 and not j.locked]
    for joint in held:
        loads = [_load(scene, machine, stance, joint, side) for side in (-1.0, 0.0, 1.0)]
        load = max(abs(value) for value, _ in loads)
        surely = min(abs(value) for value, _ in loads) > joint.force
        unit = scene.meters_per_unit
        shown = load * (unit**2 if joint.kind == HINGE else unit)
        named = "N m" if joint.kind == HINGE else "N"
        if not joint.is_acceleration and load > SPARE * joint.force:
            text = f"its drive has a force of at most {joint.force:g}, and the weight on it is"
            yield Burden(joint, f"{text} {shown:.3g} {named}", surely)
            continue
        spring = math.degrees(joint.stiffness) if joint.kind == HINGE else joint.stiffness
        if joint.is_acceleration:
            spring *= max(inertia for _, inertia in loads)
        off = load / spring if spring else math.inf
        off *= unit if joint.kind == SLIDER else 1.0
        if off > HELD[joint.kind]:
            far = f"{off:.2g} {'rad' if joint.kind == HINGE else 'm'}"
            text = f"the weight on it, {shown:.3g} {named}, pulls it off by {far} with a stiffness"
            sure = off > SURELY * HELD[joint.kind] and not joint.is_acceleration
            yield Burden(joint, f"{text} of {joint.stiffness:g}", sure)
        elif not joint.damping:
            text = f"nothing damps it, and the weight on it is {shown:.3g} {named}"
            yield Burden(joint, text, is_sure=False)


def _load(
    scene: Scene, machine: Machine, stance: Stance, joint: Joint, side: float
) -> tuple[float, float]:
    """Return the torque or force of the weight on a joint, and the inertia that hangs on it."""
    positions = _positions(machine, side, scene.meters_per_unit)
    link = machine.link_of(joint)
    inner = joint.bodies.index(link)
    start = Affine(machine.start.rows)
    frame = start.then(machine.offset(link, positions)).then(joint.frames[inner])
    axis = frame.turn(joint.axis)
    strength = number(scene.physics.get(GRAVITY))
    size = EARTHS / scene.meters_per_unit if strength is None or strength <= EARTH else strength
    pull = (0.0, 0.0, -size * math.cos(math.radians(slant(scene.physics))))
    torque = inertia = 0.0
    for body, mass in stance.masses.items():
        if joint not in machine.above(body):
            continue
        rest = start.then(machine.rest[body]).inverse()
        at = start.then(machine.offset(body, positions)).then(rest).point(stance.centres[body])
        arm = minus(at, frame.origin)
        turning = cross(axis, arm)
        inertia += mass * (dot(turning, turning) if joint.kind == HINGE else 1.0)
        if scene.prims[body].values.get(WEIGHTLESS) is not True:
            torque += mass * dot(pull, turning if joint.kind == HINGE else axis)
    return torque, inertia


def _positions(machine: Machine, side: float, unit: float) -> Mapping[str, float]:
    """Return where the bodies on driven joints are when all have gone to one side."""
    positions: dict[str, float] = {}
    for body, joint in machine.parents.items():
        if joint.kind in FAR and joint.stiffness > 0:
            far = FAR[joint.kind] / (unit if joint.kind == SLIDER else 1.0)
            low, high = joint.limits
            positions[body] = max(low, min(high, side * far))
    return positions
