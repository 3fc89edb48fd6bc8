"""Where the robot's camera looks, and which slip explains a wrong view."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.scene.pose_errors import (
    PoseError,
    pose_errors,
    pose_property,
    sensor_tolerance,
    vector,
    vector_text,
)
from lab3_usd.check.scene.sensor_location import SensorLocation, candidate_transforms
from lab3_usd.model.stage import Matrix, Prim
from lab3_usd.model.transform_math import Vector, angle_between, camera_axes


class View(Struct, frozen=True):
    """A view that is wrong: what it is, and which slip leads to it."""

    property: str
    message: str
    expected: str
    actual: str
    hint: str


def camera_misfits(
    subject: StageSubject, sensor: str, place: SensorLocation
) -> list[PoseError | View]:
    """Return what is wrong with the camera's position, scale and view.

    A camera below another parent is judged by the transform that fits best.
    """
    prim = place.prim
    candidates = [
        _judge(subject, sensor, prim, matrix)
        for matrix in candidate_transforms(subject.stage, place)
        if prim
    ]
    return min(candidates, key=len, default=[])


def _judge(
    subject: StageSubject, sensor: str, prim: Prim, matrix: Matrix
) -> list[PoseError | View]:
    scene, spec = subject.lab.scene, subject.lab.sensors[sensor]
    tolerance = sensor_tolerance(scene, subject.stage)
    found: list[PoseError | View] = [
        misfit
        for misfit in pose_errors(prim, matrix, spec["pose"], tolerance)
        if misfit.kind != "rotate" or not spec["looks"]
    ]
    limit = scene["tolerance"]["sensor_angle"]
    wrong = _wrong_view(spec, prim, matrix, limit) if spec["looks"] else None
    return found if wrong is None else [*found, wrong]


def _wrong_view(spec: Mapping[str, Any], prim: Prim, matrix: Matrix, limit: float) -> View | None:
    seen = camera_axes(matrix)
    expected = (vector(spec["looks"]["along"]), vector(spec["looks"]["up"]))
    if _is_same(seen, expected, limit):
        return None
    message = f"camera looks along {vector_text(seen[0])} of its link, up {vector_text(seen[1])}"
    x, y, z = (f"{angle:g}" for angle in vector(spec["pose"]["rotate"]))
    hint = f"set the rotation to X = {x}, Y = {y}, Z = {z} (rotateXYZ)"
    for slip in spec["slips"]:
        # A slip is recognised within a degree: the numbers were typed, not measured.
        if _is_same(seen, (vector(slip["along"]), vector(slip["up"])), 1.0):
            message, hint = slip["message"], slip["hint"]
    return View(
        pose_property(prim, "rotate"),
        message,
        f"along {vector_text(expected[0])}, up {vector_text(expected[1])}",
        f"along {vector_text(seen[0])}, up {vector_text(seen[1])}",
        hint,
    )


def _is_same(one: tuple[Vector, Vector], other: tuple[Vector, Vector], limit: float) -> bool:
    return all(angle_between(a, b) <= limit for a, b in zip(one, other, strict=True))
