"""Rules about sensors of other kinds, and what all sensors have in common.

Missing, misplaced, of another type, or there before the handout asks for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, Demands, rule
from lab3_usd.check.repairs import restorable, restoration
from lab3_usd.check.robot.location import demanded_prims
from lab3_usd.check.robot.poses import (
    OPERATIONS,
    ORDER,
    RESET,
    PoseError,
)
from lab3_usd.check.robot.sensors import (
    CAMERA,
    LIDAR,
    OTHER,
    SensorLocation,
    View,
    enclosing,
    find_sensor,
    judging_kind,
    later_sensors,
    lidars,
    misfits,
    sensor_candidates,
    sensor_group,
    sensors_of,
)
from lab3_usd.check.rules.graphs import with_missing_graphs
from lab3_usd.model.changes import ApplySchema, MovePrim, RemovePrim, RemoveSchema, Restore
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.physics import BODY_API, BODY_ENABLED, bodies, is_switched_off, joints
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import absence_reason, listed_once, once_per_stage, same_value
from lab3_usd.model.transforms import Part
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import PoseSpec, SensorAttribute, SensorSpec

EMPTY = "Scene/empty"  # the requirement that the first checkpoint holds nothing of later ones
POSITION, ROTATION = "position", "rotation"
_PARTS: Mapping[Part, str] = {"translate": POSITION, "rotate": ROTATION, "scale": "scale"}


def part_of_pose(group: str, kind: Part) -> str:
    """Return the id of the requirement about one part of a pose."""
    return f"{group}/{_PARTS[kind]}"


def pose_demands(group: str, path: str, pose: PoseSpec) -> Iterator[Demand]:
    """Yield position, rotation and scale of a prim."""
    for kind in OPERATIONS:
        title = f"{path.rpartition('/')[2]}: {_PARTS[kind]} {getattr(pose, kind)}"
        yield Demand(part_of_pose(group, kind), title, path, pose.handout)


def attribute_demand(group: str, name: str) -> str:
    """Return the id of the requirement about an attribute of a sensor."""
    return f"{group}/{name.rpartition(':')[2]}"


def sensor_demands(kind: str, of_sensor: Callable[[SensorSpec, str], Iterator[Demand]]) -> Demands:
    """Return the demands of all sensors of a kind, each by its description and its group."""

    def demands(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
        for sensor in checkpoint.sensors:
            if judging_kind(lab.sensors[sensor]) == kind:
                yield from of_sensor(lab.sensors[sensor], sensor_group(lab, sensor))

    return demands


def sensor_prim(spec: SensorSpec, group: str) -> Iterator[Demand]:
    """Yield that the sensor is at its path."""
    yield Demand(f"{group}/prim", f"{spec.path} exists", spec.path, spec.handout)


def sensor_place(spec: SensorSpec, group: str) -> Iterator[Demand]:
    """Yield the parts of the sensor's pose."""
    yield from pose_demands(group, spec.path, spec.pose)


def sensor_values(spec: SensorSpec, group: str) -> Iterator[Demand]:
    """Yield the attributes that the handout gives a value."""
    for name, entry in spec.required.items():
        value = list(entry.value) if isinstance(entry.value, tuple) else entry.value
        title = f"{group}: {name} {value}"
        yield Demand(attribute_demand(group, name), title, spec.path, entry.handout)


class PresentSensor(NamedTuple):
    """A sensor that the checkpoint asks for, and that the stage holds, with its place and prim.

    `group` is that of its requirements.
    """

    name: str
    group: str
    spec: SensorSpec
    place: SensorLocation
    prim: Prim


@once_per_stage
def present_sensors(subject: StageSubject, kind: str) -> tuple[PresentSensor, ...]:
    """Return the sensors of a kind that the checkpoint asks for and the stage holds."""
    lab = subject.lab
    places = {name: find_sensor(subject.stage, lab, name) for name in sensors_of(subject, kind)}
    return tuple(
        PresentSensor(name, sensor_group(lab, name), lab.sensors[name], place, place.prim)
        for name, place in places.items()
        if place.prim is not None
    )


def missing_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that is not in the scene; S01 reports a missing link."""
    stage = subject.stage
    gone = [path for path in demanded_prims(subject.lab) if stage.prim(path) is None]
    for sensor in sensors_of(subject, kind):
        location = find_sensor(stage, subject.lab, sensor)
        if location.prim is not None or location.wrong_type_prim is not None:
            continue
        path = location.path
        if not any(is_at_or_below(path, above) for above in gone):
            reason = absence_reason(stage, path)
            problem = Problem(
                path,
                f"{path} {reason}",
                expected=path,
                actual=reason,
                handout=subject.lab.sensors[sensor].handout,
                fix=(restoration(path, stage),),
                absent=True,
                rests_on=stage.unknown(path),
            )
            yield with_missing_graphs(problem, subject)


def misplaced_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that has another name or parent."""
    for sensor in present_sensors(subject, kind):
        prim, path = sensor.prim, sensor.place.path
        parent, _, name = path.rpartition("/")
        faults, ways = [], []
        if prim.name != name:
            faults.append(f"is named {prim.name}")
            ways.append(f"rename it to {name}")
        if prim.parent != parent:
            faults.append(f"hangs below {prim.parent or 'the root'}")
            ways.append(f"drag it onto {parent}, and accept the new parent")
        if faults:
            yield Problem(
                prim.path,
                f"{name} {' and '.join(faults)}, expected at {path}",
                expected=path,
                actual=prim.path,
                handout=sensor.spec.handout,
                related=sensor.place.related,
                hint=f"in the Stage panel, {' and '.join(ways)}",
                fix=(MovePrim(prim.path, path),),
                unmet=(f"{sensor.group}/prim",),
            )


def wrong_type_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each prim of another type at a sensor's path, where the sensor is nowhere else."""
    for sensor in sensors_of(subject, kind):
        location = find_sensor(subject.stage, subject.lab, sensor)
        spec = subject.lab.sensors[sensor]
        if location.prim is None and location.wrong_type_prim is not None:
            actual = location.wrong_type_prim.type or "a prim without a type"
            message = f"{location.path} is {actual}, expected {spec.type}"
            fix, path = (Restore(location.path),), location.path
            yield Problem(
                path, message, None, spec.type, actual, spec.handout, fix=fix, absent=True
            )


def resets_xform_stack(prim: Prim) -> bool:
    """Whether a prim ignores the transforms of its parents, and so does not move with them."""
    order = prim.attributes.get(ORDER)
    return isinstance(order, tuple) and RESET in order


def left_behind_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each sensor that does not move with its link."""
    for sensor in present_sensors(subject, kind):
        prim = sensor.prim
        if resets_xform_stack(prim):
            message = f"{prim.name} has {RESET} in {ORDER}: it ignores its link and does not move"
            message += " with the robot"
            hint = f"take {RESET} out of {ORDER}, then set the place relative to the link"
            problem = Problem(prim.path, message, ORDER, actual=RESET, hint=hint)
        elif (
            BODY_API in prim.apis
            and not is_switched_off(prim, BODY_ENABLED)
            and not any(prim.path in bodies(joint) for joint in joints(subject.stage))
        ):
            message = f"{prim.name} is a rigid body of its own: it does not move with its link"
            hint = f"select {prim.name}, and remove Rigid Body in the Property panel"
            fix = (RemoveSchema(prim.path, BODY_API),)
            problem = Problem(prim.path, message, BODY_ENABLED, actual=BODY_API, hint=hint, fix=fix)
        else:
            continue
        unmet, related = f"{sensor.group}/{POSITION}", sensor.place.related
        yield restorable(problem, sensor.spec.pose.handout, unmet, related=related)


def enclosed_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each shape that stands right around a sensor and is no part of the robot's looks."""
    for sensor in present_sensors(subject, kind):
        robot = subject.robot_of(sensor.prim.path)
        for shape in enclosing(sensor.prim, robot) if robot is not None else ():
            yield Problem(
                shape.path,
                f"{shape.name} encloses {sensor.prim.name}, which sees nothing else",
                expected="nothing around the sensor",
                actual=shape.type,
                handout=sensor.spec.handout,
                related=(sensor.prim.path,),
                fix=(RemovePrim(shape.path),),
            )


def misposed_sensors(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each part of a sensor's pose that is wrong, seen from its link.

    One below another parent is judged by the transform that fits best.
    """
    for sensor, error in pose_errors_of(subject, kind):
        yield pose_problem(sensor, error)


@listed_once
def pose_errors_of(
    subject: StageSubject, kind: str
) -> Iterator[tuple[PresentSensor, PoseError | View]]:
    """Yield what is wrong with the poses and views of sensors that move with their links."""
    for sensor in present_sensors(subject, kind):
        if not resets_xform_stack(sensor.prim):
            for error in misfits(subject, sensor.spec, sensor.place):
                yield sensor, error


def pose_problem(sensor: PresentSensor, error: PoseError | View) -> Problem:
    """Return one part of a sensor's pose that is wrong, or its view."""
    related, handout = sensor.place.related, sensor.spec.pose.handout
    if isinstance(error, View):
        site, name, hint = sensor.prim.path, error.property, error.hint
        problem = Problem(site, error.message, name, error.expected, error.actual, hint=hint)
        return restorable(problem, handout, f"{sensor.group}/{ROTATION}", related=related)
    is_only = sensor.name == sensor.spec.kind  # `the lidar`, where the lab calls it so
    name, the = (sensor.name, "the ") if is_only else (sensor.prim.name, "")
    problem = Problem(
        sensor.prim.path,
        f"{name}'s {error.message} relative to its {sensor.place.carrier}",
        error.property,
        error.expected,
        error.actual,
        hint=f"select {the}{name} and {error.hint}",
    )
    return restorable(problem, handout, part_of_pose(sensor.group, error.kind), related=related)


def wrong_attributes(
    subject: StageSubject,
    sensor: PresentSensor,
    required: Mapping[str, SensorAttribute],
    value_of: Callable[[str], Any],
) -> Iterator[Problem]:
    """Yield each attribute of a sensor with another value than the lab asks for.

    One that is asked only where it is written may be missing. `value_of` tells what one has.
    """
    prim, related = sensor.prim, sensor.place.related
    for name, entry in required.items():
        actual, wanted, value = prim.attributes.get(name), entry.value, value_of(name)
        if same_value(value, wanted) or (value is None and entry.required is not True):
            continue
        expected, actual_text = display(wanted), display(actual)
        default_text = "" if actual is not None else ", which leaves the default of its schema"
        message = f"{name} is {actual_text}{default_text}, expected {expected}"
        problem = Problem(prim.path, message, name, expected, actual_text)
        unmet, asset = attribute_demand(sensor.group, name), subject.stage.unknown_value(prim, name)
        yield restorable(problem, entry.handout, unmet, related=related, rests_on=asset)


def missing_schemas(
    subject: StageSubject, sensor: PresentSensor, wanted: Mapping[str, str]
) -> Iterator[Problem]:
    """Yield each schema that a sensor lacks; `wanted` maps them to their requirements."""
    prim = sensor.prim
    for schema, demand in wanted.items():
        if schema not in prim.apis:
            yield Problem(
                prim.path,
                f"{prim.name} lacks {schema}",
                expected=schema,
                handout=sensor.spec.handout,
                related=sensor.place.related,
                fix=(ApplySchema(prim.path, schema),),
                unmet=(demand,),
                rests_on=subject.stage.unknown(prim.path),
            )


@rule("D01", "missing-sensor", scope="stage", demands=sensor_demands(OTHER, sensor_prim))
def missing_sensor(subject: StageSubject) -> Iterator[Problem]:
    """The robot lacks an active sensor.

    Why: the node that reads the sensor finds no prim. Nothing is published on its topic.

    Fix: create the sensor as the handout says, rename it and drag it onto its link. For a
    deactivated sensor, right-click it in the Stage panel and choose Activate.

    Example: no `{sensor}` from the checkpoint on that adds it.
    """
    yield from missing_sensors(subject, OTHER)


@rule("D02", "misplaced-sensor", scope="stage")
def misplaced_sensor(subject: StageSubject) -> Iterator[Problem]:
    """A sensor has another name or parent.

    Why: below another prim it measures from the wrong place. Graphs and the TF tree refer to it by
    its path. Its settings are still judged.

    Fix: rename it in the Stage panel, or drag it onto its link and accept the new parent.

    Example: `{world}/{sensor_name}` instead of `{sensor}`.
    """
    yield from misplaced_sensors(subject, OTHER)


@rule("D03", "sensor-type", scope="stage")
def sensor_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at a sensor's path has another type.

    Why: the node that reads the sensor refuses a prim of another type. Nothing is published on its
    topic.

    Fix: delete the prim and create the sensor as the handout says.

    Example: an Xform named `Imu`.
    """
    yield from wrong_type_sensors(subject, OTHER)


@rule("D04", "sensor-pose", scope="stage", demands=sensor_demands(OTHER, sensor_place))
def sensor_pose(subject: StageSubject) -> Iterator[Problem]:
    """A sensor has another pose, or does not follow its link.

    Why: the data is published in the frame of its link, but belongs to another place or direction.
    With `!resetXformStack!` the sensor ignores its link and stays where it is while the robot moves
    away. As a separate rigid body it falls.

    Fix: select the sensor and set Translate, Orient and Scale to the values of the handout. Remove
    `!resetXformStack!` from `xformOpOrder`, and remove Rigid Body.

    Example: an IMU turned by 90 degrees: driving ahead looks like driving to the side.
    """
    yield from left_behind_sensors(subject, OTHER)
    yield from misposed_sensors(subject, OTHER)


@rule("D05", "sensor-attribute", scope="stage", demands=sensor_demands(OTHER, sensor_values))
def sensor_attribute(subject: StageSubject) -> Iterator[Problem]:
    """An attribute of a sensor has another value.

    Why: the attributes set how often the sensor measures and what it leaves out.

    Fix: select the sensor, search the Property panel for the name given here and type the value.

    Example: `sensorPeriod` 0.1 on an IMU that should measure at each physics step.
    """
    for sensor in present_sensors(subject, OTHER):
        yield from wrong_attributes(
            subject, sensor, sensor.spec.required, sensor.prim.attributes.get
        )


def _schemas(spec: SensorSpec, group: str) -> Iterator[Demand]:
    for api in spec.required_apis:
        yield Demand(f"{group}/{api}", f"{group} has {api}", spec.path, spec.handout)


@rule("D06", "sensor-schema", scope="stage", demands=sensor_demands(OTHER, _schemas))
def sensor_schema(subject: StageSubject) -> Iterator[Problem]:
    """A sensor lacks a required API schema.

    Why: a prim without the schema is not recognised as this sensor, or misses its settings. If the
    sensor refers to an asset that cannot be found, nothing is reported: the asset may bring the
    schema.

    Fix: delete the prim and create the sensor as the handout says.

    Example: a prim typed by hand instead of created by the menu.
    """
    for sensor in present_sensors(subject, OTHER):
        wanted = {api: f"{sensor.group}/{api}" for api in sensor.spec.required_apis}
        yield from missing_schemas(subject, sensor, wanted)


@rule("L08", "early-lidar", scope="stage", severity="warning")
def early_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The robot has a lidar too early.

    Why: the file may have been saved late, after work on a later part had begun. A starter scene
    must not contain a lidar.

    Fix: save each checkpoint before you start the next part.

    Example: `{lidar}` in a checkpoint before the one that adds it.
    """
    later = later_sensors(subject, LIDAR)
    paths = [subject.lab.sensors[name].path for name in later]
    is_first = not sensors_of(subject, LIDAR)
    for prim in lidars(subject) if later else ():
        # Beside a lidar that is asked for, any other place is that of a second lidar.
        if is_first or prim.path in paths:
            yield _early(subject, prim)


def _early(subject: StageSubject, prim: Prim) -> Problem:
    """Return that a sensor is there too early: an error in the starter."""
    return Problem(
        prim.path,
        f"{prim.path} belongs to a later checkpoint; was this saved late?",
        actual=prim.type,
        handout=subject.lab.scene.forbidden.starter.handout,
        severity=None if subject.checkpoint.graphs else "error",
        fix=(RemovePrim(prim.path),),
        unmet=(EMPTY,),
    )


@rule("C09", "early-camera", scope="stage", severity="warning")
def early_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot has a camera too early.

    Why: the file may have been saved late, after work on a later part had begun. A starter scene
    must not have the robot's camera.

    Fix: save each checkpoint before you start the next part.

    Example: `{camera}` in a checkpoint before the one that adds it.
    """
    yield from _early_on_robot(subject, CAMERA)


@rule("D07", "early-sensor", scope="stage", severity="warning")
def early_sensor(subject: StageSubject) -> Iterator[Problem]:
    """The robot has a sensor too early.

    Why: the file may have been saved late, after work on a later part had begun. The supplied file
    must not contain the sensor.

    Fix: save each checkpoint before you start the next part.

    Example: an IMU on the robot in the checkpoint before the part that adds it.
    """
    yield from _early_on_robot(subject, OTHER)


def _early_on_robot(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each prim of the robot that looks like a sensor of a later checkpoint."""
    lab, stage = subject.lab, subject.stage
    places = [find_sensor(stage, lab, name) for name in subject.checkpoint.sensors]
    # What stands in the place of a sensor, or is one, is judged as that.
    sensor_paths = {place.path for place in places}
    sensor_paths |= {place.prim.path for place in places if place.prim is not None}
    candidates = {
        prim.path: prim
        for name in later_sensors(subject, kind)
        for prim in sensor_candidates(lab, stage, name)
    }
    for prim in candidates.values():
        # One of the world may have any name.
        if prim.path not in sensor_paths and lab.scene.robot_of(prim.path):
            yield _early(subject, prim)
