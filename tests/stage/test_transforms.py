"""Transforms read off the operations are those of UsdGeom, for every operation there is."""

from __future__ import annotations

import pytest
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics

from lab3_usd.model.prims import Matrix
from lab3_usd.model.transforms import IDENTITY
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.prim_transforms import TransformCache, local_transform
from lab3_usd.stage.read.stage_reader import read_model

Op = UsdGeom.XformOp
VALUES = {
    **{kind: Gf.Vec3d(0.3, -1.2, 2.5) for kind in (Op.TypeTranslate, Op.TypeScale)},
    **{
        kind: Gf.Vec3d(30.0, -45.0, 110.0)
        for kind in (
            *(Op.TypeRotateXYZ, Op.TypeRotateXZY, Op.TypeRotateYXZ),
            *(Op.TypeRotateYZX, Op.TypeRotateZXY, Op.TypeRotateZYX),
        )
    },
    **dict.fromkeys((Op.TypeRotateX, Op.TypeRotateY, Op.TypeRotateZ), -37.0),
    Op.TypeOrient: Gf.Quatd(0.5, 0.5, -0.5, -0.5),
    Op.TypeTransform: Gf.Matrix4d(1.0).SetTranslate(Gf.Vec3d(1, 2, 3)),
}
ON_ONE_AXIS = [
    (getattr(Op, f"Type{kind}{axis}"), 1.7)
    for kind in ("Translate", "Scale")
    for axis in "XYZ"
    if hasattr(Op, f"Type{kind}{axis}")
]
ALL = [*VALUES.items(), *ON_ONE_AXIS]


def same(one: Matrix, other: Gf.Matrix4d) -> bool:
    return Gf.IsClose(Gf.Matrix4d(*one), other, 1e-12)


@pytest.mark.parametrize(("kind", "value"), ALL, ids=[str(kind) for kind, _ in ALL])
def test_each_operation_moves_as_usdgeom_says(kind: Op.Type, value: object) -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    xform.AddXformOp(kind, Op.PrecisionDouble).Set(value)
    assert same(local_transform(xform.GetPrim())[0], xform.GetLocalTransformation())


def test_operations_follow_each_other_in_their_order() -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    for kind, value in VALUES.items():
        xform.AddXformOp(kind, Op.PrecisionDouble, str(kind)[-3:]).Set(value)
    assert same(local_transform(xform.GetPrim())[0], xform.GetLocalTransformation())


def test_an_inverted_operation_moves_back() -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    pivot = xform.AddTranslateOp(Op.PrecisionDouble, "pivot")
    pivot.Set(Gf.Vec3d(1, 2, 3))
    xform.AddRotateZOp().Set(90.0)
    xform.AddTranslateOp(Op.PrecisionDouble, "pivot", isInverseOp=True)
    assert same(local_transform(xform.GetPrim())[0], xform.GetLocalTransformation())


@pytest.mark.parametrize("precision", [Op.PrecisionHalf, Op.PrecisionFloat])
def test_lower_precision_reads_the_same(precision: Op.Precision) -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    xform.AddOrientOp(precision).Set(
        Gf.Quath(0.5, 0.5, -0.5, -0.5)
        if precision == Op.PrecisionHalf
        else Gf.Quatf(0.5, 0.5, -0.5, -0.5)
    )
    assert same(local_transform(xform.GetPrim())[0], xform.GetLocalTransformation())


@pytest.mark.parametrize(
    "value",
    [(2, 0, 0, 1), (0.5, 0, 0, 0.1), (-3, 1, 0, 0), (0.1, 0, 0, 0), (0, 0, 0, 0), (1, 2, 3, 4)],
)
def test_a_quaternion_of_another_length_turns_as_usdgeom_says(value: tuple[float, ...]) -> None:
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    xform.AddOrientOp(Op.PrecisionDouble).Set(Gf.Quatd(*value))
    assert same(local_transform(xform.GetPrim())[0], xform.GetLocalTransformation())


def test_a_reset_leaves_out_the_parent() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Xform.Define(stage, "/a").AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    child = UsdGeom.Xform.Define(stage, "/a/b")
    child.AddTranslateOp().Set(Gf.Vec3d(0, 1, 0))
    child.SetResetXformStack(True)  # noqa: FBT003 - USD's signature
    world = TransformCache().world(child.GetPrim())
    assert world[12:15] == (0, 1, 0)
    assert same(world, UsdGeom.XformCache().GetLocalToWorldTransform(child.GetPrim()))


def test_a_type_that_usd_does_not_know_stands_where_it_says() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Xform.Define(stage, "/a").AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    lidar = stage.DefinePrim("/a/lidar", "OmniLidar")
    lidar.CreateAttribute("xformOp:translate", Sdf.ValueTypeNames.Double3).Set((0, 0, 2))
    lidar.CreateAttribute("xformOpOrder", Sdf.ValueTypeNames.TokenArray).Set(["xformOp:translate"])
    assert TransformCache().world(lidar)[12:15] == (5, 0, 2)


@pytest.mark.parametrize("name", ["xformOp:translate", "xformOp:wobble", "sidewards"])
def test_an_operation_that_is_nothing_moves_nothing(name: str) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/prim").GetPrim()
    prim.CreateAttribute("xformOpOrder", Sdf.ValueTypeNames.TokenArray).Set([name])
    assert local_transform(prim) == (IDENTITY, False)


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("translate", "Int3", Gf.Vec3i(1, 2, 3)),
        ("translate", "Quatf", Gf.Quatf(1, 2, 3, 4)),
        ("translate", "String", "far"),
        ("translate", "Float2", Gf.Vec2f(1, 2)),
        ("scale", "Double", 2.0),
        ("rotateZ", "Int", 90),
        ("rotateX", "Float3", Gf.Vec3f(1, 0, 0)),
        ("rotateXYZ", "Double4", Gf.Vec4d(1, 0, 0, 0)),
        ("transform", "Double3", Gf.Vec3d(1, 2, 3)),
        ("wobble", "Double", 2.0),
    ],
)
def test_a_value_that_usdgeom_refuses_moves_nothing(name: str, kind: str, value: object) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/prim").GetPrim()
    prim.CreateAttribute(f"xformOp:{name}", getattr(Sdf.ValueTypeNames, kind)).Set(value)
    order = prim.CreateAttribute("xformOpOrder", Sdf.ValueTypeNames.TokenArray)
    order.Set([f"xformOp:{name}"])
    with pytest.raises(Tf.ErrorException, match=r"Invalid|Returning identity"):
        UsdGeom.Xformable(prim).GetLocalTransformation()
    assert local_transform(prim) == (IDENTITY, False)


@pytest.mark.parametrize(
    ("kind", "order"), [("Int", 7), ("String", "xformOp:translate"), ("IntArray", [7])]
)
def test_an_order_of_another_type_moves_nothing(kind: str, order: object) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/prim", "OmniLidar")
    prim.CreateAttribute("xformOpOrder", getattr(Sdf.ValueTypeNames, kind)).Set(order)
    prim.CreateAttribute("xformOp:translate", Sdf.ValueTypeNames.Double3).Set((0, 0, 2))
    assert local_transform(prim) == (IDENTITY, False)


def test_a_prim_without_an_order_of_its_own_has_no_local_transform() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Xform.Define(stage, "/a").AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    plain = UsdGeom.Xform.Define(stage, "/a/b").GetPrim()
    local, world = TransformCache().of(plain, "/a/b")
    assert local is None
    assert world[12:15] == (5, 0, 0)


def test_a_shape_whose_size_was_blocked_is_no_reason_to_fail() -> None:
    stage = Usd.Stage.CreateInMemory()
    for kind, names in (("Cube", ("size",)), ("Cylinder", ("radius", "height", "axis"))):
        prim = stage.DefinePrim(f"/{kind}", kind)
        prim.ApplyAPI(UsdPhysics.CollisionAPI)
        for name in names:
            prim.GetAttribute(name).Block()
    boxes = list(read_model(stage, load_lab().platform, "stage.usda").colliders.below("/"))
    assert {box.low for box in boxes} == {(0.0, 0.0, 0.0)}
