"""Rules about what moves the robot: the drives of its wheels, and their grip on the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.robot.ground import highest_ground
from lab3_usd.check.robot.wheels import WheelJoint, turning_joints, wheel_problem
from lab3_usd.check.rules.any_physics import link_bodies
from lab3_usd.check.rules.robot_joints import drive_fault
from lab3_usd.check.rules.wheel_joints import of_each_joint
from lab3_usd.model.changes import ApplySchema, Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import Drive, JointFault, read_drive
from lab3_usd.model.physics import COLLISION_API, DAMPING, DRIVE_API, MAX_FORCE, collides
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import StageModel
from lab3_usd.model.traction import (
    DRIVE_TYPE,
    FRICTIONS,
    MATERIAL_API,
    Load,
    bound_material,
    pull_of,
    surface_of,
)

_DRIVEN = of_each_joint(stiffness="has stiffness 0", damping="has damping and force")


@rule("S10", "joint-drive", scope="robot", demands=_DRIVEN, needs="wheels")
def joint_drive(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel joint has no velocity drive, or a weak one.

    Why: velocity commands act through damping. Without damping or force the wheel ignores them;
    with stiffness it is pulled back to its start position. A drive of type acceleration considers
    only the inertia of the wheel: with a damping meant for type force it hardly moves the robot,
    and neither does a force or damping too small for its weight.

    Fix: select the joint, and under Drive > Angular set Stiffness to 0, Type to Force, and Damping
    and Max Force to the values in the supplied file. If the drive is missing, choose Add > Physics
    > Angular Drive.

    Example: `drive:angular:physics:damping` 0 on `{joint}`.
    """
    robot = subject.robot
    for joint, prim in turning_joints(subject).items():
        drive = read_drive(prim.type, prim.apis, prim.attributes)
        if not drive.api:
            asset = subject.stage.unknown(prim.path)
            fault = JointFault(f"{joint.name} has no angular drive", DAMPING, DRIVE_API)
            problem = wheel_problem(joint, robot, fault, "damping", rests_on=asset)
            yield replace(problem, fix=(ApplySchema(prim.path, DRIVE_API),))
            if asset is None:
                continue
        if drive.stiffness != 0:
            fault = drive_fault(joint.name, drive, "stiffness", drive.stiffness, "0")
            yield wheel_problem(joint, robot, fault, "stiffness")
        for word, value in (("damping", drive.damping), ("maxForce", drive.force)):
            if value is None or not value > 0:
                fault = drive_fault(joint.name, drive, word, value, "more than 0")
                asset = subject.stage.unknown_value(prim, f"{drive.start}{word}")
                yield wheel_problem(joint, robot, fault, "damping", rests_on=asset)
        yield from _weak_drive(joint, drive, subject)


_LEAST_PULL = 0.1  # metres a second squared: at half a second it goes 5 cm/s
_LONGEST_LAG = 0.5  # seconds in which a robot comes up to most of its speed


def _weak_drive(joint: WheelJoint, drive: Drive, subject: RobotSubject) -> Iterator[Problem]:
    """Say that a drive that is one does not move the robot's weight."""
    robot, stage = subject.robot, subject.stage
    boxes = list(stage.colliders.below(joint.link))
    weight = sum(link.mass or 0.0 for link in robot.links.values())
    if not boxes or not weight or stage.meters_per_unit != 1.0:
        return
    damping, force, is_acceleration = drive.damping, drive.force, drive.is_acceleration
    if not (damping and damping > 0 and force and force > 0):
        return
    own = robot.links[robot.link_at(joint.link)].mass or 0.0
    radius = max(box.high[2] - box.low[2] for box in boxes) / 2
    load = Load((weight - own) / len(robot.wheels.joints), own, radius)
    pull = pull_of(load, force, math.degrees(damping), is_acceleration=is_acceleration)
    name, expected, actual = DAMPING, "more", f"{damping:g}"
    message = f"damping is {damping:g}, too small for a robot of {weight:.2g} kg"
    if pull.lag > _LONGEST_LAG and is_acceleration:
        name, expected, actual = DRIVE_TYPE, "force", "acceleration"
        message = f"the drive is of type acceleration, expected force: with damping {damping:g}"
        message += f" it takes {pull.lag:.2g} s to move the robot"
    elif pull.lag <= _LONGEST_LAG and pull.most < _LEAST_PULL:
        name, actual = MAX_FORCE, f"{force:g}"
        message = (
            f"the drive's largest force is {force:g}, too small for a robot of {weight:.2g} kg"
        )
    elif pull.lag <= _LONGEST_LAG:
        return
    fault = JointFault(message, name, expected, actual)
    yield wheel_problem(joint, robot, fault, "damping")


@rule("S25", "wheel-grip", scope="robot", demands=link_bodies, needs="wheels")
def wheel_grip(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel has no friction on the ground.

    Why: the wheels turn, and the robot does not move, or slides. The Friction Combine Mode combines
    the two materials, by default to their mean, so a single frictionless material does no harm. An
    unauthored friction is 0.

    Fix: select the material and set Static Friction and Dynamic Friction to the values in the
    supplied file.

    Example: 0 for both frictions, of the material of the ground and of that of the tyres.
    """
    stage, robot = subject.stage, subject.robot
    ground = highest_ground(subject)
    if ground is None:
        return
    floor_material = _material(stage, ground[1])
    floor = surface_of(floor_material.attributes if floor_material is not None else None)
    slick: dict[str, list[str]] = {}  # wheels without friction, by the material of their shapes
    for name in robot.wheels.joints.values():
        link = robot.path_of(name)
        shapes = [part for part in stage.with_api(COLLISION_API) if is_at_or_below(part.path, link)]
        materials = [_material(stage, shape.path) for shape in shapes if collides(shape)]
        surfaces = [
            surface_of(None if material is None else material.attributes) for material in materials
        ]
        if surfaces and not any(surface.grips(floor) for surface in surfaces):
            of_wheel = next(
                (material for material in (*materials, floor_material) if material is not None),
                None,
            )
            slick.setdefault(of_wheel.path if of_wheel is not None else link, []).append(name)
    for site, names in slick.items():
        slides = dict.fromkeys((site, floor_material.path if floor_material else site))
        values = [(path, name) for path in slides for name in FRICTIONS]
        yield Problem(
            site,
            f"{' and '.join(names)} {'have' if names[1:] else 'has'} no friction on {ground[1]}",
            FRICTIONS[1],
            "above 0",
            handout=subject.lab.handout.behind("S25", robot.handout),
            related=(
                *map(robot.path_of, names),
                *(
                    f"{path}.{name}"
                    for path, name in values
                    if (path, name) != (site, FRICTIONS[1])
                ),
            ),
            fix=tuple(Restore(path, name) for path, name in values),
            unmet=tuple(f"{subject.robot.group}/collision/{name}" for name in names),
        )


def _material(stage: StageModel, shape: str) -> Prim | None:
    """Return the physics material of a shape, None for Isaac Sim's default."""

    def targets(path: str) -> Mapping[str, tuple[str, ...]]:
        prim = stage.prims.get(path)
        return {} if prim is None else prim.relationships

    prim = stage.prim(bound_material(shape, targets))
    return prim if prim is not None and prim.present and MATERIAL_API in prim.apis else None
