"""Robots without graphs, in any unit and place."""

from __future__ import annotations

from pathlib import Path

from places import REPOSITORY
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd.author.adding import AddOptions, add_graphs
from lab3_usd.author.request import Request
from lab3_usd.isaac.releases import BASE

ROVER = REPOSITORY / "docs" / "examples" / "rover.usda"
LIDAR_API = "OmniSensorGenericLidarCoreAPI"


def new_stage(path: Path, metres: float = 1.0, up: str = "Z") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def add_link(stage: Usd.Stage, path: str, at: Gf.Vec3d) -> Usd.Prim:
    link = UsdGeom.Xform.Define(stage, path)
    link.AddTranslateOp().Set(at)
    UsdPhysics.RigidBodyAPI.Apply(link.GetPrim())
    return link.GetPrim()


def add_joint(
    stage: Usd.Stage,
    path: str,
    bodies: tuple[str, str],
    at: Gf.Vec3d,
    axis: str = "Y",
    *,
    gains: tuple[float, float] | None = (0.0, 1000.0),
    limits: tuple[float, float] | None = None,
) -> Usd.Prim:
    joint = UsdPhysics.RevoluteJoint.Define(stage, path)
    joint.CreateAxisAttr(axis)
    joint.CreateBody0Rel().SetTargets([bodies[0]])
    joint.CreateBody1Rel().SetTargets([bodies[1]])
    joint.CreateLocalPos0Attr(Gf.Vec3f(at))
    if limits is not None:
        joint.CreateLowerLimitAttr(limits[0])
        joint.CreateUpperLimitAttr(limits[1])
    if gains is not None:
        drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular")
        drive.CreateStiffnessAttr(gains[0])
        drive.CreateDampingAttr(gains[1])
    return joint.GetPrim()


def add_wheel(stage: Usd.Stage, path: str, at: Gf.Vec3d, radius: float, axis: str = "Y") -> None:
    add_link(stage, path, at)
    shape = UsdGeom.Cylinder.Define(stage, f"{path}/collider")
    shape.CreateAxisAttr(axis)
    shape.CreateRadiusAttr(radius)
    shape.CreateHeightAttr(radius / 2)
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())


def add_rover(
    stage: Usd.Stage,
    root: str = "/World/Bot",
    *,
    radius: float = 0.05,
    distance: float = 0.3,
    rows: tuple[float, ...] = (0.0,),
    names: tuple[str, str] = ("left", "right"),
    gains: tuple[float, float] | None = (0.0, 1000.0),
) -> None:
    """Add a robot with wheels left and right in rows along X; lengths in metres."""
    unit = 1 / UsdGeom.GetStageMetersPerUnit(stage)
    UsdGeom.Xform.Define(stage, root)
    base = add_link(stage, f"{root}/base", Gf.Vec3d(0, 0, radius) * unit)
    UsdPhysics.ArticulationRootAPI.Apply(base)
    for row, ahead in enumerate(rows):
        for name, side in zip(names, (1, -1), strict=True):
            path = f"{root}/{name}_wheel{row or ''}"
            at = Gf.Vec3d(ahead, side * distance / 2, 0) * unit
            add_wheel(stage, path, at + Gf.Vec3d(0, 0, radius) * unit, radius * unit)
            joint = f"{root}/joints/{name}_joint{row or ''}"
            add_joint(stage, joint, (f"{root}/base", path), at, gains=gains)


def add_lidar(stage: Usd.Stage, path: str, *, with_api: bool = True) -> Usd.Prim:
    prim = stage.DefinePrim(path, "OmniLidar")
    if with_api:
        prim.SetMetadata("apiSchemas", Sdf.TokenListOp.Create(prependedItems=[LIDAR_API]))
    return prim


def rover_at(folder: Path, name: str = "rover.usda") -> Path:
    """Copy the rover of the documentation."""
    path = folder / name
    path.write_bytes(ROVER.read_bytes())
    return path


def carter_at(folder: Path) -> Path:
    """Copy the carter of the documentation, without its graphs."""
    path = folder / "carter.usda"
    layer = Sdf.Layer.FindOrOpen(str(REPOSITORY / "docs" / "examples" / "carter.usda"))
    bare = Sdf.Layer.CreateNew(str(path))
    bare.TransferContent(layer)
    for name in ("differential_drive", "odometry"):
        del bare.GetPrimAtPath("/World/Carter").nameChildren[name]
    bare.Save()
    return path


def payload_at(folder: Path) -> Path:
    """Write a stage that holds the rover of the documentation behind a payload."""
    stage = new_stage(folder / "payload.usda")
    robot = stage.DefinePrim("/World/Robot", "Xform")
    robot.GetPayloads().AddPayload(f"./{rover_at(folder).name}", "/World/Rover")
    stage.Save()
    return folder / "payload.usda"


BARE = {"rover": rover_at, "carter": carter_at, "payload": payload_at}


def with_three_graphs(path: Path) -> Path:
    """Add what three commands add: clock, drive and odometry."""
    added = add_graphs(path, [Request(k) for k in ("clock", "drive", "odometry")], AddOptions(BASE))
    assert added.data is not None
    path.write_bytes(added.data)
    return path
