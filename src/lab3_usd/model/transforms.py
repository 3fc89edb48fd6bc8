"""Transforms as plain numbers: translation, rotation and scale of a matrix, and directions.

Matrices are 16 numbers in rows as USD multiplies: row vectors from the left, translation last.
"""

from __future__ import annotations

import math

from msgspec import Struct

from lab3_usd.model.prims import Matrix

Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]  # where X, Y and Z of the prim point in its parent

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_UNTURNED = IDENTITY[:12]  # without the translation
AXES: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Pose(Struct, frozen=True):
    """A transform taken apart; a mirrored one has a negative scale along X."""

    translation: Vector
    rotation: Rotation
    scale: Vector


def decompose(matrix: Matrix) -> Pose:
    """Take a transform apart; shear, which no widget of Isaac Sim writes, is left out."""
    rows = [(matrix[at], matrix[at + 1], matrix[at + 2]) for at in (0, 4, 8)]
    lengths = [length(row) for row in rows]
    if dot(cross(rows[0], rows[1]), rows[2]) < 0:
        lengths[0] = -lengths[0]
    units = [
        scaled(row, 1 / size) if size else axis
        for row, size, axis in zip(rows, lengths, AXES, strict=True)
    ]
    return Pose(
        translation=(matrix[12], matrix[13], matrix[14]),
        rotation=(units[0], units[1], units[2]),
        scale=(lengths[0], lengths[1], lengths[2]),
    )


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


def rotation_difference(one: Rotation, other: Rotation) -> float:
    """Return the angle in degrees by which two rotations differ.

    The arc tangent keeps small angles exact, where the arc cosine drowns them in rounding.
    """
    rows: Rotation = (_seen(one[0], other), _seen(one[1], other), _seen(one[2], other))
    skew = (rows[1][2] - rows[2][1], rows[2][0] - rows[0][2], rows[0][1] - rows[1][0])
    trace = rows[0][0] + rows[1][1] + rows[2][2]
    return math.degrees(math.atan2(length(skew), trace - 1))


def _seen(vector: Vector, frame: Rotation) -> Vector:
    """Return a vector in the coordinates of a frame."""
    return (dot(vector, frame[0]), dot(vector, frame[1]), dot(vector, frame[2]))


def camera_axes(matrix: Matrix) -> tuple[Vector, Vector]:
    """Return where a USD camera with this transform looks, and what it has on top.

    A USD camera looks along its own -Z with +Y on top.
    """
    rotation = decompose(matrix).rotation
    return scaled(rotation[2], -1.0), rotation[1]


def angle_between(one: Vector, other: Vector) -> float:
    """Return the angle in degrees between two directions."""
    return math.degrees(math.atan2(length(cross(one, other)), dot(one, other)))


def multiply(one: Matrix, other: Matrix) -> Matrix:
    """Return the transform that does `one` first, then `other`, which most often only moves."""
    if other[:12] == _UNTURNED:
        return (*one[:12], one[12] + other[12], one[13] + other[13], one[14] + other[14], 1.0)
    a, b, c, d, e, f, g, h, i, j, k, m, n, o, p, q = other
    numbers: list[float] = []
    for x, y, z, w in (one[:4], one[4:8], one[8:12], one[12:]):
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
    linear = [tuple(column[row] for column in columns) for row in range(3)]
    translation = tuple(-sum(matrix[12 + k] * linear[k][at] for k in range(3)) for at in range(3))
    return (*linear[0], 0.0, *linear[1], 0.0, *linear[2], 0.0, *translation, 1.0)


def relative_transform(matrix: Matrix, base: Matrix) -> Matrix | None:
    """Return a world transform as seen from another one."""
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
    x, y, z = (sum(vector[k] * rotation[k][at] for k in range(3)) for at in range(3))
    return (x, y, z)


def rotate_by_quaternion(vector: Vector, quaternion: tuple[float, float, float, float]) -> Vector:
    """Return a direction turned by a quaternion x, y, z, w of any length but zero."""
    part = quaternion[:3]
    size = dot(part, part) + quaternion[3] ** 2
    if not size:
        return vector
    first = cross(part, vector)
    second = cross(part, first)
    x, y, z = (vector[at] + 2 * (quaternion[3] * first[at] + second[at]) / size for at in range(3))
    return (x, y, z)


def distance(one: Vector, other: Vector) -> float:
    """Return how far two points are apart."""
    return math.dist(one, other)


def dot(one: Vector, other: Vector) -> float:
    """Return the scalar product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: Vector, other: Vector) -> Vector:
    """Return the vector product."""
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


def length(vector: Vector) -> float:
    """Return the length of a vector."""
    return math.sqrt(dot(vector, vector))


def scaled(vector: Vector, factor: float) -> Vector:
    """Return a vector times a number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def minus(one: Vector, other: Vector) -> Vector:
    """Return the difference."""
    return (one[0] - other[0], one[1] - other[1], one[2] - other[2])
