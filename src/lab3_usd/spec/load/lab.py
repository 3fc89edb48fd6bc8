"""Assembles the lab from the files of `graphs/`, each checked against the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Formatter
from typing import Any

from msgspec import UNSET, Struct, UnsetType
from msgspec.structs import replace

from lab3_usd.data import data_folder, program
from lab3_usd.errors import SpecError
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import typed_value
from lab3_usd.spec import ros
from lab3_usd.spec.contradictions.names import graph_frames, graph_topics
from lab3_usd.spec.lab import CHECKPOINTS, ROS, RUBRIC, SCENE, SUBMISSION, Lab, Policy
from lab3_usd.spec.load.checkpoints import (
    accumulate,
    read_checkpoint_file,
    with_ids,
)
from lab3_usd.spec.load.graph_file import parse_graph
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.scene import (
    ForbiddenPrims,
    RobotSpec,
    SceneSpec,
    SensorSpec,
    StageUnits,
    Tolerances,
    WorldSpec,
)
from lab3_usd.spec.submission import (
    FIRST_TEAM,
    ChecklistSpec,
    Deliverable,
    FolderNames,
    StageFiles,
    StarterRules,
    SubmissionSpec,
    of_team,
)
from lab3_usd.yaml_file import as_record, read_yaml, records

_ByName = dict[str, dict[str, Any]]


class RosFile(Struct, forbid_unknown_fields=True):
    """The running system, and the commands that show it.

    What `navigation` leaves out is as in the bundled lab.
    """

    system: ros.SystemSpec
    topics: _ByName = {}
    lifecycle: ros.LifecycleSpec = ros.LifecycleSpec("", {})
    nodes: dict[str, ros.HandoutReference] = {}
    forbidden_nodes: ros.ForbiddenNodes = ros.ForbiddenNodes((), "")
    goal: ros.GoalSpec | None = None
    evidence: _ByName | None = None  # as in the bundled lab
    commands: tuple[dict[str, Any], ...] = ()
    navigation: dict[str, Any] | None = None


def _ros_data(folder: Path) -> dict[str, Any]:
    if (folder / ROS).is_file():
        return read_yaml(folder / ROS)
    # The course shows nothing of the running system.
    return {"system": {**_bundled_ros()["system"], "packages": {}, "handout": ""}}


def _ros_spec(data: Mapping[str, Any]) -> ros.RosSpec:
    content = as_record(data, RosFile, ROS)
    evidence = _bundled_ros()["evidence"] if content.evidence is None else content.evidence
    kinds = records(evidence, ros.EvidenceKind, f"{ROS}: evidence")
    for name, kind in kinds.items():
        for key, text, placeholders in (
            ("run", kind.run, ("of", "to")),
            ("file", kind.file, ("name",)),
        ):
            _refuse_placeholders(text, placeholders, f"{ROS}: evidence: {name}: {key}")
    return ros.RosSpec(
        system=content.system,
        topics=records(content.topics, ros.TopicSpec, f"{ROS}: topics"),
        lifecycle=content.lifecycle,
        nodes=content.nodes,
        forbidden_nodes=content.forbidden_nodes,
        goal=content.goal,
        kinds=kinds,
        commands=tuple(
            _command(command, kinds, f"{ROS}: command {number}")
            for number, command in enumerate(content.commands, start=1)
        ),
        navigation=_navigation(content.navigation),
    )


def _navigation(given: dict[str, Any] | None) -> ros.NavigationSpec | None:
    """Return Nav2's parameters, laid over those of the bundled lab; None for a lab without Nav2."""
    if given is None:
        return None
    is_whole = given.keys() >= {*ros.NavigationSpec.__struct_fields__}
    usual = {} if is_whole else _bundled_ros()["navigation"]
    usual.pop("handout", None)
    return as_record({**usual, **given}, ros.NavigationSpec, f"{ROS}: navigation")


def _refuse_placeholders(text: str, allowed: tuple[str, ...], where: str) -> None:
    """Refuse what is written like a placeholder and is none."""
    try:
        placeholders = [name for _, name, _, _ in Formatter().parse(text) if name is not None]
    except ValueError as error:
        raise SpecError(f"{where}: {error}") from error
    for name in placeholders:
        if name not in allowed:
            listed = ", ".join(f"{{{each}}}" for each in allowed)
            raise SpecError(f"{where}: '{{{name}}}' is not a placeholder; known are {listed}")


def _bundled_ros() -> dict[str, Any]:
    return read_yaml(data_folder("graphs") / ROS)


def _command(
    entry: Mapping[str, Any], kinds: Mapping[str, ros.EvidenceKind], where: str
) -> ros.Command:
    name = entry.get("kind")
    if not isinstance(name, str) or name not in kinds:
        raise SpecError(f"{where}: there is no kind {name!r}; known are {', '.join(kinds)}")
    return as_record({**entry, "kind": kinds[name]}, ros.Command, f"{where} ({name})")


class SceneFile(Struct, forbid_unknown_fields=True):
    """The scene: units, robots, sensors, world and map.

    `robots` are described by name; `robot` is the only one, without a name. A course of scenes has
    neither, but `props`. `namespaces` are those that prims give to the topics of what is below them
    (`isaac:namespace`), by path.
    """

    stage: StageUnits
    tolerance: Tolerances
    world: WorldSpec = WorldSpec()
    robot: RobotSpec | UnsetType = UNSET
    robots: _ByName = {}
    forbidden: ForbiddenPrims = ForbiddenPrims()
    sensors: dict[str, SensorSpec] = {}
    namespaces: dict[str, str] = {}
    props: dict[str, PropSpec] = {}
    map: ros.MapFacts | None = None


def parse_scene(data: Mapping[str, Any]) -> SceneSpec:
    """Return what a scene file that has been read asks for.

    Raises:
        SpecError: it lacks a part, or holds a value of the wrong kind; the line names the part.
    """
    scene = as_record(data, SceneFile, SCENE)
    places: dict[str, str] = {}
    sensors = {}
    for sensor, spec in scene.sensors.items():
        where = f"{SCENE}: {sensor}"
        if spec.path in places:
            raise SpecError(f"{where}: '{spec.path}' is the path of {places[spec.path]}")
        places[spec.path] = sensor
        typed = {
            name: replace(
                attribute, value=typed_value(attribute.value, attribute.type, f"{where}: {name}")
            )
            for name, attribute in spec.attributes.items()
        }
        sensors[sensor] = replace(spec, attributes=typed)
    return SceneSpec(
        stage=scene.stage,
        tolerance=scene.tolerance,
        robots=tuple(_robots(scene)),
        world=scene.world,
        forbidden=scene.forbidden,
        sensors=sensors,
        map=scene.map,
        namespaces=scene.namespaces,
        props=scene.props,
    )


def _robots(scene: SceneFile) -> Iterator[RobotSpec]:
    """Yield the robots of a scene file: the only one, those with names, or none."""
    if scene.robot is not UNSET and scene.robots:
        raise SpecError(f"{SCENE}: 'robot' or 'robots': both are given, expected one of them")
    named = records(scene.robots, RobotSpec, f"{SCENE}: robots")
    robot_of = {f"robots: {name}": robot for name, robot in named.items()}
    robot_of |= {} if isinstance(scene.robot, UnsetType) else {"robot": scene.robot}
    places: dict[str, str] = {}
    for where, robot in robot_of.items():
        wheels = robot.wheels
        if wheels.left and wheels.left not in wheels.joints:
            raise SpecError(
                f"{SCENE}: {where}: wheels: left: '{wheels.left}' is not a joint of the wheels"
            )
        if robot.path in places:
            raise SpecError(f"{SCENE}: {where}: '{robot.path}' is the path of {places[robot.path]}")
        places[robot.path] = where
        yield robot


class SubmissionFile(Struct, forbid_unknown_fields=True):
    """The files of a submission, and the checklists."""

    folders: FolderNames
    stages: StageFiles
    deliverables: dict[str, dict[str, Any]] = {}
    starter: StarterRules | None = None  # as in the bundled lab
    checklist: dict[str, tuple[dict[str, Any], ...]] = {}


def load_submission(folder: Path, ids: Mapping[str, str]) -> SubmissionSpec:
    """Load `submission.yaml` of a folder; `ids` are those of the checkpoints by their keys.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    content = as_record(read_yaml(folder / SUBMISSION), SubmissionFile, SUBMISSION)
    checklist = f"{SUBMISSION}: checklist"
    starter = content.starter
    if starter is None:  # facts of USD and of Isaac Sim: those that the bundled lab compares
        bundled = read_yaml(data_folder("graphs") / SUBMISSION)["starter"]
        usual = as_record(bundled, StarterRules, f"{SUBMISSION}: starter")
        starter = replace(usual, handout=content.stages.handout)
    differ = tuple(ids.get(key, key) for key in content.stages.differ)
    lines = (
        as_record({"section": section, **line}, ChecklistSpec, f"{checklist}: {section}")
        for section, lines in content.checklist.items()
        for line in lines
    )
    return SubmissionSpec(
        folders=content.folders,
        stages=replace(content.stages, differ=differ),
        deliverables=records(content.deliverables, Deliverable, f"{SUBMISSION}: deliverables"),
        starter=starter,
        checklist=tuple(replace(line, stages=ids.get(line.stages, line.stages)) for line in lines),
    )


def refuse_no_lab(folder: Path) -> None:
    """Refuse a folder that describes no lab at all.

    Raises:
        SpecError: it is missing, empty, or without the file that names the others.
    """
    if not folder.is_dir():
        raise SpecError(f"{folder}: there is no such folder; name one that describes a lab")
    if not (folder / CHECKPOINTS).is_file():
        what = f"holds no {CHECKPOINTS}" if any(folder.iterdir()) else "is empty"
        write = f"{program()} lab new DIR STAGE... describes one"
        raise SpecError(f"{folder}: {what}; name a folder that describes a lab ({write})")


def assemble_lab(folder: Path, platform: Platform, team: str) -> Lab:
    """Read every file of the lab, with the values of a team, '' for the first one.

    Raises:
        SpecError: a file is missing or wrong; the line names file, graph, role and port.
    """
    checkpoints = read_yaml(folder / CHECKPOINTS)
    pattern = {"files": checkpoints.get("files")}  # whose place for the team is each team's
    content = read_checkpoint_file(of_team(checkpoints, team or FIRST_TEAM) | pattern)
    written = {}
    for name in content.graph_names():
        file = f"{name}.yaml"
        if not (folder / file).is_file():
            raise SpecError(f"{CHECKPOINTS}: asks for the graph '{name}', but there is no {file}")
        written[file] = read_yaml(folder / file)
    written |= {SCENE: read_yaml(folder / SCENE), ROS: _ros_data(folder)}
    written |= {CHECKPOINTS: {key: checkpoints[key] for key in checkpoints if key not in pattern}}
    files = {file: of_team(data, team or FIRST_TEAM) for file, data in written.items()}
    said = {file: with_ids(data, content.ids) for file, data in files.items()}
    graphs = {}
    for name in content.graph_names():
        file = f"{name}.yaml"
        graphs[name] = parse_graph(said[file], platform, file)
        if graphs[name].name != name:
            wrong = f"describes the graph '{graphs[name].name}', expected '{name}'"
            raise SpecError(f"{file}: {wrong}")
    scene = parse_scene(said[SCENE])
    _refuse_other_names(content.policy, platform)
    lab = Lab(
        folder=folder,
        title=content.title,
        platform=_with_sensors(platform, scene),
        graphs=graphs,
        checkpoints=accumulate(content, graphs, scene.sensors),
        policy=content.policy,
        frames=content.frames,
        ros=_ros_spec(said[ROS]),
        submission=load_submission(folder, content.ids),
        handout=content.handout,
        scene=scene,
        by_team=tuple(file for file, data in written.items() if files[file] != data),
        team=team,
    )
    stages = lab.submission.stages  # without a name, the starter has that of the first stage
    named = replace(stages, starter=stages.starter or lab.checkpoints[lab.first].file)
    lab = replace(lab, submission=replace(lab.submission, stages=named))
    lab = _with_silence(lab)
    return replace(lab, points=_points(folder / RUBRIC, lab))


def _points(rubric: Path, lab: Lab) -> dict[str, float]:
    """Return what each checkpoint is worth by a rubric, which grading reads, and may refuse."""
    try:
        items = read_yaml(rubric).get("items") if rubric.is_file() else None
    except SpecError:
        items = None
    points: dict[str, float] = {}
    for item in items.values() if isinstance(items, dict) else ():
        if isinstance(item, dict) and isinstance(item.get("points"), int | float):
            checkpoint = str(item.get("checkpoint", ""))
            checkpoint = lab.ids.get(checkpoint, checkpoint)
            points[checkpoint] = points.get(checkpoint, 0.0) + item["points"]
    return points


def _with_silence(lab: Lab) -> Lab:
    """Return a lab whose checkpoints know the topics and frames of graphs that they do not have.

    Those topics were removed; the frames are also those of optional checkpoints and of later ones.
    """
    topics: dict[str, set[str]] = {}
    for topic in graph_topics(lab):
        topics.setdefault(topic.graph, set()).add(topic.name)
    points, frames = {}, {frame.child for frame in graph_frames(lab)}
    for key, point in lab.checkpoints.items():
        there = [topics.get(name, set()) for name in point.graphs]
        gone = [topics.get(n, set()) for n, g in lab.graphs.items() if point.is_removed(g.path)]
        reached = ("", *lab.reached(key))
        own = {}
        for name in point.graphs:
            nodes = lab.graphs[name].nodes.items()
            own[name] = lab.graphs[name].without([r for r, n in nodes if n.since not in reached])
        points[key] = replace(
            point,
            silent=frozenset().union(*gone).difference(*there),
            unsent=frozenset(frames - {f.child for f in graph_frames(replace(lab, graphs=own))}),
        )
    return replace(lab, checkpoints=points)


def _refuse_other_names(policy: Policy, platform: Platform) -> None:
    """Refuse names of ROS that are not Isaac Sim's: no lab can change them."""
    for name in ("namespace", "namespace_attribute", "tree_topics"):
        said, usual = getattr(policy, name), getattr(platform.ros, name)
        if said and said != usual:
            raise SpecError(
                f"{CHECKPOINTS}: policy: {name} is {said!r}, that of Isaac Sim {usual!r}"
            )


def _with_sensors(platform: Platform, scene: SceneSpec) -> Platform:
    """Return a platform whose sensors of the lab are placed, and read as the lab describes them."""
    sensors = scene.sensors.values()
    types = {sensor.type for sensor in sensors}
    attributes = {name for sensor in sensors for name in sensor.attributes}
    attributes |= {name for prop in scene.props.values() for name in prop.properties}
    return replace(
        platform,
        placed=platform.placed | types,
        attributes=platform.attributes | attributes,
    )
