"""Where the robot's camera looks, and which slip explains a wrong view."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.check.model import Matrix, Prim
from lab3_usd.check.poses import Vector, angle_between, view
from lab3_usd.check.posing import Misfit, misfits, pose_property, sensor_tolerance, text, vector
from lab3_usd.check.sensor_place import Place, frames_of
from lab3_usd.check.subject import StageSubject

SENSOR = "camera"


class View(Struct, frozen=True):
    """A view that is wrong: what it is, and which slip leads to it."""

    property: str
    message: str
    expected: str
    actual: str
    hint: str | None


def camera_misfits(subject: StageSubject, place: Place) -> list[Misfit | View]:
    """Return what is wrong with the camera's position, scale and view.

    A camera below another parent is judged by the transform that fits best.
    """
    prim = place.prim
    judged = [_judge(subject, prim, matrix) for matrix in frames_of(subject.stage, place) if prim]
    return min(judged, key=len, default=[])


def _judge(subject: StageSubject, prim: Prim, matrix: Matrix) -> list[Misfit | View]:
    scene = subject.lab.scene
    tolerance = sensor_tolerance(scene, subject.stage)
    found: list[Misfit | View] = [
        misfit
        for misfit in misfits(prim, matrix, scene[SENSOR]["pose"], tolerance)
        if misfit.kind != "rotate"
    ]
    wrong = _wrong_view(subject, prim, matrix)
    return found if wrong is None else [*found, wrong]


def _wrong_view(subject: StageSubject, prim: Prim, matrix: Matrix) -> View | None:
    spec = subject.lab.scene[SENSOR]
    limit = subject.lab.scene["tolerance"]["sensor_angle"]
    seen = view(matrix)
    wanted = (vector(spec["looks"]["along"]), vector(spec["looks"]["up"]))
    if _is_same(seen, wanted, limit):
        return None
    message, hint = f"camera looks along {text(seen[0])} of its link, up {text(seen[1])}", None
    for slip in spec["slips"]:
        # A slip is recognised within a degree: the numbers were typed, not measured.
        if _is_same(seen, (vector(slip["along"]), vector(slip["up"])), 1.0):
            message, hint = slip["message"], slip["hint"]
    return View(
        pose_property(prim, "rotate"),
        message,
        f"along {text(wanted[0])}, up {text(wanted[1])}",
        f"along {text(seen[0])}, up {text(seen[1])}",
        hint,
    )


def _is_same(one: tuple[Vector, Vector], other: tuple[Vector, Vector], limit: float) -> bool:
    return all(angle_between(a, b) <= limit for a, b in zip(one, other, strict=True))
