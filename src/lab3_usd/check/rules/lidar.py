"""Rules about the 2D lidar.

One, at its path, with the rates and values by which it gives the scan that the lab needs.
"""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.lab_topics import once_there
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.repairs import restorable
from lab3_usd.check.robot.poses import units_of
from lab3_usd.check.robot.sensors import LIDAR, blind_range, place_of, second_lidars, sensor_group
from lab3_usd.check.rules.sensor_values import refused_values
from lab3_usd.check.rules.sensors import (
    PresentSensor,
    enclosed_sensors,
    left_behind_sensors,
    misplaced_sensors,
    misposed_sensors,
    missing_schemas,
    missing_sensors,
    present_sensors,
    sensor_demands,
    sensor_place,
    sensor_prim,
    sensor_values,
    wrong_attributes,
    wrong_type_sensors,
)
from lab3_usd.facts.sensor_values import SensorValues, listed_entries, reading_rates, values_of
from lab3_usd.isaac.releases import order
from lab3_usd.model.changes import RemovePrim, Restore
from lab3_usd.model.finding import Place, Problem, display
from lab3_usd.model.physics import numbers
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import same_value
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import ScanSpec, SensorSpec


@rule("L01", "missing-lidar", scope="stage", demands=sensor_demands(LIDAR, sensor_prim))
def missing_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The robot has no active lidar.

    Why: the lidar graph renders nothing, and no scan is published.

    Fix: create the lidar of the handout with Create > Sensors > RTX Lidar{lidar_menu}, rename the
    prim to `{lidar_name}` and drag it onto `{lidar_link}`. For a deactivated lidar, right-click it
    in the Stage panel and choose Activate.

    Example: no `{lidar}` from the checkpoint on that adds the lidar.
    """
    yield from missing_sensors(subject, LIDAR)


@rule("L02", "misplaced-lidar", scope="stage")
def misplaced_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The lidar has another name or parent.

    Why: below another prim it scans from the wrong place, and its frame is another. Later steps do
    not find it under another name. Its settings are still judged.

    Fix: rename it in the Stage panel, or drag it onto `{lidar_link}` and accept the new parent.

    Example: `{world}/Example_Rotary_2D`, as the Create menu makes it with nothing selected.
    """
    yield from misplaced_sensors(subject, LIDAR)


@rule("L03", "lidar-type", scope="stage")
def lidar_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the lidar's path is not an RTX lidar.

    Why: the lidar helper refuses every prim that is not an OmniLidar. No scan is published.

    Fix: delete the prim and create the lidar with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: an empty Xform named `{lidar_name}`.
    """
    yield from wrong_type_sensors(subject, LIDAR)


@rule("L04", "lidar-pose", scope="stage", demands=sensor_demands(LIDAR, sensor_place))
def lidar_pose(subject: StageSubject) -> Iterator[Problem]:
    """The lidar is off its link's origin, or does not follow it.

    Why: the scan is published in the frame of the lidar's link. If the lidar is moved or turned,
    the walls are displaced in RViz and on the map. With `!resetXformStack!` it ignores its link and
    stays where it is while the robot drives away. As a separate rigid body it falls.

    Fix: select the lidar and set Translate, Rotate and Scale to the values expected here. Remove
    `!resetXformStack!` from `xformOpOrder`, and remove Rigid Body.

    Example: `xformOp:translate` with the position of the link, which is so entered a second time.
    """
    yield from left_behind_sensors(subject, LIDAR)
    yield from misposed_sensors(subject, LIDAR)


@rule("L05", "lidar-rate", scope="stage", demands=sensor_demands(LIDAR, sensor_values))
def lidar_rate(subject: StageSubject) -> Iterator[Problem]:
    """A rate of the lidar has another value.

    Why: the tick rate sets how often a scan is published. If it differs from the scan rate, each
    scan covers only part of a turn, and Isaac Sim gives no message. A rate that is not set has the
    value of the lidar's schema, 10.

    Fix: select the lidar, search the Property panel for the name given here and type the value.

    Example: `omni:sensor:tickRate` 20.
    """
    for lidar in present_sensors(subject, LIDAR):
        values = values_of(lidar.prim, subject.stage)
        yield from wrong_attributes(subject, lidar, lidar.spec.required, values.get)


def _scan(spec: SensorSpec, group: str) -> Iterator[Demand]:
    if spec.scan or spec.required_api:
        title = f"{group} has the lidar's schema and gives a scan"
        yield Demand(f"{group}/schema", title, spec.path, spec.handout)


@rule("L06", "lidar-schema", scope="stage", demands=sensor_demands(LIDAR, _scan))
def lidar_schema(subject: StageSubject) -> Iterator[Problem]:
    """The lidar lacks the schema of a generic RTX lidar.

    Why: the lidar helper refuses it with a warning in the console, and no scan is published. If the
    lidar refers to an asset that cannot be found, nothing is reported: the asset may bring the
    schema.

    Fix: delete the prim and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: a prim typed by hand, `def OmniLidar "{lidar_name}"`, without a reference.
    """
    for sensor in present_sensors(subject, LIDAR):
        wanted = sensor.spec.required_api
        if wanted:
            yield from missing_schemas(subject, sensor, {wanted: f"{sensor.group}/schema"})


def _no_second(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for name in checkpoint.sensors:
        spec, group = lab.sensors[name], sensor_group(lab, name)
        if spec.kind == LIDAR:
            handout = lab.scene.forbidden.lidar.handout or spec.handout
            yield Demand(f"{group}/only", "no second lidar", spec.path, handout)


@rule("L07", "second-lidar", scope="stage", demands=_no_second)
def second_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a second lidar.

    Why: a second lidar that a graph uses costs frame rate. Its graph or frame may be confused with
    those of the right lidar. The handout forbids it.

    Fix: delete or deactivate the prim named here.

    Example: `/World/Example_Rotary_2D` beside `{lidar}`.
    """
    sensors = present_sensors(subject, LIDAR)
    handout = subject.lab.scene.forbidden.lidar.handout
    right = ", ".join(sensor.prim.path for sensor in sensors)
    seconds = second_lidars(subject)
    covered: dict[str, dict[Place, None]] = {prim.path: {} for prim in seconds}
    for node in subject.stage.nodes() if seconds else ():
        for path in upwards(node.path):
            if path in covered:
                covered[path][once_there(node.path)] = None
    for prim in seconds:
        yield Problem(
            prim.path,
            f"{prim.path} is a second lidar beside {right}",
            actual=prim.type,
            handout=handout,
            related=tuple(sensor.place.path for sensor in sensors),
            fix=(RemovePrim(prim.path),),
            unmet=tuple(f"{sensor.group}/only" for sensor in sensors),
            covers=tuple(covered[prim.path]),
        )


_TURN = 360.0
_Fault = tuple[str, str, str]  # attribute, message, what is expected


def _scanning(subject: StageSubject) -> Iterator[tuple[PresentSensor, ScanSpec]]:
    """Yield the lidars with a `scan` in the lab, and that `scan`."""
    for lidar in present_sensors(subject, LIDAR):
        if lidar.spec.scan is not None:
            yield lidar, lidar.spec.scan


def _problem(lidar: PresentSensor, scan: ScanSpec, fault: _Fault) -> Problem:
    name, message, expected = fault
    actual = display(lidar.prim.attributes.get(name))
    problem = Problem(lidar.prim.path, message, name, expected, actual)
    return restorable(problem, scan.handout, f"{lidar.group}/schema", related=lidar.place.related)


@rule("L09", "no-scan", scope="stage")
def no_scan(subject: StageSubject) -> Iterator[Problem]:
    """A value of the lidar prevents any scan.

    Why: before it runs, the model of the lidar compares its values: each list has an entry for each
    emitter, channels and banks exist, no emitter fires after its turn. If one does not fit, the
    lidar does not start. What is not set has the value of the schema: 128 emitters. Without rates
    there are no beams. With everything beyond the far range, or nearer than the near range, the
    scan is empty.

    Fix: select the lidar, search the Property panel for the name given here and type the expected
    value, or delete the lidar and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: `omni:sensor:Core:numberOfEmitters` 2 with one azimuth.

    Basis: NVIDIA's rules of Isaac Sim 6.2 (`lidar_sensor_rules.py`), and its checker of 6.0.1.
    """
    for lidar in present_sensors(subject, LIDAR):
        unmet = tuple(demand.id for demand in _scan(lidar.spec, lidar.group))
        for problem in refused_values(lidar, subject, "error"):
            yield replace(problem, unmet=unmet)
    for lidar, scan in _scanning(subject):
        for fault in _blind_ranges(lidar, scan, subject):
            robot = subject.lab.scene.robot_of(lidar.prim.path) or subject.lab.scene.robot
            asset = subject.stage.unknown_outside(robot.path)
            yield replace(_problem(lidar, scan, fault), rests_on=asset)


def _blind_ranges(lidar: PresentSensor, scan: ScanSpec, subject: StageSubject) -> Iterator[_Fault]:
    """Yield a range within which nothing lies at the start.

    How far things are no stage tells whose units are wrong.
    """
    prim, units = lidar.prim, units_of(subject.lab.scene, subject.stage)
    at = place_of(prim, subject)
    if scan.ranges is None or units.actual != units.expected:
        return
    near, far = (values_of(prim, subject.stage).number(name) for name in scan.ranges)
    is_range = near is None or far is None or 0 <= near < far
    robot = subject.lab.scene.robot_of(prim.path)
    beside = "" if robot is None else robot.path
    is_known = at is not None and is_range
    blind = blind_range(subject.stage, beside, at, (near, far)) if at and is_known else None
    if blind is None:
        return
    nearest, farthest = blind
    if far is not None and 0 < far < nearest:
        message = (
            f"{scan.ranges[1]} is {display(far)}, and the nearest thing is {nearest:.3g} m away"
        )
        yield scan.ranges[1], message, f"more than {nearest:.3g}"
    if near is not None and near > farthest:
        message = (
            f"{scan.ranges[0]} is {display(near)}, and nothing is farther than {farthest:.3g} m"
        )
        yield scan.ranges[0], message, f"less than {farthest:.3g}"


@rule("L10", "other-scan", scope="stage", severity="warning")
def other_scan(subject: StageSubject) -> Iterator[Problem]:
    """The lidar scans only part of the circle, tilted, or in another way.

    Why: {map?}the map and AMCL assume{else}who receives it expects{/} a full circle at the height
    of the lidar. Walls outside the scanned part are missing; what lies above or below appears as a
    wall in its plane. Without emitters of its own a lidar has the schema's: 128 that
    look from -15 to 10 degrees. Read at another rate than it turns, each scan is part of a circle.

    Fix: select the lidar, search the Property panel for the name given here and type the expected
    value, or reset it with the blue square beside it. Delete a lidar without emitters, and create
    it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: `omni:sensor:Core:validEndAzimuthDeg` 180.

    Basis: the schema of Isaac Sim 6.0.1, for the emitters.
    """
    for lidar, scan in _scanning(subject):
        values = values_of(lidar.prim, subject.stage)
        faults = [*_part_of_circle(values, scan), *_other_points(values, scan)]
        faults += _part_of_turn(lidar, values, subject)
        problems = [_problem(lidar, scan, fault) for fault in faults]
        for name in values.attributes or values.written:
            if name.startswith(scan.emitters) and name.rpartition(":")[2] == scan.elevation:
                problems += _not_level(lidar, scan, subject, name)
        for problem in problems:
            name = problem.property or ""
            entry = lidar.spec.attributes.get(name)  # what the lab describes so is no fault
            if entry is None or not same_value(entry.value, values.get(name)):
                yield problem


def _part_of_circle(values: SensorValues, scan: ScanSpec) -> Iterator[_Fault]:
    limits = [values.number(name) for name in scan.circle]
    start, end = (
        usual if limit is None else limit
        for limit, usual in zip(limits, scan.circle.values(), strict=True)
    )
    covered = end - start if end >= start else (end - start) % _TURN
    if not covered >= scan.whole:
        written = [name for name in scan.circle if values.written.get(name)]
        name = written[-1] if written else [*scan.circle][-1]
        message = (
            f"the lidar covers {covered:g} degrees of the circle, from azimuth {start:g} to {end:g}"
        )
        yield name, message, f"{_TURN:g} degrees"


def _part_of_turn(
    lidar: PresentSensor, values: SensorValues, subject: StageSubject
) -> Iterator[_Fault]:
    """Yield a rate that makes a scan part of a turn, where none is wrong that the lab asks for."""
    names, platform = subject.platform.sensor_models.lidar, subject.platform
    rates = reading_rates(values, names)
    since = platform.changes.sensors.since  # from which on the rate of reading has an effect
    if rates is None or order(platform.release) < order(since):
        return
    asked = lidar.spec.required.items()
    if any(not same_value(values.get(name), entry.value) for name, entry in asked):
        return  # L05's
    tick, turns = rates
    described = lidar.spec.attributes.get(names.rate)
    is_as_described = described is not None and same_value(described.value, tick)
    name, expected = (names.turns, tick) if is_as_described else (names.rate, turns)
    yield name, f"{names.rate} is {tick:g} while {names.turns} is {turns:g}", f"{expected:g}"


def _other_points(values: SensorValues, scan: ScanSpec) -> Iterator[_Fault]:
    for name, kept in scan.keep.items():
        actual = values.written.get(name)
        if actual is not None and not same_value(actual, kept.value):
            expected = display(kept.value)
            message = f"{name} is {display(actual)}, expected {expected}; {kept.otherwise}"
            yield name, message, expected


def _not_level(
    lidar: PresentSensor, scan: ScanSpec, subject: StageSubject, name: str
) -> Iterator[Problem]:
    """Yield elevations that are not level: as written, or else those of the schema."""
    prim, profile = lidar.prim, lidar.spec.attributes
    degrees = numbers(listed_entries(values_of(prim, subject.stage).get(name)))
    steepest = max(degrees, key=abs, default=0.0)
    if abs(steepest) <= scan.level:
        return
    if name in prim.attributes:
        direction = "up" if steepest > 0 else "down"
        message = f"{name} reaches {steepest:g} degrees: the lidar looks {direction}"
        yield _problem(lidar, scan, (name, message, "0 degrees"))
        return
    emitters = tuple((prim.path, other) for other in profile if other.startswith(scan.emitters))
    if not emitters:  # the lab leaves them to the schema, too
        return
    low, high = min(degrees), max(degrees)
    message = f"{name} is not set: the emitters of the schema look from {low:g} to {high:g} degrees"
    missing = [other for other in profile if other not in prim.attributes]
    yield replace(
        _problem(lidar, scan, (name, message, "0 degrees")),
        fix=tuple(Restore(prim.path, other) for other in missing or [name]),
        # Where the lists of the emitters differ in length, that is what is wrong.
        assumes=emitters,
        rests_on=subject.stage.unknown(prim.path),
    )


@rule("L11", "lidar-asset", scope="stage", severity="warning")
def lidar_asset(subject: StageSubject) -> Iterator[Problem]:
    """The lidar refers to another vendor asset.

    Why: the menu lists lidars with similar names. Another one may also look up and down, or rotate
    differently, so the scan is silent or not flat. The check cannot open the asset, but it sees the
    name.

    Fix: delete the lidar and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: a reference to `Example_Rotary.usda`, created with Example Rotary instead of Example
    Rotary 2D.
    """
    for lidar in present_sensors(subject, LIDAR):
        expected = _stem(lidar.spec.asset_suffix)
        other_names = {*subject.lab.scene.forbidden.lidar.names} - {expected}
        for missing in subject.stage.unresolved:
            made_of = _stem(missing.asset)
            if missing.prim == lidar.prim.path and made_of in other_names:
                yield Problem(
                    lidar.prim.path,
                    f"the lidar is made of {made_of}, expected {expected}",
                    None,
                    expected,
                    made_of,
                    lidar.spec.handout,
                    lidar.place.related,
                )


@rule("L12", "lidar-enclosed", scope="stage", severity="warning")
def lidar_enclosed(subject: StageSubject) -> Iterator[Problem]:
    """A shape encloses the lidar.

    Why: the beams end at the inside of the shape. The scan shows it and no walls.

    Fix: delete the shape, move it away, or make it invisible.

    Example: a sphere of 0.1 m at the lidar, added to see where it is.
    """
    yield from enclosed_sensors(subject, LIDAR)


def _stem(asset: str) -> str:
    """Return the name of an asset's file without its ending."""
    return asset.rpartition("/")[2].partition(".")[0]
