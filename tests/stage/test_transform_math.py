"""Matrices are taken apart as USD means them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pxr import Gf, Usd, UsdGeom

from lab3_usd.model.prims import Matrix
from lab3_usd.model.transforms import (
    IDENTITY,
    Vector,
    angle_between,
    angles_from_z,
    camera_axes,
    decompose,
    euler_angles,
    inverse,
    multiply,
    relative_transform,
    rotate_by_quaternion,
    rotate_vector,
    rotation_difference,
    rotation_from_euler,
    transform_point,
)

DEGREES = st.floats(-170, 170)
TURNS = st.tuples(DEGREES, st.floats(-85, 85), DEGREES)
PLACES = st.tuples(*[st.floats(-10, 10)] * 3)
SIZES = st.tuples(*[st.floats(0.1, 10)] * 3)


def matrix_of(place: Vector, turn: Vector, size: Vector) -> Matrix:
    """The local matrix of a prim with translate, rotateXYZ and scale."""
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    xform.AddTranslateOp().Set(Gf.Vec3d(*place))
    xform.AddRotateXYZOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*turn))
    xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*size))
    return tuple(number for row in xform.GetLocalTransformation() for number in row)


@given(PLACES, TURNS, SIZES)
def test_a_matrix_comes_apart_into_what_made_it(place: Vector, turn: Vector, size: Vector) -> None:
    pose = decompose(matrix_of(place, turn, size))
    assert pose.translation == pytest.approx(place)
    assert pose.scale == pytest.approx(size)
    assert rotation_difference(pose.rotation, rotation_from_euler(turn)) == pytest.approx(
        0, abs=1e-6
    )


@given(TURNS)
def test_angles_from_z_are_those_of_the_operation_that_turns_about_z_first(turn: Vector) -> None:
    rotation = rotation_from_euler(turn)
    stage = Usd.Stage.CreateInMemory()
    xform = UsdGeom.Xform.Define(stage, "/prim")
    xform.AddRotateZYXOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*angles_from_z(rotation)))
    made = decompose(tuple(number for row in xform.GetLocalTransformation() for number in row))
    assert rotation_difference(made.rotation, rotation) == pytest.approx(0, abs=1e-6)


def there_and_back(turn: Vector) -> float:
    rotation = rotation_from_euler(turn)
    return rotation_difference(rotation_from_euler(euler_angles(rotation)), rotation)


@given(TURNS)
def test_angles_give_the_rotation_back(turn: Vector) -> None:
    assert there_and_back(turn) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("turn", [(90, 0, -90), (30, 90, 0), (-20, -90, 0), (0, 90, 45)])
def test_angles_hold_where_two_axes_fall_together(turn: Vector) -> None:
    assert there_and_back(turn) == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("angle", [1e-5, 0.05, 90, 179, 180])
def test_the_turn_between_two_rotations_is_the_angle_that_was_turned(angle: float) -> None:
    assert rotation_difference(
        rotation_from_euler((0, 0, angle)), rotation_from_euler((0, 0, 0))
    ) == pytest.approx(angle, rel=1e-6)


def test_a_mirrored_matrix_has_a_negative_scale() -> None:
    pose = decompose(matrix_of((0, 0, 0), (0, 0, 0), (1, -2, 1)))
    assert math.prod(pose.scale) == pytest.approx(-2)


def test_a_flat_matrix_has_a_scale_of_zero_and_no_inverse() -> None:
    flat = matrix_of((0, 0, 0), (0, 0, 0), (1, 0, 1))
    assert decompose(flat).scale == (1, 0, 1)
    assert inverse(flat) is None
    assert relative_transform(IDENTITY, flat) is None


@given(PLACES, TURNS, SIZES)
def test_the_inverse_undoes(place: Vector, turn: Vector, size: Vector) -> None:
    matrix = matrix_of(place, turn, size)
    undone = inverse(matrix)
    assert undone is not None
    assert multiply(matrix, undone) == pytest.approx(IDENTITY, abs=1e-7)


@given(PLACES, PLACES, TURNS, SIZES)
def test_points_and_products_go_where_usd_puts_them(
    point: Vector, place: Vector, turn: Vector, size: Vector
) -> None:
    matrix = matrix_of(place, turn, size)
    twice = Gf.Matrix4d(*matrix) * Gf.Matrix4d(*matrix)
    assert transform_point(point, matrix) == pytest.approx(
        tuple(Gf.Matrix4d(*matrix).Transform(point))
    )
    assert multiply(matrix, matrix) == pytest.approx(
        [number for row in twice for number in row], abs=1e-9
    )


@given(PLACES, TURNS)
def test_directions_turn_with_the_rotation(direction: Vector, turn: Vector) -> None:
    matrix = Gf.Matrix4d(*matrix_of((1, 2, 3), turn, (1, 1, 1)))
    assert rotate_vector(direction, rotation_from_euler(turn)) == pytest.approx(
        tuple(matrix.TransformDir(Gf.Vec3d(*direction))), abs=1e-9
    )


@given(PLACES, PLACES, st.floats(-179, 179))
def test_a_quaternion_turns_as_usd_does(direction: Vector, axis: Vector, angle: float) -> None:
    quaternion = Gf.Rotation(Gf.Vec3d(*axis) + Gf.Vec3d(20, 0, 0), angle).GetQuat()
    numbers = (*quaternion.GetImaginary(), quaternion.GetReal())
    turned_by_usd = Gf.Rotation(quaternion).TransformDir(Gf.Vec3d(*direction))
    for factor in (1, -1, 3):
        scaled = (
            numbers[0] * factor,
            numbers[1] * factor,
            numbers[2] * factor,
            numbers[3] * factor,
        )
        assert rotate_by_quaternion(direction, scaled) == pytest.approx(
            tuple(turned_by_usd), abs=1e-6
        )


def test_an_empty_quaternion_turns_nothing() -> None:
    assert rotate_by_quaternion((1, 2, 3), (0, 0, 0, 0)) == (1, 2, 3)


def test_a_camera_looks_along_its_own_minus_z() -> None:
    look, up = camera_axes(IDENTITY)
    assert angle_between(look, (0, 0, -1)) == 0
    assert angle_between(up, (0, 1, 0)) == 0


def test_the_handouts_camera_looks_ahead() -> None:
    look, up = camera_axes(matrix_of((0.1, 0, 0.2), (90, 0, -90), (1, 1, 1)))
    assert angle_between(look, (1, 0, 0)) == pytest.approx(0, abs=1e-9)
    assert angle_between(up, (0, 0, 1)) == pytest.approx(0, abs=1e-9)
