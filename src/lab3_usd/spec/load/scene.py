"""Loads `scene.yaml`; a mistake in it is one clear line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.spec.files import SCENE
from lab3_usd.spec.load.records import record
from lab3_usd.spec.scene import SceneSpec
from lab3_usd.spec.values import typed_value


def parse_scene(data: Mapping[str, Any]) -> SceneSpec:
    """Return what a scene file that has been read asks for.

    Raises:
        SpecError: it lacks a part, or holds a value of the wrong kind; the line names the part.
    """
    scene = record(data, SceneSpec, SCENE)
    wheels = scene.robot.wheels
    if wheels.left and wheels.left not in wheels.joints:
        message = f"{SCENE}: robot: wheels: left: '{wheels.left}' is no joint of the wheels"
        raise SpecError(message)
    places: dict[str, str] = {}
    sensors = {}
    for sensor, spec in scene.sensors.items():
        where = f"{SCENE}: {sensor}"
        if spec.path in places:
            message = f"{where}: '{spec.path}' is the path of {places[spec.path]}"
            raise SpecError(message)
        places[spec.path] = sensor
        typed = {
            name: replace(each, value=typed_value(each.value, each.type, f"{where}: {name}"))
            for name, each in spec.attributes.items()
        }
        sensors[sensor] = replace(spec, attributes=typed)
    return replace(scene, sensors=sensors)
