"""Rules about sensors, what reads them, and scripts; of several lidars also with a lab."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject, ModelSubject
from lab3_usd.check.registry import Parameter, rule
from lab3_usd.facts.articulations import articulations
from lab3_usd.facts.execution_order import nodes_of, nodes_with, run_states
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.render_products import read_lidars, read_sensors
from lab3_usd.facts.sensor_faults import SensorFault, faults_of
from lab3_usd.facts.sensor_values import reading_rates, values_of
from lab3_usd.facts.stuck_nodes import lost_products, refused_target
from lab3_usd.isaac.node_types import INPUT, KIND
from lab3_usd.isaac.release_changes import leads_past
from lab3_usd.isaac.releases import is_release_within, order
from lab3_usd.isaac.topics import PRODUCT
from lab3_usd.model.changes import ApplySchema, Edit, RenameProperty, Retarget, SetValue
from lab3_usd.model.finding import Problem, Severity, display
from lab3_usd.model.physics import is_body
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.transforms import AXES, angle_between, decompose, rotate_vector


@rule("K93", "unequal-lidars")
@rule("L13", "unequal-scan-rates", scope="stage")
def unequal_lidars(subject: ModelSubject) -> Iterator[Problem]:
    """Two lidars are read whose scan rates differ.

    Why: Isaac Sim 6.0 crashes seconds after Play; the next release does not.

    Fix: give all lidars the same scan rate, or read one of them only.

    Example: `omni:sensor:Core:scanRateBaseHz` 10 of one lidar and 20 of the other.

    Basis: IsaacSim issue 718, which NVIDIA has reproduced. The renderer is not public.
    """
    stage, platform = subject.stage, subject.platform
    running = run_states(stage)
    first: dict[tuple[str, str], tuple[str, float]] = {}
    for node, asked, prim in read_sensors(stage):
        if node.path not in running or prim.type not in asked.types:
            continue
        path = prim.path
        for name in asked.equal if is_release_within(platform.release, *asked.equal_in) else ():
            values = values_of(prim, stage)
            rate = values.number(name)
            if rate is None:
                continue
            other = first.setdefault((prim.type, name), (path, rate))
            if other[0] == path or other[1] == rate:
                continue
            (right, expected), (odd, actual) = other, (path, rate)
            if actual == values.default(name):  # more often the other one was changed
                (right, expected), (odd, actual) = (path, rate), other
            yield Problem(
                odd,
                f"{name} is {actual:g}, and {expected:g} at {right}: Isaac Sim "
                f"{platform.release} crashes",
                property=name,
                expected=f"{expected:g}",
                actual=f"{actual:g}",
                related=(right, node.path),
                assumes=((odd, name), (right, name)),
                rests_on=stage.unknown_value(prim, name),
            )


_FLAT = "laser_scan"
_STEEP = Parameter("K76", "angle", 45.0, "degrees that the Z axis may point away from up")


@rule("K15", "unreadable-target")
def unreadable_target(subject: LintSubject) -> Iterator[Problem]:
    """A target of a node has the wrong type of prim.

    Why: the node finds no sensor, body or articulation there. It logs an error or stays silent, and
    its outputs stay 0.

    Fix: in the Property panel, choose a prim of the kind that the node reads. For joint states that
    is the articulation root, or a link or joint of the robot, and no prim above the root.

    Example: `inputs:lidarPrim` of an Isaac Read Lidar Beams, a node for PhysX lidars, names an
    `OmniLidar`.
    """
    targets = subject.platform.targets
    for node in nodes_of(lambda kind: kind.type in targets, subject.stage):
        unread = refused_target(node, subject.stage)
        if unread is not None:
            asked, path, port = unread.asked, unread.prim.path, INPUT + unread.asked.input
            roots = articulations(path, subject.stage) if asked.part_of else ()
            what = f"above {roots[0]}, the articulation root" if roots else f"not {asked.what}"
            yield Problem(
                node.path,
                f"{port} is {path}, which is {what}: {asked.effect}",
                property=port,
                expected=roots[0] if roots else asked.what,
                actual=path,
                related=(path, *roots[:1]),
                fix=(Retarget(node.path, port, tuple(roots)),) if len(roots) == 1 else (),
                rests_on=unread.unknown,
            )


@rule("K70", "product-of-another-sensor")
def product_of_another_sensor(subject: LintSubject) -> Iterator[Problem]:
    """A helper reads the render product of another sensor.

    Why: the lidar helper accepts only lidars and logs a message; a camera helper on a lidar
    publishes an image without content.

    Fix: connect Render Product Path to the Isaac Create Render Product of the right sensor.

    Example: a ROS2 RTX Lidar Helper behind the render product of the camera.
    """
    for node, needed, prim in read_sensors(subject.stage):
        apis = set(prim.apis)
        is_accepted = not apis.isdisjoint(needed.schemas_in(subject.platform.release))
        if prim.type not in needed.types and not is_accepted:
            yield Problem(
                node.path,
                f"reads {prim.path}, which has {f'type {prim.type}' if prim.type else 'no type'}",
                property=PRODUCT,
                expected=" or ".join(needed.types),
                actual=prim.type,
                related=(prim.path,),
                hint=needed.instead or None if apis & {*needed.schemas_until} else None,
                rests_on=None if prim.type else subject.stage.unknown(prim.path),
            )


@rule("K71", "sensor-without-schema")
def sensor_without_schema(subject: LintSubject) -> Iterator[Problem]:
    """A lidar lacks the schema that makes it one.

    Why: the lidar helper rejects it with a warning, and publishes nothing.

    Fix: create the lidar with Create > Sensors > RTX Lidar, or apply the schema named here.

    Example: an `OmniLidar` without `OmniSensorGenericLidarCoreAPI`.
    """
    for node, needed, prim in read_sensors(subject.stage):
        if needed.needs and prim.type in needed.types and needed.needs not in prim.apis:
            yield Problem(
                prim.path,
                f"has no {needed.needs}, so {node.path} refuses it",
                expected=needed.needs,
                related=(node.path,),
                fix=(ApplySchema(prim.path, needed.needs),),
                rests_on=subject.stage.unknown(prim.path),
            )


@rule("K72", "refused-sensor", formerly="no-scan-from-this")
def refused_sensor(subject: LintSubject) -> Iterator[Problem]:
    """The values of a sensor do not fit each other.

    Why: before it runs, the model of a sensor compares its values. It does not start if one has
    another type, if a list of a lidar lacks an entry for an emitter, or if there is no such
    channel, bank or range. What is not set has the value of the schema: 128 emitters. A rotary
    lidar with a rate of 0 has no angle between two rays; with the near range beyond the far range
    nothing is in range. Where no node reads the sensor, it is a warning.

    Fix: set the value named here, or create the sensor anew with Create > Sensors.

    Example: `omni:sensor:Core:numberOfEmitters = 2` with one azimuth.

    Basis: NVIDIA's rules of Isaac Sim 6.2 (`lidar_sensor_rules.py`), its checker of 6.0.1, and
    `OgnROS2RtxLidarHelper.py:119-134`.
    """
    reading: dict[str, list[str]] = {}
    for node, _, prim in read_sensors(subject.stage):
        reading.setdefault(prim.path, []).append(node.path)
    for prim, fault in _sensor_faults(subject):
        if fault.severity == "error":
            readers = tuple(reading.get(prim.path, ()))
            severity: Severity | None = None if readers else "warning"
            problem = _problem(prim, fault, subject)
            yield replace(problem, related=readers, severity=severity)


def _sensor_faults(subject: LintSubject) -> Iterator[tuple[Prim, SensorFault]]:
    """Yield what is wrong with the values of sensors: those that nodes read, and all others."""
    models, stage = subject.platform.sensor_models, subject.stage
    read = (prim for _, _, prim in read_sensors(stage))
    sensors = (*read, *stage.with_api(lambda api: models.is_sensor([api])))
    for prim in {prim.path: prim for prim in sensors if prim.present}.values():
        for fault in faults_of(prim, stage):
            yield prim, fault


def _problem(prim: Prim, fault: SensorFault, subject: LintSubject) -> Problem:
    name = next(iter(fault.attributes), None)
    return Problem(
        prim.path,
        fault.message,
        property=name,
        expected=fault.expected,
        actual=None if name is None else display(prim.attributes.get(name)),
        rests_on=subject.stage.unknown(prim.path) if fault.is_open else None,
    )


@rule("K73", "partial-scans", severity="warning")
def partial_scans(subject: LintSubject) -> Iterator[Problem]:
    """A lidar is read at another rate than it turns, or does not accumulate its scan.

    Why: if it is read more often than it turns, each message covers a part of the circle, and the
    rest of the scan is empty, as it is without accumulation: -1. With a tick rate of 0 it is read
    at every update. A rate that is not set is 10.

    Fix: set tick rate and scan rate to the same number, and Accumulate Outputs to True.

    Example: `tickRate = 60` beside `scanRateBaseHz = 10`.

    Basis: NVIDIA's Lidar class warns where the rates differ (`lidar.py:141-156`), and its lidars
    accumulate (`lidar.py:53-56`); the writer fills the rest of each scan with -1
    (`OgnROS2PublishLaserScan.cpp:169`). The renderer is not public; that a tick rate of 0 means
    every frame is shown for cameras (`test_camera.py:1421`). Before 6.0 the tick rate had no
    effect.
    """
    since, names = subject.platform.changes.sensors.since, subject.platform.sensor_models.lidar
    release = subject.platform.release
    if order(release) < order(since):
        return
    before = subject.moved_from
    is_moved = before is not None and leads_past(since, before.release, release)
    flat = {
        prim.path
        for node, _, prim in read_sensors(subject.stage)
        if effective_value(node, KIND, subject.live) == _FLAT
    }
    for prim in read_lidars(subject.stage):
        values = values_of(prim, subject.stage)
        rates = reading_rates(values, names)
        if rates is not None:
            tick, turns = rates
            rate = values.attributes.get(names.rate)
            yield Problem(
                prim.path,
                f"{names.rate} is {tick:g} while {names.turns} is {turns:g}",
                property=names.rate if names.rate in prim.attributes else names.turns,
                expected=f"{turns:g}",
                actual=f"{tick:g}",
                fix=() if rate is None else (SetValue(prim.path, names.rate, rate.type, turns),),
                likely=not is_moved,  # before, it was read as often as it turned
                rests_on=subject.stage.unknown_value(prim, names.rate, names.turns),
            )
        if values.written.get(names.whole) is False and prim.path in flat:
            yield Problem(
                prim.path,
                f"{names.whole} is False: a scan has the points of one update, else -1",
                property=names.whole,
                expected="True",
                actual="False",
                fix=(SetValue(prim.path, names.whole, "bool", True),),  # noqa: FBT003 - a value
                likely=True,
            )


@rule("K74", "unused-camera", severity="note", counted=("unused camera", "unused cameras"))
def unused_camera(subject: LintSubject) -> Iterator[Problem]:
    """No render product uses a robot's camera.

    Why: it publishes nothing. It may be for the viewport, or its graph was forgotten.

    Fix: nothing is required. Create a render product of it to publish its image.

    Example: `/World/robot/base_link/rear_camera`, without a graph.
    """
    if not subject.live:
        return
    used = {
        target
        for node in subject.live.values()
        for state in node.ports.values()
        for target in state.targets
    }
    for prim in subject.stage.of_type("Camera"):
        if not prim.present or prim.path in used:
            continue
        carriers = (subject.stage.prims.get(path) for path in upwards(prim.parent))
        if any(carrier is not None and is_body(carrier) for carrier in carriers):
            yield Problem(prim.path, "no node reads this camera")


@rule("K75", "empty-render-product")
def empty_render_product(subject: LintSubject) -> Iterator[Problem]:
    """A render product has no width, no height or no camera.

    Why: there is nothing to render. A node that reads the product reports an error or publishes
    nothing.

    Fix: set Width and Height to the size of the image. Clear Render Product Prim, or choose a
    render product with a camera: it is used as it is.

    Example: `inputs:width = 0` on an Isaac Create Render Product.
    """
    for node, ports in nodes_with(lambda kind: kind.product, subject.stage):
        named = next(iter(node.targets(ports.named)), "")
        product = subject.stage.products.get(named)
        if product is not None and not product.camera:
            yield Problem(
                node.path,
                f"{ports.named} is {named}, which shows no camera",
                property=ports.named,
                expected="a render product",
                actual=named,
                related=(named,),
                rests_on=subject.stage.unknown(named),
            )
        # A product that is named is used as it is, with its own size.
        for port in ports.size if product is None else ():
            if effective_value(node, port, subject.live) == 0:
                text = f"{port} is 0: there is no image"
                yield Problem(node.path, text, property=port, expected="above 0", actual="0")
    for lost in lost_products(subject.stage):
        if lost.sure:
            yield Problem(
                lost.node.path,
                f"{lost.port} is {lost.path}, which shows no camera",
                property=lost.port,
                expected="a render product",
                actual=lost.path,
            )


@rule("K76", "lidar-on-its-side", severity="warning", parameters=(_STEEP,))
def lidar_on_its_side(subject: LintSubject) -> Iterator[Problem]:
    """The scan plane of a lidar is not level.

    Why: a laser scan lies in the plane perpendicular to the lidar's Z axis. If that axis does not
    point up, the scan cuts floor and ceiling, and its map is not a floor plan.

    Fix: turn the lidar so that its Z axis points up; in a stage with Y up it needs a rotation.

    Example: an `OmniLidar` with `xformOp:rotateX = 90` in a stage with Z up.
    """
    up = AXES["XYZ".index(subject.stage.up_axis)]
    for node, needed, prim in read_sensors(subject.stage):
        is_flat = effective_value(node, KIND, subject.live) == _FLAT
        if prim.world is None or not (needed.needs and is_flat):
            continue
        tilt = angle_between(rotate_vector(AXES[2], decompose(prim.world).rotation), up)
        if tilt > subject.value(_STEEP):
            yield Problem(
                prim.path,
                f"its Z axis points {tilt:.0f} degrees away from up, and {node.path} publishes a "
                "flat scan",
                related=(node.path,),
                rests_on=subject.stage.unknown_pose(prim),
            )


@rule("K80", "script", severity="note", counted=("script", "scripts"))
def script(subject: LintSubject) -> Iterator[Problem]:
    """The stage contains code.

    Why: Isaac Sim runs it after a confirmation. It can do anything: publish, move, write files. Its
    effects are not judged.

    Fix: nothing is required. Read the script before you open a stage from somebody else.

    Example: a Script Node that publishes a marker.
    """
    for code in subject.stage.scripts:
        yield Problem(code.prim, f"carries code ({code.carrier}), which is not judged")


@rule("K89", "odd-sensor-value", severity="warning")
def sensor_value(subject: LintSubject) -> Iterator[Problem]:
    """A sensor has a value or attribute unknown to its model.

    Why: attributes outside the schema, and invalid tokens, are ignored. NVIDIA's rules for Isaac
    Sim 6.2 refuse the other values, or this release is known to fail with them. A sensor whose
    model is another one by name is a note.

    Fix: set the value named here, and remove an attribute that no schema has.

    Example: `omni:sensor:Core:nearRange`, instead of `omni:sensor:Core:nearRangeM`.

    Basis: NVIDIA's rules of Isaac Sim 6.2 (`lidar_sensor_rules.py`), and the schema of 6.0.1.
    """
    for prim, fault in _sensor_faults(subject):
        if fault.severity != "error":
            problem = _problem(prim, fault, subject)
            yield replace(problem, severity=fault.severity, fix=_renamed(prim, fault, subject))


def _renamed(prim: Prim, fault: SensorFault, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the edit that gives an attribute its present name, if its value can stay."""
    models = subject.platform.sensor_models
    attributes = models.attributes_of(prim.apis)
    return tuple(
        RenameProperty(prim.path, name, new)
        for name in fault.attributes
        if (new := models.renamed.get(name, name)) in attributes and new not in prim.attributes
    )
