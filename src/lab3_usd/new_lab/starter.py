"""Describes the starter scene of a lab: its first stage without graphs and sensors."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from lab3_usd.model.physics import MASS
from lab3_usd.new_lab.robot import pose
from lab3_usd.new_lab.yaml_text import as_typed, document
from lab3_usd.spec.lab import STARTER, Lab
from lab3_usd.stage.read.plain_scene import PlainPrim, read_plain_scene

_HEAD = """\
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
        inside[name] = dict(_prim(prim, lab, weighed))
    return document(_HEAD, {"default_prim": scene.default_prim, "prims": tree}), ""


def _prim(prim: PlainPrim, lab: Lab, weighed: set[str]) -> Iterator[tuple[str, Any]]:
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
