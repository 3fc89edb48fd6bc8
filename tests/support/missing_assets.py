"""Stages of which assets, or sublayers of assets, did not come along."""

from __future__ import annotations

from pathlib import Path

from foreign_robots import rover
from pxr import Sdf, Usd
from scene_changes import CAMERA, LIDAR, LINKS, ROBOT
from scene_stages import built

ROVER = "/World/Rover"
LACKING = (
    '(subLayers = [@./edits.usda@])\ndef Xform "Walls"\n{\n    def Xform "inner"\n    {\n    }\n}\n'
)


def behind_a_missing_robot(checkpoint: str) -> Usd.Stage:
    """A stage as its author saves it over a robot file that did not come along."""
    stage = built(checkpoint)
    for prim in list(stage.GetPrimAtPath(ROBOT).GetChildren()):
        if prim.GetName() not in LINKS and prim.GetTypeName() != "OmniGraph":
            stage.RemovePrim(prim.GetPath())
    layer = stage.GetRootLayer()
    for link in LINKS:
        spec = layer.GetPrimAtPath(f"{ROBOT}/{link}")
        for child in [each.name for each in spec.nameChildren]:
            if f"{spec.path}/{child}" not in {LIDAR, CAMERA}:
                del spec.nameChildren[child]
        for name in [each.name for each in spec.properties]:
            spec.RemoveProperty(spec.properties[name])
        spec.ClearInfo("apiSchemas")
        spec.specifier = Sdf.SpecifierOver
        spec.typeName = ""
    stage.GetPrimAtPath(ROBOT).GetPayloads().AddPayload("./turtlebot3_burger.usd")
    return stage


def over_an_asset(folder: Path, text: str, *, payload: bool = False, top: str = "") -> Usd.Stage:
    """A stage whose walls come from an asset that holds this text."""
    (folder / "walls.usda").write_text(f"#usda 1.0\n{text}")
    stage = built("05")
    walls = stage.DefinePrim("/Environment/More", "Xform")
    arcs = walls.GetPayloads() if payload else walls.GetReferences()
    add = arcs.AddPayload if payload else arcs.AddReference
    add(str(folder / "walls.usda"), Sdf.Path(top or "/Walls"))
    return stage


def rover_of_a_missing_asset() -> Usd.Stage:
    stage = rover()
    for prim in list(stage.GetPrimAtPath(ROVER).GetChildren()):
        stage.RemovePrim(prim.GetPath())
    stage.GetPrimAtPath(ROVER).GetReferences().AddReference("./rover.usd")
    return stage
