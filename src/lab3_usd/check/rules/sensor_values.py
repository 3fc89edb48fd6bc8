"""Rules about the values of all sensors, by their schemas and their models."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.robot.sensors import CAMERA, LIDAR, OTHER
from lab3_usd.check.rules.sensors import PresentSensor, present_sensors
from lab3_usd.facts.sensor_faults import faults_of
from lab3_usd.facts.sensor_values import values_of
from lab3_usd.model.changes import Restore
from lab3_usd.model.finding import Problem, Severity, display
from lab3_usd.model.stage import same_value


def refused_values(
    sensor: PresentSensor, subject: StageSubject, *severities: Severity
) -> Iterator[Problem]:
    """Yield values that the sensor's model refuses or ignores, of these severities.

    A value that the lab asks for is reported as such, where it has another.
    """
    prim, spec = sensor.prim, sensor.spec
    faults = [each for each in faults_of(prim, subject.stage) if each.severity in severities]
    values = values_of(prim, subject.stage)
    other = {
        name
        for name, entry in spec.required.items()
        if name in prim.attributes and not same_value(values.get(name), entry.value)
    }
    lab = {name: entry.value for name, entry in spec.attributes.items()}
    changed = {
        name
        for name in (*prim.attributes, *lab)
        if not same_value(prim.attributes.get(name), lab.get(name))
    }
    for fault in faults:
        if other & {*fault.attributes}:
            continue
        name = next(iter(fault.attributes), None)
        yield Problem(
            prim.path,
            fault.message,
            name,
            fault.expected,
            None if name is None else display(prim.attributes.get(name)),
            spec.scan.handout if spec.scan else spec.handout,
            sensor.place.related,
            severity=fault.severity,
            fix=tuple(
                Restore(prim.path, each)
                for each in fault.attributes
                if each in changed or (fault.is_type and each in lab)
            ),
            rests_on=subject.stage.unknown(prim.path) if fault.is_open else None,
        )


@rule("D08", "sensor-value", scope="stage", severity="warning")
def sensor_value(subject: StageSubject) -> Iterator[Problem]:
    """A sensor has a value or attribute unknown to its model.

    Why: attributes outside the schema, and invalid tokens, are ignored. NVIDIA's rules for Isaac
    Sim 6.2 refuse the other values, or this release is known to fail with them. Another name of the
    model is a note. A value of another type is an error, since the model does not start.

    Fix: select the sensor, search the Property panel for the name given here and type the expected
    value. Remove an attribute that no schema has.

    Example: `omni:sensor:Core:nearRange` instead of `omni:sensor:Core:nearRangeM`.

    Basis: NVIDIA's rules of Isaac Sim 6.2 (`lidar_sensor_rules.py`), and the schemas of 6.0.1.
    """
    for kind in (LIDAR, CAMERA, OTHER):
        for sensor in present_sensors(subject, kind):
            errors: tuple[Severity, ...] = () if kind == LIDAR else ("error",)
            yield from refused_values(sensor, subject, *errors, "warning", "note")
