"""What is said of the robot's camera, beyond one fault for each thing that is asked of it."""

from __future__ import annotations

import pytest
from pxr import Gf, UsdGeom
from scene_stages import (
    CAMERA,
    ORIENT,
    ROBOT,
    SCALE,
    TICK,
    TRANSLATE,
    Change,
    as_matrix,
    author,
    built,
    clear,
    define,
    findings_of,
    found_after,
    move_prim,
    negated,
    put,
    refer,
    remove,
    rotated,
    several,
    told,
    told_after,
    turn,
    without_api,
)

RIGHT = Gf.Quatd(0.5, 0.5, -0.5, -0.5)
FLOATS = Gf.Quatd(0.49999997, 0.50000003, -0.5, -0.49999994)


def in_single_precision(stage: object) -> None:
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(CAMERA))  # type: ignore[attr-defined] # pxr
    xform.ClearXformOpOrder()
    xform.GetPrim().RemoveProperty(ORIENT)
    xform.GetPrim().RemoveProperty(TRANSLATE)
    xform.AddTranslateOp(UsdGeom.XformOp.PrecisionFloat).Set(Gf.Vec3f(0.1, 0, 0.2))
    xform.AddOrientOp(UsdGeom.XformOp.PrecisionFloat).Set(Gf.Quatf(RIGHT))


EQUALS: dict[str, Change] = {
    "the handout's angles": rotated(CAMERA, (90, 0, -90)),
    "the same angles another way": rotated(CAMERA, (90, -90, 0), "ZYX"),
    "matrix": as_matrix(CAMERA),
    "other sign": negated(CAMERA),
    "noise": put(CAMERA, ORIENT, FLOATS),
    "single precision": in_single_precision,
    "a little off": put(CAMERA, TRANSLATE, Gf.Vec3d(0.10000000149, 5e-5, 0.2)),
    "no sensor schema": several(clear(CAMERA, TICK), without_api(CAMERA, "OmniSensorAPI")),
    "default aperture": lambda stage: (
        UsdGeom.Camera(stage.GetPrimAtPath(CAMERA)).CreateHorizontalApertureAttr(20.955) and None
    ),
    "another camera on the robot": define(f"{ROBOT}/base_link/Extra", "Camera"),
    "a camera of the world with its name": define("/World/Camera_1", "Camera"),
    "perspective": author(CAMERA, "projection", "Token", "perspective"),
    "pinhole": author(CAMERA, "cameraProjectionType", "Token", "pinhole"),
    "no clipping planes": author(CAMERA, "clippingPlanes", "Float4Array", []),
    "no lens distortion": author(CAMERA, "omni:lensdistortion:model", "Token", ""),
}


@pytest.mark.parametrize("change", EQUALS.values(), ids=EQUALS)
def test_what_means_the_same_is_no_fault(change: Change) -> None:
    assert told_after("04", change) == []


CHANGED: dict[str, tuple[Change, str]] = {
    "orthographic": (author(CAMERA, "projection", "Token", "orthographic"), "projection"),
    "fisheye": (
        author(CAMERA, "cameraProjectionType", "Token", "fisheyePolynomial"),
        "cameraProjectionType",
    ),
    "distorted": (
        author(CAMERA, "omni:lensdistortion:model", "Token", "opencvFisheye"),
        "omni:lensdistortion:model",
    ),
    "shifted": (
        author(CAMERA, "horizontalApertureOffset", "Float", 9.0),
        "horizontalApertureOffset",
    ),
    "black": (author(CAMERA, "exposure", "Float", -30.0), "exposure"),
    "clipped": (
        author(CAMERA, "clippingPlanes", "Float4Array", [Gf.Vec4f(1, 0, 0, -2)]),
        "clippingPlanes",
    ),
}


@pytest.mark.parametrize(("change", "name"), CHANGED.values(), ids=CHANGED)
def test_another_image_than_a_plain_one_is_a_warning(change: Change, name: str) -> None:
    (found,) = found_after("04", change)
    assert (found.rule, found.severity, found.prim, found.property) == (
        *("C10", "warning"),
        *(CAMERA, name),
    )


@pytest.mark.parametrize("checkpoint", ["04", "08"])
def test_a_schema_without_a_rate_is_a_warning(checkpoint: str) -> None:
    (found,) = found_after(checkpoint, clear(CAMERA, TICK))
    assert (found.rule, found.severity, found.property) == ("C07", "warning", TICK)


def test_a_rate_of_zero_is_a_fault() -> None:
    (found,) = found_after("04", put(CAMERA, TICK, 0.0))
    assert (found.rule, found.severity, found.property) == ("C07", "error", TICK)


def test_a_rate_behind_a_missing_asset_is_not_verifiable() -> None:
    found = told_after("04", clear(CAMERA, TICK), refer(CAMERA, "camera.usd"))
    assert found == [("F02", CAMERA, None)]


def test_a_camera_of_the_world_with_its_name_is_not_the_robots() -> None:
    found = told_after("04", remove(CAMERA), define("/World/Camera_1", "Camera"))
    assert found == [("C01", CAMERA, None)]


def test_the_handouts_fallback_typed_into_the_orient_field_is_named_as_that() -> None:
    (found,) = found_after("04", put(CAMERA, ORIENT, Gf.Quatd(0.5, 0.5, -0.5, 0.5)))
    assert found.rule == "C05"
    assert "Orient field" in found.message
    assert "(90, 0, 90)" in found.message


def test_any_other_view_is_told_as_it_is() -> None:
    (found,) = found_after("04", rotated(CAMERA, (60, 0, -90)))
    assert (found.rule, found.property) == ("C05", "xformOp:rotateXYZ")
    assert found.actual == "along (0.866025, 0, -0.5), up (0.5, 0, 0.866025)"


def test_a_mirrored_camera_is_scaled_wrong() -> None:
    assert ("C04", CAMERA, SCALE) in told_after("04", put(CAMERA, SCALE, Gf.Vec3d(1, 1, -1)))


def test_each_part_of_the_pose_is_a_fault_of_its_own() -> None:
    stage = built("04")
    put(CAMERA, TRANSLATE, Gf.Vec3d(0, 0, 0))(stage)
    put(CAMERA, ORIENT, turn(10))(stage)
    assert told(stage, "04") == [("C04", CAMERA, TRANSLATE), ("C05", CAMERA, ORIENT)]


def test_a_camera_dragged_off_its_link_in_place_is_only_misplaced() -> None:
    stage = built("04")
    move_prim(CAMERA, "/World/Camera_1")(stage)
    put("/World/Camera_1", TRANSLATE, Gf.Vec3d(1.9, 0, 0.2))(stage)
    assert told(stage, "04") == [("C02", "/World/Camera_1", None)]


def test_the_inside_of_a_misplaced_camera_is_judged() -> None:
    stage = built("04")
    move_prim(CAMERA, f"{ROBOT}/base_link/Camera_1")(stage)
    put(f"{ROBOT}/base_link/Camera_1", "focalLength", 50.0)(stage)
    assert told(stage, "04") == [
        ("C02", f"{ROBOT}/base_link/Camera_1", None),
        ("C06", f"{ROBOT}/base_link/Camera_1", "focalLength"),
    ]


def test_a_camera_below_a_missing_link_is_not_told_again() -> None:
    assert [each[0] for each in told_after("04", remove(f"{ROBOT}/base_footprint"))] == ["S01"]


def test_a_changed_aperture_is_a_warning() -> None:
    stage = built("04")
    UsdGeom.Camera(stage.GetPrimAtPath(CAMERA)).CreateVerticalApertureAttr(24.0)
    (found,) = findings_of(stage, "04")
    assert (found.rule, found.severity) == ("C08", "warning")
    assert (found.prim, found.property) == (CAMERA, "verticalAperture")


@pytest.mark.parametrize("checkpoint", ["01", "03"])
def test_an_early_camera_is_a_warning(checkpoint: str) -> None:
    found = found_after(checkpoint, define(CAMERA, "Camera"))
    assert [(each.rule, each.severity, each.prim) for each in found] == [("C09", "warning", CAMERA)]


def test_a_lens_behind_a_missing_asset_is_not_verifiable() -> None:
    found = told_after("04", clear(CAMERA, "focalLength"), refer(CAMERA, "camera.usd"))
    assert found == [("F02", CAMERA, None)]


@pytest.mark.parametrize("checkpoint", ["00", "01", "03"])
def test_a_camera_of_the_world_is_not_early_whatever_its_name(checkpoint: str) -> None:
    assert told_after(checkpoint, define("/World/Camera_1", "Camera")) == []


def test_a_camera_of_another_name_on_the_robot_is_early() -> None:
    found = told_after("03", define(f"{ROBOT}/base_scan/Camera", "Camera"))
    assert found == [("C09", f"{ROBOT}/base_scan/Camera", None)]


def test_a_pivot_that_moves_the_camera_is_named_in_the_repair() -> None:
    stage = built("04")
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(CAMERA))
    move, turned, size = xform.GetOrderedXformOps()
    xform.AddTranslateOp(opSuffix="pivot").Set(Gf.Vec3d(1, 2, 3))
    pivot = xform.GetOrderedXformOps()[-1]
    back = xform.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    xform.SetXformOpOrder([move, pivot, turned, size, back])
    (found,) = findings_of(stage, "04")
    assert (found.rule, found.property) == ("C04", TRANSLATE)
    assert "remove the pivot (xformOp:translate:pivot)" in found.hint
