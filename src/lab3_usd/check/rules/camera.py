"""Rules about the robot's camera: at its path, looking ahead, with its lens, rate and image."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import restorable
from lab3_usd.check.robot.poses import PoseError
from lab3_usd.check.robot.sensors import CAMERA, View
from lab3_usd.check.rules.sensors import (
    PresentSensor,
    attribute_demand,
    enclosed_sensors,
    left_behind_sensors,
    misplaced_sensors,
    missing_sensors,
    pose_errors_of,
    pose_problem,
    present_sensors,
    sensor_demands,
    sensor_place,
    sensor_prim,
    sensor_values,
    wrong_attributes,
    wrong_type_sensors,
)
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.stage import same_value
from lab3_usd.spec.scene import Plain, SensorSpec


@rule("C01", "missing-camera", scope="stage", demands=sensor_demands(CAMERA, sensor_prim))
def missing_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot has no active camera.

    Why: the camera graph renders nothing, and no image is published.

    Fix: choose Create > Camera, rename it to `{camera_name}` and drag it onto `{camera_link}`. For
    a deactivated camera, right-click it in the Stage panel and choose Activate.

    Example: no `{camera}` from the checkpoint on that adds the camera.
    """
    yield from missing_sensors(subject, CAMERA)


@rule("C02", "misplaced-camera", scope="stage")
def misplaced_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera has another name or parent.

    Why: the camera graph and the TF tree refer to it by its path. Below a prim that does not move,
    the image does not change while the robot drives. Its settings are still judged.

    Fix: rename it in the Stage panel, or drag it onto `{camera_link}` and accept the new parent.

    Example: `{world}/{camera_name}`.
    """
    yield from misplaced_sensors(subject, CAMERA)


@rule("C03", "camera-type", scope="stage")
def camera_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the camera's path is not a camera.

    Why: a render product needs a camera. Nothing is published on the image topic.

    Fix: delete the prim and create the camera with Create > Camera.

    Example: an Xform named `{camera_name}`.
    """
    yield from wrong_type_sensors(subject, CAMERA)


@rule("C04", "camera-position", scope="stage", demands=sensor_demands(CAMERA, sensor_place))
def camera_position(subject: StageSubject) -> Iterator[Problem]:
    """The camera is at another position, scaled, or left behind.

    Why: inside the robot it sees the inside of a part. At another position the image does not match
    its TF frame. With `!resetXformStack!` the camera ignores its link and stays where it is while
    the robot drives away. As a separate rigid body it falls.

    Fix: select the camera and set Translate and Scale to the values expected here. Remove
    `!resetXformStack!` from `xformOpOrder`, and remove Rigid Body.

    Example: `xformOp:translate` (0, 0, 0), where the Create menu puts it.
    """
    yield from left_behind_sensors(subject, CAMERA)
    for camera, error in pose_errors_of(subject, CAMERA):
        if isinstance(error, PoseError) and error.kind != "rotate":
            yield pose_problem(camera, error)


@rule("C05", "camera-view", scope="stage")
def camera_view(subject: StageSubject) -> Iterator[Problem]:
    """The camera looks the wrong way, or is rolled.

    Why: the image shows something else. The viewing direction is judged, not the
    way in which the rotation is written. A USD camera looks along its own -Z.

    Fix: set the rotation to the value expected here. The Orient field of the Property panel turns
    about Z first; a quaternion has w first.

    Example: `xformOp:orient` (0.5, 0.5, 0.5, -0.5), from (90, 0, -90) typed into the Orient field.
    """
    for camera, error in pose_errors_of(subject, CAMERA):
        if isinstance(error, View) or error.kind == "rotate":
            yield pose_problem(camera, error)


@rule("C06", "camera-lens", scope="stage", demands=sensor_demands(CAMERA, sensor_values))
def camera_lens(subject: StageSubject) -> Iterator[Problem]:
    """Focal length or clipping range of the camera is wrong.

    Why: the field of view and the camera info depend on the lens. USD's default near plane of 1 m
    hides everything close to the robot.

    Fix: select the camera and set Focal Length and Clipping Range to the values expected here.

    Example: `focalLength` 18.147562, as Create > Camera writes it.
    """
    yield from _attributes(subject, lambda required: required is True)


@rule("C07", "camera-rate", scope="stage")
def camera_rate(subject: StageSubject) -> Iterator[Problem]:
    """The camera has another sensor rate.

    Why: the rate sets how often an image is published. Create > Camera applies no sensor schema, so
    a missing rate is right. If the camera has `OmniSensorAPI` without a rate, the default 0 gives
    an image for every rendered frame: a warning.

    Fix: select the camera, search the Property panel for the name given here and type the value.

    Example: `omni:sensor:tickRate` 30.
    """
    yield from _attributes(subject, lambda required: required is not True)
    for camera in present_sensors(subject, CAMERA):
        yield from _left_alone(subject, camera)


def _left_alone(subject: StageSubject, camera: PresentSensor) -> Iterator[Problem]:
    """Yield rates that the camera has by a schema, and that are not set."""
    spec, prim = camera.spec, camera.prim
    if spec.rate_api not in prim.apis:
        return
    for name, entry in spec.required.items():
        if entry.required is not True and name not in prim.attributes:
            expected = display(entry.value)
            message = (
                f"{name} is not set, expected {expected}; {spec.rate_api} has the default 0, "
                "an image for every rendered frame"
            )
            asset = subject.stage.unknown(prim.path)
            problem = Problem(prim.path, message, name, expected, display(None), severity="warning")
            unmet, related = attribute_demand(camera.group, name), camera.place.related
            yield restorable(problem, entry.handout, unmet, related=related, rests_on=asset)


def _attributes(subject: StageSubject, is_asked: Callable[[bool | str], bool]) -> Iterator[Problem]:
    for camera in present_sensors(subject, CAMERA):
        required = camera.spec.required.items()
        attributes = {name: entry for name, entry in required if is_asked(entry.required)}
        yield from wrong_attributes(subject, camera, attributes, camera.prim.attributes.get)


@rule("C08", "camera-aperture", scope="stage", severity="warning")
def camera_aperture(subject: StageSubject) -> Iterator[Problem]:
    """The camera's aperture was changed.

    Why: aperture and focal length determine the field of view.

    Fix: select the camera, and reset the aperture with the blue square beside it.

    Example: `horizontalAperture` 36.
    """
    yield from _away_from_default(subject, lambda spec: spec.keep_default)


@rule("C10", "camera-image", scope="stage", severity="warning")
def camera_image(subject: StageSubject) -> Iterator[Problem]:
    """The camera's image is not plain perspective.

    Why: the camera info describes a pinhole camera with focal length and aperture. An orthographic,
    shifted or fisheye image does not match it, and clipping planes hide parts of the world. Another
    exposure may make the image black or white.

    Fix: select the camera, and reset the property named here with the blue square beside it.

    Example: `projection` orthographic.
    """
    yield from _away_from_default(subject, lambda spec: spec.plain_image)


@rule("C11", "camera-enclosed", scope="stage", severity="warning")
def camera_enclosed(subject: StageSubject) -> Iterator[Problem]:
    """A shape encloses the camera.

    Why: the image shows the inside of the shape.

    Fix: delete the shape, move it away, or make it invisible.

    Example: a cube of 0.1 m at the camera, added as its housing.
    """
    yield from enclosed_sensors(subject, CAMERA)


def _away_from_default(
    subject: StageSubject, usual: Callable[[SensorSpec], Mapping[str, Plain]]
) -> Iterator[Problem]:
    """Yield what somebody set to another value than the one a camera has by itself."""
    for camera in present_sensors(subject, CAMERA):
        prim = camera.prim
        for name, default in usual(camera.spec).items():
            actual = prim.attributes.get(name)
            if actual is not None and not same_value(actual, default):
                actual_text, expected = display(actual), display(default)
                message = f"{name} is {actual_text}, the default is {expected}"
                problem = Problem(prim.path, message, name, expected, actual_text)
                handout = camera.spec.default_handout or camera.spec.handout
                yield restorable(problem, handout, related=camera.place.related)
