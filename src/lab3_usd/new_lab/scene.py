"""Describes the scene of a stage, its sensors, and the starter that it is built on."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.robot.ground import boxes, has_ground, lights, planes
from lab3_usd.check.robot.sensors import CAMERA, LIDAR, enclosing
from lab3_usd.isaac.load.lab_types import with_lab_types
from lab3_usd.isaac.values import Value, is_known_type
from lab3_usd.model.physics import BODY_API, MASS, SCENE, collides, is_joint
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import StageModel
from lab3_usd.model.transforms import IDENTITY, camera_axes
from lab3_usd.new_lab.graphs import unknown_types
from lab3_usd.new_lab.robot import (
    PART,
    describe_joints,
    describe_robots,
    describe_wheels,
    moved_joints,
    pose,
    without_noise,
)
from lab3_usd.new_lab.yaml_text import as_typed, document
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CATALOG, STARTER, Lab
from lab3_usd.spec.load.lab import parse_scene
from lab3_usd.spec.scene import ANYWHERE, SensorSpec
from lab3_usd.stage.read.plain_scene import PlainPrim, read_plain_scene
from lab3_usd.stage.read.prims import Authored, authored_attributes
from lab3_usd.stage.read.stage_reader import read_stage

_PLAIN_TYPES = ("", "Xform", "Scope")


def holds_graphs_alone(stage: StageModel, path: str) -> bool:
    """Whether a prim is there for graphs: it is plain, as is what it holds beside them."""
    graphs = [graph.path for graph in stage.graphs if is_at_or_below(graph.path, path)]
    is_scene = path in (stage.default_prim, *graphs)
    below = stage.below(path)
    return (
        bool(graphs)
        and not is_scene
        and all(
            (prim.type in _PLAIN_TYPES and not prim.apis)
            or any(is_at_or_below(prim.path, graph) for graph in graphs)
            for prim in below
        )
    )


class Source(Struct, frozen=True):
    """A stage, and the bundled lab with every node type of the stage in its platform.

    `unknown` are the types that nobody knows, as they are described. `sensors` are the prims that
    may be sensors, `authored` what the stage writes at each.
    """

    stem: str
    stage: StageModel
    lab: Lab
    unknown: Mapping[str, Any]
    sensors: tuple[Prim, ...]
    authored: Mapping[str, Authored]


def read_described(path: Path, lab: Lab) -> Source:
    """Read a stage; `lab` is the bundled one.

    Raises:
        StageError: the stage cannot be read.
    """
    stage = read_stage(path, lab.platform)
    unknown = unknown_types(stage.nodes())
    if unknown:
        lab = replace(lab, platform=with_lab_types(lab.platform, {"types": unknown}, CATALOG))
    sensor_types = {prim.path: prim.type for prim in _sensors(stage, lab)}
    # The place of a prim of a type that USD does not know is read where a lab has such a sensor.
    placed = lab.platform.placed.union(sensor_types.values())
    stage = read_stage(path, replace(lab.platform, placed=placed))
    return Source(
        stem=path.stem,
        stage=stage,
        lab=lab,
        unknown=unknown,
        sensors=tuple(stage.prims[path] for path in sensor_types),
        authored=authored_attributes(path, sensor_types),
    )


def _sensors(stage: StageModel, lab: Lab) -> Iterator[Prim]:
    """Yield what graphs read that is no body, then prims of the types that are always sensors."""
    targets = (
        path
        for graph in stage.graphs
        for node in graph.nodes
        for state in node.ports.values()
        for path in state.targets
    )
    for path in dict.fromkeys(targets):
        prim = stage.prim(path)
        if prim is None or prim.type in _PLAIN_TYPES:
            continue
        if BODY_API not in prim.apis and not is_joint(prim):
            yield prim
    for spec in lab.sensors.values():
        if spec.recognised == ANYWHERE:
            yield from (prim for prim in stage.of_type(spec.type) if prim.present)


_OTHER = re.compile(r"(physics|physx|drive|node|kind|visibility|xformOp|purpose|ui)")
# What of a known kind is the same in every lab.
_TAKEN_OVER = ("recognised", "required_api", "scan", "rate_api")


def named_prims(graph: GraphSpec) -> Iterator[str]:
    """Yield the prims that the nodes of a graph name."""
    for node in graph.nodes.values():
        for target in node.targets:
            yield from target.prims


def describe_sensors(source: Source, sections: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Describe the sensors by short names; `sections` are the handout's by path."""
    sensors: dict[str, dict[str, Any]] = {}
    for prim in source.sensors:
        of_lab = _known(prim.type, source.lab)
        words = re.findall(r"[A-Z][a-z0-9]*|[a-z0-9]+", prim.type)  # vendor, word, Sensor
        inner = words[1:-1] if len(words) > 2 else words[-1:]  # noqa: PLR2004
        kind = of_lab.kind if of_lab else "_".join(inner).lower() or "sensor"  # as imu
        taken = sum(sensor["kind"] == kind for sensor in sensors.values())
        name = kind if not taken else f"{kind}_{taken + 1}"
        sensors[name] = _sensor(source, prim, kind, sections[prim.path])
    return sensors


def _known(type_name: str, lab: Lab) -> SensorSpec | None:
    """Return what the bundled lab says of a sensor of this type, None where it has none."""
    return next((sensor for sensor in lab.sensors.values() if sensor.type == type_name), None)


def _sensor(source: Source, prim: Prim, kind: str, section: str) -> dict[str, Any]:
    of_lab = _known(prim.type, source.lab)
    data: dict[str, Any] = {
        "kind": kind,
        "path": prim.path,
        "type": prim.type,
        "handout": section,
        "pose": {**pose(prim.local, source.stage.meters_per_unit), "handout": section},
    }
    same = {} if of_lab is None else to_builtins(of_lab)
    data |= {key: same[key] for key in _TAKEN_OVER if same.get(key)}
    if "scan" in data:
        data["scan"]["handout"] = section
    if same.get("view"):
        along, up = camera_axes(prim.local or IDENTITY)
        data["view"] = {"along": without_noise(along), "up": without_noise(up)}
        data["default_handout"] = section
    if prim.apis:
        data["apis"] = list(prim.apis)
    attributes = {
        name: _attribute(authored, same.get("attributes"), name, section)
        for name, authored in sorted(source.authored[prim.path].items())
        if not _OTHER.match(name) and is_known_type(authored[0])
    }
    return data | ({"attributes": attributes} if attributes else {})


def _attribute(
    authored: tuple[str, Value], usual: Mapping[str, Any] | None, name: str, section: str
) -> dict[str, Any]:
    """Describe an attribute: of a known kind those are required that the bundled lab requires."""
    kind, value = authored
    data = {"type": kind, "value": as_typed(value)}
    if usual is None:
        return {**data, "required": True, "handout": section}
    known_entry = usual.get(name, {})
    kept = {key: known_entry[key] for key in ("required", "schema") if known_entry.get(key)}
    return {**data, **kept, "handout": section} if kept else data


def appearance_below(source: Source, lab: Lab) -> dict[str, list[str]]:
    """Return what right below links holds the model's own shapes at cameras and lidars, by robot.

    `lab` is the described one, which does not name them yet.
    """
    subject = _subject(source.stage, lab)
    names: dict[str, dict[str, None]] = {}
    for sensor in lab.sensors.values():
        prim = source.stage.prim(sensor.path)
        if prim is None or sensor.kind not in (CAMERA, LIDAR):
            continue
        on_robot = subject.robot_of(sensor.path)
        if on_robot is None:
            continue
        for shape in enclosing(prim, on_robot):
            _, *below = shape.path.removeprefix(f"{on_robot.robot.path}/").split("/")
            names.setdefault(on_robot.robot.path, {}).update(dict.fromkeys(below[:1]))
    return {path: [*materials] for path, materials in names.items()}


def describe_scene(
    stage: StageModel, first: StageModel, graphs: Mapping[str, GraphSpec], lab: Lab, until: str
) -> dict[str, Any]:
    """Describe units, robots and world; sensors are added by who knows their checkpoints.

    `first` is the stage of the first checkpoint, which has what all of them have. `lab` is the
    bundled one, whose tolerances hold; `until` is the last checkpoint.
    """
    robots = describe_robots(stage, graphs.values(), until)
    several = len(robots) > 1
    described = (
        {"robots": robots} if several else dict(zip(["robot"], robots.values(), strict=False))
    )
    parent = _parent(first, graphs, robots)
    data: dict[str, Any] = {
        "stage": {
            "handout": PART,
            "up_axis": stage.up_axis,
            "meters_per_unit": stage.meters_per_unit,
            "kilograms_per_unit": stage.kilograms_per_unit,
        },
        "tolerance": to_builtins(lab.scene.tolerance),
        **described,
        "world": {"graph_parent": {"path": parent, "handout": PART}} if parent else {},
    }
    for name, robot in robots.items():
        moved = moved_joints(stage, robot["path"], robot["links"], graphs.values())
        wheels = {"handout": PART, "joints": moved, "joints_below": "", "distance": 0.0}
        drafted = {**robot, "wheels": {**wheels, "axle": [0.0, 1.0, 0.0]}}
        draft = {
            **data,
            **({"robots": {**robots, name: drafted}} if several else {"robot": drafted}),
        }
        subject = _subject(stage, replace(lab, scene=parse_scene(draft)))
        (own,) = (seen for seen in subject.robots if seen.robot.path == robot["path"])
        described = describe_wheels(own) if moved else {}
        if described:
            robot["wheels"] = described
            for link in described["joints"].values():
                if any(map(collides, stage.below(f"{robot['path']}/{link}"))):
                    robot["links"][link]["collision"] = True
        turning = described.get("joints", {})
        moving = describe_joints(stage, robot["path"], robot["links"], turning)
        if moving:
            robot["joints"] = moving
    data["world"] |= dict(_world(_subject(stage, replace(lab, scene=parse_scene(data)))))
    return data


def _subject(stage: StageModel, lab: Lab) -> StageSubject:
    """Return what rules see of a stage by a lab."""
    return StageSubject(lab=lab, checkpoint=lab.checkpoints[lab.last], stage=stage, roles={})


def _parent(
    stage: StageModel, graphs: Mapping[str, GraphSpec], robots: Mapping[str, Mapping[str, Any]]
) -> str:
    """Return the prim of the first stage below which graphs stand that are not on a robot.

    It is '' where there is none: a prim that holds graphs alone is made with them.
    """
    paths = [robot["path"] for robot in robots.values()]
    for graph in graphs.values():
        parent = graph.path.rpartition("/")[0]
        while parent and (stage.prim(parent) is None or holds_graphs_alone(stage, parent)):
            parent = parent.rpartition("/")[0]
        if parent and not any(is_at_or_below(parent, robot) for robot in paths):
            return parent
    return f"/{paths[0].split('/')[1]}" if paths else stage.default_prim


def _world(subject: StageSubject) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the parts of the world that the stage has, and where they usually are."""
    stage = subject.stage
    for robot in (*subject.robots, subject.without_robot)[:1]:
        if has_ground(robot):
            flat = [prim.path for prim in planes(robot)]
            yield "ground", _part([*flat, *(box.path for box in boxes(robot))][0])
    for part, prims in (("light", lights(stage)), ("physics_scene", stage.of_type(SCENE))):
        path = next((prim.path for prim in prims if prim.present), "")
        if path:
            yield part, _part(path)


def _part(path: str) -> dict[str, str]:
    return {"handout": PART, "usual": path}


_STARTER_HEAD = """\
The starter scene, where `build` is given no other. Masses of links and the robot's pose are in
scene.yaml. Poses in metres and degrees; `set` has values as USD has them, lengths in units of the
stage, quaternions as [w, x, y, z]."""
_NOWHERE = {"translate": [0.0, 0.0, 0.0], "rotate": [0.0, 0.0, 0.0], "scale": [1.0, 1.0, 1.0]}


def describe_starter(path: Path, lab: Lab, made: Collection[str]) -> tuple[str, str]:
    """Describe the starter after the first stage of a lab that has been described.

    It is the text of `starter.yaml`, and why there is none: the scene is no plain one. The prims
    `made` come with the graphs.

    Raises:
        StageError: the stage cannot be read.
    """
    added = {sensor.path for sensor in lab.sensors.values()}
    graphs = (graph.path for graph in lab.graphs.values())
    scene = read_plain_scene(path, {*added, *made, *graphs})
    robots = lab.scene.robots
    paths = {prim.path for prim in scene.prims}
    needed = (path for robot in robots for path in (robot.path, *robot.link_paths))
    missing = next((path for path in needed if path not in paths), "")
    reason = scene.reason or (f"{missing} is not in {path.stem}" if missing else "")
    if reason:
        return "", f"{STARTER}: {reason}; give the starter to every build"
    weighed = {
        robot.path_of(name) for robot in robots for name, link in robot.links.items() if link.mass
    }
    tree: dict[str, Any] = {}
    for prim in scene.prims:
        inside = tree
        *above, name = prim.path.split("/")[1:]
        for outer in above:
            inside = inside[outer].setdefault("children", {})
        inside[name] = dict(_starter_prim(prim, lab, weighed))
    return document(_STARTER_HEAD, {"default_prim": scene.default_prim, "prims": tree}), ""


def _starter_prim(prim: PlainPrim, lab: Lab, weighed: set[str]) -> Iterator[tuple[str, Any]]:
    yield "type", prim.type
    if prim.doc:
        yield "doc", prim.doc
    if prim.apis:
        yield "apis", list(prim.apis)
    if prim.local is not None:
        place = pose(prim.local, lab.scene.stage.meters_per_unit)
        is_robot = any(prim.path == robot.path for robot in lab.scene.robots)
        away = {key: value for key, value in place.items() if value != _NOWHERE[key]}
        yield "pose", {} if is_robot else away
    values = {
        name: as_typed(value) if kind is None else {"type": kind, "value": as_typed(value)}
        for name, kind, value in prim.values
        if not (name == MASS and prim.path in weighed)
    }
    if values:
        yield "set", values
    if prim.targets:
        yield "targets", {name: list(paths) for name, paths in prim.targets}
