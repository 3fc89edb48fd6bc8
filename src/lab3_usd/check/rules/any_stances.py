"""Rules about how robots stand and what they start in, with and without a lab."""

from __future__ import annotations

from collections.abc import Iterator
from posixpath import commonpath
from typing import TYPE_CHECKING

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject, ModelSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.world import SHAPE, at_rest, rests
from lab3_usd.facts.articulations import commands_of, driven_wheels
from lab3_usd.facts.robots import robots
from lab3_usd.facts.stances import INERTIA, driven_machines, machines
from lab3_usd.model.changes import Restore
from lab3_usd.model.finding import Place, Problem
from lab3_usd.model.physics import (
    CENTRE,
    GRAVITY,
    GRAVITY_DIRECTION,
    JOINT_ENABLED,
    MASS,
    SCENE,
    SLIDES_OFF,
    down,
    is_felt,
    is_switched_off,
    joints_at,
    number,
    slant,
    vector,
)
from lab3_usd.model.prims import upwards
from lab3_usd.model.transforms import vector_text
from lab3_usd.physics.unmodelled import inert

if TYPE_CHECKING:
    from lab3_usd.model.stage import StageModel
    from lab3_usd.physics.machine import Machine


@rule("Y01", "wheels-off-ground")
def wheels_off_ground(subject: LintSubject) -> Iterator[Problem]:
    """Something below its driven wheels carries the robot, or nothing does, and it tips over.

    Why: wheels have no suspension. A chassis or castors 0.3 mm below the wheels carry the robot,
    and the wheels turn in the air. A centre of mass outside the area between the contacts tips it.

    Fix: raise the shape named here, so that nothing reaches below the wheels, or lower the wheels.
    One castor lower than the wheels tips the robot a little, and it drives. Of a robot that tips
    over, correct masses and centres of mass, or add castors that collide.

    Example: the collision box of the chassis reaches 1 mm below the wheels.
    """
    stage = subject.stage
    for node, machine in driven_machines(stage):
        for problem in _carried(machine, stage):
            yield replace(problem, related=(*problem.related, node.path))
    # Those that tip over and that nothing commands.
    built = machines(stage)
    falling = [machine for machine in built.machines if machine.falls] if built is not None else []
    idle = (
        [each for each in robots(stage) if not commands_of((each.root,), stage)] if falling else []
    )
    wheels = {wheel.joint.link for robot in idle for wheel in robot.wheels}
    for machine in falling:
        if not wheels.isdisjoint(machine.rest):
            yield from _carried(machine, stage)


@rule("S31", "carried-by-other-parts", scope="stage", demands=rests, needs="wheels")
def carried_by_other_parts(subject: StageSubject) -> Iterator[Problem]:
    """Something below its wheels carries the robot, or nothing does, and it tips over.

    Why: wheels have no suspension. A chassis or castors 0.3 mm below the wheels carry the robot,
    and the wheels turn in the air. A centre of mass outside the area between the contacts tips it.

    Fix: set the shape named here, its link, and masses, to the values in the supplied file.

    Example: the collision box of `{robot}/{base}` reaches 1 mm below the wheels.
    """
    built = machines(subject.stage)
    if built is None:
        return
    for robot in subject.lab.scene.robots:
        rolling = map(robot.path_of, robot.wheels.joints.values())
        machine = next(filter(None, map(built.member.get, rolling)), None)
        below = f"{robot.path}/{robot.wheels.joints_below}"
        turned = [f"{below}/{name}" for name in robot.wheels.joints]
        parts = (robot.path, *map(robot.path_of, robot.links), *turned)
        for problem in _carried(machine, subject.stage) if machine is not None else ():
            body = built.body_of(problem.prim)
            yield replace(
                problem,
                handout=subject.lab.handout.behind("S19", robot.handout),
                related=(*problem.related, robot.path),
                fix=(Restore(problem.prim), Restore(body)) if body != problem.prim else (),
                unmet=(at_rest(robot),),
                assumes=(*problem.assumes, *((part, None) for part in parts)),
            )


def _carried(machine: Machine, stage: StageModel) -> Iterator[Problem]:
    """Yield what carries a robot in place of its wheels, or that nothing does.

    If the robot rests on a part whose joint is disabled, the joint is the fault.
    """
    tied = joints_at(machine.rest, stage) if machine.falls else ()
    is_tied = any(is_switched_off(joint, JOINT_ENABLED) for joint in tied)
    tips = machine.falls and not is_tied
    if machine.smooth or (machine.carrier is None and not tips):
        return
    path, text = machine.carrier or (
        machine.base,
        "nothing carries its centre of mass: it tips over",
    )
    weights: list[Place] = [(body, name) for body in machine.rest for name in (MASS, CENTRE)]
    parts = [*machine.rest, *(joint.path for joint in machine.parents.values())]
    shapes: list[Place] = [(f"{body}/", name) for body in machine.rest for name in SHAPE]
    yield Problem(
        path,
        text,
        expected="the weight on the wheels",
        related=() if path == machine.base else (machine.base,),
        assumes=(*((part, None) for part in parts), *shapes, *(weights if tips else ())),
        rests_on=stage.unknown_below(commonpath(machine.rest)),
    )


@rule("Y02", "ground-without-hold")
def ground_without_hold(subject: LintSubject) -> Iterator[Problem]:
    """The ground below a driven robot carries nothing.

    Why: the robot falls through. A mesh that does not move collides by its triangles, and a plane
    has a front: both have one side, by the order of the points and `orientation`, whatever
    `doubleSided` says. The robot does not collide with shapes of another physics scene.

    Fix: reverse the order of the points of the faces, or set `orientation` to the other hand; turn
    a plane so that it faces up; remove the target of Simulation Owner.

    Example: `orientation = "leftHanded"` of a floor whose points go round counterclockwise.

    Basis: PhysX was tried with such floors; `benchmarks/README.md` has the results.
    """
    for node, machine in driven_machines(subject.stage):
        if machine.no_ground is not None:
            path, why = machine.no_ground
            yield Problem(
                path,
                f"it {why}: the robot falls through",
                expected="a face that looks up, in the robot's physics scene",
                related=(machine.base, node.path),
                assumes=((path, "physics:simulationOwner"),),
                rests_on=subject.stage.unknown_outside(machine.base),
            )


@rule("Y03", "gravity")
def gravity(subject: LintSubject) -> Iterator[Problem]:
    """No gravity holds the driven robot on the ground.

    Why: without weight wheels do not pull. Only the schema's own value, -inf, is the earth's:
    another number below 0 pulls the other way, and the robot falls up.

    Fix: set Gravity Magnitude of the physics scene to 9.81 (981 in centimetres), and Gravity
    Direction to (0, 0, -1) where Z is up.

    Example: `physics:gravityMagnitude = -9.81`.
    """
    stage = subject.stage
    if not driven_wheels(stage):
        return
    for scene in [prim for prim in stage.of_type(SCENE) if prim.present][:1]:
        if not is_felt(scene.attributes, stage.meters_per_unit or 1.0):
            strength = f"{number(scene.attributes.get(GRAVITY)):g}"
            text = f"{GRAVITY} is {strength}, expected about {9.81 / stage.meters_per_unit:g}"
            yield Problem(scene.path, text, GRAVITY, actual=strength)
        elif slant(scene.attributes, stage.up_axis) > SLIDES_OFF:
            actual = vector_text(vector(scene.attributes.get(GRAVITY_DIRECTION)))
            right = vector_text(down(stage.up_axis))
            text = f"gravity pulls along {actual}, expected {right}"
            yield Problem(scene.path, text, GRAVITY_DIRECTION, right, actual)


@rule("Y04", "starts-inside", severity="warning")
@rule("S32", "starts-inside-another", scope="stage", severity="warning")
def starts_inside(subject: ModelSubject) -> Iterator[Problem]:
    """A robot starts inside a wall, a crate or another robot.

    Why: PhysX throws apart what overlaps when playing starts: the robot jumps some centimetres, or
    turns over.

    Fix: move the robot, or what it is inside of, so that their collision shapes do not overlap.

    Example: a wall that reaches 3 cm into the chassis.
    """
    built = machines(subject.stage)
    told: set[frozenset[str]] = set()
    for machine in built.machines if built is not None else ():
        for overlap in machine.inside:
            pair = frozenset((overlap.own, overlap.other))
            if pair in told:
                continue
            told.add(pair)
            shapes = (overlap.own, overlap.other)
            places = [(path, "xformOp:*") for shape in shapes for path in upwards(shape)]
            yield Problem(
                overlap.own,
                f"is {100 * overlap.depth:.2g} cm inside {overlap.other}",
                expected="shapes that do not overlap",
                related=(overlap.other,),
                assumes=(*places, *((joint.path, None) for joint in machine.parents.values())),
                rests_on=subject.stage.unknown(*shapes),
            )


@rule("Y05", "impossible-inertia", severity="warning")
@rule("S33", "inertia-of-no-body", scope="stage", severity="warning")
def impossible_inertia(subject: ModelSubject) -> Iterator[Problem]:
    """A body of a robot has an inertia that no body of its mass and size can have.

    Why: placeholders, as 1 kg m2 for a body of 30 g, hold the joint or throw the robot over.

    Fix: remove `physics:diagonalInertia` and `physics:principalAxes`, so that PhysX computes them
    from mass and shapes, or write the real values.

    Example: `physics:diagonalInertia = (1, 1, 1)` of a link of 30 g.
    """
    built = machines(subject.stage)
    if built is None:
        return
    for machine in built.machines:
        for path, text in inert(built, machine):
            yield Problem(
                path,
                text,
                property=INERTIA,
                expected="at most mass times size squared",
                assumes=((path, "physics:mass"), *((f"{path}/", name) for name in SHAPE)),
                rests_on=subject.stage.unknown_below(path),
            )
