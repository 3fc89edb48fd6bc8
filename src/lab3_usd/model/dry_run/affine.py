"""Places in space: a 3 x 3 matrix, as rows, and where the origin goes."""

from __future__ import annotations

import math
from typing import NamedTuple

from lab3_usd.model.transform_math import Vector, length

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Rows = tuple[Vector, Vector, Vector]
_HALF_TURN = 1e-3  # w of a quaternion, below which another part is larger
AXES: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Affine(NamedTuple):
    """Maps a point p to `rows` p + `origin`."""

    rows: Rows = AXES
    origin: Vector = (0.0, 0.0, 0.0)

    def point(self, at: Vector) -> Vector:
        """Return where a point goes."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        x, y, z = at
        u, v, w = self.origin
        return (a * x + b * y + c * z + u, d * x + e * y + f * z + v, g * x + h * y + i * z + w)

    def turn(self, direction: Vector) -> Vector:
        """Return where a direction goes."""
        return turned(self.rows, direction)

    def then(self, inner: Affine) -> Affine:
        """Return the place of something that stands at `inner` in this place's frame."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        (p, q, r), (s, t, u), (v, w, x) = inner.rows
        rows = (
            (a * p + b * s + c * v, a * q + b * t + c * w, a * r + b * u + c * x),
            (d * p + e * s + f * v, d * q + e * t + f * w, d * r + e * u + f * x),
            (g * p + h * s + i * v, g * q + h * t + i * w, g * r + h * u + i * x),
        )
        return Affine(rows, self.point(inner.origin))

    def inverse(self) -> Affine:
        """Return the way back; a place without volume has none and gives zeros."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        one, two, three = e * i - f * h, f * g - d * i, d * h - e * g
        volume = a * one + b * two + c * three
        k = 1.0 / volume if volume else 0.0
        rows = (
            (one * k, (c * h - b * i) * k, (b * f - c * e) * k),
            (two * k, (a * i - c * g) * k, (c * d - a * f) * k),
            (three * k, (b * g - a * h) * k, (a * e - b * d) * k),
        )
        x, y, z = turned(rows, self.origin)
        return Affine(rows, (-x, -y, -z))

    def rigid(self) -> Affine:
        """Return the same place without scale."""
        columns = [column(self.rows, each) for each in range(3)]
        lengths = [length(each) or 1.0 for each in columns]
        rows = tuple(tuple(n / k for n, k in zip(row, lengths, strict=True)) for row in self.rows)
        return Affine(rows, self.origin)  # type: ignore[arg-type]

    def quaternion(self) -> Quaternion:
        """Return the rotation of a place without scale."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        w = math.sqrt(max(0.0, 1.0 + a + e + i)) / 2.0
        if w > _HALF_TURN:
            k = 0.25 / w
            return (w, (h - f) * k, (c - g) * k, (d - b) * k)
        x = math.copysign(math.sqrt(max(0.0, 1.0 + a - e - i)) / 2.0, h - f)
        y = math.copysign(math.sqrt(max(0.0, 1.0 - a + e - i)) / 2.0, c - g)
        z = math.copysign(math.sqrt(max(0.0, 1.0 - a - e + i)) / 2.0, d - b)
        if x and y and (x * y > 0) != (b + d > 0):
            y = -y
        if x and z and (x * z > 0) != (c + g > 0):
            z = -z
        if not x and y and z and (y * z > 0) != (f + h > 0):
            z = -z
        return (w, x, y, z)


HERE = Affine()


def turned(rows: Rows, direction: Vector) -> Vector:
    """Return the matrix times a vector."""
    x, y, z = direction
    return tuple(a * x + b * y + c * z for a, b, c in rows)  # type: ignore[return-value]


def column(rows: Rows, number: int) -> Vector:
    """Return one column of a matrix."""
    return (rows[0][number], rows[1][number], rows[2][number])


def rotation(quaternion: Quaternion) -> Rows:
    """Return the matrix of a quaternion of any length."""
    w, x, y, z = quaternion
    k = w * w + x * x + y * y + z * z
    if not k:
        return AXES
    s = 2.0 / k
    return (
        (1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )


def about(axis: Vector, angle: float) -> Rows:
    """Return the rotation by `angle` radians about an axis of length 1."""
    half = angle / 2.0
    s = math.sin(half)
    return rotation((math.cos(half), axis[0] * s, axis[1] * s, axis[2] * s))


def heading(place: Affine) -> float:
    """Return the angle about Z by which a place looks away from +X."""
    return math.atan2(place.rows[1][0], place.rows[0][0])
