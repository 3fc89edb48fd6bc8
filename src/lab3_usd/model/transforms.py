"""Transforms as plain numbers: translation, rotation and scale of a matrix, and directions.

Matrices are 16 numbers in rows as USD multiplies: row vectors from the left, translation last.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from msgspec import Struct

from lab3_usd.model.prims import Matrix

Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]  # the prim's X, Y and Z as directions in its parent

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_UNTURNED = IDENTITY[:12]  # without the translation
AXES: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Pose(Struct, frozen=True):
    """A decomposed transform."""

    translation: Vector
    rotation: Rotation
    scale: Vector


Part = Literal["translate", "rotate", "scale"]


class PlaceTolerance(Struct, frozen=True):
    """What counts as the same pose: a length, degrees, and relative factors."""

    position: float
    angle: float
    scale: float


SAVED_PLACE = PlaceTolerance(1e-5, 0.01, 1e-5)  # what single precision leaves of a place


def parts_apart(pose: Pose, expected: Pose, tolerance: PlaceTolerance) -> Iterator[Part]:
    """Yield the parts by which two poses differ; a mirrored one is scaled otherwise.

    A number that is none (NaN) is near nothing, which is why each test is the other way round.
    """
    if not distance(pose.translation, expected.translation) <= tolerance.position:
        yield "translate"
    if not rotation_difference(pose.rotation, expected.rotation) <= tolerance.angle:
        yield "rotate"
    if not is_scaled_alike(pose.scale, expected.scale, tolerance.scale):
        yield "scale"


def is_scaled_alike(scale: Vector, expected: Vector, limit: float) -> bool:
    """Whether two scales are the same up to a relative limit."""
    pairs = zip(scale, expected, strict=True)
    return all(abs(one - other) <= limit * max(abs(one), abs(other)) for one, other in pairs)


def vector_text(numbers: Sequence[float]) -> str:
    """Write a vector as the Property panel shows it, without float noise."""
    return "(" + ", ".join(f"{round(number, 6) + 0.0:g}" for number in numbers) + ")"


def decompose(matrix: Matrix) -> Pose:
    """Decompose a transform; shear, which no widget of Isaac Sim writes, is dropped."""
    x, y, z = scale = scale_of(matrix)
    return Pose(
        translation=(matrix[12], matrix[13], matrix[14]),
        rotation=(_turned(matrix, 0, x), _turned(matrix, 1, y), _turned(matrix, 2, z)),
        scale=scale,
    )


def _turned(matrix: Matrix, axis: int, size: float) -> Vector:
    """Return where a transform turns an axis, itself where its scale is 0."""
    row = (matrix[4 * axis], matrix[4 * axis + 1], matrix[4 * axis + 2])
    return scaled(row, 1 / size) if size else AXES[axis]


def scale_of(matrix: Matrix) -> Vector:
    """Return by what a transform scales the axes; a mirrored one has a negative scale along X."""
    a, b, c, _, d, e, f, _, g, h, i = matrix[:11]
    x, y, z = (
        math.sqrt(a * a + b * b + c * c),
        math.sqrt(d * d + e * e + f * f),
        math.sqrt(g * g + h * h + i * i),
    )
    is_mirrored = (b * f - c * e) * g + (c * d - a * f) * h + (a * e - b * d) * i < 0
    return -x if is_mirrored else x, y, z


def rotation_from_euler(degrees: Vector) -> Rotation:
    """Return the rotation about X, then Y, then Z, as `xformOp:rotateXYZ` writes it."""
    (sx, sy, sz), (cx, cy, cz) = (
        [function(math.radians(angle)) for angle in degrees] for function in (math.sin, math.cos)
    )
    return (
        (cy * cz, cy * sz, -sy),
        (sx * sy * cz - cx * sz, sx * sy * sz + cx * cz, sx * cy),
        (cx * sy * cz + sx * sz, cx * sy * sz - sx * cz, cx * cy),
    )


def euler_angles(rotation: Rotation) -> Vector:
    """Return degrees about X, then Y, then Z that give this rotation."""
    across, up, ahead = rotation
    sine = max(-1.0, min(1.0, -across[2]))
    about_y = math.asin(sine)
    if abs(across[0]) + abs(across[1]) > 1e-9:  # noqa: PLR2004 - else X and Z turn the same way
        about_x = math.atan2(up[2], ahead[2])
        about_z = math.atan2(across[1], across[0])
    else:
        about_x, about_z = math.atan2(up[0] * sine, up[1]), 0.0
    return (math.degrees(about_x), math.degrees(about_y), math.degrees(about_z))


def angles_from_z(rotation: Rotation) -> Vector:
    """Return degrees about X, Y and Z that give this rotation where Z turns first, then Y, then X.

    The rotation back turns by the same angles the other way, and about X first.
    """
    (a, b, c), (d, e, f), (g, h, i) = rotation
    x, y, z = euler_angles(((a, d, g), (b, e, h), (c, f, i)))
    return -x, -y, -z


def rotation_difference(first: Rotation, second: Rotation) -> float:
    """Return the angle in degrees by which two rotations differ.

    The arc tangent keeps small angles exact, where the arc cosine drowns them in rounding.
    """
    rows: Rotation = (_seen(first[0], second), _seen(first[1], second), _seen(first[2], second))
    skew = (rows[1][2] - rows[2][1], rows[2][0] - rows[0][2], rows[0][1] - rows[1][0])
    trace = rows[0][0] + rows[1][1] + rows[2][2]
    return math.degrees(math.atan2(length(skew), trace - 1))


def _seen(vector: Vector, frame: Rotation) -> Vector:
    """Return a vector in the coordinates of a frame."""
    return (dot(vector, frame[0]), dot(vector, frame[1]), dot(vector, frame[2]))


def camera_axes(matrix: Matrix) -> tuple[Vector, Vector]:
    """Return the view and up directions of a USD camera with this transform.

    A USD camera looks along its own -Z with +Y on top.
    """
    rotation = decompose(matrix).rotation
    return scaled(rotation[2], -1.0), rotation[1]


def angle_between(first: Vector, second: Vector) -> float:
    """Return the angle in degrees between two directions."""
    return math.degrees(math.atan2(length(cross(first, second)), dot(first, second)))


def multiply(first: Matrix, second: Matrix) -> Matrix:
    """Return the transform that does `first`, then `second`, which most often only moves."""
    if second[:12] == _UNTURNED:
        return (
            *first[:12],
            first[12] + second[12],
            first[13] + second[13],
            first[14] + second[14],
            1.0,
        )
    a, b, c, d, e, f, g, h, i, j, k, m, n, o, p, q = second
    numbers: list[float] = []
    for x, y, z, w in (first[:4], first[4:8], first[8:12], first[12:]):
        numbers += (
            x * a + y * e + z * i + w * n,
            x * b + y * f + z * j + w * o,
            x * c + y * g + z * k + w * p,
            x * d + y * h + z * m + w * q,
        )
    return tuple(numbers)


def inverse(matrix: Matrix) -> Matrix | None:
    """Return the transform that undoes this one, None where a scale of zero cannot be undone."""
    rows = [(matrix[at], matrix[at + 1], matrix[at + 2]) for at in (0, 4, 8)]
    volume = dot(cross(rows[0], rows[1]), rows[2])
    if not volume:
        return None
    columns = [
        scaled(cross(rows[1], rows[2]), 1 / volume),
        scaled(cross(rows[2], rows[0]), 1 / volume),
        scaled(cross(rows[0], rows[1]), 1 / volume),
    ]
    first, second, third = zip(*columns, strict=True)
    linear = (*first, 0.0, *second, 0.0, *third, 0.0)
    moved = transform_point((matrix[12], matrix[13], matrix[14]), (*linear, 0.0, 0.0, 0.0, 1.0))
    return (*linear, *scaled(moved, -1.0), 1.0)


def relative_transform(matrix: Matrix, base: Matrix) -> Matrix | None:
    """Return a world transform relative to another one."""
    undone = inverse(base)
    return None if undone is None else multiply(matrix, undone)


def transform_point(point: Vector, matrix: Matrix) -> Vector:
    """Return where a point goes."""
    x, y, z = point
    return (
        x * matrix[0] + y * matrix[4] + z * matrix[8] + matrix[12],
        x * matrix[1] + y * matrix[5] + z * matrix[9] + matrix[13],
        x * matrix[2] + y * matrix[6] + z * matrix[10] + matrix[14],
    )


def rotate_vector(vector: Vector, rotation: Rotation) -> Vector:
    """Return where a direction goes."""
    x, y, z = vector
    across, up, ahead = rotation
    return (
        x * across[0] + y * up[0] + z * ahead[0],
        x * across[1] + y * up[1] + z * ahead[1],
        x * across[2] + y * up[2] + z * ahead[2],
    )


def rotate_by_quaternion(vector: Vector, quaternion: tuple[float, float, float, float]) -> Vector:
    """Return a direction turned by a quaternion x, y, z, w of any length but zero."""
    part = quaternion[:3]
    size = dot(part, part) + quaternion[3] ** 2
    if not size:
        return vector
    first = cross(part, vector)
    second = cross(part, first)
    return (
        vector[0] + 2 * (quaternion[3] * first[0] + second[0]) / size,
        vector[1] + 2 * (quaternion[3] * first[1] + second[1]) / size,
        vector[2] + 2 * (quaternion[3] * first[2] + second[2]) / size,
    )


def box_of(points: Iterable[Vector]) -> tuple[Vector, Vector]:
    """Return the lowest and the highest coordinates of points."""
    xs, ys, zs = zip(*points, strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def distance(start: Vector, end: Vector) -> float:
    """Return how far two points are apart."""
    return math.dist(start, end)


def dot(first: Vector, second: Vector) -> float:
    """Return the scalar product."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def cross(first: Vector, second: Vector) -> Vector:
    """Return the vector product."""
    return (
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    )


def length(vector: Vector) -> float:
    """Return the length of a vector."""
    return math.sqrt(dot(vector, vector))


def scaled(vector: Vector, factor: float) -> Vector:
    """Return a vector times a number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def minus(minuend: Vector, subtrahend: Vector) -> Vector:
    """Return the difference."""
    return (minuend[0] - subtrahend[0], minuend[1] - subtrahend[1], minuend[2] - subtrahend[2])
