"""Rules about prims of later parts, before the handout asks for them."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.sensor_location import (
    CAMERA,
    LIDAR,
    OTHER,
    find_sensor,
    is_named,
    later_sensors,
    lidars,
    sensor_candidates,
    sensors_of,
)
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.prims import Prim


@rule("S18", "starter-not-empty", scope="stage")
def starter_not_empty(subject: StageSubject) -> Iterator[Problem]:
    """The first checkpoint holds parts of later checkpoints.

    Why: the first checkpoint shows the supplied scene. Leftovers of a finished lab publish beside
    the student's own graphs: two clocks, two odometries, two parents of one frame.

    Fix: open the supplied file and save it as the first checkpoint before adding anything. Delete
    the prims named here.

    Example: `/World/ActionGraph` in `{stage0}`.
    """
    if subject.checkpoint.graphs:
        return
    spec = subject.lab.scene.forbidden.starter
    form = subject.lab.catalog.graph
    told = [graph.path for graph in subject.lab.graphs.values()]
    told = [path for path in told if (prim := subject.stage.prim(path)) and prim.type == form.type]
    for path, kind in sorted(_prims_and_nodes(subject)):
        is_sensor = any(kind == sensor.type for sensor in subject.lab.sensors.values())
        is_wrong = is_named(path.rpartition("/")[2], spec.names) or kind == form.type
        is_wrong = is_wrong or (path in spec.paths and not is_sensor)
        if is_wrong and not any(is_at_or_below(path, top) for top in told):
            told.append(path)
            message = f"{path} is not part of the supplied scene; was this saved late?"
            yield Problem(path, message, actual=kind, handout=spec.handout)


def _prims_and_nodes(subject: StageSubject) -> Iterator[tuple[str, str]]:
    """Yield path and type of everything in the scene, nodes of graphs included."""
    for prim in subject.stage.prims.values():
        if prim.present:
            yield prim.path, prim.type
    for node in subject.stage.nodes():
        yield node.path, ""


@rule("L08", "early-lidar", scope="stage", severity="warning")
def early_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a lidar before the handout asks for one.

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
    severity: Severity | None = None if subject.checkpoint.graphs else "error"
    message = f"{prim.path} belongs to a later checkpoint; was this saved late?"
    handout = subject.lab.scene.forbidden.starter.handout
    return Problem(prim.path, message, actual=prim.type, handout=handout, severity=severity)


@rule("C09", "early-camera", scope="stage", severity="warning")
def early_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot has a camera before the handout asks for one.

    Why: the file may have been saved late, after work on a later part had begun. A starter scene
    must not have the robot's camera.

    Fix: save each checkpoint before you start the next part.

    Example: `{camera}` in a checkpoint before the one that adds it.
    """
    yield from _early_on_robot(subject, CAMERA)


@rule("D07", "early-sensor", scope="stage", severity="warning")
def early_sensor(subject: StageSubject) -> Iterator[Problem]:
    """The robot has a sensor before the handout asks for one of its type.

    Why: the file may have been saved late, after work on a later part had begun. The supplied file
    must not contain the sensor.

    Fix: save each checkpoint before you start the next part.

    Example: an IMU on the robot in the checkpoint before the part that adds it.
    """
    yield from _early_on_robot(subject, OTHER)


def _early_on_robot(subject: StageSubject, kind: str) -> Iterator[Problem]:
    """Yield each prim of the robot that looks like a sensor of a later checkpoint."""
    lab, stage = subject.lab, subject.stage
    asked = [find_sensor(lab, stage, name) for name in subject.checkpoint.sensors]
    # What stands in the place of a sensor, or is one, is judged as that.
    others = {place.path for place in asked}
    others |= {place.prim.path for place in asked if place.prim is not None}
    found = {
        prim.path: prim
        for name in later_sensors(subject, kind)
        for prim in sensor_candidates(lab, stage, name)
    }
    for prim in found.values():
        # One of the world may have any name.
        if prim.path not in others and is_at_or_below(prim.path, lab.scene.robot.path):
            yield _early(subject, prim)
