"""Rules about sensors of other kinds, and what all sensors have in common.

Missing, misplaced, of another type.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.robot.poses import ORDER, RESET, PoseError, pose_errors, sensor_tolerance
from lab3_usd.check.robot.sensors import (
    OTHER,
    SensorLocation,
    candidate_transforms,
    find_sensor,
    sensors_of,
)
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.physics import BODY_API, BODY_ENABLED, bodies, is_switched_off, joints
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import absence_reason, is_unresolved, missing_graphs_text, same_value
from lab3_usd.spec.scene import SensorAttribute, SensorSpec


class PresentSensor(NamedTuple):
    """A sensor that the checkpoint asks for, and that the stage holds, with its place and prim."""

    name: str
    spec: SensorSpec
    place: SensorLocation
    prim: Prim


def present_sensors(subject: StageSubject, kind: str) -> Iterator[PresentSensor]:
    """Yield the sensors of a kind that the checkpoint asks for and the stage holds."""
    for name in sensors_of(subject, kind):
        place = find_sensor(subject.lab, subject.stage, name)
        if place.prim is not None:
            yield PresentSensor(name, subject.lab.sensors[name], place, place.prim)


def missing_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that is not in the scene; S01 reports a missing link."""
    stage = subject.stage
    for sensor in sensors_of(subject, kind):
        found = find_sensor(subject.lab, stage, sensor)
        if found.prim is not None or found.wrong_type_prim is not None:
            continue
        path, link = found.path, found.path.rpartition("/")[0]
        if stage.prim(link) is not None and not is_unresolved(stage, path):
            why, handout = absence_reason(stage, path), subject.lab.sensors[sensor].handout
            message = f"{path} {why}{missing_graphs_text(subject.missing_graphs, path)}"
            yield Problem(path, message, None, path, why, handout)


def misplaced_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that has another name or parent."""
    for _, spec, place, prim in present_sensors(subject, kind):
        parent, _, name = place.path.rpartition("/")
        what = [f"is named {prim.name}"] if prim.name != name else []
        if prim.parent != parent:
            what.append(f"hangs below {prim.parent or 'the root'}")
        if what:
            message = f"{name} {' and '.join(what)}, expected at {place.path}"
            expected, is_, related = place.path, prim.path, place.related
            yield Problem(prim.path, message, None, expected, is_, spec.handout, related)


def wrong_type_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each prim of another type at a sensor's path, where the sensor is nowhere else."""
    for sensor in sensors_of(subject, kind):
        found = find_sensor(subject.lab, subject.stage, sensor)
        spec = subject.lab.sensors[sensor]
        if found.prim is None and found.wrong_type_prim is not None:
            actual = found.wrong_type_prim.type or "a prim without a type"
            message = f"{found.path} is {actual}, expected {spec.type}"
            yield Problem(found.path, message, None, spec.type, actual, spec.handout)


def resets_xform_stack(prim: Prim) -> bool:
    """Whether a prim ignores the transforms of its parents, and so does not move with them."""
    order = prim.attributes.get(ORDER)
    return isinstance(order, tuple) and RESET in order


def left_behind_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that does not move with its link."""
    for found in present_sensors(subject, kind):
        yield from _left_behind(subject, found)


def _left_behind(subject: StageSubject, found: PresentSensor) -> Iterator[Problem]:
    prim, handout, related = found.prim, found.spec.pose.handout, found.place.related
    if resets_xform_stack(prim):
        message = f"{prim.name} has {RESET} in {ORDER}: "
        message += "it ignores its link and does not move with the robot"
        hint = f"take {RESET} out of {ORDER}, then set the place relative to the link"
        yield Problem(prim.path, message, ORDER, None, RESET, handout, related, hint=hint)
    elif _is_own_body(prim, subject):
        message = f"{prim.name} is a rigid body of its own: it does not move with its link"
        hint = "select the sensor and remove Rigid Body in the Property panel under Physics"
        yield Problem(prim.path, message, BODY_ENABLED, None, BODY_API, handout, related, hint=hint)


def _is_own_body(prim: Prim, subject: StageSubject) -> bool:
    if BODY_API not in prim.apis or is_switched_off(prim, BODY_ENABLED):
        return False
    return not any(prim.path in bodies(joint) for joint in joints(subject.stage))


def misposed_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each part of a sensor's pose that is wrong, seen from its link.

    One below another parent is judged by the transform that fits best.
    """
    tolerance = sensor_tolerance(subject.lab.scene, subject.stage)
    for found in present_sensors(subject, kind):
        if not resets_xform_stack(found.prim):
            transforms = candidate_transforms(subject.stage, found.place)
            pose = found.spec.pose
            judged = [
                [*pose_errors(found.prim, transform, pose, tolerance)] for transform in transforms
            ]
            for error in min(judged, key=len, default=[]):
                yield pose_problem(found, error)


def pose_problem(found: PresentSensor, error: PoseError) -> Problem:
    """Return one part of a sensor's pose that is wrong."""
    is_only = found.name == found.spec.kind  # `the lidar`, where the lab calls it so
    name, the = (found.name, "the ") if is_only else (found.prim.name, "")
    return Problem(
        found.prim.path,
        f"{name}'s {error.message} relative to its link",
        error.property,
        error.expected,
        error.actual,
        found.spec.pose.handout,
        found.place.related,
        hint=f"select {the}{name} and {error.hint}",
    )


def wrong_attributes(
    subject: StageSubject, found: PresentSensor, asked: Mapping[str, SensorAttribute]
) -> Iterator[Problem]:
    """Yield each attribute of a sensor with another value than the lab asks for.

    One that is asked only where it is written may be missing.
    """
    prim, related = found.prim, found.place.related
    for name, entry in asked.items():
        actual, wanted = prim.attributes.get(name), entry.value
        may_be_absent = entry.required is not True or is_unresolved(subject.stage, prim.path)
        if same_value(actual, wanted) or (actual is None and may_be_absent):
            continue
        expected, is_ = display(wanted), display(actual)
        why = "" if actual is not None else ", which leaves USD's own default"
        message = f"{name} is {is_}{why}, expected {expected}"
        yield Problem(prim.path, message, name, expected, is_, entry.handout, related)


@rule("D01", "missing-sensor", scope="stage")
def missing_sensor(subject: StageSubject) -> Iterator[Problem]:
    """A sensor of the robot is missing, deactivated, or only an over.

    Why: the node that reads the sensor finds no prim. Nothing is published on its topic.

    Fix: create the sensor as the handout says, rename it and drag it onto its link. For a
    deactivated sensor, right-click it in the Stage panel and choose Activate.

    Example: no `{sensor}` from the checkpoint on that adds it.
    """
    yield from missing_sensors(subject, OTHER)


@rule("D02", "misplaced-sensor", scope="stage")
def misplaced_sensor(subject: StageSubject) -> Iterator[Problem]:
    """A sensor of the robot has another name or parent than the handout asks for.

    Why: below another prim it measures from the wrong place. Graphs and the TF tree refer to it by
    its path. Its settings are still judged.

    Fix: rename it in the Stage panel, or drag it onto its link and accept the new parent.

    Example: `{world}/{sensor_name}` instead of `{sensor}`.
    """
    yield from misplaced_sensors(subject, OTHER)


@rule("D03", "sensor-type", scope="stage")
def sensor_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the path of a sensor is of another type.

    Why: the node that reads the sensor refuses a prim of another type. Nothing is published on its
    topic.

    Fix: delete the prim and create the sensor as the handout says.

    Example: an Xform named `Imu`.
    """
    yield from wrong_type_sensors(subject, OTHER)


@rule("D04", "sensor-pose", scope="stage")
def sensor_pose(subject: StageSubject) -> Iterator[Problem]:
    """A sensor is not at the handout's pose on its link, or does not move with it.

    Why: what the sensor measures is published in the frame of its link, and belongs to another
    place or direction. With `!resetXformStack!` the sensor ignores its link and stays where it is
    while the robot drives away. As a separate rigid body it falls.

    Fix: select the sensor and set Translate, Orient and Scale to the values of the handout. Remove
    `!resetXformStack!` from `xformOpOrder`, and remove Rigid Body.

    Example: an IMU turned by 90 degrees: driving ahead looks like driving to the side.
    """
    yield from left_behind_sensors(subject, OTHER)
    yield from misposed_sensors(subject, OTHER)


@rule("D05", "sensor-attribute", scope="stage")
def sensor_attribute(subject: StageSubject) -> Iterator[Problem]:
    """An attribute of a sensor does not have the handout's value.

    Why: the attributes set how often the sensor measures and what it leaves out.

    Fix: select the sensor, search the Property panel for the name given here and type the value.

    Example: `sensorPeriod` 0.1 on an IMU that should measure at each physics step.
    """
    for found in present_sensors(subject, OTHER):
        yield from wrong_attributes(subject, found, found.spec.required)


@rule("D06", "sensor-schema", scope="stage")
def sensor_schema(subject: StageSubject) -> Iterator[Problem]:
    """A sensor lacks an API schema that the handout asks for.

    Why: a prim without the schema is not recognised as this sensor, or misses its settings. If the
    sensor refers to an asset that cannot be found, nothing is reported: the asset may bring the
    schema.

    Fix: delete the prim and create the sensor as the handout says.

    Example: a prim typed by hand instead of created by the menu.
    """
    for _, spec, place, prim in present_sensors(subject, OTHER):
        for wanted in spec.required_apis:
            if wanted not in prim.apis and not is_unresolved(subject.stage, prim.path):
                message = f"{prim.name} lacks {wanted}"
                yield Problem(prim.path, message, None, wanted, None, spec.handout, place.related)
