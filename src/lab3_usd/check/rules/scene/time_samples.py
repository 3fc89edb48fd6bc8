"""The rule about time samples that change a value while the timeline plays."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import live_nodes
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import bodies_below
from lab3_usd.model.stage import AnimatedAttribute
from lab3_usd.spec.catalog import INPUT

_OPERATION, _ORDER = "xformOp:", "xformOpOrder"
_SENSOR = "omni:sensor:"


@rule("S30", "value-changes-with-time", scope="stage", severity="warning")
def value_changes_with_time(subject: StageSubject) -> Iterator[Problem]:
    """Time samples change a value while the timeline plays.

    Why: at Play the timeline runs over the samples, and the robot, a sensor or a setting no longer
    has its saved value. The value at the start is judged like any other. This rule reports later
    values: an error for the poses of the robot and the sensors and for sensor rates, otherwise a
    warning.

    Fix: select the prim, delete the keys of the attribute in the Curve Editor or the Timeline, and
    set the value again.

    Example: the lidar has a key at time 50 that puts it at (9, 9, 9).
    """
    for each in subject.stage.moving:
        severity = _severity(each, subject)
        if severity is not None and each.prim not in subject.faulty_prims:
            yield Problem(
                each.prim,
                f"{each.property} is {each.first} at the start and {each.then} at time "
                f"{each.time:g}, expected no time samples",
                property=each.property,
                expected=each.first,
                actual=each.then,
                severity=severity,
            )


def _severity(moving: AnimatedAttribute, subject: StageSubject) -> Severity | None:
    """Return how grave it is that the value changes, None where it matters to nothing."""
    stage = subject.stage
    if moving.prim in live_nodes(stage, subject.lab):
        return "warning" if moving.property.startswith(INPUT) else None
    prim = stage.prim(moving.prim)
    if prim is None:
        return None
    if moving.property.startswith(_OPERATION):
        order = prim.attributes.get(_ORDER)
        is_used = isinstance(order, tuple) and any(
            str(name).endswith(moving.property) for name in order
        )
        return _severity_of_place(moving.prim, subject) if is_used else None
    if moving.property not in prim.attributes:
        return None
    return "error" if moving.property in _rates(moving.prim, subject) else "warning"


def _severity_of_place(path: str, subject: StageSubject) -> Severity | None:
    stage, scene = subject.stage, subject.lab.scene
    robot = scene.robot.path
    sensors = [scene.sensors[name].path for name in subject.checkpoint.sensors]
    parts = [robot, *sensors, *bodies_below(stage, robot)]
    if any(is_at_or_below(part, path) for part in parts):
        return "error"
    is_solid = bool(bodies_below(stage, path)) or any(True for _ in stage.colliders.below(path))
    return "warning" if is_solid else None


def _rates(path: str, subject: StageSubject) -> list[str]:
    """Return the rates that the lab asks of the sensor at a path."""
    found = (subject.lab.sensors[name] for name in subject.checkpoint.sensors)
    return [
        name
        for sensor in found
        if sensor.path == path
        for name in sensor.required
        if name.startswith(_SENSOR)
    ]
