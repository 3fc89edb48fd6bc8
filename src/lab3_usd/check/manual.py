"""Fills the names of a lab into the manuals of the rules: `{lidar_link}` is its lidar's link.

What stands between `{wheels?}` and `{/}` is for labs with that part (`PARTS`), what stands behind
an `{else}` there for the others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from msgspec.structs import replace

from lab3_usd.check.registry import Rule, all_rules
from lab3_usd.data import as_called, program
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import Severity, configured_severity
from lab3_usd.model.physics import down
from lab3_usd.spec.scene import NO_ROBOT

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab

_NAME = r"\{(\w+)\}"
_CHOICE = r"(?s)\{([a-z ]+)\?\}((?:(?!\{[a-z ]+\?\}).)*?)\{/\}"  # innermost
_ELSE = "{else}"
_LAST_STAGE = 4  # as many as examples tell apart
_MESSAGES = {  # what tells the topics that manuals name
    "scan": "sensor_msgs/msg/LaserScan",
    "commands": "geometry_msgs/msg/Twist",
    "map_topic": "nav_msgs/msg/OccupancyGrid",
}
# What manuals say where there is no lab, or the lab has no such thing.
PLAIN: dict[str, str] = {
    "robot": "/World/Robot",
    "base": "base_link",
    "link": "arm_link",
    "wheel": "link_1",
    "other_wheel": "link_2",
    "joint": "joint_1",
    "other_joint": "joint_2",
    "joint_path": "/World/Robot/joints/joint_1",
    "world": "/World",
    "down": "(0, 0, -1)",
    "gravity": "9.81",
    "lidar": "/World/Robot/base_link/Lidar",
    "lidar_name": "Lidar",
    "lidar_link": "base_link",
    "lidar_menu": "",
    "camera": "/World/Robot/base_link/Camera",
    "camera_name": "Camera",
    "camera_link": "base_link",
    "sensor": "/World/Robot/base_link/Imu",
    "sensor_name": "Imu",
    "graph": "/World/Clock",
    "graph_name": "Clock",
    "next_graph": "/World/Drive",
    "next_graph_name": "Drive",
    "tree_graph_name": "Odometry",
    "stages": "stages",
    "maps": "maps",
    "shown": "output",
    "assets": "supplied",
    "starter": "supplied/starter.usda",
    "map": "map.yaml",
    "map_image": "map.pgm",
    "scan": "/scan",
    "commands": "/cmd_vel",
    "map_topic": "/map",
    "isaac": "6.0.1",
    "root": "odom",
    "above": "map",
    **{f"stage{n}": f"stage_{n}.usda" for n in range(_LAST_STAGE + 1)},
    **{f"stem{n}": f"stage_{n}" for n in range(_LAST_STAGE + 1)},
    "map_stage": "stage_9.usda",
}


def rules_in(lab: Lab, severities: Iterable[tuple[str, Severity]] = ()) -> dict[str, Rule]:
    """Return every rule by id, in the words of a lab, as grave as is configured."""
    by_name = dict(severities)
    return {
        name: replace(
            rule,
            words=in_words_of(lab, rule.manual),
            severity=configured_severity(name, rule.severity, by_name),
        )
        for name, rule in all_rules().items()
    }


def rules_of_lab(lab: Lab) -> dict[str, Rule]:
    """Return the rules that can find something in a submission of this lab, in its words."""
    parts = {part for part, has_part in PARTS.items() if has_part(lab)}
    return {
        name: rule
        for name, rule in rules_in(lab).items()
        if rule.scope not in _WITHOUT_A_LAB
        and {rule.needs, _OF_FAMILY.get(rule.family, "")} - {""} <= parts
    }


_WITHOUT_A_LAB = ("lint", "script", "native")
_OF_FAMILY = {
    "L": "lidar",
    "C": "camera",
    "D": "other sensor",
    "M": "map",
    "V": "navigation",
    "E": "running system",
}
# What a lab may leave out, with whether it has it.
PARTS: Mapping[str, Callable[[Lab], bool]] = {
    "wheels": lambda lab: any(robot.wheels.joints for robot in lab.scene.robots),
    "described joints": lambda lab: any(robot.joints for robot in lab.scene.robots),
    "lidar": lambda lab: "lidar" in _kinds(lab),
    "camera": lambda lab: "camera" in _kinds(lab),
    "render product": lambda lab: bool({"lidar", "camera"} & _kinds(lab)),
    "other sensor": lambda lab: "other" in _kinds(lab),
    "observation camera": lambda lab: lab.scene.world.observation_camera is not None,
    "map": lambda lab: lab.scene.map is not None,
    "localization": lambda lab: lab.frames.localization is not None,
    "guarded root": lambda lab: bool(lab.frames.guarded),
    "forbidden transform": lambda lab: bool(lab.frames.forbidden_transforms),
    "removals": lambda lab: any(point.removed for point in lab.checkpoints.values()),
    "props": lambda lab: bool(lab.scene.props),
    "optional checkpoints": lambda lab: any(point.optional for point in lab.checkpoints.values()),
    "navigation": lambda lab: lab.ros.navigation is not None,
    "goal": lambda lab: lab.ros.goal is not None,
    "running system": lambda lab: bool(lab.topics),
}


def _kinds(lab: Lab) -> set[str]:
    """Return which rules judge sensors of a lab."""
    from lab3_usd.check.robot.sensors import judging_kind

    return {judging_kind(sensor) for sensor in lab.sensors.values()}


def in_words_of(lab: Lab | None, manual: str) -> str:
    """Return a text of a manual with the names of a lab, or with plain ones."""
    return _in_words(lab, manual, program())


@lru_cache(maxsize=1024)  # the reports of a class all quote the same
def _in_words(lab: Lab | None, manual: str, called: str) -> str:
    manual = as_called(manual, called)
    if "{" not in manual:
        return manual
    while (chosen := re.sub(_CHOICE, lambda choice: _chosen(lab, choice), manual)) != manual:
        manual = chosen
    words = PLAIN if lab is None else _words(lab)
    return re.sub(_NAME, lambda name: words[name[1]], manual)


def _chosen(lab: Lab | None, choice: re.Match[str]) -> str:
    """Return the text of a choice for this lab; without a lab, the one for labs with the part."""
    has_part = lab is None or PARTS[choice[1]](lab)
    for_it, _, for_others = choice[2].partition(_ELSE)
    return for_it if has_part else for_others


@lru_cache(maxsize=4)
def _words(lab: Lab) -> Mapping[str, str]:
    parts = (*_of_robot(lab), *_of_sensors(lab), *_of_files(lab))
    words = {name: word for name, word in parts if word}
    graphs = list(lab.graphs.values())
    for name, number in (("graph", 0), ("next_graph", 1)):
        words[name] = _at([graph.path for graph in graphs], number)
        words[f"{name}_name"] = _at([graph.name for graph in graphs], number)
    with_tree = (point.graphs for point in lab.checkpoints.values() if point.frames)
    words["tree_graph_name"] = _at(next(with_tree, tuple(lab.graphs)), len(graphs))
    for name, message in _MESSAGES.items():
        topics = (topic for topic, spec in lab.topics.items() if spec.type == message)
        words[name] = next(topics, "")
    published = [topic for topic, spec in lab.topics.items() if not spec.subscribed]
    received = [topic for topic, spec in lab.topics.items() if spec.subscribed]
    words["scan"] = words["scan"] or _at(published, 1) or _at(received, 0)
    words["commands"] = words["commands"] or _at(received, 0)
    words["isaac"] = "" if lab.platform.release == BASE else lab.platform.release
    words |= {"root": lab.frames.root, "above": lab.frames.above}
    return PLAIN | {name: word for name, word in words.items() if word}


def _at(words: Sequence[str], number: int) -> str:
    """Return one of several, the last where there are fewer, '' where there is none."""
    return words[min(number, len(words) - 1)] if words else ""


def _of_robot(lab: Lab) -> Iterator[tuple[str, str]]:
    parent = lab.scene.world.graph_parent
    yield "world", "" if parent is None else parent.path
    units = lab.scene.stage
    yield "down", f"({', '.join(f'{part:g}' for part in down(units.up_axis))})"
    yield "gravity", f"{9.81 / units.meters_per_unit:g}"
    robot = lab.scene.robot
    if robot is NO_ROBOT:
        return
    joints, wheels = [*robot.wheels.joints, *robot.joints], list(robot.wheels.joints.values())
    links = [name for name in robot.links if name not in (robot.base_frame, *wheels)]
    placed = [name for name in links if robot.links[name].offset is not None]
    yield "robot", robot.path
    yield "base", lab.frame_of(robot.base)
    yield "lidar_link", lab.frame_of(robot.base)  # unless there is one
    yield "link", _at(placed, 0) or _at(links[::-1], 0) or _at(wheels, 0)
    yield "wheel", _at(wheels, 0)
    yield "other_wheel", _at(wheels, 1)
    yield "joint", _at(joints, 0)
    yield "other_joint", _at(joints, 1)
    yield "joint_path", robot.joint_path(joints[0]) if wheels else ""


def _of_sensors(lab: Lab) -> Iterator[tuple[str, str]]:
    from lab3_usd.check.robot.sensors import CAMERA, LIDAR

    kinds = {sensor.kind: "sensor" for sensor in lab.sensors.values()}
    kinds |= {LIDAR: "lidar", CAMERA: "camera"}
    for kind, word in kinds.items():
        first = lab.first_sensor(kind)
        if first is not None:
            yield word, first.path
            yield f"{word}_name", first.name
            yield f"{word}_link", first.path.rpartition("/")[0].rpartition("/")[2]
            # Vendor and name of the sensor's asset, as the Create menu has them.
            vendor, _, file = first.asset_suffix.rpartition("/")
            name = file.partition(".")[0].replace("_", " ")
            yield f"{word}_menu", f" > {vendor.rpartition('/')[2]} > {name}" if name else ""


def _of_files(lab: Lab) -> Iterator[tuple[str, str]]:
    folders, files = lab.submission.folders, lab.submission.stages
    stems, ending = list(lab.files.values()), files.endings[0]
    for number in range(_LAST_STAGE + 1):
        yield f"stem{number}", _at(stems, number)
        yield f"stage{number}", f"{_at(stems, number)}{ending}"
    on_map = [p.file for p in lab.checkpoints.values() if p.localization and not p.new]
    yield "map_stage", f"{(on_map or stems)[-1]}{ending}"
    yield "stages", folders.stages
    yield "maps", folders.maps
    yield "shown", _at(folders.shown, 0)
    yield "assets", folders.starter
    yield "starter", f"{folders.starter}/{files.starter}{ending}"
    facts = lab.scene.map
    yield "map", "" if facts is None else facts.yaml
    yield "map_image", "" if facts is None else facts.image
