"""Stages whose lidar has other values: the cases of `sensor_values.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import quick_yaml
from breaking import copied
from pxr import Sdf, Usd
from scene_changes import LIDAR
from scene_stages import built

CASES: Mapping[str, Mapping[str, Any]] = quick_yaml.load(
    (Path(__file__).resolve().parents[1] / "sensor_values.yaml").read_text(encoding="utf-8")
)
CORE, STATE = "omni:sensor:Core:", "emitterState:"
STATE_API = "OmniSensorGenericLidarCoreEmitterStateAPI"


def whole(name: str) -> str:
    """Return the whole name of an attribute of a case."""
    if name.startswith("omni:"):
        return name
    return f"{CORE}{STATE if ':' in name else ''}{name}"


def lidar_alone() -> Usd.Stage:
    """Return a stage that has the lidar of the last stage of the lab, and nothing else."""
    return copied(_lidar())


@cache
def _lidar() -> Sdf.Layer:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(layer, LIDAR)
    Sdf.CopySpec(built("05").GetRootLayer(), LIDAR, layer, LIDAR)
    layer.GetPrimAtPath(LIDAR).nameChildren.clear()
    for path in Sdf.Path(LIDAR).GetPrefixes():
        layer.GetPrimAtPath(path).specifier = Sdf.SpecifierDef
    return layer


def with_values(change: Mapping[str, Any], stage: Usd.Stage | None = None) -> Usd.Stage:
    """Return the last stage of the lab after a change of its lidar."""
    stage = stage or built("05")
    lidar = stage.GetPrimAtPath(LIDAR)
    for name, said in change.items():
        if name == "apply":
            apis = Sdf.TokenListOp()
            apis.prependedItems = [
                *lidar.GetPrimTypeInfo().GetAppliedAPISchemas(),
                f"{STATE_API}:{said}",
            ]
            lidar.SetMetadata("apiSchemas", apis)
        elif said is None:
            lidar.RemoveProperty(whole(name))
        else:
            kind, value = said
            lidar.RemoveProperty(whole(name))
            attribute = lidar.CreateAttribute(
                whole(name), Sdf.ValueTypeNames.Find(kind), custom=False
            )
            attribute.Set(float(value) if value == "nan" else value)
    return stage
