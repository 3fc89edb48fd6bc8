"""How far a prim's pose is from the one the handout asks for, part by part."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.prims import Matrix, Prim
from lab3_usd.model.stage import StageModel
from lab3_usd.model.transforms import (
    Part,
    PlaceTolerance,
    Pose,
    Vector,
    decompose,
    distance,
    euler_angles,
    is_scaled_alike,
    parts_apart,
    rotation_from_euler,
    scale_of,
    scaled,
    vector_text,
)
from lab3_usd.spec.scene import PoseSpec, SceneSpec

ORDER = "xformOpOrder"
_PIVOT = ":pivot"
RESET = "!resetXformStack!"  # in that order: leave out the transforms of all parents
# The operations of the Property panel; others that do the same, in the order of preference.
OPERATIONS: Mapping[Part, tuple[str, ...]] = {
    "translate": ("xformOp:translate",),
    "rotate": ("xformOp:orient", "xformOp:rotate"),
    "scale": ("xformOp:scale",),
}
UNSCALED: Vector = (1.0, 1.0, 1.0)


class Units(Struct, frozen=True):
    """How many metres one unit of a stage has, and how many the lab asks for.

    Where they differ, lengths that are right in either are right.
    """

    actual: float = 1.0
    expected: float = 1.0

    def nearest(self, point: Vector, expected: Vector) -> Vector:
        """Return a point of a stage in metres, by the unit with which it is nearer to another."""
        readings = (scaled(point, self.expected), scaled(point, self.actual))
        return min(readings, key=lambda reading: distance(reading, expected))

    def shown(self, metres: Vector) -> Vector:
        """Return what the Property panel shows in a stage with the units asked for."""
        return scaled(metres, 1.0 / self.expected)


class Tolerance(PlaceTolerance, frozen=True):
    """What counts as the same pose, with lengths in metres.

    `units` are those of the stage and of the lab, whose files give lengths in metres.
    """

    units: Units


class PoseError(Struct, frozen=True):
    """One part of a pose that is wrong, the property that says so, and how to repair it."""

    kind: Part
    property: str
    message: str
    expected: str
    actual: str
    hint: str


def sensor_tolerance(scene: SceneSpec, stage: StageModel) -> Tolerance:
    """Return how exactly a sensor must stand."""
    spec = scene.tolerance
    return Tolerance(spec.sensor_position, spec.sensor_angle, spec.scale, units_of(scene, stage))


def root_tolerance(scene: SceneSpec, stage: StageModel) -> Tolerance:
    """Return how exactly the robot must stand."""
    spec = scene.tolerance
    return Tolerance(spec.root_position, spec.root_angle, spec.scale, units_of(scene, stage))


def units_of(scene: SceneSpec, stage: StageModel) -> Units:
    """Return the units of a stage beside those of the lab."""
    return Units(stage.meters_per_unit, scene.stage.meters_per_unit)


def pose_errors(
    prim: Prim, matrix: Matrix, expected: PoseSpec, tolerance: Tolerance
) -> Iterator[PoseError]:
    """Yield what is wrong with a transform."""
    pose, units = decompose(matrix), tolerance.units
    in_metres = units.nearest(pose.translation, expected.translate)
    wanted = Pose(expected.translate, rotation_from_euler(expected.rotate), expected.scale)
    values: Mapping[Part, tuple[Vector, Vector, str]] = {
        "translate": (pose.translation, units.shown(expected.translate), ""),
        "rotate": (euler_angles(pose.rotation), expected.rotate, " degrees"),
        "scale": (pose.scale, expected.scale, ""),
    }
    for part in parts_apart(replace(pose, translation=in_metres), wanted, tolerance):
        yield _misfit(prim, part, *values[part])


def _misfit(prim: Prim, kind: Part, actual: Vector, expected: Vector, unit: str) -> PoseError:
    name = {"translate": "translation", "rotate": "rotation", "scale": "scale"}[kind]
    actual_text, expected_text = vector_text(actual), vector_text(expected)
    message = f"{name} is {actual_text}{unit}, expected {expected_text}"
    # The operation that sets the point about which the prim is turned and scaled.
    pivot = next((operation for operation in _operations(prim) if operation.endswith(_PIVOT)), None)
    hint = f"set {kind.capitalize()} to {expected_text} in the Property panel"
    if prim.placeless:
        message = f"{message}: {untyped(prim)}"
        hint = f"write {prim.name} with the type Xform (def Xform)"
    if pivot is not None and kind == "translate":
        hint = f"{hint}, and remove the pivot ({pivot}), which shifts what is turned or scaled"
    return PoseError(kind, pose_property(prim, kind), message, expected_text, actual_text, hint)


def untyped(prim: Prim) -> str:
    """Say why a prim has no place, as the end of a sentence."""
    what = f"a {prim.type}" if prim.type else "a prim without a type"
    return f"{what} has no place of its own"


def is_near(point: Vector, expected: Vector, tolerance: float, units: Units) -> bool:
    """Whether two points are the same, with `point` in stage units and `expected` in metres.

    A stage whose units are wrong is right in one of two ways: in its units, or in those asked for.
    """
    return distance(units.nearest(point, expected), expected) <= tolerance


def pose_property(prim: Prim, kind: Part) -> str:
    """Return the operation that sets this part of the pose, as authored, else as the panel would.

    A pose written as one matrix has no part of its own to point at; the panel's name stands in.
    """
    authored = _operations(prim)
    for operation in OPERATIONS[kind]:
        for name in authored:
            if name.startswith(operation):
                return name
    return OPERATIONS[kind][0]


def _operations(prim: Prim) -> list[str]:
    """Return the names of the operations that move a prim, in their order."""
    order = prim.attributes.get(ORDER)
    return [name for name in order if isinstance(name, str)] if isinstance(order, tuple) else []


def scale_on_parent(prim: Prim) -> Vector:
    """Return by what a prim is scaled on its parent."""
    return UNSCALED if prim.local is None else scale_of(prim.local)


def is_scaled(prim: Prim, tolerance: float) -> bool:
    """Whether a prim has another size than its parent gives it."""
    return not is_scaled_alike(scale_on_parent(prim), UNSCALED, tolerance)
