"""Where the sensors of the lab really stand, where the camera looks, and what is around them."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import RobotSubject, StageSubject
from lab3_usd.check.robot.poses import PoseError, pose_errors, pose_property, sensor_tolerance
from lab3_usd.model.physics import number, numbers
from lab3_usd.model.prims import Collider, Matrix, Prim, is_at_or_below, upwards
from lab3_usd.model.stage import StageModel, listed_once, once_per_stage
from lab3_usd.model.transforms import (
    IDENTITY,
    Vector,
    angle_between,
    angles_from_z,
    camera_axes,
    relative_transform,
    rotation_from_euler,
    scaled,
    vector_text,
)
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import ANYWHERE, SensorSpec, ViewSpec

LIDAR, CAMERA = "lidar", "camera"  # the kinds that have rules of their own
OTHER = "other"


class SensorLocation(Struct, frozen=True):
    """The prim that is a required sensor, at its path or elsewhere; None where there is none.

    `wrong_type_prim` is the prim of another type that stands at the path instead, `carrier` what
    its parent is called.
    """

    path: str
    prim: Prim | None = None
    wrong_type_prim: Prim | None = None
    carrier: str = "link"

    @property
    def is_misplaced(self) -> bool:
        """Whether the sensor has another name or parent."""
        return self.prim is not None and self.prim.path != self.path

    @property
    def related(self) -> tuple[str, ...]:
        """The path at which the handout wants the sensor that stands elsewhere."""
        return (self.path,) if self.is_misplaced else ()


def sensors_of(subject: StageSubject, kind: str) -> tuple[str, ...]:
    """Name the sensors that the checkpoint asks for and the rules of a kind judge."""
    return tuple(
        name
        for name in subject.checkpoint.sensors
        if judging_kind(subject.lab.sensors[name]) == kind
    )


def later_sensors(subject: StageSubject, kind: str) -> tuple[str, ...]:
    """Name the sensors of a kind that only a later checkpoint asks for."""
    added = subject.lab.added_until(subject.checkpoint.id)
    return tuple(
        name
        for name, spec in subject.lab.sensors.items()
        if judging_kind(spec) == kind and name not in added
    )


def judging_kind(spec: SensorSpec) -> str:
    """Return which rules judge a sensor: those of its kind, or those of all others."""
    return spec.kind if spec.kind in (LIDAR, CAMERA) else OTHER


@once_per_stage
def find_sensor(stage: StageModel, lab: Lab, name: str) -> SensorLocation:
    """Find the sensor `name` of the scene file: at its path, else the prim that is meant.

    Meant is a prim of the right type that hangs below the robot, or has the name and is used by a
    graph; for a sensor that is recognised anywhere, every prim of the type. Of several such, the
    one that a graph uses is the lab's, even beside an unused one at the path. No prim is two
    sensors.
    """
    spec = lab.sensors[name]
    path = spec.path
    carrier = "parent" if lab.scene.robot_of(path) is None else "link"
    at = stage.prim(path)
    is_there = at is not None and at.type == spec.type
    if is_there and spec.recognised != ANYWHERE:
        return SensorLocation(path, at, carrier=carrier)
    if at is not None and not at.type and stage.unknown(path):
        return SensorLocation(path)  # the missing asset may say what it is
    # Prims that are other sensors of the type: at their paths, or found before.
    alike = [key for key, sensor in lab.sensors.items() if sensor.type == spec.type]
    taken = {lab.sensors[key].path for key in alike if key != name}
    for key in alike[: alike.index(name)]:
        prim = find_sensor(stage, lab, key).prim
        taken |= {prim.path} if prim is not None else set()
    candidates = [prim for prim in sensor_candidates(lab, stage, name) if prim.path not in taken]
    if len(candidates) > 1:
        candidates.sort(
            key=lambda prim: (not is_used_by_graph(stage, prim), _strangeness(prim, path, lab))
        )
    prim = candidates[0] if candidates else None
    return SensorLocation(path, prim, None if is_there else at, carrier)


def is_used_by_graph(stage: StageModel, prim: Prim) -> bool:
    """Whether a node names the prim as its target, or a graph that holds nodes lies below it."""
    return prim.path in _used_by_graphs(stage)


@once_per_stage
def _used_by_graphs(stage: StageModel) -> frozenset[str]:
    """Return the prims that nodes name as their targets, and those above graphs with nodes."""
    graphs = (graph for graph in stage.graphs if graph.active and graph.nodes)
    above = {path for graph in graphs for path in upwards(graph.path.rpartition("/")[0])}
    states = (state for node in stage.nodes() for state in node.ports.values())
    return frozenset(above.union(*(state.targets for state in states if state.targets)))


def sensor_relocations(lab: Lab, stage: StageModel) -> dict[str, str]:
    """Map the path of each sensor that stands elsewhere to the path where it really is."""
    places = [find_sensor(stage, lab, name) for name in lab.sensors]
    return {
        place.path: place.prim.path
        for place in places
        if place.prim is not None and place.is_misplaced
    }


def sensor_candidates(lab: Lab, stage: StageModel, name: str) -> Iterator[Prim]:
    """Yield the prims of the scene that could be meant as the sensor."""
    spec = lab.sensors[name]
    robot = lab.scene.robot_of(spec.path)
    carriers = () if robot is None else (robot.path, *robot.link_paths)
    for prim in stage.of_type(spec.type):
        if prim.present and prim.path not in carriers:
            is_on_robot = robot is not None and is_at_or_below(prim.path, robot.path)
            is_known = spec.recognised == ANYWHERE or is_on_robot
            if is_known or (prim.name == spec.name and is_used_by_graph(stage, prim)):
                yield prim


def _strangeness(prim: Prim, path: str, lab: Lab) -> tuple[bool, bool, bool, str]:
    parent, _, name = path.rpartition("/")
    is_off_robot = lab.scene.robot_of(prim.path) is not lab.scene.robot_of(path)
    return prim.name != name, prim.parent != parent, is_off_robot, prim.path


def candidate_transforms(stage: StageModel, place: SensorLocation) -> list[Matrix]:
    """Return the transforms a sensor may be judged by.

    A sensor below another parent may be right relative to that one or to the expected one, since
    Isaac Sim keeps the world transform when a prim is dragged. There are none if a missing asset
    may define the pose.
    """
    prim = place.prim
    if prim is None or stage.unknown_pose(prim):
        return []
    frames = [prim.local or IDENTITY]
    parent = place.path.rpartition("/")[0]
    base = stage.prim(parent)
    if prim.parent != parent and base is not None and base.world and prim.world:
        seen = relative_transform(prim.world, base.world)
        frames += [seen] if seen is not None else []
    return frames


def is_named(name: str, names: Container[str]) -> bool:
    """Whether a prim has one of these names, or one with the number Isaac Sim adds to a copy."""
    if name in names:
        return True
    original, _, number = name.rpartition("_")
    return number.isdecimal() and original in names


def lidars(subject: StageSubject, right: tuple[str, ...] = ()) -> Iterator[Prim]:
    """Yield everything that is a lidar by type or by a name of the vendor's, topmost only.

    Left out are the lidars that are right, with what they hang below.
    """
    names = subject.lab.scene.forbidden.lidar.names
    kinds = [name for name, spec in subject.lab.sensors.items() if spec.kind == LIDAR]
    typed = {
        prim.path for name in kinds for prim in sensor_candidates(subject.lab, subject.stage, name)
    }
    topmost = ""
    named = subject.stage.named(lambda leaf: is_named(leaf, names))
    paths = typed | {prim.path for prim in named if prim.present}
    for path in sorted(paths):
        is_right = any(is_at_or_below(lidar, path) for lidar in right)
        if not is_right and not (topmost and is_at_or_below(path, topmost)):
            topmost = path
            yield subject.stage.prims[path]


@once_per_stage
def second_lidars(subject: StageSubject) -> tuple[Prim, ...]:
    """Return the lidars beside those that the checkpoint asks for, where all of those are there.

    One at the path of another sensor is left to the rule of that sensor.
    """
    places = [
        find_sensor(subject.stage, subject.lab, sensor) for sensor in sensors_of(subject, LIDAR)
    ]
    right = tuple(place.prim.path for place in places if place.prim is not None)
    if not right or len(right) < len(places):
        return ()
    required = (find_sensor(subject.stage, subject.lab, key) for key in subject.checkpoint.sensors)
    stand_ins = [location.wrong_type_prim for location in required if location.prim is None]
    later = [subject.lab.sensors[name].path for name in later_sensors(subject, LIDAR)]
    return tuple(
        prim for prim in lidars(subject, right) if prim not in stand_ins and prim.path not in later
    )


class View(Struct, frozen=True):
    """A view that is wrong: what it is, and which slip leads to it."""

    property: str
    message: str
    expected: str
    actual: str
    hint: str


def misfits(
    subject: StageSubject, spec: SensorSpec, place: SensorLocation
) -> list[PoseError | View]:
    """Return what is wrong with the pose of a sensor, and with its view where the lab asks for one.

    A sensor below another parent is judged by the transform that fits best.
    """
    prim = place.prim
    candidates = [
        _misfits(subject, spec, prim, matrix)
        for matrix in candidate_transforms(subject.stage, place)
        if prim
    ]
    return min(candidates, key=len, default=[])


def _misfits(
    subject: StageSubject, spec: SensorSpec, prim: Prim, matrix: Matrix
) -> list[PoseError | View]:
    tolerance = sensor_tolerance(subject.lab.scene, subject.stage)
    errors = [*pose_errors(prim, matrix, spec.pose, tolerance)]
    if spec.view is None:
        return [*errors]
    seen, moved = ViewSpec(*camera_axes(matrix)), (e for e in errors if e.kind != "rotate")
    if _is_same(seen, spec.view, tolerance.angle):
        return [*moved]
    return [*moved, _wrong_view(spec, prim, seen, spec.view)]


def _wrong_view(spec: SensorSpec, prim: Prim, seen: ViewSpec, expected: ViewSpec) -> View:
    message = f"camera looks along {vector_text(seen.along)} of its link, up {vector_text(seen.up)}"
    site = pose_property(prim, "rotate")
    x, y, z = (f"{angle:g}" for angle in spec.pose.rotate)
    hint = f"set the rotation to X = {x}, Y = {y}, Z = {z} (rotateXYZ)"
    if site.startswith("xformOp:orient"):
        typed = vector_text(angles_from_z(rotation_from_euler(spec.pose.rotate)))
        hint = (
            f"in the Property panel, type {typed} into the Orient field, which turns about Z first"
        )
    for slip in spec.slips:
        # A slip is recognised within a degree: the numbers were typed, not measured.
        if _is_same(seen, slip, 1.0):
            message, hint = slip.message, slip.hint or hint
    return View(
        site,
        message,
        f"along {vector_text(expected.along)}, up {vector_text(expected.up)}",
        f"along {vector_text(seen.along)}, up {vector_text(seen.up)}",
        hint,
    )


def _is_same(view: ViewSpec, expected: ViewSpec, limit: float) -> bool:
    pairs = ((view.along, expected.along), (view.up, expected.up))
    return all(angle_between(a, b) <= limit for a, b in pairs)


def sensor_group(lab: Lab, sensor: str) -> str:
    """Return the name of a sensor's prim; the sensor's own where another or a graph has that."""
    names = [spec.name for spec in lab.sensors.values()]
    name = lab.sensors[sensor].name
    return name if names.count(name) == 1 and name not in lab.graphs else sensor


_SOLID = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone")  # whose boxes are as they are
_SHAPES = (*_SOLID, "Mesh")
_ROOM = 1.5  # metres to a side: what is larger around a sensor is a room, or the sky
INVISIBLE = {"visibility": "invisible"}
_HIDDEN = {**INVISIBLE, "purpose": "guide"}
_INTENSITY, _EXPOSURE, _COLOR = "inputs:intensity", "inputs:exposure", "inputs:color"
_SHARES = ("inputs:diffuse", "inputs:specular")  # of its light that materials scatter and reflect
_BRIGHTEST = 50_000.0  # the largest intensity that a schema gives (DistantLight)
_DARK = 0.01  # intensity below which nothing is seen


def place_of(prim: Prim, subject: StageSubject) -> Vector | None:
    """Return where a prim is at the start, in metres; None where nothing, or an asset, says it."""
    if prim.world is None or subject.stage.unknown_pose(prim):
        return None
    return scaled((prim.world[12], prim.world[13], prim.world[14]), subject.stage.meters_per_unit)


def blind_range(
    stage: StageModel, robot: str, at: Vector, limits: tuple[float | None, float | None]
) -> tuple[float, float] | None:
    """Return between which distances all things lie that are level with a place, if none is seen.

    They lie between by their boxes, which may be nearer, and reach farther, than what is in them.
    What belongs to the prim at `robot` is left out. None where something may lie between the
    `limits`, the near and the far range, or there are no things.
    """
    near, far = limits
    nearest, farthest = math.inf, 0.0
    for box in _things(stage, robot):
        if not box.low[2] <= at[2] <= box.high[2]:
            continue
        gaps = [(box.low[i] - at[i], box.high[i] - at[i]) for i in (0, 1)]
        nearest = min(nearest, math.hypot(*(max(low, 0.0, -high) for low, high in gaps)))
        farthest = max(farthest, math.hypot(*(max(-low, high) for low, high in gaps)))
        if (far is None or nearest <= far) and (near is None or near <= farthest):
            return None
    return (nearest, farthest) if farthest > 0 else None


def _things(stage: StageModel, robot: str) -> Iterator[Collider]:
    """Yield the boxes around all that a robot may meet or see beside itself."""
    yield from stage.colliders.beside(robot)
    for prim in stage.of_type(lambda name: name in _SHAPES):
        if prim.present and not is_at_or_below(prim.path, robot):
            box = stage.colliders.shape(prim.path)
            if box is not None:
                yield box


def enclosing(sensor: Prim, subject: RobotSubject) -> Iterator[Prim]:
    """Yield the shapes on the robot right around a sensor that are no part of how it looks."""
    at = place_of(sensor, subject)
    if at is None:
        return
    for prim, box in _shapes_on_robot(subject):
        is_around = all(
            low < middle < high for low, middle, high in zip(box.low, at, box.high, strict=True)
        )
        if is_around and hidden_by(prim, subject.stage) is None:
            yield prim


@listed_once
def _shapes_on_robot(subject: RobotSubject) -> Iterator[tuple[Prim, Collider]]:
    """Yield the shapes on the robot that are no part of how it looks, and no room, with boxes."""
    robot, stage = subject.robot, subject.stage
    for prim in stage.below(robot.path, _SOLID.__contains__, frozenset(robot.appearance_below)):
        box = stage.colliders.shape(prim.path) if prim.present else None
        if box is not None and all(
            high - low < 2 * _ROOM for low, high in zip(box.low, box.high, strict=True)
        ):
            yield prim, box


def hidden_by(prim: Prim, stage: StageModel, hiding: Mapping[str, str] = _HIDDEN) -> Prim | None:
    """Return the prim, itself or one above it, by whose value a prim is not rendered."""
    for above in map(stage.prim, upwards(prim.path)):
        values = {} if above is None else above.attributes
        if any(values.get(name) == value for name, value in hiding.items()):
            return above
    return None


def darkened(light: Prim, stage: StageModel) -> tuple[Prim, str] | None:
    """Return the prim and the property by which a light is dark, None for one that shines."""
    intensity, exposure = (number(light.attributes.get(n)) for n in (_INTENSITY, _EXPOSURE))
    if intensity is not None and intensity <= 0:
        return light, _INTENSITY
    # UsdLux multiplies the intensity by two to the power of the exposure, and by the color.
    if math.log2(intensity or _BRIGHTEST) + (exposure or 0.0) < math.log2(_DARK):
        return light, _EXPOSURE
    color = numbers(light.attributes.get(_COLOR))
    if color and max(color) <= 0:
        return light, _COLOR
    if all(number(light.attributes.get(name)) == 0 for name in _SHARES):
        return light, _SHARES[0]
    hiding = hidden_by(light, stage, INVISIBLE)
    return None if hiding is None else (hiding, next(iter(INVISIBLE)))


def shares_of(dark: Iterable[tuple[Prim, str]]) -> Iterator[tuple[str, str]]:
    """Yield the shares of lights that are dark because all of their shares are 0."""
    for light, name in dark:
        yield from ((light.path, share) for share in _SHARES if name in _SHARES)
