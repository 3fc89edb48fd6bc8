from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd.errors import UsageError
from lab3_usd.stage import lidar_plane
from lab3_usd.stage.lidar_plane import Segment, SliceOptions, StageSlice, slice_stage
from lab3_usd.stage.write.starter import build_starter

ROBOT, LIDAR = "/robot", "/robot/scan"


@pytest.fixture
def stage() -> Usd.Stage:
    made = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(made, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(made, 1.0)
    return made


def shape(stage: Usd.Stage, kind: str, path: str = "/Thing", **values: Any) -> Usd.Prim:
    prim = stage.DefinePrim(path, kind)
    for name, value in values.items():
        prim.GetAttribute(name).Set(value)
    UsdPhysics.CollisionAPI.Apply(prim)
    return prim


def mesh(stage: Usd.Stage, points: list[Any], faces: list[list[int]]) -> Usd.Prim:
    return shape(
        stage,
        "Mesh",
        points=points,
        faceVertexCounts=[len(face) for face in faces],
        faceVertexIndices=[corner for face in faces for corner in face],
    )


def cut(stage: Usd.Stage, height: float | None = 0.0) -> StageSlice:
    return slice_stage(stage, SliceOptions(ROBOT, LIDAR, height))


def bounds(segments: tuple[Segment, ...]) -> list[float]:
    xs = [x for segment in segments for x, _ in segment]
    ys = [y for segment in segments for _, y in segment]
    return [min(xs), min(ys), max(xs), max(ys)]


def outline_length(segments: tuple[Segment, ...]) -> float:
    return sum(math.dist(begin, end) for begin, end in segments)


# -- shapes


def test_a_cube_is_cut_into_its_outline(stage: Usd.Stage) -> None:
    shape(stage, "Cube", size=2.0)
    segments = cut(stage, 0.3).segments
    assert bounds(segments) == pytest.approx([-1, -1, 1, 1])
    assert outline_length(segments) == pytest.approx(8)


def test_rotation_and_scale_of_every_parent_count(stage: Usd.Stage) -> None:
    parent = UsdGeom.Xform.Define(stage, "/Parent")
    parent.AddTranslateOp().Set(Gf.Vec3d(10, 0, 5))
    parent.AddRotateZOp().Set(90.0)
    child = UsdGeom.Xformable(shape(stage, "Cube", "/Parent/Box", size=1.0))
    child.AddTranslateOp().Set(Gf.Vec3d(2, 0, 0))
    child.AddScaleOp().Set(Gf.Vec3f(4, 2, 1))
    # 4 x 2 turned by 90 degrees is 2 x 4, and 2 along X has become 2 along Y.
    assert bounds(cut(stage, 5.0).segments) == pytest.approx([9, 0, 11, 4])


def test_a_box_turned_by_45_degrees_about_x_is_cut_at_its_edge(stage: Usd.Stage) -> None:
    UsdGeom.Xformable(shape(stage, "Cube", size=2.0)).AddRotateXOp().Set(45.0)
    half = math.sqrt(2)
    assert bounds(cut(stage, 0.0).segments) == pytest.approx([-1, -half, 1, half])
    assert bounds(cut(stage, half / 2).segments) == pytest.approx([-1, -half / 2, 1, half / 2])


@pytest.mark.parametrize(
    ("axis", "expected"), [("X", [-2, -0.8, 2, 0.8]), ("Y", [-0.8, -2, 0.8, 2])]
)
def test_a_lying_cylinder_is_cut_into_a_rectangle(
    stage: Usd.Stage, axis: str, expected: list[float]
) -> None:
    shape(stage, "Cylinder", axis=axis, radius=1.0, height=4.0)
    segments = cut(stage, 0.6).segments  # 0.6 above the axis the half width is 0.8
    assert bounds(segments) == pytest.approx(expected, abs=2e-3)
    assert outline_length(segments) == pytest.approx(2 * (4 + 1.6), abs=5e-3)


@pytest.mark.parametrize(
    ("kind", "values", "height", "radius"),
    [
        ("Cylinder", {"axis": "Z", "radius": 0.5, "height": 2.0}, 0.9, 0.5),
        ("Sphere", {"radius": 1.0}, 0.6, 0.8),
        ("Cone", {"axis": "Z", "radius": 1.0, "height": 2.0}, 0.5, 0.25),
        ("Capsule", {"axis": "Z", "radius": 1.0, "height": 2.0}, 0.9, 1.0),
        ("Capsule", {"axis": "Z", "radius": 1.0, "height": 2.0}, 1.6, 0.8),
    ],
)
def test_a_standing_round_shape_is_cut_into_a_circle(
    stage: Usd.Stage, kind: str, values: dict[str, Any], height: float, radius: float
) -> None:
    shape(stage, kind, **values)
    segments = cut(stage, height).segments
    reach = [math.hypot(x, y) for segment in segments for x, y in segment]
    assert min(reach) == pytest.approx(radius, rel=4e-3)
    assert max(reach) == pytest.approx(radius, rel=4e-3)
    assert outline_length(segments) == pytest.approx(2 * math.pi * radius, rel=4e-3)


def test_nothing_is_cut_above_or_below_a_shape(stage: Usd.Stage) -> None:
    shape(stage, "Cube", size=2.0)
    assert cut(stage, 1.01).segments == cut(stage, -1.01).segments == ()


def test_shapes_without_values_have_the_size_of_their_schema(stage: Usd.Stage) -> None:
    shape(stage, "Cube")
    assert bounds(cut(stage).segments) == pytest.approx([-1, -1, 1, 1])


def test_a_concave_face_is_cut_into_its_pieces(stage: Usd.Stage) -> None:
    # A U that stands upright: at height 2 its two arms are cut, at 0.5 its foot.
    corners = [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]
    mesh(stage, [(x, 0, z) for x, z in corners], [list(range(8))])
    assert cut(stage, 2.0).segments == (((0, 0), (1, 0)), ((3, 0), (4, 0)))
    assert cut(stage, 0.5).segments == (((0, 0), (4, 0)),)


def test_a_ring_keeps_its_hole(stage: Usd.Stage) -> None:
    prim = mesh(
        stage,
        [
            (x, y, z)
            for r in (1, 2)
            for x, y in ((-r, -r), (r, -r), (r, r), (-r, r))
            for z in (0, 1)
        ],
        [[i, (i + 2) % 8, (i + 3) % 8, i + 1] for i in (0, 2, 4, 6)]
        + [[8 + i, 8 + (i + 2) % 8, 8 + (i + 3) % 8, 9 + i] for i in (0, 2, 4, 6)],
    )
    UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr("convexHull")
    assert outline_length(cut(stage, 0.5).segments) == pytest.approx(8 + 16)


def test_a_face_that_lies_in_the_cut_has_no_outline_of_its_own(stage: Usd.Stage) -> None:
    mesh(stage, [(0, 0, 1), (1, 0, 1), (1, 1, 1)], [[0, 1, 2]])
    assert cut(stage, 1.0).segments == ()


def test_holes_and_broken_faces_of_a_mesh_are_left_out(stage: Usd.Stage) -> None:
    points = [(0, 0, -1), (1, 0, -1), (1, 0, 1), (0, 0, 1), (0, 5, math.nan), (math.nan, 0, 1)]
    prim = mesh(stage, points, [[0, 1, 2, 3], [0, 1, 2, 3], [0, 1, 99], [0, 4, 1], [0, 5, 1]])
    prim.GetAttribute("holeIndices").Set([1])
    assert cut(stage).segments == (((0, 0), (1, 0)),)


def test_a_mesh_without_points_is_empty(stage: Usd.Stage) -> None:
    shape(stage, "Mesh")
    assert cut(stage).segments == ()


# -- what counts


def test_only_enabled_active_colliders_count(stage: Usd.Stage) -> None:
    stage.DefinePrim("/Seen", "Cube")
    shape(stage, "Cube", "/Off").GetAttribute("physics:collisionEnabled").Set(False)  # noqa: FBT003 - pxr
    shape(stage, "Cube", "/Gone").SetActive(False)  # noqa: FBT003 - pxr
    stage.OverridePrim("/Over").ApplyAPI(UsdPhysics.CollisionAPI)
    assert cut(stage) == StageSlice(0.0, None, ())


def test_the_robot_and_the_ground_plane_are_left_out(stage: Usd.Stage) -> None:
    stage.DefinePrim(ROBOT, "Xform")
    shape(stage, "Cube", f"{ROBOT}/base/collisions")
    shape(stage, "Plane", "/Ground")
    shape(stage, "Cube", "/robot_shelf", size=4.0)
    found = cut(stage)
    assert bounds(found.segments) == pytest.approx([-2, -2, 2, 2])
    assert found.not_cut == ()


def test_instances_are_cut_each_in_its_place(stage: Usd.Stage) -> None:
    stage.CreateClassPrim("/Crate")
    shape(stage, "Cube", "/Crate/shape", size=1.0)
    for name, x in (("A", 0.0), ("B", 7.0)):
        instance = UsdGeom.Xform.Define(stage, f"/{name}")
        instance.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        instance.GetPrim().GetReferences().AddInternalReference("/Crate")
        instance.GetPrim().SetInstanceable(True)  # noqa: FBT003 - pxr
    segments = cut(stage).segments
    assert bounds(segments) == pytest.approx([-0.5, -0.5, 7.5, 0.5])
    assert outline_length(segments) == pytest.approx(8)


def test_a_collider_that_is_no_shape_stands_for_the_shapes_below_it(stage: Usd.Stage) -> None:
    shape(stage, "Xform", "/Shelf")
    stage.DefinePrim("/Shelf/Group/Board", "Cube")
    shape(stage, "Cube", "/Shelf/Off", size=8.0).GetAttribute("physics:collisionEnabled").Set(0)
    found = cut(stage)
    assert bounds(found.segments) == pytest.approx([-1, -1, 1, 1])
    assert found.not_cut == ()


def test_a_shape_that_cannot_be_cut_is_told(stage: Usd.Stage) -> None:
    shape(stage, "NurbsPatch", "/Patch")
    shape(stage, "Cube", "/Box")
    found = cut(stage)
    assert found.not_cut == ("/Patch",)
    assert found.segments


def test_an_asset_that_cannot_be_found_is_counted(
    stage: Usd.Stage, capfd: pytest.CaptureFixture[str]
) -> None:
    stage.DefinePrim("/Room", "Xform").GetReferences().AddReference("not_here.usd")
    capfd.readouterr()
    assert cut(stage).missing == 1


# -- units and heights


def test_centimetres_become_metres(stage: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    shape(stage, "Cube", size=200.0)
    assert bounds(cut(stage, 0.9).segments) == pytest.approx([-1, -1, 1, 1])
    assert cut(stage, 1.1).segments == ()


def test_a_stage_with_y_up_is_turned_so_that_z_is_up(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    box = UsdGeom.Xformable(shape(stage, "Cube", size=1.0))
    box.AddTranslateOp().Set(Gf.Vec3d(3, 5, -2))
    # X stays, the height is Y, and -Z of a Y-up world points along Y.
    assert bounds(cut(stage, 5.0).segments) == pytest.approx([2.5, 1.5, 3.5, 2.5])


def test_the_height_is_that_of_the_lidars_link(stage: Usd.Stage) -> None:
    UsdGeom.Xform.Define(stage, ROBOT).AddTranslateOp().Set(Gf.Vec3d(1.8, -0.5, 0.1))
    UsdGeom.Xform.Define(stage, LIDAR).AddTranslateOp().Set(Gf.Vec3d(-0.032, 0, 0.182))
    found = cut(stage, None)
    assert found.height == pytest.approx(0.282)
    assert found.robot == pytest.approx((1.8, -0.5))


def test_a_stage_without_the_link_needs_a_height(stage: Usd.Stage) -> None:
    with pytest.raises(UsageError):
        cut(stage, None)


def test_the_bundled_starter_is_cut_at_its_lidar(tmp_path: Path) -> None:
    build_starter(tmp_path / "starter.usda")
    made = Usd.Stage.Open(str(tmp_path / "starter.usda"))
    found = slice_stage(made, SliceOptions("/turtlebot3_burger", "/turtlebot3_burger/base_scan"))
    assert found.height == pytest.approx(0.182)
    assert found.robot == (1.8, 0.0)
    assert bounds(found.segments) == pytest.approx([-6.0, -3.1, 2.5, 4.6])
    assert not found.not_cut
    assert not found.missing


# -- what is not looked at twice, or at all


def test_nested_colliders_are_cut_once(stage: Usd.Stage) -> None:
    path = ""
    for _ in range(3):
        path += "/group"
        shape(stage, "Xform", path)
        stage.DefinePrim(f"{path}/box", "Cube")
    assert outline_length(cut(stage).segments) == pytest.approx(3 * 8)


def test_what_a_disabled_collider_holds_is_cut_with_the_one_above(stage: Usd.Stage) -> None:
    shape(stage, "Xform", "/group")
    inner = shape(stage, "Xform", "/group/inner")
    UsdPhysics.CollisionAPI(inner).CreateCollisionEnabledAttr(False)  # noqa: FBT003 - USD's signature
    stage.DefinePrim("/group/inner/box", "Cube")
    assert outline_length(cut(stage).segments) == pytest.approx(8)


@pytest.mark.parametrize(
    ("up", "height", "is_looked_at"),
    [
        (0.0, 0.0, True),
        (0.0, 0.9999, True),
        (0.0, 1.1, False),
        (0.0, -1.1, False),
        (5.0, 5.0, True),
    ],
)
def test_faces_of_a_mesh_that_the_cut_misses_are_not_looked_at(
    stage: Usd.Stage,
    monkeypatch: pytest.MonkeyPatch,
    up: float,
    height: float,
    is_looked_at: bool,  # noqa: FBT001 - a case
) -> None:
    prim = mesh(stage, [(-1, -1, -1), (1, 0, 1), (0, 1, -1), (0, 0, 1)], [[0, 1, 2], [0, 2, 3]])
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0, 0, up))
    seen: list[str] = []
    mesh_faces = lidar_plane._mesh

    def noted(prim: Usd.Prim) -> object:
        seen.append(str(prim.GetPath()))
        return mesh_faces(prim)

    monkeypatch.setattr(lidar_plane, "_mesh", noted)
    found = cut(stage, height)
    assert seen == (["/Thing"] if is_looked_at else [])
    assert bool(found.segments) == is_looked_at


def test_a_mesh_that_stands_nowhere_is_named(stage: Usd.Stage) -> None:
    prim = mesh(stage, [(0, 0, -1), (1, 0, 1), (0, 1, -1)], [[0, 1, 2]])
    broken = Sdf.ValueTypeNames.String
    prim.CreateAttribute("xformOp:translate", broken).Set("here")
    UsdGeom.Xformable(prim).GetXformOpOrderAttr().Set(["xformOp:translate"])
    found = cut(stage)
    assert found.not_cut == ("/Thing",)


def test_a_shape_that_stands_again_where_it_stood_is_cut_once() -> None:
    lidar_plane._cut_solid.cache_clear()
    for _ in range(2):
        again = Usd.Stage.CreateInMemory()
        UsdPhysics.CollisionAPI.Apply(UsdGeom.Cylinder.Define(again, "/Thing").GetPrim())
        assert cut(again).segments
    cuts = lidar_plane._cut_solid.cache_info()
    assert (cuts.misses, cuts.hits) == (1, 1)
