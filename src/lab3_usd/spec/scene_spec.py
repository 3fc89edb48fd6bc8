"""The shape of `scene.yaml`, so that a slip in it is one clear line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from lab3_usd.spec.records import record
from lab3_usd.spec.values import typed

SCENE_FILE = "scene.yaml"
SENSORS = ("lidar", "camera")
Number = Annotated[float, Meta(ge=-1e9, le=1e9)]  # finite, and no room is larger
Number3 = tuple[Number, Number, Number]


class _Stage(Struct):
    up_axis: str
    meters_per_unit: Number
    kilograms_per_unit: Number


class _Pose(Struct):
    translate: Number3
    rotate: Number3
    scale: Number3


class _Articulation(Struct):
    target: str
    api: str
    switch: str


class _Link(Struct):
    mass: Number = 0.0
    offset: Number3 = (0.0, 0.0, 0.0)


class _Wheels(Struct):
    joints: dict[str, str]


class _Robot(Struct):
    path: str
    pose: _Pose
    articulation: _Articulation
    links: dict[str, _Link]
    wheels: _Wheels


class _GraphParent(Struct):
    path: str


class _World(Struct):
    graph_parent: _GraphParent


class _Attribute(Struct):
    type: str
    value: Any = None


class _Sensor(Struct):
    path: str
    type: str
    handout: str
    pose: _Pose
    apis: tuple[str, ...]
    attributes: dict[str, _Attribute]


class _Scene(Struct):
    stage: _Stage
    tolerance: dict[str, Number]
    robot: _Robot
    world: _World
    forbidden: dict[str, Any]
    lidar: _Sensor
    camera: _Sensor
    map: dict[str, Any]


def check_scene(scene: Mapping[str, Any]) -> None:
    """Refuse a scene file that lacks a part or holds a value of the wrong kind.

    Raises:
        SpecError: names the part and the attribute.
    """
    said = record(scene, _Scene, SCENE_FILE)
    for sensor in SENSORS:
        for name, attribute in getattr(said, sensor).attributes.items():
            typed(attribute.value, attribute.type, f"{SCENE_FILE}: {sensor}: {name}")
