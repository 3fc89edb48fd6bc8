"""Rules about what the starter brings, and time samples that change it."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject, StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.repairs import moved_back, restorable, restoration
from lab3_usd.check.robot.axles import held_at, holder_of, rest_frames
from lab3_usd.check.robot.ground import UP
from lab3_usd.check.robot.location import demanded_prims, same_named_prims
from lab3_usd.check.robot.poses import is_near, pose_errors, pose_property, root_tolerance, units_of
from lab3_usd.check.robot.sensors import is_named
from lab3_usd.check.rules.graphs import with_missing_graphs
from lab3_usd.check.rules.sensors import EMPTY, part_of_pose, pose_demands
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.values import same_numbers
from lab3_usd.model.changes import MovePrim, RemovePrim, Restore
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.physics import bodies, bodies_below
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import AnimatedAttribute, UnresolvedAsset, absence_reason
from lab3_usd.model.transforms import (
    AXES,
    IDENTITY,
    Vector,
    angle_between,
    decompose,
    relative_transform,
    rotation_difference,
    vector_text,
)
from lab3_usd.spec.lab import Checkpoint, Lab


def _supplied_prims(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    del checkpoint
    for path, handout in demanded_prims(lab).items():
        demand = f"{lab.scene.group_of(path)}/prim/{path.rpartition('/')[2]}"
        yield Demand(demand, f"{path} exists", path, handout)


@rule("S01", "missing-prim", scope="world", demands=_supplied_prims)
def missing_prim(subject: RobotSubject) -> Iterator[Problem]:
    """Robot, link or parent of the graphs is missing or elsewhere.

    Why: graphs, sensors and TF refer to these prims by their paths. Prims below a missing prim are
    not reported one by one. If the robot was moved, its parts are judged where they are.

    Fix: undo the deletion, or activate the prim (right-click in the Stage panel, Activate). If it
    was deleted long ago, open the supplied file again and repeat the steps from there.

    Example: `{robot}/{link}` deactivated in the Stage panel.
    """
    scene, stage = subject.lab.scene, subject.stage
    root = subject.robot
    for expected, home in subject.relocations.items():
        if home == root.path:  # everything else is judged where it is
            problem = Problem(
                home,
                f"{root.called} is at {home}, expected at {expected}",
                expected=expected,
                actual=home,
                handout=root.handout,
                related=(expected,),
                hint=f"rename or drag the robot in the Stage panel, back to {expected}",
                fix=(MovePrim(home, expected),),
                unmet=(f"{root.group}/prim/{expected.rpartition('/')[2]}",),
            )
            yield with_missing_graphs(problem, subject)
    parent = scene.world.graph_parent
    wanted = {} if parent is None else {parent.path: parent.handout}
    if scene.robots:
        wanted[root.path] = root.handout
    if stage.prim(root.path) is not None:
        wanted |= dict.fromkeys(root.link_paths, root.handout)
    missing: list[str] = []
    for path, handout in wanted.items():
        if stage.prim(path) is not None or any(is_at_or_below(path, top) for top in missing):
            continue
        asset = stage.unknown(path)
        if asset is None:
            missing.append(path)
        reason = absence_reason(stage, path)
        places = (
            (subject.relocations[path],)
            if path in subject.relocations
            else same_named_prims(stage, root.path, path.rpartition("/")[2])
        )
        problem = Problem(
            path,
            f"{path} {reason}",
            expected=path,
            actual=reason,
            handout=handout,
            fix=(restoration(path, stage),),
            absent=True,
            rests_on=asset,
        )
        yield with_missing_graphs(moved_back(problem, path, places), subject)


def _units(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    del checkpoint
    spec = lab.scene.stage
    titles = {
        "upAxis": f"up axis {spec.up_axis}",
        "metersPerUnit": f"{spec.meters_per_unit:g} m per unit",
        "kilogramsPerUnit": f"{spec.kilograms_per_unit:g} kg per unit",
    }
    if spec.default_prim:
        titles["defaultPrim"] = f"default prim {spec.default_prim}"
    for name, title in titles.items():
        yield Demand(f"Scene/stage/{name}", title, "/", spec.handout)


@rule("S02", "stage-units", scope="stage", demands=_units)
def stage_units(subject: StageSubject) -> Iterator[Problem]:
    """The stage has another up axis, other units or another default prim.

    Why: lengths, masses and gravity{running system?}, and the ROS frames (+Z up, metres),{/} depend
    on these units. With centimetres for metres a thing is a hundred times too small.

    Fix: set the property named here to the value expected here, in the stage's properties (select
    the root in the Stage panel) or in the file's first lines, or open the supplied file again and
    save it under the new name.

    Example: a new stage, whose unit is USD's default. If the given starter has the same units, the
    finding is a warning.
    """
    wanted, stage = subject.lab.scene.stage, subject.stage
    units = {
        "metersPerUnit": (stage.meters_per_unit, wanted.meters_per_unit),
        "kilogramsPerUnit": (stage.kilograms_per_unit, wanted.kilograms_per_unit),
    }
    margin = subject.lab.scene.tolerance.margin("unit")
    is_turned = stage.up_axis != wanted.up_axis
    wrong: list[tuple[str, str, str]] = []
    wrong += [("upAxis", stage.up_axis, wanted.up_axis)] if is_turned else []
    default = stage.default_prim.removeprefix("/")
    if wanted.default_prim not in ("", default):
        wrong.append(("defaultPrim", default or "not set", wanted.default_prim))
    wrong += [
        (name, f"{unit:g}", f"{right:g}")
        for name, (unit, right) in units.items()
        if not same_numbers([unit], [right], margin)
    ]
    teller = "tell your instructor; the starter needs other units or another up axis"
    for name, actual, expected in wrong:
        message = f"{name} is {actual}, expected {expected}"
        problem = Problem("/", message, name, expected, actual, if_supplied=teller)
        yield restorable(problem, wanted.handout, f"Scene/stage/{name}")


def _robot_pose(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    del checkpoint
    for robot in lab.scene.robots:
        if robot.pose is not None:
            yield from pose_demands(robot.group, robot.path, robot.pose)


@rule("S03", "robot-pose", scope="robot", demands=_robot_pose)
def robot_pose(subject: RobotSubject) -> Iterator[Problem]:
    """The robot root has another pose than the starter's.

    Why: all places in the handout assume this pose. In later checkpoints it is a warning, because
    the stage may have been saved after a run.

    Fix: select the robot root and set Translate, Rotate and Scale to the values expected here in
    the Property panel.

    Example: `xformOp:translate` (0, 0, 0).
    """
    spec, stage = subject.robot, subject.stage
    root = stage.prim(spec.path)
    if root is None or spec.pose is None:
        return
    severity: Severity | None = None
    if subject.lab.is_after(subject.checkpoint.id, spec.pose_is_error_until) and not root.placeless:
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
            fix=() if root.placeless else (Restore(root.path, wrong.property),),
            unmet=(part_of_pose(spec.group, wrong.kind),),
            # An unset pose would be that of the origin.
            rests_on=stage.unknown_pose(root),
        )


def _link_offsets(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for robot in lab.scene.robots if checkpoint.id == lab.first else ():
        for name, link in robot.links.items():
            if link.offset is not None:
                title = f"{name} sits at {list(link.offset)} on the robot"
                path = robot.path_of(name)
                yield Demand(f"{robot.group}/offset/{name}", title, path, link.handout)


@rule("S17", "link-place", scope="robot", formerly="scan-offset", demands=_link_offsets)
def link_place(subject: RobotSubject) -> Iterator[Problem]:
    """A link with a sensor is at another place.

    Why: a sensor measures at its link and publishes in that frame. At another place it sees parts
    of the robot, or its data is displaced. The link's own transform is judged in the first
    checkpoint only, since later stages may be saved during a run; at Play the link goes where its
    joint holds it. A turned link is a warning: its frame turns with it, so that its data stays
    right in TF.

    Fix: select the link and set Translate to the value expected here in the Property panel, or
    restore the local positions of its joint, or start again from the supplied file.

    Example: `{robot}/{link}` 3 cm beside its place.
    """
    scene, stage = subject.lab.scene, subject.stage
    units, robot = units_of(scene, stage), subject.robot
    for name, link in robot.links.items():
        prim, expected = stage.prim(robot.path_of(name)), link.offset
        if prim is None or expected is None:
            continue
        for place in _link_places(subject, prim):
            site, asset = place.prim, place.unknown
            related = () if site == prim.path else (prim.path,)
            if not is_near(place.at, expected, scene.tolerance.link_position, units):
                at, asked = vector_text(place.at), vector_text(units.shown(expected))
                message = f"{name} {place.how} at {at} on the robot, expected {asked}"
                hint, unmet = f"{place.hint} {asked}", f"{robot.group}/{place.demand}/{name}"
                problem = Problem(site, message, place.property, asked, at, hint=hint)
                yield restorable(problem, link.handout, unmet, related=related, rests_on=asset)
            elif place.turn > scene.tolerance.axle_angle:
                turn = f"{place.turn:.3g} degrees"
                message = f"{name} {place.how} turned by {turn}, expected 0"
                problem = Problem(site, message, place.turned_by, "0 degrees", turn)
                problem = restorable(problem, link.handout, related=related, rests_on=asset)
                yield replace(problem, severity="warning")


class _LinkPlace(Struct, frozen=True):
    """Where a link is on the robot, which property says so, and how that is repaired.

    `turn` is by how many degrees the property `turned_by` turns it.
    `demand` is what is unmet where that is elsewhere: the link's own place, or that it is held.
    `unknown` is a missing asset that could put the link elsewhere.
    """

    prim: str
    property: str
    at: Vector
    turned_by: str
    turn: float
    how: str
    hint: str
    demand: str
    unknown: UnresolvedAsset | None = None


def _link_places(subject: RobotSubject, link: Prim) -> Iterator[_LinkPlace]:
    """Yield where a link stands in the first checkpoint, and where its joint holds it."""
    robot = subject.robot
    root, base = subject.stage.prim(robot.path), robot.links.get(robot.base_frame)
    is_first = subject.checkpoint.id == subject.lab.first
    seen = root and root.world and link.world and relative_transform(link.world, root.world)
    if is_first and seen and not link.placeless:  # else it is no body
        hint = f"in the Property panel of {link.name}, set Translate to"
        translate = pose_property(link, "translate")
        at, unknown = decompose(seen), subject.stage.unknown_pose(link)
        turned_by, turn = pose_property(link, "rotate"), rotation_difference(at.rotation, AXES)
        point = at.translation
        yield _LinkPlace(
            link.path, translate, point, turned_by, turn, "sits", hint, "offset", unknown
        )
    joint = holder_of(subject, link.path)
    rest = held_at(subject, joint, link.path) if joint is not None else None
    if joint is not None and rest is not None and base is not None and base.offset is None:
        side = 1 - bodies(joint).index(link.path)
        hint = f"restore the local positions of {joint.name}, so that it holds {link.name} at"
        at = decompose(rest)
        is_level = angle_between(at.rotation[2], UP) <= subject.lab.scene.tolerance.axle_angle
        turn = rotation_difference(at.rotation, AXES) if is_level else 0.0
        how = "is held" if link.path in rest_frames(subject) else "would be held"
        place, turned_by = f"physics:localPos{side}", f"physics:localRot{side}"
        point = at.translation
        yield _LinkPlace(joint.path, place, point, turned_by, turn, how, hint, "joined")


_OPERATION, _ORDER = "xformOp:", "xformOpOrder"
_SENSOR = "omni:sensor:"


@rule("S30", "value-changes-with-time", scope="stage", severity="warning")
def value_changes_with_time(subject: StageSubject) -> Iterator[Problem]:
    """A value changes during Play.

    Why: at Play the timeline runs over the samples, and the robot, a sensor or a setting no longer
    has its saved value. The value at the start is judged like any other. This rule reports later
    values: an error for the poses of the robot and the sensors and for sensor rates, otherwise a
    warning.

    Fix: select the prim, delete the keys of the attribute in the Curve Editor or the Timeline, and
    set the value again.

    Example: the robot has a key at time 50 that puts it at (9, 9, 9).
    """
    nodes = live_nodes(subject.stage)
    for attribute in subject.stage.moving:
        severity = _severity(attribute, subject)
        if severity is not None:
            yield Problem(
                attribute.prim,
                f"{attribute.property} is {attribute.first} at the start and {attribute.then} "
                f"at time {attribute.time:g}, expected one value",
                property=attribute.property,
                expected=attribute.first,
                actual=attribute.then,
                severity=severity,
                fix=(Restore(attribute.prim, attribute.property),),
                assumes=((attribute.prim, None),) if attribute.prim in nodes else (),
            )


def _severity(moving: AnimatedAttribute, subject: StageSubject) -> Severity | None:
    """Return how grave it is that the value changes, None where it matters to nothing."""
    stage = subject.stage
    if moving.prim in live_nodes(stage):
        return "warning" if moving.property.startswith(INPUT) else None
    prim = stage.prim(moving.prim)
    if prim is None:
        return None
    if moving.property.startswith(_OPERATION):
        order = prim.attributes.get(_ORDER)
        is_used = isinstance(order, tuple) and any(
            str(name).endswith(moving.property) for name in order
        )
        return _severity_of_place(moving.prim, subject) if is_used else None
    if moving.property not in prim.attributes:
        return None
    is_rate = moving.property.startswith(_SENSOR) and any(
        sensor.path == moving.prim and moving.property in sensor.required
        for sensor in (subject.lab.sensors[name] for name in subject.checkpoint.sensors)
    )
    return "error" if is_rate else "warning"


def _severity_of_place(path: str, subject: StageSubject) -> Severity | None:
    stage, scene = subject.stage, subject.lab.scene
    robots = [robot.path for robot in scene.robots]
    sensors = [scene.sensors[name].path for name in subject.checkpoint.sensors]
    links = (body for robot in robots for body in bodies_below(stage, robot))
    parts = [*robots, *sensors, *links]
    if any(is_at_or_below(part, path) for part in parts):
        return "error"
    is_solid = bool(bodies_below(stage, path)) or any(True for _ in stage.colliders.below(path))
    return "warning" if is_solid else None


def _nothing_more(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    if checkpoint.id == lab.first:
        handout = lab.scene.forbidden.starter.handout
        yield Demand(EMPTY, "nothing of the later parts", "/", handout, part="starter")


@rule("S18", "starter-not-empty", scope="stage", demands=_nothing_more)
def starter_not_empty(subject: StageSubject) -> Iterator[Problem]:
    """The first checkpoint contains parts of later ones.

    Why: the first checkpoint shows the supplied scene. Leftovers of a finished lab publish beside
    the student's own graphs: two clocks, two parents of one frame.

    Fix: open the supplied file and save it as the first checkpoint before adding anything. Delete
    the prims named here.

    Example: `/World/ActionGraph` in `{stage0}`.
    """
    if subject.checkpoint.graphs:
        return
    spec = subject.lab.scene.forbidden.starter
    form = subject.lab.platform.graph
    graphs = [subject.stage.prim(graph.path) for graph in subject.lab.graphs.values()]
    tops = [prim.path for prim in graphs if prim is not None and prim.type == form.type]
    types = [(prim.path, prim.type) for prim in subject.stage.prims.values() if prim.present]
    types += [(node.path, "") for node in subject.stage.nodes()]
    for path, kind in sorted(types):
        is_sensor = any(kind == sensor.type for sensor in subject.lab.sensors.values())
        is_wrong = is_named(path.rpartition("/")[2], spec.names) or kind == form.type
        is_wrong = is_wrong or (path in spec.paths and not is_sensor)
        is_wrong = is_wrong and not subject.checkpoint.is_removed(path)
        if is_wrong and not any(is_at_or_below(path, top) for top in tops):
            tops.append(path)
            message = f"{path} is not part of the supplied scene; was this saved late?"
            fix, unmet = (RemovePrim(path),), (EMPTY,)
            yield Problem(path, message, actual=kind, handout=spec.handout, fix=fix, unmet=unmet)
