"""Rules about the 2D lidar: one, at its path, at identity, with its rates and its schema."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.conformance import same_value
from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.sensors.placement import (
    left_behind_sensors,
    misplaced_sensors,
    misposed_sensors,
    missing_sensors,
    present_sensors,
    wrong_type_sensors,
)
from lab3_usd.check.scene.sensor_location import LIDAR, second_lidars
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import display


@rule("L01", "missing-lidar", scope="stage")
def missing_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The lidar is missing, deactivated, or only an over.

    Why: the lidar graph renders nothing, and no scan is published.

    Fix: create the lidar of the handout with Create > Sensors > RTX Lidar{lidar_menu}, rename the
    prim to `{lidar_name}` and drag it onto `{lidar_link}`. For a deactivated lidar, right-click it
    in the Stage panel and choose Activate.

    Example: no `{lidar}` from the checkpoint on that adds the lidar.
    """
    yield from missing_sensors(subject, LIDAR)


@rule("L02", "misplaced-lidar", scope="stage")
def misplaced_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The lidar has another name or parent than the handout asks for.

    Why: below another prim it scans from the wrong place, and its frame is another. Later steps do
    not find it under another name. Its settings are still judged.

    Fix: rename it in the Stage panel, or drag it onto `{lidar_link}` and accept the new parent.

    Example: `{world}/Example_Rotary_2D`, as the Create menu makes it with nothing selected.
    """
    yield from misplaced_sensors(subject, LIDAR)


@rule("L03", "lidar-type", scope="stage")
def lidar_type(subject: StageSubject) -> Iterator[Problem]:
    """The prim at the lidar's path is not an RTX lidar.

    Why: the lidar helper refuses every prim that is not an OmniLidar. No scan is published.

    Fix: delete the prim and create the lidar with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: an empty Xform named `{lidar_name}`.
    """
    yield from wrong_type_sensors(subject, LIDAR)


@rule("L04", "lidar-pose", scope="stage")
def lidar_pose(subject: StageSubject) -> Iterator[Problem]:
    """The lidar is not at the origin of its link, or does not move with it.

    Why: the scan is published in the frame of the lidar's link. If the lidar is moved or turned,
    the walls are displaced in RViz and on the map. With `!resetXformStack!` it ignores its link and
    stays where it is while the robot drives away. As a separate rigid body it falls.

    Fix: select the lidar and set Translate, Rotate and Scale to the values expected here. Remove
    `!resetXformStack!` from `xformOpOrder`, and remove Rigid Body.

    Example: `xformOp:translate` with the position of the link, which is so entered a second time.
    """
    yield from left_behind_sensors(subject, LIDAR)
    yield from misposed_sensors(subject, LIDAR)


@rule("L05", "lidar-rate", scope="stage")
def lidar_rate(subject: StageSubject) -> Iterator[Problem]:
    """A rate of the lidar is not set to the value in the handout.

    Why: the tick rate sets how often a scan is published. If it differs from the scan rate, each
    scan covers only part of a turn, and Isaac Sim gives no message. The schema's default tick rate
    is 10. Its default scan rate is not documented: a warning.

    Fix: select the lidar, search the Property panel for the name given here and type the value.

    Example: `omni:sensor:tickRate` 20.
    """
    for _, spec, place, prim in present_sensors(subject, LIDAR):
        may_be_hidden = is_unresolved(subject.stage, prim.path)
        for name, entry in spec.required.items():
            actual = prim.attributes.get(name)
            unset = entry.unset if actual is None and spec.required_api in prim.apis else ""
            is_hidden = actual is None and may_be_hidden
            if not same_value(actual, entry.value) and unset != "right" and not is_hidden:
                expected, is_ = display(entry.value), display(actual)
                yield Problem(
                    prim.path,
                    f"{name} is {is_}, expected {expected}",
                    name,
                    expected,
                    is_,
                    entry.handout,
                    place.related,
                    severity="warning" if unset else None,
                )


@rule("L06", "lidar-schema", scope="stage")
def lidar_schema(subject: StageSubject) -> Iterator[Problem]:
    """The lidar lacks the schema of a generic RTX lidar.

    Why: the lidar helper refuses it with a warning in the console, and no scan is published. If the
    lidar refers to an asset that cannot be found, nothing is reported: the asset may bring the
    schema.

    Fix: delete the prim and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: a prim typed by hand, `def OmniLidar "{lidar_name}"`, without a reference.
    """
    for _, spec, place, prim in present_sensors(subject, LIDAR):
        wanted = spec.required_api
        if wanted and wanted not in prim.apis and not is_unresolved(subject.stage, prim.path):
            message = f"lidar lacks {wanted}"
            yield Problem(prim.path, message, None, wanted, None, spec.handout, place.related)


@rule("L07", "second-lidar", scope="stage")
def second_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a second lidar.

    Why: a second lidar that a graph uses costs frame rate. Its graph or frame may be confused with
    those of the right lidar. The handout forbids it.

    Fix: delete or deactivate the prim named here.

    Example: `/World/Example_Rotary_2D` beside `{lidar}`.
    """
    found = [*present_sensors(subject, LIDAR)]
    handout = subject.lab.scene.forbidden.lidar.handout
    right = ", ".join(each.prim.path for each in found)
    related = tuple(each.place.path for each in found)
    for prim in second_lidars(subject):
        message = f"{prim.path} is a second lidar beside {right}"
        yield Problem(prim.path, message, actual=prim.type, handout=handout, related=related)
