"""Describes the scene of a stage: units, robot, world, sensors, in the form of `scene.yaml`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import to_builtins
from msgspec.structs import replace

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.scene.ground import boxes, has_ground, lights, planes
from lab3_usd.describe.robot import PART, describe_robot, describe_wheels, moved_joints
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import SCENE, collides
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.scene import parse_scene


def describe_scene(
    stage: StageModel, graphs: Mapping[str, GraphSpec], lab: Lab, until: str
) -> dict[str, Any]:
    """Describe units, robot and world; sensors are added by who knows their checkpoints.

    `lab` is the bundled one, whose tolerances hold; `until` is the last checkpoint.

    Raises:
        UsageError: the stage has no robot.
    """
    robot = describe_robot(stage, graphs.values(), until)
    data: dict[str, Any] = {
        "stage": {
            "handout": PART,
            "up_axis": stage.up_axis,
            "meters_per_unit": stage.meters_per_unit,
            "kilograms_per_unit": stage.kilograms_per_unit,
        },
        "tolerance": to_builtins(lab.scene.tolerance),
        "robot": robot,
        "world": {"graph_parent": {"path": _parent(stage, graphs, robot["path"]), "handout": PART}},
    }
    moved = moved_joints(stage, robot["path"], robot["links"], graphs.values())
    wheels = {"handout": PART, "joints": moved, "joints_below": "", "distance": 0.0}
    draft = {**data, "robot": {**robot, "wheels": {**wheels, "axle": [0.0, 1.0, 0.0]}}}
    subject = _subject(stage, replace(lab, scene=parse_scene(draft)))
    found = describe_wheels(subject) if moved else {}
    if found:
        robot["wheels"] = found
        for link in found["joints"].values():
            robot["links"][link] |= _collision(stage, f"{robot['path']}/{link}")
    data["world"] |= dict(_world(subject))
    return data


def _subject(stage: StageModel, lab: Lab) -> StageSubject:
    return StageSubject(
        lab=lab,
        checkpoint=lab.checkpoints[lab.last],
        stage=stage,
        roles={},
        faulty_prims=frozenset(),
    )


def _collision(stage: StageModel, link: str) -> dict[str, bool]:
    return {"collision": True} if any(map(collides, stage.below(link))) else {}


def _parent(stage: StageModel, graphs: Mapping[str, GraphSpec], robot: str) -> str:
    """Return the prim below which graphs stand that are not on the robot."""
    for graph in graphs.values():
        parent = graph.path.rpartition("/")[0]
        if parent and not is_at_or_below(parent, robot) and stage.prim(parent) is not None:
            return parent
    return f"/{robot.split('/')[1]}"


def _world(subject: StageSubject) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the parts of the world that the stage has, and where they usually are."""
    stage, robot = subject.stage, subject.lab.scene.robot.path
    if has_ground(subject):
        found = [*(prim.path for prim in planes(stage, robot)), *(b.path for b in boxes(subject))]
        yield "ground", _part(found[0])
    for part, prims in (("light", lights(stage)), ("physics_scene", stage.of_type(SCENE))):
        path = next((prim.path for prim in prims if prim.present), "")
        if path:
            yield part, _part(path)


def _part(path: str) -> dict[str, str]:
    return {"handout": PART, "usual": path}
