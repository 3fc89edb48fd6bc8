"""Large scenes around the lab's robot, for the benchmarks: many prims, or heavy meshes."""

from __future__ import annotations

import math
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd import build_checkpoint

PER_GROUP = 100  # prims below one Xform, as a building has rooms


def lab_stage(folder: Path, form: str = "usda") -> Path:
    """Build the stage of checkpoint 05 as text (`usda`) or binary (`usdc`)."""
    target = folder / f"Lab3_05_lab.{form}"
    if not target.exists():
        build_checkpoint(None, "05", target)
    return target


def crowded(folder: Path, prims: int, form: str = "usdc") -> Path:
    """Add groups of boxes without collision to the stage of checkpoint 05, as furniture."""
    target = folder / f"Lab3_05_crowded_{prims}.{form}"
    stage = _copy(folder, target)
    for number in range(0, prims, PER_GROUP):
        group = f"/Furniture/Room_{number:06}"
        UsdGeom.Xform.Define(stage, group).AddTranslateOp().Set(Gf.Vec3d(20, number / 10, 0))
        for box in range(min(PER_GROUP, prims - number) - 1):
            UsdGeom.Cube.Define(stage, f"{group}/Box_{box:02}").GetSizeAttr().Set(0.1)
    stage.GetRootLayer().Save()
    return target


def meshed(folder: Path, meshes: int = 200, points: int = 5000, form: str = "usdc") -> Path:
    """Add collision meshes beside the walls of the stage of checkpoint 05."""
    target = folder / f"Lab3_05_meshed_{meshes}.{form}"
    stage = _copy(folder, target)
    cloud = [Gf.Vec3f(math.cos(step), math.sin(step), (step % 1) * 2 - 1) for step in range(points)]
    counts = [3] * (points // 3)
    indices = [*range(3 * len(counts))]
    for number in range(meshes):
        mesh = UsdGeom.Mesh.Define(stage, f"/Hall/Rock_{number:03}")
        mesh.GetPointsAttr().Set(cloud)
        mesh.GetExtentAttr().Set([Gf.Vec3f(-1), Gf.Vec3f(1)])  # as Isaac Sim writes it
        mesh.GetFaceVertexCountsAttr().Set(counts)
        mesh.GetFaceVertexIndicesAttr().Set(indices)
        mesh.AddTranslateOp().Set(Gf.Vec3d(30 + 3 * (number % 20), 3 * (number // 20), 1))
        mesh.AddRotateXYZOp().Set(Gf.Vec3f(0, 0, number))
        UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    stage.GetRootLayer().Save()
    return target


def _copy(folder: Path, target: Path) -> Usd.Stage:
    layer = Sdf.Layer.FindOrOpen(str(lab_stage(folder)))
    layer.Export(str(target))
    return Usd.Stage.Open(str(target))
