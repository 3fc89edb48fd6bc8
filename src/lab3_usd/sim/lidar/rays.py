"""Rays of a turning beam against segments."""

from __future__ import annotations

import math
from functools import cache, lru_cache

from msgspec import Struct

from lab3_usd.model.dry_run.behaviour import Segment

_MOST_KEPT = 128  # sweeps: a lidar that stands, or comes there again, sees the same
NOTHING = -1.0  # what Isaac Sim writes for a ray without return
EDGE_ON = 1e-12


class Beam(Struct, frozen=True):
    """A scan: directions from `start` on, `step` apart, and the ranges within which it sees."""

    start: float
    step: float
    count: int
    near: float
    far: float


@cache
def directions(start: float, step: float, count: int) -> tuple[list[float], list[float]]:
    """Return cosines and sines of the directions of a beam."""
    angles = [start + each * step for each in range(count)]
    return [math.cos(each) for each in angles], [math.sin(each) for each in angles]


@lru_cache(maxsize=_MOST_KEPT)
def sweep(beam: Beam, segments: tuple[Segment, ...]) -> tuple[float, ...]:
    """Return the distance along each direction to the nearest segment in range."""
    ranges = [math.inf] * beam.count
    near, count = beam.near, beam.count
    around = round(2 * math.pi / beam.step)
    cosines, sines = directions(beam.start, beam.step, beam.count)
    for segment in segments:
        rays, area, dx, dy = _touched(beam, segment)
        for k in rays:
            ray = k % around
            if ray < count:
                across = dy * cosines[ray] - dx * sines[ray]
                if across > 0 and near <= area / across < ranges[ray]:
                    ranges[ray] = area / across
    return tuple(each if each <= beam.far else NOTHING for each in ranges)


def _touched(beam: Beam, segment: Segment) -> tuple[range, float, float, float]:
    """Return the numbers of the rays that meet a segment, and the segment seen from its right."""
    ax, ay, bx, by = segment
    area = ax * by - ay * bx
    if abs(area) < EDGE_ON:
        return range(0), 0.0, 0.0, 0.0
    if area < 0:
        ax, ay, bx, by, area = bx, by, ax, ay, -area
    one, other = math.atan2(ay, ax), math.atan2(by, bx)
    other += 2 * math.pi if other < one else 0.0
    first = math.ceil((one - beam.start) / beam.step - 1e-9)
    last = math.floor((other - beam.start) / beam.step + 1e-9)
    return range(first, last + 1), area, bx - ax, by - ay
