"""Where the robot's camera looks, and which slip explains a wrong view."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.scene.pose_errors import (
    PoseError,
    pose_errors,
    pose_property,
    sensor_tolerance,
    vector_text,
)
from lab3_usd.check.scene.sensor_location import SensorLocation, candidate_transforms
from lab3_usd.model.prims import Matrix, Prim
from lab3_usd.model.transform_math import angle_between, camera_axes
from lab3_usd.spec.scene import SensorSpec, ViewSpec


class View(Struct, frozen=True):
    """A view that is wrong: what it is, and which slip leads to it."""

    property: str
    message: str
    expected: str
    actual: str
    hint: str


def camera_misfits(
    subject: StageSubject, spec: SensorSpec, place: SensorLocation
) -> list[PoseError | View]:
    """Return what is wrong with the camera's position, scale and view.

    A camera below another parent is judged by the transform that fits best.
    """
    prim = place.prim
    candidates = [
        _judge(subject, spec, prim, matrix)
        for matrix in candidate_transforms(subject.stage, place)
        if prim
    ]
    return min(candidates, key=len, default=[])


def _judge(
    subject: StageSubject, spec: SensorSpec, prim: Prim, matrix: Matrix
) -> list[PoseError | View]:
    tolerance = sensor_tolerance(subject.lab.scene, subject.stage)
    found: list[PoseError | View] = [
        misfit
        for misfit in pose_errors(prim, matrix, spec.pose, tolerance)
        if misfit.kind != "rotate" or spec.looks is None
    ]
    along, up = camera_axes(matrix)
    seen = ViewSpec(along, up)
    if spec.looks is None or _is_same(seen, spec.looks, tolerance.angle):
        return found
    return [*found, _wrong_view(spec, prim, seen, spec.looks)]


def _wrong_view(spec: SensorSpec, prim: Prim, seen: ViewSpec, expected: ViewSpec) -> View:
    message = f"camera looks along {vector_text(seen.along)} of its link, up {vector_text(seen.up)}"
    x, y, z = (f"{angle:g}" for angle in spec.pose.rotate)
    hint = f"set the rotation to X = {x}, Y = {y}, Z = {z} (rotateXYZ)"
    for slip in spec.slips:
        # A slip is recognised within a degree: the numbers were typed, not measured.
        if _is_same(seen, slip, 1.0):
            message, hint = slip.message, slip.hint
    return View(
        pose_property(prim, "rotate"),
        message,
        f"along {vector_text(expected.along)}, up {vector_text(expected.up)}",
        f"along {vector_text(seen.along)}, up {vector_text(seen.up)}",
        hint,
    )


def _is_same(one: ViewSpec, other: ViewSpec, limit: float) -> bool:
    pairs = ((one.along, other.along), (one.up, other.up))
    return all(angle_between(a, b) <= limit for a, b in pairs)
