"""Checks the shape of `scene.yaml`, so that a mistake in it is one clear line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from lab3_usd.errors import SpecError
from lab3_usd.spec.files import SCENE
from lab3_usd.spec.load.records import record
from lab3_usd.spec.values import typed_value

Number = Annotated[float, Meta(ge=-1e9, le=1e9)]  # finite, and no room is larger
Number3 = tuple[Number, Number, Number]
# What a part says that is left out: a lab need not have wheels, a scan, slips or forbidden names.
_NO_WHEELS = {"joints": {}, "joints_below": "", "distance": 0.0, "axle": (0.0, 1.0, 0.0)}
_NO_ARTICULATION = {
    "target": "",
    "api": "PhysicsArticulationRootAPI",
    "switch": "physxArticulation:articulationEnabled",
}
_NOTHING_FORBIDDEN = {"handout": "", "names": (), "paths": ()}
_PLAIN_SENSOR = {
    "apis": (),
    "required_apis": (),
    "required_api": "",
    "recognised": "on the robot",
    "asset_suffix": "",
    "attributes": {},
    "scan": {},
    "looks": {},
    "slips": (),
    "keep_default": {},
    "plain_image": {},
    "rate_api": "",
}


class _Stage(Struct):
    up_axis: str
    meters_per_unit: Number
    kilograms_per_unit: Number


class _Pose(Struct):
    translate: Number3
    rotate: Number3
    scale: Number3
    handout: str = ""


class _Articulation(Struct):
    target: str
    handout: str
    api: str = ""
    switch: str = ""


class _Link(Struct):
    handout: str
    mass: Number = 0.0
    offset: Number3 = (0.0, 0.0, 0.0)


class _Wheels(Struct):
    handout: str
    joints: dict[str, str]
    joints_below: str
    distance: Number
    axle: Number3


class _Robot(Struct):
    path: str
    handout: str
    pose: _Pose
    base_frame: str
    links: dict[str, _Link]
    articulation: _Articulation | None = None
    pose_is_error_until: str = ""
    wheels: _Wheels | None = None


class _GraphParent(Struct):
    path: str
    handout: str


class _WorldPart(Struct):
    handout: str
    usual: str


class _Observer(Struct):
    handout: str
    usual: str
    type: str


class _World(Struct):
    graph_parent: _GraphParent
    ground: _WorldPart | None = None
    light: _WorldPart | None = None
    physics_scene: _WorldPart | None = None
    observation_camera: _Observer | None = None


class _Attribute(Struct):
    type: str
    value: Any = None


class _Sensor(Struct):
    kind: str
    path: str
    type: str
    handout: str
    pose: _Pose
    apis: tuple[str, ...] = ()
    required_apis: tuple[str, ...] = ()
    attributes: dict[str, _Attribute] = {}


class _Scene(Struct):
    stage: _Stage
    tolerance: dict[str, Number]
    robot: _Robot
    world: _World
    forbidden: dict[str, Any] = {}
    sensors: dict[str, _Sensor] = {}
    map: dict[str, Any] = {}


def complete_scene(scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene file in which every part says something, also one that the lab lacks.

    Raises:
        SpecError: it lacks a part that every lab has, or holds a value of the wrong kind.
    """
    check_scene(scene)
    given = scene["robot"]
    articulation = {
        "handout": given["handout"],
        **_NO_ARTICULATION,
        **given.get("articulation", {}),
    }
    robot = {
        "wheels": {"handout": given["handout"], **_NO_WHEELS},
        "pose_is_error_until": "",
        **given,
        "articulation": articulation,
    }
    said = scene.get("forbidden", {})
    forbidden = {
        part: {**_NOTHING_FORBIDDEN, **said.get(part, {})} for part in ("starter", "lidar")
    }
    sensors = {
        name: {**_PLAIN_SENSOR, **sensor} for name, sensor in scene.get("sensors", {}).items()
    }
    return {**scene, "robot": robot, "forbidden": forbidden, "sensors": sensors}


def check_scene(scene: Mapping[str, Any]) -> None:
    """Refuse a scene file that lacks a part or holds a value of the wrong kind.

    Raises:
        SpecError: names the part and the attribute.
    """
    said = record(scene, _Scene, SCENE)
    places: dict[str, str] = {}
    for sensor, spec in said.sensors.items():
        if spec.path in places:
            message = f"{SCENE}: {sensor}: '{spec.path}' is the path of {places[spec.path]}"
            raise SpecError(message)
        places[spec.path] = sensor
        for name, attribute in spec.attributes.items():
            typed_value(attribute.value, attribute.type, f"{SCENE}: {sensor}: {name}")
