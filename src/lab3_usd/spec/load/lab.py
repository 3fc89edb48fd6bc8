"""Puts the lab together out of the files of `graphs/`, each checked against the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.data import data_folder, lab_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec import ros
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, SUBMISSION, Lab
from lab3_usd.spec.load.catalog import parse_catalog
from lab3_usd.spec.load.checkpoints import accumulate, by_ids, read_checkpoint_file
from lab3_usd.spec.load.compiled import load_isaac_types
from lab3_usd.spec.load.graph import parse_graph
from lab3_usd.spec.positions import located
from lab3_usd.spec.scene import SceneSpec
from lab3_usd.spec.submission import (
    ChecklistSpec,
    Deliverable,
    FolderNames,
    StageFiles,
    StarterRules,
    SubmissionSpec,
)
from lab3_usd.spec.values import typed_value
from lab3_usd.spec.yaml_file import read_yaml, record, records

_ByName = dict[str, dict[str, Any]]


class RosFile(Struct, forbid_unknown_fields=True):
    """The running system, and the commands that show it."""

    system: ros.SystemSpec
    topics: _ByName = {}
    lifecycle: ros.LifecycleSpec = ros.LifecycleSpec("", {})
    nodes: dict[str, ros.HandoutReference] = {}
    forbidden_nodes: ros.ForbiddenNodes = ros.ForbiddenNodes((), "")
    goal: ros.GoalSpec | None = None
    evidence: _ByName | None = None  # as in the bundled lab
    commands: tuple[dict[str, Any], ...] = ()
    navigation: ros.NavigationSpec | None = None


def load_ros(folder: Path | None = None) -> ros.RosSpec:
    """Load `ros.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else lab_folder()
    content = record(read_yaml(folder / ROS), RosFile, ROS)
    kinds = records(_evidence(content), ros.EvidenceKind, f"{ROS}: evidence")
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
        navigation=content.navigation,
    )


def _evidence(content: RosFile) -> _ByName:
    """Return how diagnostic commands are written: as in the bundled lab by default."""
    if content.evidence is not None:
        return content.evidence
    evidence: _ByName = read_yaml(data_folder("graphs") / ROS)["evidence"]
    return evidence


def _command(
    entry: Mapping[str, Any], kinds: Mapping[str, ros.EvidenceKind], where: str
) -> ros.Command:
    name = entry.get("kind")
    if not isinstance(name, str) or name not in kinds:
        raise SpecError(f"{where}: there is no kind {name!r}; known are {', '.join(kinds)}")
    return record({**entry, "kind": kinds[name]}, ros.Command, f"{where} ({name})")


def parse_scene(data: Mapping[str, Any]) -> SceneSpec:
    """Return what a scene file that has been read asks for.

    Raises:
        SpecError: it lacks a part, or holds a value of the wrong kind; the line names the part.
    """
    scene = record(data, SceneSpec, SCENE)
    wheels = scene.robot.wheels
    if wheels.left and wheels.left not in wheels.joints:
        raise SpecError(
            f"{SCENE}: robot: wheels: left: '{wheels.left}' is not a joint of the wheels"
        )
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
    return replace(scene, sensors=sensors)


class SubmissionFile(Struct, forbid_unknown_fields=True):
    """The files of a submission, and the checklists."""

    folders: FolderNames
    stages: StageFiles
    deliverables: dict[str, dict[str, Any]] = {}
    starter: StarterRules | None = None  # as in the bundled lab
    checklist: dict[str, tuple[dict[str, Any], ...]] = {}


def load_submission(folder: Path | None = None) -> SubmissionSpec:
    """Load `submission.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else lab_folder()
    content = record(read_yaml(folder / SUBMISSION), SubmissionFile, SUBMISSION)
    checklist = f"{SUBMISSION}: checklist"
    return SubmissionSpec(
        folders=content.folders,
        stages=content.stages,
        deliverables=records(content.deliverables, Deliverable, f"{SUBMISSION}: deliverables"),
        starter=content.starter or _usual_starter(),
        checklist=tuple(
            record({"section": section, **line}, ChecklistSpec, f"{checklist}: {section}")
            for section, lines in content.checklist.items()
            for line in lines
        ),
    )


def _usual_starter() -> StarterRules:
    """Return what the bundled lab compares of a starter: facts of USD and of Isaac Sim."""
    content = read_yaml(data_folder("graphs") / SUBMISSION)
    return record(content["starter"], StarterRules, f"{SUBMISSION}: starter")


def assemble(folder: Path) -> Lab:
    """Read every file of the lab.

    Raises:
        SpecError: a file is missing or wrong; the line ends with its place in the file.
    """
    try:
        return _assembled(folder)
    except SpecError as error:
        raise located(error, folder) from error


def _assembled(folder: Path) -> Lab:
    content = read_checkpoint_file(read_yaml(folder / CHECKPOINTS))
    files = _graph_files(folder, content.graph_names())
    catalog = _catalog(folder, files)
    graphs = {name: _graph(name, data, catalog) for name, data in files.items()}
    scene = parse_scene(read_yaml(folder / SCENE))
    lab = Lab(
        folder=folder,
        title=content.title,
        catalog=catalog,
        graphs=graphs,
        checkpoints=accumulate(content, graphs, tuple(scene.sensors)),
        policy=content.policy,
        frames=content.frames,
        ros=load_ros(folder),
        submission=load_submission(folder),
        handout=content.handout,
        scene=scene,
    )
    lab = by_ids(_with_starter(lab))
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


def _with_starter(lab: Lab) -> Lab:
    """Return a lab whose starter has a name: where the lab has none, that of the first stage."""
    stages = lab.submission.stages
    named = replace(stages, starter=stages.starter or lab.checkpoints[lab.first].file)
    return replace(lab, submission=replace(lab.submission, stages=named))


def _catalog(folder: Path, graphs: Mapping[str, Mapping[str, Any]]) -> Catalog:
    """Return the node types of the lab, and those of Isaac Sim that its graphs name besides.

    What the lab's own catalog leaves out is as in the bundled one.
    """
    catalog = parse_catalog(_catalog_data(folder / CATALOG))
    more = sorted(set(_named_types(graphs)) - set(catalog.types))
    known = load_isaac_types().catalog.types if more else {}
    types = {name: known[name] for name in more if name in known}
    return replace(catalog, types={**catalog.types, **types})


def _catalog_data(own: Path) -> dict[str, Any]:
    """Return the lab's own file over that of the bundled lab, type by type."""
    bundled = data_folder("graphs") / own.name
    if own == bundled:
        return read_yaml(own)
    base, content = read_yaml(bundled), read_yaml(own) if own.exists() else {}
    types = content.get("types", {})
    if not isinstance(types, dict):
        return content  # which its reader refuses
    return {**base, **content, "types": {**base["types"], **types}}


def _named_types(graphs: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the node types that files of graphs name; faults of a file are reported later."""
    for data in graphs.values():
        nodes = data.get("nodes")
        for node in nodes.values() if isinstance(nodes, dict) else ():
            if isinstance(node, dict) and isinstance(node.get("type"), str):
                yield node["type"]


def _graph_files(folder: Path, names: list[str]) -> dict[str, dict[str, Any]]:
    found = {}
    for name in names:
        file = f"{name}.yaml"
        if not (folder / file).is_file():
            raise SpecError(f"{CHECKPOINTS}: asks for the graph '{name}', but there is no {file}")
        found[name] = read_yaml(folder / file)
    return found


def _graph(name: str, data: Mapping[str, Any], catalog: Catalog) -> GraphSpec:
    file = f"{name}.yaml"
    spec = parse_graph(data, catalog, file)
    if spec.name != name:
        raise SpecError(f"{file}: describes the graph '{spec.name}', expected '{name}'")
    return spec
