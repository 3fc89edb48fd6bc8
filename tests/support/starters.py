"""Starters as an instructor might hand them in: the bundled scene, saved or arranged otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics

from lab3_usd.data import lab_folder
from lab3_usd.stage.write.starter import build_starter

ROBOT = "/turtlebot3_burger"
BASE_SCAN = f"{ROBOT}/base_scan"
ENVIRONMENT = "/Environment"
OWN_FILES = (ROBOT, ENVIRONMENT)  # what a layered starter keeps in files of their own
OFFLINE = "https://assets.example.invalid/Assets/Isaac/6.0/Isaac/Environments/room.usd"
COMMENT = "# A comment that only an untouched file keeps.\n"
STAGE_INFO = ("defaultPrim", "kilogramsPerUnit", "metersPerUnit", "upAxis")

Change = Callable[[Usd.Stage], None]


def text_starter(file: Path) -> Path:
    """The starter of the lab in force as text."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(_text(lab_folder()))
    return file


@cache
def _text(_lab: Path) -> bytes:
    with TemporaryDirectory() as folder:
        target = Path(folder) / "starter.usda"
        build_starter(target)
        return target.read_bytes()


def binary_starter(file: Path) -> Path:
    """The bundled starter as a crate file."""
    source = text_starter(file.with_name(f"{file.stem}_text.usda"))
    Sdf.Layer.FindOrOpen(str(source)).Export(str(file), "", {"format": "usdc"})
    source.unlink()
    return file


def changed(file: Path, change: Change) -> Path:
    """The bundled starter after a change made through the USD API."""
    stage = Usd.Stage.Open(str(text_starter(file)))
    change(stage)
    stage.Save()
    return file


def _split(source: Sdf.Layer, file: Path, paths: Iterable[str], default: str = "") -> Sdf.Layer:
    """Move some root prims into a layer of their own, which starts with a comment."""
    file.parent.mkdir(parents=True, exist_ok=True)
    layer = Sdf.Layer.CreateNew(str(file))
    for path in paths:
        Sdf.CopySpec(source, path, layer, path)
    layer.defaultPrim = default
    _copy_info(source, layer, "upAxis", "metersPerUnit")
    layer.Save()
    file.write_text(file.read_text().replace("\n", f"\n{COMMENT}", 1))
    return layer


def _copy_info(source: Sdf.Layer, layer: Sdf.Layer, *keys: str) -> None:
    for key in keys:
        layer.pseudoRoot.SetInfo(key, source.pseudoRoot.GetInfo(key))


def layered_starter(folder: Path, robot: str = "../robots/burger.usda") -> Path:
    """The starter in four files below `folder`; the root layer is `scene/root.usda`.

    World and physics scene come by sublayer, the robot by reference from a folder beside,
    the environment by payload.
    """
    whole_file = text_starter(folder / "whole.usda")
    whole = Sdf.Layer.OpenAsAnonymous(str(whole_file))
    whole_file.unlink()
    roots = [str(prim.path) for prim in whole.rootPrims]
    parts = [path for path in roots if path not in OWN_FILES]
    _split(whole, folder / "scene" / "layers" / "base.usda", parts)
    _split(whole, folder / "robots" / "burger.usda", [ROBOT], "turtlebot3_burger")
    _split(whole, folder / "scene" / "layers" / "environment.usda", [ENVIRONMENT], "Environment")
    root = Sdf.Layer.CreateNew(str(folder / "scene" / "root.usda"))
    _copy_info(whole, root, *STAGE_INFO)
    root.subLayerPaths.append("./layers/base.usda")
    robot_prim = Sdf.PrimSpec(root, "turtlebot3_burger", Sdf.SpecifierDef)
    robot_prim.referenceList.prependedItems.append(Sdf.Reference(robot))
    environment = Sdf.PrimSpec(root, "Environment", Sdf.SpecifierDef)
    environment.payloadList.prependedItems.append(Sdf.Payload("layers/environment.usda"))
    root.Save()
    return folder / "scene" / "root.usda"


def reordered(stage: Usd.Stage) -> None:
    """Turn the order of the root prims and of the robot's children around."""
    layer = stage.GetRootLayer()
    layer.rootPrimOrder = [prim.name for prim in layer.rootPrims][::-1]
    robot = layer.GetPrimAtPath(ROBOT)
    robot.nameChildrenOrder = [prim.name for prim in robot.nameChildren][::-1]


def another_environment(stage: Usd.Stage) -> None:
    """Put ground and light under World, as a plain new stage has them, and drop the room."""
    stage.RemovePrim(ENVIRONMENT)
    stage.DefinePrim("/Environment", "Xform")
    UsdLux.DistantLight.Define(stage, "/World/defaultLight")
    ground = UsdGeom.Plane.Define(stage, "/World/Ground/plane")
    UsdPhysics.CollisionAPI.Apply(ground.GetPrim())


def extra_prims(stage: Usd.Stage) -> None:
    """Add what an instructor or Isaac Sim may leave in a scene."""
    stage.DefinePrim("/Render/Vars", "Scope")
    stage.OverridePrim("/OmniverseKit_Persp")
    stage.DefinePrim(f"{BASE_SCAN}/housing", "Sphere")
    box = stage.DefinePrim("/World/Props/box", "Cube")
    UsdGeom.Xformable(box).AddTranslateOp().Set(Gf.Vec3d(-3.0, 2.0, 0.5))
    stage.GetRootLayer().customLayerData = {
        "cameraSettings": {"boundCamera": "/OmniverseKit_Persp"}
    }


def offline_room(stage: Usd.Stage) -> None:
    """Refer to a room that nobody can reach from here."""
    stage.DefinePrim("/World/Room", "Xform").GetReferences().AddReference(OFFLINE)
