"""Rules about what the robot's camera makes of what it sees, which the handout leaves alone."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.met import same_value
from lab3_usd.check.registry import rule
from lab3_usd.check.say import shown
from lab3_usd.check.sensor_place import sensor_place
from lab3_usd.check.subject import StageSubject

SENSOR = "camera"


@rule("C08", "camera-aperture", scope="stage", severity="warning")
def camera_aperture(subject: StageSubject) -> Iterator[Problem]:
    """The aperture of the robot's camera was changed, which E5 says to leave alone.

    Why: with the focal length it makes the field of view.

    Fix: select the camera, and reset the aperture with the blue square beside it.

    Example: `horizontalAperture` 36.
    """
    yield from _changed(subject, "keep_default")


@rule("C10", "camera-image", scope="stage", severity="warning")
def camera_image(subject: StageSubject) -> Iterator[Problem]:
    """The robot's camera draws another image than a plain perspective one.

    Why: the camera info describes a pinhole with focal length and aperture. An orthographic or
    fisheye image does not fit it, and clipping planes cut parts of the world away.

    Fix: select the camera, and reset the property named here with the blue square beside it.

    Example: `projection` orthographic.
    """
    yield from _changed(subject, "plain_image")


def _changed(subject: StageSubject, section: str) -> Iterator[Problem]:
    """Yield what somebody set to another value than the one a camera has by itself."""
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    for name, default in subject.lab.scene[SENSOR][section].items():
        actual = None if prim is None else prim.attributes.get(name)
        if place is None or prim is None or actual is None:
            continue
        usual = tuple(default) if isinstance(default, list) else default
        if not same_value(actual, usual):
            message = f"{name} is {shown(actual)}, the default is {shown(usual)}"
            yield Problem(
                prim.path, message, name, shown(usual), shown(actual), "E5", place.related
            )
