"""Rules about what the starter brings: its prims, units, the robot's pose."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.axles import rest_frames, welds
from lab3_usd.check.scene.pose_errors import (
    is_near,
    pose_errors,
    pose_property,
    root_tolerance,
    units_of,
    vector_text,
)
from lab3_usd.check.scene.robot_location import same_named_prims
from lab3_usd.model.absent_prims import (
    absence_reason,
    is_pose_unresolved,
    is_unresolved,
    missing_graphs_text,
)
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import bodies
from lab3_usd.model.prims import Prim
from lab3_usd.model.transform_math import IDENTITY, Vector, decompose, relative_transform


@rule("S01", "missing-prim", scope="stage")
def missing_prim(subject: StageSubject) -> Iterator[Problem]:
    """The robot, one of its links, or the parent of the graphs is missing or at another path.

    Why: graphs, sensors and TF refer to these prims by their paths. Prims below a missing prim are
    not reported one by one. If the robot was moved, its parts are judged where they are.

    Fix: undo the deletion, or activate the prim (right-click in the Stage panel, Activate). If it
    was deleted long ago, open the supplied file again and repeat the steps from there.

    Example: `{robot}/{link}` deactivated in the Stage panel.
    """
    scene, stage = subject.lab.scene, subject.stage
    root = scene.robot
    yield from _robot_elsewhere(subject)
    wanted = {scene.world.graph_parent.path: scene.world.graph_parent.handout}
    wanted[root.path] = root.handout
    if stage.prim(root.path) is not None:
        wanted |= dict.fromkeys(root.link_paths, root.handout)
    told: list[str] = []
    for path, handout in wanted.items():
        is_told = any(is_at_or_below(path, above) for above in told)
        if not is_told and stage.prim(path) is None and not is_unresolved(stage, path):
            told.append(path)
            why = absence_reason(stage, path)
            others = _places(subject, path)
            at, hint = "", None
            if others:
                at = f"; it seems to be the prim at {others[0]}"
                hint = f"rename or drag {others[0]} back to {path} in the Stage panel"
            message = f"{path} {why}{at}{missing_graphs_text(subject.missing_graphs, path)}"
            yield Problem(path, message, None, path, why, handout, others, hint=hint)


def _robot_elsewhere(subject: StageSubject) -> Iterator[Problem]:
    """Yield that the robot has another name or parent; everything else is judged where it is."""
    spec = subject.lab.scene.robot
    for expected, home in subject.relocations.items():
        if home == spec.path:
            gone = missing_graphs_text(subject.missing_graphs, home)
            message = f"the robot is at {home}, expected at {expected}{gone}"
            hint = f"rename or drag the robot in the Stage panel, back to {expected}"
            handout = spec.handout
            yield Problem(home, message, None, expected, home, handout, (expected,), hint=hint)


def _places(subject: StageSubject, path: str) -> tuple[str, ...]:
    """Return where a missing link could be meant to be."""
    if path in subject.relocations:
        return (subject.relocations[path],)
    root, name = subject.lab.scene.robot.path, path.rpartition("/")[2]
    return same_named_prims(subject.stage, root, name)


@rule("S02", "stage-units", scope="stage")
def stage_units(subject: StageSubject) -> Iterator[Problem]:
    """The stage is not Z up, in metres and kilograms.

    Why: lengths and masses of the handout, gravity and the ROS frames (+Z up, metres) depend on
    these units. A robot in centimetres is a hundred times too small.

    Fix: set the property named here to the value expected here, in the stage's properties (select
    the root in the Stage panel) or in the file's first lines, or open the supplied file again and
    save it under the new name.

    Example: `metersPerUnit = 0.01`, which is USD's default. If the given starter has the same
    units, the finding is a warning.
    """
    wanted, stage = subject.lab.scene.stage, subject.stage
    pairs = {
        "metersPerUnit": (stage.meters_per_unit, wanted.meters_per_unit),
        "kilogramsPerUnit": (stage.kilograms_per_unit, wanted.kilograms_per_unit),
    }
    tolerance = subject.lab.scene.tolerance.number
    is_turned = stage.up_axis != wanted.up_axis
    wrong = [("upAxis", stage.up_axis, wanted.up_axis)] if is_turned else []
    wrong += [
        (name, f"{actual:g}", f"{expected:g}")
        for name, (actual, expected) in pairs.items()
        if not abs(actual - expected) <= tolerance * expected
    ]
    for name, is_, should in wrong:
        message = f"{name} is {is_}, expected {should}"
        yield Problem("/", message, name, should, is_, wanted.handout)


@rule("S03", "robot-pose", scope="stage")
def robot_pose(subject: StageSubject) -> Iterator[Problem]:
    """The robot root is not at the pose of the starter.

    Why: the map, the initial pose of AMCL and the goals of the handout assume this pose. In later
    checkpoints it is a warning, because the stage may have been saved after a run.

    Fix: select the robot root and set Translate, Rotate and Scale to the values expected here in
    the Property panel.

    Example: `xformOp:translate` (0, 0, 0).
    """
    spec, stage = subject.lab.scene.robot, subject.stage
    root = stage.prim(spec.path)
    if root is None or (root.local is None and is_unresolved(stage, root.path)):
        return
    severity: Severity | None = None
    if subject.lab.is_after(subject.checkpoint.id, spec.pose_is_error_until):
        severity = "warning"
    tolerance = root_tolerance(subject.lab.scene, stage)
    for wrong in pose_errors(root, root.local or IDENTITY, spec.pose, tolerance):
        yield Problem(
            root.path,
            f"robot root's {wrong.message}",
            wrong.property,
            wrong.expected,
            wrong.actual,
            spec.pose.handout,
            severity=severity,
            hint=f"select the robot root and {wrong.hint}",
        )


@rule("S17", "scan-offset", scope="stage")
def scan_offset(subject: StageSubject) -> Iterator[Problem]:
    """A link, as the one that carries the lidar, is not at its place on the robot.

    Why: a scan is taken at the height of its link and published in that frame. At another place the
    lidar sees parts of the robot, or the walls do not match the map. The link's own transform is
    judged in the first checkpoint only, because a later stage may have been saved during a run. At
    Play the link goes where its joint holds it.

    Fix: select the link and set Translate to the value expected here in the Property panel, or
    restore the local positions of its joint, or start again from the supplied file.

    Example: `{robot}/{link}` 3 cm beside its place.
    """
    scene, stage = subject.lab.scene, subject.stage
    units, robot = units_of(scene, stage), scene.robot
    for name, link in robot.links.items():
        prim, expected = stage.prim(f"{robot.path}/{name}"), link.offset
        if prim is None or expected is None:
            continue
        for found in _link_places(subject, prim):
            if not is_near(found.at, expected, scene.tolerance.link_position, units):
                is_, should = vector_text(found.at), vector_text(units.shown(expected))
                message = f"{name} {found.how} at {is_} on the robot, expected {should}"
                related = () if found.prim == prim.path else (prim.path,)
                hint = f"{found.hint} {should}"
                yield Problem(
                    found.prim,
                    message,
                    found.property,
                    should,
                    is_,
                    link.handout,
                    related,
                    hint=hint,
                )


class _LinkPlace(Struct, frozen=True):
    """Where a link is on the robot, which property says so, and how that is repaired."""

    prim: str
    property: str
    at: Vector
    how: str
    hint: str


def _link_places(subject: StageSubject, link: Prim) -> Iterator[_LinkPlace]:
    """Yield where a link stands in the first checkpoint, and where its joint holds it."""
    robot = subject.lab.scene.robot
    root, base = subject.stage.prim(robot.path), robot.links.get(robot.base_frame)
    is_first = subject.checkpoint.id == subject.lab.first
    if is_first and not is_pose_unresolved(subject.stage, link) and root is not None:
        seen = root.world and link.world and relative_transform(link.world, root.world)
        if seen:
            hint = f"in the Property panel of {link.name}, set Translate to"
            where = pose_property(link, "translate")
            yield _LinkPlace(link.path, where, decompose(seen).translation, "sits", hint)
    joint = next((each for each in welds(subject) if link.path in bodies(each)), None)
    rest = rest_frames(subject).get(link.path)
    if joint is not None and rest is not None and base is not None and base.offset is None:
        side = 1 - bodies(joint).index(link.path)
        hint = f"restore the local positions of {joint.name}, so that it holds {link.name} at"
        at = decompose(rest).translation
        yield _LinkPlace(joint.path, f"physics:localPos{side}", at, "is held", hint)
