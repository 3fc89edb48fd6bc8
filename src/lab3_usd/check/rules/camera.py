"""Rules about the robot's camera: at its path, looking ahead, with its lens and its rate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from lab3_usd.check.absence import is_hidden
from lab3_usd.check.camera_view import View, camera_misfits
from lab3_usd.check.finding import Problem
from lab3_usd.check.met import same_value
from lab3_usd.check.model import Prim
from lab3_usd.check.posing import Misfit
from lab3_usd.check.registry import rule
from lab3_usd.check.rules import early  # noqa: F401 - registers its rules
from lab3_usd.check.say import shown
from lab3_usd.check.sensor_place import (
    Place,
    misplaced_problem,
    missing_problem,
    sensor_place,
    stranger_problem,
)
from lab3_usd.check.subject import StageSubject

SENSOR = "camera"


@rule("C01", "missing-camera", scope="stage")
def missing_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera is not in the scene: never made, deleted, deactivated, or only an over.

    Why: the camera graph renders nothing, and `/camera/image_raw` stays silent.

    Fix: choose Create > Camera, rename it to `Camera_1` and drag it onto `base_footprint` (E3). A
    deactivated one: right-click it in the Stage panel, Activate.

    Example: no `/turtlebot3_burger/base_footprint/Camera_1` in checkpoint 04.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from missing_problem(subject, place, subject.lab.scene[SENSOR]["handout"])


@rule("C02", "misplaced-camera", scope="stage")
def misplaced_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera has another name or another parent than the handout asks for.

    Why: the camera graph and the TF tree name it by its path; below a prim that does not move, the
    image stands still while the robot drives. What it holds is judged all the same.

    Fix: rename it in the Stage panel, or drag it onto `base_footprint` and accept the reparenting.

    Example: `/World/Camera_1`.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from misplaced_problem(place, subject.lab.scene[SENSOR]["handout"])


@rule("C03", "camera-type", scope="stage")
def camera_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the camera's path is no camera.

    Why: a render product needs a camera; the image topic stays silent.

    Fix: delete the prim and make the camera with Create > Camera.

    Example: an Xform named `Camera_1`.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from stranger_problem(place, subject.lab.scene[SENSOR])


def _wrong(subject: StageSubject) -> Iterator[tuple[Place, Prim, Misfit | View]]:
    place = sensor_place(subject, SENSOR)
    if place is not None and place.prim is not None:
        for misfit in camera_misfits(subject, place):
            yield place, place.prim, misfit


@rule("C04", "camera-position", scope="stage")
def camera_position(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera does not stand where the handout puts it, or is scaled.

    Why: inside the robot it sees the inside of a plate, elsewhere the image does not fit the TF
    frame `Camera_1`.

    Fix: select the camera and set Translate (0.1, 0, 0.2) and Scale (1, 1, 1).

    Example: `xformOp:translate` (0, 0, 0), the place where the Create menu puts it.
    """
    for place, prim, wrong in _wrong(subject):
        if isinstance(wrong, Misfit):
            yield Problem(
                prim.path,
                f"camera's {wrong.message} relative to its link",
                wrong.property,
                wrong.expected,
                wrong.actual,
                subject.lab.scene[SENSOR]["pose"]["handout"],
                place.related,
            )


@rule("C05", "camera-view", scope="stage")
def camera_view(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera does not look ahead with the sky on top.

    Why: the image shows the side, the back or the floor. Judged by where it looks (robot +X, up
    +Z), however the rotation is written; a USD camera looks along its own -Z.

    Fix: set the rotation to X = 90, Y = 0, Z = -90 (rotateXYZ), which is the quaternion
    (0.5, 0.5, -0.5, -0.5) with w first.

    Example: `xformOp:orient` (0.5, 0.5, 0.5, -0.5), from (90, 0, -90) typed into the Orient field.
    """
    for place, prim, wrong in _wrong(subject):
        if isinstance(wrong, View):
            yield Problem(
                prim.path,
                wrong.message,
                wrong.property,
                wrong.expected,
                wrong.actual,
                subject.lab.scene[SENSOR]["pose"]["handout"],
                place.related,
                hint=wrong.hint,
            )


@rule("C06", "camera-lens", scope="stage")
def camera_lens(subject: StageSubject) -> Iterator[Problem]:
    """Focal length or clipping range of the robot's camera is not the handout's, or is not set.

    Why: the field of view and the camera info depend on the lens; a near plane of 1 m, which USD
    takes where nothing is written, cuts away everything close to the robot.

    Fix: select the camera and set Focal Length 18 and Clipping Range 0.01 and 100.

    Example: `focalLength` 18.147562, as Create > Camera writes it.
    """
    yield from _attributes(subject, lambda entry: entry["required"] is True)


@rule("C07", "camera-rate", scope="stage")
def camera_rate(subject: StageSubject) -> Iterator[Problem]:
    """The sensor rate of the robot's camera is set, and not to what the handout says.

    Why: the rate sets how often an image is published. Create > Camera applies no sensor schema:
    a rate that is absent is no fault.

    Fix: select the camera, search the Property panel for the name given here and type 10.

    Example: `omni:sensor:tickRate` 30.
    """
    yield from _attributes(subject, lambda entry: entry["required"] is not True)


def _attributes(subject: StageSubject, is_asked: Any) -> Iterator[Problem]:  # noqa: ANN401
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    if place is None or prim is None:
        return
    for name, entry in subject.lab.scene[SENSOR]["attributes"].items():
        actual, wanted = prim.attributes.get(name), entry["value"]
        wanted = tuple(wanted) if isinstance(wanted, list) else wanted
        if not is_asked(entry) or same_value(actual, wanted):
            continue
        may_be_absent = entry["required"] is not True or is_hidden(subject.stage, prim.path)
        if actual is None and may_be_absent:
            continue
        expected, is_ = shown(wanted), shown(actual)
        why = "" if actual is not None else ", which leaves USD's own default"
        message = f"{name} is {is_}{why}, expected {expected}"
        yield Problem(prim.path, message, name, expected, is_, entry["handout"], place.related)


@rule("C08", "camera-aperture", scope="stage", severity="warning")
def camera_aperture(subject: StageSubject) -> Iterator[Problem]:
    """The aperture of the robot's camera was changed, which E5 says to leave alone.

    Why: with the focal length it makes the field of view.

    Fix: select the camera, and reset the aperture with the blue square beside it.

    Example: `horizontalAperture` 36.
    """
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    if place is None or prim is None:
        return
    for name, default in subject.lab.scene[SENSOR]["keep_default"].items():
        actual = prim.attributes.get(name)
        if actual is not None and not same_value(actual, default):
            message = f"{name} is {shown(actual)}, the default is {shown(default)}"
            yield Problem(
                prim.path, message, name, shown(default), shown(actual), "E5", place.related
            )
