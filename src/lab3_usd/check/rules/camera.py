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
from lab3_usd.check.rules import early, image  # noqa: F401 - registers their rules
from lab3_usd.check.say import shown
from lab3_usd.check.sensor_place import (
    Place,
    misplaced_problem,
    missing_problem,
    own_body_problem,
    sensor_place,
    stays_behind,
    stays_behind_problem,
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
    if place is not None and place.prim is not None and not stays_behind(place.prim):
        for misfit in camera_misfits(subject, place):
            yield place, place.prim, misfit


@rule("C04", "camera-position", scope="stage")
def camera_position(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera does not stand where the handout puts it, is scaled, or stays behind.

    Why: inside the robot it sees the inside of a plate, elsewhere the image does not fit the TF
    frame `Camera_1`. With `!resetXformStack!` the camera ignores its link and stays where it is
    while the robot drives away; as a rigid body of its own it falls.

    Fix: select the camera and set Translate (0.1, 0, 0.2) and Scale (1, 1, 1). Take
    `!resetXformStack!` out of `xformOpOrder`, and remove Rigid Body.

    Example: `xformOp:translate` (0, 0, 0), the place where the Create menu puts it.
    """
    handout = subject.lab.scene[SENSOR]["pose"]["handout"]
    place = sensor_place(subject, SENSOR)
    if place is not None and place.prim is not None and stays_behind(place.prim):
        yield stays_behind_problem(place, place.prim, handout)
    elif place is not None and place.prim is not None:
        yield from own_body_problem(place, place.prim, subject.stage, handout)
    for place, prim, wrong in _wrong(subject):
        if isinstance(wrong, Misfit):
            yield Problem(
                prim.path,
                f"camera's {wrong.message} relative to its link",
                wrong.property,
                wrong.expected,
                wrong.actual,
                handout,
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
    a rate that is absent is no fault. Where the camera has `OmniSensorAPI` and no rate is written,
    the schema's 0 means an image for every rendered frame: a warning.

    Fix: select the camera, search the Property panel for the name given here and type 10.

    Example: `omni:sensor:tickRate` 30.
    """
    yield from _attributes(subject, lambda entry: entry["required"] is not True)
    yield from _left_alone(subject)


def _left_alone(subject: StageSubject) -> Iterator[Problem]:
    """Yield rates that the camera has by a schema, and that nobody has set."""
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    spec = subject.lab.scene[SENSOR]
    if place is None or prim is None or spec["rate_api"] not in prim.apis:
        return
    for name, entry in spec["attributes"].items():
        is_rate = entry["required"] is not True and name not in prim.attributes
        if is_rate and not is_hidden(subject.stage, prim.path):
            expected = shown(entry["value"])
            message = (
                f"{name} is not set, expected {expected}; {spec['rate_api']} takes 0 then, which "
                "is an image for every rendered frame"
            )
            yield Problem(
                prim.path,
                message,
                name,
                expected,
                shown(None),
                entry["handout"],
                place.related,
                severity="warning",
            )


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
