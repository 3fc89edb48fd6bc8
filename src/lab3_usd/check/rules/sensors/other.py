"""Rules about sensors of kinds that have no rules of their own: an IMU, a contact sensor."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.sensors.placement import (
    left_behind_sensors,
    misplaced_sensors,
    misposed_sensors,
    missing_sensors,
    present_sensors,
    wrong_attributes,
    wrong_type_sensors,
)
from lab3_usd.check.scene.sensor_location import OTHER
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.finding import Problem


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
