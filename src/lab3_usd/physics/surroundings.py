"""What is around a robot where playing starts: what stops it, and what it is inside of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from lab3_usd.model.dry_run import AXES, Affine
from lab3_usd.model.solids import Solid
from lab3_usd.model.transforms import box_of
from lab3_usd.physics.bodies import has_collision
from lab3_usd.physics.machine import FIXED, Floor, Machine
from lab3_usd.physics.overlaps import Block, Overlap, block_of, box_around, overlaps
from lab3_usd.physics.stance import Stance, masses_of, shapes_of
from lab3_usd.physics.surfaces import cut, placed_surface
from lab3_usd.physics.unmodelled import filtered

if TYPE_CHECKING:
    from lab3_usd.physics.machines import Machines

SKIRT = 0.05  # metres above the ground at which walls stop a robot
STEP_UP = 0.05  # metres that the ground may be above a robot's origin
LEVEL = 1e-6  # metres between what carries a wheel and the ground
_HEAVY = 0.5  # part of a robot's mass, from which on a body may stop it
AROUND = 3.0  # metres in which others may be in the way
STEP = 0.01  # metres that the ground may rise or fall
_MANY_FACES = 5000  # of a mesh on which no step is looked for


def note_obstacles(machines: Machines, machine: Machine, stance: Stance, ground: float) -> None:
    """Note what stops a robot that drives: heavy bodies, steps, and where the ground ends."""
    if not machine.wheels or machine.is_given_ground:
        return
    unit = 1.0 / machines.scene.meters_per_unit
    own = _HEAVY * sum(stance.masses.values())
    for other in machines.near(machine):
        shapes = [prim for body in other.rest for prim in machines.bodies.shapes[body]]
        surfaces = [placed_surface(prim, prim.world) for prim in shapes]
        segments = cut(surfaces, ground + SKIRT * unit)
        if not segments:
            continue
        masses, _ = masses_of(machines.scene, other, shapes_of(machines.bodies, other))
        mass = sum(masses.values())
        if mass > own:
            machine.barriers[f"{other.base.rpartition('/')[2]} of {mass:.3g} kg"] = segments
    low, high = ground - STEP * unit, ground + SKIRT * unit
    near = {
        path: surface
        for path, surface in machines.solid.items()
        if surface.box[1][2] >= low and surface.box[0][2] <= high
    }
    planes = [s for path, s in near.items() if machines.scene.prims[path].type == "Plane"]
    is_flat = any(abs(plane.box[1][2] - ground) < LEVEL * unit for plane in planes)
    small = [surface for surface in near.values() if len(surface.counts) <= _MANY_FACES]
    if is_flat:
        small = [s for s in small if ground + STEP * unit < s.box[1][2] <= high]
    if small:
        goes_on = is_flat or len(small) < len(near)
        machine.floor = Floor(tuple(small), ground, unit, goes_on)


def overlaps_of(
    machines: Machines, machine: Machine, shapes: Mapping[str, Sequence[Solid]]
) -> Iterator[Overlap]:
    """Yield what a robot is inside of where playing starts; its ground is none of that.

    Of one that is held by the world only the links that move are thrown. Of other robots the first
    one: a heap of robots is told robot by robot.
    """
    scene = machines.scene
    start = Affine(AXES, machine.start.origin)
    own = [
        solid.moved(start)
        for body, solids in shapes.items()
        if not machine.held or any(joint.kind != FIXED for joint in machine.above(body))
        for solid in solids
    ]
    if not own:
        return
    low, high = box = box_of([corner for solid in own for corner in box_around(solid)])

    def deep(blocks: Iterable[Block | None]) -> Iterator[Overlap]:
        for overlap in overlaps(own, filter(None, blocks), scene.meters_per_unit):
            if not any(filtered(machines, [overlap.own], [overlap.other])):
                yield overlap

    step = start.origin[2] + STEP_UP / scene.meters_per_unit
    floors = machines.floors(machine)
    blocks: list[Block | None] = []
    for path, surface in machines.solid.items():
        at, to = surface.box
        is_ground = path in floors and to[2] <= step
        if not is_ground and all(low[k] < to[k] and at[k] < high[k] for k in range(3)):
            blocks.append(block_of(scene.prims[path], box, surface))
    yield from deep(blocks)
    for other in machines.near(machine):
        parts = (prim for body in other.rest for prim in scene.below(body))
        inside = list(deep(block_of(prim, box) for prim in parts if has_collision(prim)))
        yield from inside
        if inside:
            return
