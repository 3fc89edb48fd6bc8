"""Rules about the 2D lidar: one, at its path, at identity, with its rates and its schema."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_hidden
from lab3_usd.check.finding import Problem
from lab3_usd.check.met import same_value
from lab3_usd.check.posing import Misfit, misfits, sensor_tolerance
from lab3_usd.check.registry import rule
from lab3_usd.check.rules import early, scan  # noqa: F401 - registers their rules
from lab3_usd.check.say import shown
from lab3_usd.check.sensor_place import (
    frames_of,
    misplaced_problem,
    missing_problem,
    own_body_problem,
    second_lidars,
    sensor_place,
    stays_behind,
    stays_behind_problem,
    stranger_problem,
)
from lab3_usd.check.subject import StageSubject

SENSOR = "lidar"


@rule("L01", "missing-lidar", scope="stage")
def missing_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The lidar is not in the scene: never made, deleted, deactivated, or only an over.

    Why: the lidar graph renders nothing and `/scan` stays silent.

    Fix: choose Create > Sensors > RTX Lidar > NVIDIA > Example Rotary 2D, rename the prim to
    `Lidar2D` and drag it onto `base_scan` (D3). A deactivated one: right-click, Activate.

    Example: no `/turtlebot3_burger/base_scan/Lidar2D` in checkpoint 03.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from missing_problem(subject, place, subject.lab.scene[SENSOR]["handout"])


@rule("L02", "misplaced-lidar", scope="stage")
def misplaced_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The lidar has another name or another parent than the handout asks for.

    Why: below another prim it scans from the wrong place, and its frame is not `base_scan`'s; with
    another name every later step looks for it in vain. What it holds is judged all the same.

    Fix: rename it in the Stage panel, or drag it onto `base_scan` and accept the reparenting.

    Example: `/World/Example_Rotary_2D`, as the Create menu makes it with nothing selected.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from misplaced_problem(place, subject.lab.scene[SENSOR]["handout"])


@rule("L03", "lidar-type", scope="stage")
def lidar_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the lidar's path is no RTX lidar.

    Why: the lidar helper refuses every prim that is not an OmniLidar; `/scan` stays silent.

    Fix: delete the prim and make the lidar with Create > Sensors > RTX Lidar > NVIDIA > Example
    Rotary 2D.

    Example: an empty Xform that was named `Lidar2D`.
    """
    place = sensor_place(subject, SENSOR)
    if place is not None:
        yield from stranger_problem(place, subject.lab.scene[SENSOR])


@rule("L04", "lidar-pose", scope="stage")
def lidar_pose(subject: StageSubject) -> Iterator[Problem]:
    """The lidar does not sit at the origin of its link, or does not move with it.

    Why: the scan is published in the frame `base_scan`: what the lidar is moved or turned by, the
    walls are off in RViz and on the map (8.7, 8.14). With `!resetXformStack!` it ignores its link
    and stays where it is while the robot drives away; as a rigid body of its own it falls.

    Fix: select the lidar and set Translate (0, 0, 0), Rotate (0, 0, 0) and Scale (1, 1, 1). Take
    `!resetXformStack!` out of `xformOpOrder`, and remove Rigid Body.

    Example: `xformOp:translate` (0, 0, 0.182), the place of the link typed in again.
    """
    place = sensor_place(subject, SENSOR)
    if place is None or place.prim is None:
        return
    spec, prim = subject.lab.scene[SENSOR], place.prim
    tolerance = sensor_tolerance(subject.lab.scene, subject.stage)
    if stays_behind(prim):
        yield stays_behind_problem(place, prim, spec["pose"]["handout"])
        return
    yield from own_body_problem(place, prim, subject.stage, spec["pose"]["handout"])

    def judged() -> Iterator[list[Misfit]]:
        for matrix in frames_of(subject.stage, place):
            yield list(misfits(prim, matrix, spec["pose"], tolerance))

    for wrong in min(judged(), key=len, default=[]):
        message = f"lidar's {wrong.message} relative to its link"
        yield Problem(
            prim.path,
            message,
            wrong.property,
            wrong.expected,
            wrong.actual,
            spec["pose"]["handout"],
            place.related,
        )


@rule("L05", "lidar-rate", scope="stage")
def lidar_rate(subject: StageSubject) -> Iterator[Problem]:
    """A rate of the lidar is not the handout's, or is not set.

    Why: the tick rate sets how often a scan is published; when it differs from the scan rate, each
    scan is only a part of a turn, and Isaac Sim does not say so. Where no tick rate is written, the
    lidar's schema takes 10; what it takes for a scan rate is not public: a warning.

    Fix: select the lidar, search the Property panel for the name given here and type the value.

    Example: `omni:sensor:tickRate` 20.
    """
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    if place is None or prim is None:
        return
    spec = subject.lab.scene[SENSOR]
    for name, entry in spec["attributes"].items():
        actual = prim.attributes.get(name)
        if not entry.get("required") or same_value(actual, entry["value"]):
            continue
        unset = entry["unset"] if actual is None and spec["required_api"] in prim.apis else None
        if unset != "right" and (actual is not None or not is_hidden(subject.stage, prim.path)):
            yield Problem(
                prim.path,
                f"{name} is {shown(actual)}, expected {shown(entry['value'])}",
                name,
                shown(entry["value"]),
                shown(actual),
                entry["handout"],
                place.related,
                severity="warning" if unset else None,
            )


@rule("L06", "lidar-schema", scope="stage")
def lidar_schema(subject: StageSubject) -> Iterator[Problem]:
    """The lidar lacks the schema by which Isaac Sim recognises a generic RTX lidar.

    Why: the lidar helper refuses it with a warning in the console, and `/scan` stays silent. An
    asset that cannot be found from here could bring the schema: nothing is said then.

    Fix: delete the prim and make it with Create > Sensors > RTX Lidar > NVIDIA > Example Rotary 2D.

    Example: a prim typed by hand, `def OmniLidar "Lidar2D"`, without a reference.
    """
    place = sensor_place(subject, SENSOR)
    prim = None if place is None else place.prim
    if place is None or prim is None:
        return
    wanted = str(subject.lab.scene[SENSOR]["required_api"])
    if wanted not in prim.apis and not is_hidden(subject.stage, prim.path):
        message = f"lidar lacks {wanted}"
        handout = subject.lab.scene[SENSOR]["handout"]
        yield Problem(prim.path, message, None, wanted, None, handout, place.related)


@rule("L07", "second-lidar", scope="stage")
def second_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds another lidar beside the one that the handout asks for.

    Why: one that a graph uses renders as well and costs frames, and its graph or frame may get
    mixed up with the right one's; D4 forbids it.

    Fix: delete or deactivate the prim named here.

    Example: `/World/Example_Rotary_2D` beside `/turtlebot3_burger/base_scan/Lidar2D`.
    """
    place = sensor_place(subject, SENSOR)
    if place is None or place.prim is None:
        return
    handout = subject.lab.scene["forbidden"][SENSOR]["handout"]
    for prim in second_lidars(subject):
        message = f"{prim.path} is a second lidar beside {place.prim.path}"
        yield Problem(prim.path, message, actual=prim.type, handout=handout, related=(place.path,))
