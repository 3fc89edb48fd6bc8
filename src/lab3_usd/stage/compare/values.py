"""Whether two values of two stages are the same, and how to show them when they are not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf

from lab3_usd.model.formatting import display
from lab3_usd.spec.catalog import Value
from lab3_usd.stage.read.plain_values import plain_value

_LONGEST = 60  # characters of a value in a message
_QUATERNIONS = (Gf.Quatd, Gf.Quatf, Gf.Quath)
_LARGEST = 3.4028234e38  # that a float holds: as a limit it is none, as infinity is
_NEAR_ZERO = 1e-3  # of the tolerance: below it a lone number is as good as zero


def same_value(was: Any, now: Any, tolerance: float) -> bool:  # noqa: ANN401 - what USD holds
    """Whether two values are the same up to a relative tolerance.

    Vectors are measured by their longest part; a rotation and its negative are the same; assets
    are compared by what they resolve to.
    """
    if was == now:
        return True
    if now is None or isinstance(was, (bool, str)) or isinstance(now, (bool, str)):
        return False
    if isinstance(was, Sdf.AssetPathArray):
        return _same_assets(was, now)
    if isinstance(was, Sdf.AssetPath):
        return isinstance(now, Sdf.AssetPath) and same_asset(was, now)
    return _same_numbers(was, now, tolerance)


def _same_numbers(was: Any, now: Any, tolerance: float) -> bool:  # noqa: ANN401
    one, other = list(_numbers(was)), list(_numbers(now))
    if len(one) != len(other):
        return False
    if isinstance(was, _QUATERNIONS) and math.fsum(map(_product, one, other)) < 0:
        other = [-part for part in other]
    return _close(one, other, tolerance)


def _product(one: float, other: float) -> float:
    return one * other


def _close(one: Sequence[float], other: Sequence[float], tolerance: float) -> bool:
    pairs = list(zip(one, other, strict=True))
    if not all(map(math.isfinite, (*one, *other))):
        return all(a == b for a, b in pairs)
    longest = max(map(abs, (*one, *other)), default=0.0)
    near = tolerance * (longest if len(one) > 1 else _NEAR_ZERO)
    return all(math.isclose(a, b, rel_tol=tolerance, abs_tol=near) for a, b in pairs)


def _numbers(value: Any) -> Iterator[float]:  # noqa: ANN401
    """Yield every number of a value; what holds none yields a value that equals nothing."""
    if isinstance(value, (int, float)):
        yield math.copysign(math.inf, value) if abs(value) >= _LARGEST else float(value)
    elif isinstance(value, _QUATERNIONS):
        yield from (float(value.GetReal()), *map(float, value.GetImaginary()))
    elif isinstance(value, (str, Sdf.AssetPath)):
        yield math.nan
    else:
        try:
            parts = list(value)
        except TypeError:
            parts = [math.nan]
        for part in parts:
            yield from _numbers(part)


def same_asset(was: Sdf.AssetPath, now: Sdf.AssetPath) -> bool:
    """Whether two asset paths lead to the same file, to equal ones, or cannot be told apart.

    Saving a stage in another folder rewrites its relative paths, and an asset that is not here
    cannot be judged.
    """
    one, other = str(was.resolvedPath), str(now.resolvedPath)
    if not one or not other:
        return bool(was.path) == bool(now.path)
    if one == other:
        return True
    first, second = Path(one), Path(other)
    try:
        if not (first.is_file() and second.is_file()):
            return first.name == second.name
        same_size = first.stat().st_size == second.stat().st_size
        return same_size and first.read_bytes() == second.read_bytes()
    except OSError:
        return first.name == second.name


def _same_assets(was: Any, now: Any) -> bool:  # noqa: ANN401
    is_array = isinstance(now, Sdf.AssetPathArray) and len(was) == len(now)
    return is_array and all(map(same_asset, was, now))


def display_value(value: Any) -> str:  # noqa: ANN401
    """Return a value for a message: short numbers, and long arrays by their length."""
    text = display(_short(plain_value(value)))
    if len(text) <= _LONGEST:
        return text
    return f"{text[:_LONGEST]}..." if isinstance(value, str) else f"{len(value)} values"


def _short(value: Value | None) -> Value | None:
    """Cut the noise of single precision."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, tuple):
        return tuple(each for each in map(_short, value) if each is not None)
    return value


def same_place(was: Gf.Matrix4d, now: Gf.Matrix4d, limits: tuple[float, float, float]) -> str:
    """Say how two transforms differ: 'moved', 'turned' or 'scaled'; '' where they do not.

    `limits` are a length in stage units, an angle in degrees and a relative scale.
    """
    length, angle, scale = limits
    if (was.ExtractTranslation() - now.ExtractTranslation()).GetLength() > length:
        return "moved"
    if not same_scale(was, now, scale):
        return "scaled"
    rows = [(was.GetRow3(row), now.GetRow3(row)) for row in range(3)]
    return "turned" if any(_angle(one, other) > angle for one, other in rows) else ""


def same_scale(was: Gf.Matrix4d, now: Gf.Matrix4d, limit: float) -> bool:
    """Whether two transforms scale alike, up to a relative limit; a mirrored one does not."""
    for row in range(3):
        one, other = was.GetRow3(row).GetLength(), now.GetRow3(row).GetLength()
        if not abs(one - other) <= limit * max(one, other):
            return False
    return bool(was.GetDeterminant3() * now.GetDeterminant3() >= 0)


def _angle(one: Gf.Vec3d, other: Gf.Vec3d) -> float:
    """Return the angle between two axes in degrees, 0 where one has no length."""
    if not one.GetLength() or not other.GetLength():
        return 0.0
    across = Gf.Cross(one, other).GetLength()
    return math.degrees(math.atan2(across, Gf.Dot(one, other)))
