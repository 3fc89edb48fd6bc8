"""The shape of `scene.yaml`, so that a slip in it is one clear line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lab3_usd.spec.values import typed
from lab3_usd.spec.yaml_file import expect, need, parts, texts

SCENE_FILE = "scene.yaml"
SENSORS = ("lidar", "camera")
_SECTIONS = ("stage", "tolerance", "robot", "world", "forbidden", *SENSORS, "map")


def check_scene(scene: Mapping[str, Any]) -> None:
    """Refuse a scene file that lacks a part or holds a value of the wrong kind.

    Raises:
        SpecError: names the part and the attribute.
    """
    for section in _SECTIONS:
        need(scene, section, dict, SCENE_FILE)
    for key, value in scene["tolerance"].items():
        expect(value, (int, float), f"{SCENE_FILE}: tolerance: {key}")
    _check_robot(scene["robot"])
    where = f"{SCENE_FILE}: world"
    parent = need(scene["world"], "graph_parent", dict, where)
    need(parent, "path", str, f"{where}: graph_parent")
    for sensor in SENSORS:
        _check_sensor(scene[sensor], f"{SCENE_FILE}: {sensor}")


def _check_robot(robot: Mapping[str, Any]) -> None:
    where = f"{SCENE_FILE}: robot"
    need(robot, "path", str, where)
    check_pose(need(robot, "pose", dict, where), where)
    for key in ("target", "api", "switch"):
        need(need(robot, "articulation", dict, where), key, str, where)
    for name, link in need(robot, "links", dict, where).items():
        expect(link, dict, f"{where}: {name}")
        if "mass" in link:
            typed(link["mass"], "double", f"{where}: {name}: mass")
    wheels = need(robot, "wheels", dict, where)
    need(wheels, "joints", dict, f"{where}: wheels")


def _check_sensor(sensor: Mapping[str, Any], where: str) -> None:
    for key in ("path", "type", "handout"):
        need(sensor, key, str, where)
    check_pose(need(sensor, "pose", dict, where), where)
    texts(sensor, "apis", where)
    for name, attribute in parts(sensor, "attributes", dict, where).items():
        place = f"{where}: {name}"
        typed(attribute.get("value"), need(attribute, "type", str, place), place)


def check_pose(pose: Mapping[str, Any], where: str) -> None:
    """Refuse a pose without translation in metres, rotation in degrees and scale.

    Raises:
        SpecError: one of the three is missing or has not three numbers.
    """
    for key in ("translate", "rotate", "scale"):
        typed(need(pose, key, list, where), "double3", f"{where}: pose: {key}")
