"""Rules about what PhysX makes of bodies, shapes and joints, with and without a lab."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import ModelSubject, StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.model.changes import ApplySchema, Restore
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.physics import (
    BODIES,
    BODY_API,
    COLLISION_API,
    MASS,
    MASS_API,
    SCENE,
    bodies,
    collides,
    is_body,
    joints,
    numbers,
)
from lab3_usd.model.prims import Prim, is_at_or_below, upwards
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import decompose

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Checkpoint, Lab

_PHYSICAL = frozenset({BODY_API, COLLISION_API, MASS_API})
_OWNER = "physics:simulationOwner"
_MASSES = (MASS, "physics:density", "physics:diagonalInertia")
_ROUND = ("Sphere", "Capsule", "Cone")  # shapes of one radius in all directions
_TUBE, _AXIS, _AXES = "Cylinder", "axis", "XYZ"  # its length may have a scale of its own
_UNEVEN = 0.01  # of a scale


def link_bodies(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    """Yield what is asked of each link by itself."""
    del checkpoint
    for robot in lab.scene.robots:
        group = robot.group
        for name, link in robot.links.items():
            path = robot.path_of(name)
            yield Demand(f"{group}/body/{name}", f"{name} is a rigid body", path, robot.handout)
            if link.mass is not None:
                title = f"{name} weighs {link.mass:g} kg"
                yield Demand(f"{group}/mass/{name}", title, path, link.handout)
            if link.collision:
                title = f"{name} has collision geometry"
                yield Demand(f"{group}/collision/{name}", title, path, link.handout)


@rule("K96", "simulation-owner")
def simulation_owner(subject: ModelSubject) -> Iterator[Problem]:
    """A body of joints, its shape, joint or ground belongs to no physics scene, or to another.

    Why: PhysX makes no body and no shape whose owner is not a physics scene. Where a stage has two
    scenes, it makes no joint between bodies of different owners, and no articulation of them; a
    body without an owner has another one than a body with. A robot falls through ground of another
    scene.

    Fix: in the Property panel, remove the target of Simulation Owner, or choose the one physics
    scene for all bodies of the robot.

    Example: `physics:simulationOwner` of a wheel names `/World/physicsScene_01`, which was deleted.

    Basis: NVIDIA-Omniverse/PhysX, `usdLoad/PhysicsBody.cpp:285-295, 600`, `Collision.cpp:396-406`,
    `Joint.cpp:132-140` and `Articulation.cpp:34-66`.
    """
    stage = subject.stage
    lost: dict[tuple[str, bool], list[Prim]] = {}
    for prim in (*_tied_prims(stage), *_still_shapes(stage)):
        is_asked = prim.present and not {BODY_API, COLLISION_API}.isdisjoint(prim.apis)
        owners = prim.relationships.get(_OWNER, ()) if is_asked else ()
        owning = [owner for owner in map(stage.prim, owners) if owner is not None]
        if owners and not any(owner.present and owner.type == SCENE for owner in owning):
            lost.setdefault((owners[0], is_body(prim)), []).append(prim)
    for (owner, are_bodies), prims in lost.items():
        kind = "body" if are_bodies else "shape"
        more = f", and of {len(prims) - 1} more" if prims[1:] else ""
        yield Problem(
            prims[0].path,
            f"{_OWNER} is {owner}, which is not a physics scene: PhysX makes no {kind} of it{more}",
            property=_OWNER,
            expected="no target, or a physics scene",
            actual=owner,
            related=tuple(prim.path for prim in prims[1:]),
            covers=tuple((prim.path, _OWNER) for prim in prims[1:]),
            rests_on=stage.unknown(owner),
        )
    scenes = [prim for prim in stage.of_type(SCENE) if prim.present]
    yield from _of_other_scenes(stage, [scene.path for scene in scenes])
    for joint in joints(stage) if len(scenes) > 1 else ():
        ends = [stage.prim(path) for path in bodies(joint)]
        owners = tuple(next(iter(end.relationships.get(_OWNER, ())), "") for end in ends if end)
        if len(owners) == len(BODIES) and len({*owners}) > 1:
            whose = [f"owner {owner}" if owner else "no simulation owner" for owner in owners]
            pairs = zip(bodies(joint), whose, strict=True)
            first, second = (f"{path} ({owner})" for path, owner in pairs)
            yield Problem(
                joint.path,
                f"connects {first} with {second}: PhysX creates no joint across scenes",
                expected="one simulation owner",
                related=bodies(joint),
                assumes=tuple((path, _OWNER) for path in bodies(joint)),
                rests_on=stage.unknown(*bodies(joint)),
            )


def _still_shapes(stage: StageModel) -> Sequence[Prim]:
    """Return the shapes that no body moves, where a stage has bodies that joints tie."""
    shapes = stage.with_api(COLLISION_API) if _tied_bodies(stage) else ()
    return [shape for shape in shapes if not joined_bodies(stage).carrier(shape.path)]


def _of_other_scenes(stage: StageModel, scenes: Sequence[str]) -> Iterator[Problem]:
    """Yield the ground and the walls of a physics scene to which no robot belongs."""
    if len(scenes) < len(BODIES):
        return
    bodies_of = (stage.prims[path] for path in sorted(_tied_bodies(stage)) if stage.prim(path))
    owners = {next(iter(body.relationships.get(_OWNER, ())), scenes[0]) for body in bodies_of}
    for shape in _still_shapes(stage) if len(owners) == 1 else ():
        owner = next(iter(shape.relationships.get(_OWNER, ())), "")
        if owner in scenes and owner not in owners and collides(shape):
            yield Problem(
                shape.path,
                f"belongs to the physics scene {owner}, and the robot to {next(iter(owners))}: "
                "it is not there for the robot",
                property=_OWNER,
                expected=next(iter(owners)),
                actual=owner,
                rests_on=stage.unknown(shape.path),
            )


@rule("S28", "robot-of-no-scene", scope="stage", demands=link_bodies)
def robot_of_no_scene(subject: StageSubject) -> Iterator[Problem]:
    """A body, shape, joint or ground belongs to no physics scene, or to another.

    Why: PhysX makes no body and no shape whose owner is not a physics scene, and no joint between
    bodies of different scenes. The robot falls apart, or through the ground.

    Fix: in the Property panel, remove the target of Simulation Owner.

    Example: `physics:simulationOwner` of `{robot}/{link}` names a scene that was deleted.

    Basis: NVIDIA-Omniverse/PhysX, `usdLoad/PhysicsBody.cpp:285-295, 600` and `Joint.cpp:132-140`.
    """
    for problem in simulation_owner(subject):
        places = (problem.prim, *problem.related)
        robot = next(filter(None, map(subject.lab.scene.robot_of, places)), None)
        links = [] if robot is None else [*robot.links]
        unmet = tuple(
            f"{robot.group}/body/{link}"
            for link in links
            if robot and any(is_at_or_below(path, robot.path_of(link)) for path in places)
        )
        fix = tuple(Restore(path, _OWNER) for path in places if problem.property)
        yield replace(problem, handout=robot and robot.handout, fix=fix, unmet=unmet)


@rule("K97", "ignored-physics", severity="warning")
@rule("S27", "physics-not-as-written", scope="stage", severity="warning")
def ignored_physics(subject: ModelSubject) -> Iterator[Problem]:
    """PhysX interprets a jointed body, its collider or a joint differently from the file.

    Why: of two bodies at one end of a joint PhysX uses the first. It ignores a negative mass,
    density or inertia, and a mass without PhysicsMassAPI: the mass is then computed from the
    shapes, or is 1 kg. For the radius of a round shape it uses the largest scale, so an unevenly
    scaled one is larger than it looks.

    Fix: name one body, write the mass in kilograms, and give a shape its size by radius and height
    instead of a scale.

    Example: a cylinder that is scaled 1, 2, 1 across its axis.

    Basis: NVIDIA-Omniverse/PhysX, `omni.usdphysics/plugins/Joint.cpp:118-134`,
    `Collision.cpp:86-310`, and `usdLoad/Mass.cpp:50-90, 465`.
    """
    stage = subject.stage
    for joint in joints(stage):
        for name in BODIES:
            targets = joint.relationships.get(name, ())
            if len(targets) > 1:
                yield Problem(
                    joint.path,
                    f"{name} names {' and '.join(targets)}, of which the first counts",
                    property=name,
                    expected="one body",
                    actual=", ".join(targets),
                )
    for shape in _tied_prims(stage):
        if shape.present and not {MASS_API, BODY_API}.isdisjoint(shape.apis):
            yield from _ignored_masses(shape, stage)
        scale = _uneven(shape) if collides(shape) else ""
        if scale:
            yield Problem(
                shape.path,
                f"is scaled {scale}: PhysX uses the largest as the factor of its radius",
                expected="an even scale",
                actual=scale,
                assumes=tuple((above, "xformOp:*") for above in upwards(shape.parent)),
            )


def _ignored_masses(prim: Prim, stage: StageModel) -> Iterator[Problem]:
    """Yield what is written of the mass of a prim and has no effect."""
    held = prim.attributes
    written = {
        name: numbers(value if isinstance(value, tuple) else (value,))
        for name, value in held.items()
        if name in _MASSES
    }
    for name, parts in written.items():
        if any(part < 0 for part in parts):
            yield Problem(
                prim.path,
                f"{name} is {display(held[name])}, below 0: PhysX ignores it",
                property=name,
                expected="above 0",
                actual=display(held[name]),
                assumes=((prim.path, name),),
            )
    idle = [name for name, parts in written.items() if any(parts)]
    if idle and MASS_API not in prim.apis:
        yield Problem(
            prim.path,
            f"{' and '.join(idle)} {'has' if len(idle) == 1 else 'have'} no effect without "
            f"{MASS_API}",
            property=idle[0],
            expected=MASS_API,
            fix=(ApplySchema(prim.path, MASS_API),),
            assumes=tuple((prim.path, name) for name in idle),
            rests_on=stage.unknown(prim.path),
        )


@once_per_stage
def _tied_bodies(stage: StageModel) -> frozenset[str]:
    return frozenset(path for joint in joints(stage) for path in bodies(joint) if path)


@once_per_stage
def _tied_prims(stage: StageModel) -> tuple[Prim, ...]:
    """Return the bodies that joints tie, and the prims with shapes or masses that belong to one."""
    carrier, tied = joined_bodies(stage).carrier, _tied_bodies(stage)
    physical = stage.with_api(_PHYSICAL.__contains__)
    return tuple(prim for prim in physical if carrier(prim.path) in tied)


def _uneven(shape: Prim) -> str:
    """Return the scale of a round shape that has no radius by it, '' for an even one."""
    if shape.world is None or shape.type not in {*_ROUND, _TUBE}:
        return ""
    scale = decompose(shape.world).scale
    along = _AXES.find(str(shape.attributes.get(_AXIS, "Z"))) if shape.type == _TUBE else -1
    across = [abs(part) for index, part in enumerate(scale) if index != along]
    is_even = max(across) - min(across) <= _UNEVEN * max(across)
    return "" if is_even else ", ".join(f"{part:g}" for part in scale)
