"""Every requirement of the scene itself, with the place and the rules that speak of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.check.scene_item import POSE, SceneItem, pose_items
from lab3_usd.check.sensor_items import camera_items, lidar_items
from lab3_usd.spec.spec import Checkpoint, Lab

_SCENE = "Scene"


def scene_items(lab: Lab, checkpoint: Checkpoint) -> tuple[SceneItem, ...]:
    """Return what the checkpoint asks of the scene, in the order of the scene file."""
    items = [*_stage_items(lab), *_robot_items(lab, checkpoint), *_wheel_items(lab)]
    items += _world_items(lab)
    if checkpoint.id == min(lab.checkpoints):
        items.append(_nothing_more(lab))
    if "lidar" in checkpoint.sensors:
        items += lidar_items(lab)
    if "camera" in checkpoint.sensors:
        items += camera_items(lab)
    return tuple(items)


def _stage_items(lab: Lab) -> Iterator[SceneItem]:
    spec = lab.scene["stage"]
    titles = {
        "upAxis": f"up axis {spec['up_axis']}",
        "metersPerUnit": f"{spec['meters_per_unit']:g} m per unit",
        "kilogramsPerUnit": f"{spec['kilograms_per_unit']:g} kg per unit",
    }
    for name, title in titles.items():
        yield SceneItem(f"Scene/stage/{name}", _SCENE, title, "/", name, spec["handout"], ("S02",))
    parent = lab.scene["world"]["graph_parent"]
    yield _prim_item(parent["path"], parent["handout"])


def _prim_item(path: str, handout: str) -> SceneItem:
    name = path.rpartition("/")[2]
    return SceneItem(f"Scene/prim/{name}", _SCENE, f"{path} exists", path, None, handout, ("S01",))


def _robot_items(lab: Lab, checkpoint: Checkpoint) -> Iterator[SceneItem]:
    robot = lab.scene["robot"]
    path = robot["path"]
    yield _prim_item(path, robot["handout"])
    yield from pose_items(_SCENE, path, robot["pose"], dict.fromkeys(POSE, ("S03",)))
    for name, link in robot["links"].items():
        yield from _link_items(f"{path}/{name}", link, robot)
        if "offset" in link and checkpoint.id == min(lab.checkpoints):
            yield SceneItem(
                f"Scene/offset/{name}",
                _SCENE,
                f"{name} sits at {link['offset']} on the robot",
                f"{path}/{name}",
                POSE["translate"][1],
                link["handout"],
                ("S17",),
            )
    target = robot["articulation"]
    yield SceneItem(
        "Scene/articulation",
        _SCENE,
        "one articulation root",
        target["target"],
        None,
        target["handout"],
        ("S11",),
    )
    yield SceneItem(
        "Scene/rest",
        _SCENE,
        "robot rests on the ground",
        path,
        None,
        "A5",
        ("S19", "S21"),
        ("physics:body",),
    )


def _link_items(
    path: str, link: Mapping[str, Any], robot: Mapping[str, Any]
) -> Iterator[SceneItem]:
    name = path.rpartition("/")[2]
    yield _prim_item(path, robot["handout"])
    yield SceneItem(
        f"Scene/body/{name}",
        _SCENE,
        f"{name} is a rigid body",
        path,
        "physics:rigidBodyEnabled",
        robot["handout"],
        ("S05", "S24"),
        ("physics:kinematicEnabled", "xformOp:scale"),
    )
    if "mass" in link:
        title = f"{name} weighs {link['mass']:g} kg"
        yield SceneItem(
            f"Scene/mass/{name}", _SCENE, title, path, "physics:mass", link["handout"], ("S04",)
        )
    if link.get("collision"):
        title = f"{name} has collision geometry"
        where = "physics:collisionEnabled"
        yield SceneItem(
            f"Scene/collision/{name}", _SCENE, title, path, where, link["handout"], ("S06",)
        )
    if name not in robot["wheels"]["joints"].values() and name != robot["base_frame"]:
        yield SceneItem(
            f"Scene/joined/{name}",
            _SCENE,
            f"joints tie {name} to the robot",
            path,
            None,
            link["handout"],
            ("S12", "S07"),
        )


def _wheel_items(lab: Lab) -> Iterator[SceneItem]:
    robot = lab.scene["robot"]
    wheels = robot["wheels"]
    for name in wheels["joints"]:
        path = f"{robot['path']}/{wheels['joints_below']}/{name}"
        parts: tuple[tuple[str, str, str | None, str, tuple[str, ...]], ...] = (
            ("joint", f"{name} turns a wheel", None, "S07 S23", ("physics:jointEnabled",)),
            ("bodies", f"{name} connects its wheel", "physics:body1", "S08", ("physics:body0",)),
            ("axis", f"{name} turns forward", "physics:axis", "S09", ("physics:localRot",)),
            ("stiffness", f"{name} has stiffness 0", "drive:angular:physics:stiffness", "S10", ()),
            ("damping", f"{name} has damping", "drive:angular:physics:damping", "S10", ()),
            (
                "place",
                f"{name} sits at its place",
                "physics:localPos0",
                "S20",
                ("physics:localPos1",),
            ),
        )
        for part, title, where, ids, also in parts:
            rules = tuple(ids.split())
            yield SceneItem(
                f"Scene/{part}/{name}", _SCENE, title, path, where, wheels["handout"], rules, also
            )


def _world_items(lab: Lab) -> Iterator[SceneItem]:
    world = lab.scene["world"]
    parts = (
        ("ground", "a ground with collision", "S13", ("physics:collisionEnabled",)),
        ("light", "a light", "S14", ()),
        ("physics_scene", "a physics scene", "S15", ()),
    )
    for part, title, rule, also in parts:
        spec = world[part]
        yield SceneItem(
            f"Scene/{part}", _SCENE, title, spec["usual"], None, spec["handout"], (rule,), also
        )


def _nothing_more(lab: Lab) -> SceneItem:
    spec, rules = lab.scene["forbidden"]["starter"], ("S18", "L08", "C09")
    title = "nothing of the later parts"
    return SceneItem("Scene/empty", _SCENE, title, "/", None, spec["handout"], rules, anywhere=True)
