"""Simulates the rays of a lidar on the visible shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.model.dry_run import Affine, Scene, Segment
from lab3_usd.physics.machines import Machines
from lab3_usd.physics.surfaces import (
    Surface,
    Triangle,
    cut,
    joined_segments,
    placed_surface,
    sections,
    straddling,
)

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


@lru_cache(maxsize=16)
def directions(start: float, step: float, count: int) -> tuple[list[float], list[float]]:
    """Return cosines and sines of the directions of a beam."""
    angles = [start + number * step for number in range(count)]
    return [math.cos(angle) for angle in angles], [math.sin(angle) for angle in angles]


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
    return tuple(distance if distance <= beam.far else NOTHING for distance in ranges)


def measured(beam: Beam, segments: tuple[Segment, ...], unit: float) -> tuple[float, ...]:
    """Return what a beam in metres measures of segments in units of the stage, in metres."""
    if unit == 1.0:
        return sweep(beam, segments)
    ranges = sweep(replace(beam, near=beam.near / unit, far=beam.far / unit), segments)
    return tuple(distance if distance < 0 else distance * unit for distance in ranges)


def _touched(beam: Beam, segment: Segment) -> tuple[range, float, float, float]:
    """Return the numbers of the rays that meet a segment, and the segment seen from its right."""
    ax, ay, bx, by = segment
    area = ax * by - ay * bx
    if abs(area) < EDGE_ON:
        return range(0), 0.0, 0.0, 0.0
    if area < 0:
        ax, ay, bx, by, area = bx, by, ax, ay, -area
    right, left = math.atan2(ay, ax), math.atan2(by, bx)
    left += 2 * math.pi if left < right else 0.0
    first = math.ceil((right - beam.start) / beam.step - 1e-9)
    last = math.floor((left - beam.start) / beam.step + 1e-9)
    return range(first, last + 1), area, bx - ax, by - ay


LEVEL = 1e-6  # radians by which a beam may lean and its cut still be kept


class Surroundings(Struct):
    """The visible shapes of a stage; what moves with a body is kept apart."""

    still: list[Surface]
    moving: dict[str, list[Surface]]  # by body, in its frame
    cuts: dict[float, list[Segment]] = field(default_factory=dict)
    own: dict[str, list[Segment]] = field(default_factory=dict)  # by sensor

    @classmethod
    def of(cls, scene: Scene, machines: Machines) -> Surroundings:
        """Sort the visible shapes of a scene."""
        surroundings = cls([], {})
        for prim in scene.prims.values():
            if prim.seen and prim.type != "Camera":
                body = machines.body_of(prim.path)
                if body:
                    back = machines.bodies.prims[body].world.rigid().inverse()
                    surface = placed_surface(prim, back.then(prim.world))
                    surroundings.moving.setdefault(body, []).append(surface)
                else:
                    surroundings.still.append(placed_surface(prim, prim.world))
        return surroundings

    def around(self, at: Affine) -> list[Segment]:
        """Return what the plane through `at` cuts out of what stands still, in that frame."""
        back = at.inverse()
        (_, _, lean), (_, _, tilt), (_, _, up) = at.rows
        if abs(lean) + abs(tilt) > LEVEL or up < 0:
            return sections(_straddling(self.still, back), 0.0)
        level = self.level(at.origin[2])
        (c, s, _), (d, e, _), _ = back.rows
        x, y, _ = back.origin
        return [
            (c * p + s * q + x, d * p + e * q + y, c * u + s * v + x, d * u + e * v + y)
            for p, q, u, v in level
        ]

    def level(self, height: float) -> list[Segment]:
        """Return what a level plane cuts out of what stands still."""
        height = round(height, 6)
        if height not in self.cuts:
            self.cuts[height] = joined_segments(cut(self.still, height))
        return self.cuts[height]

    def seen(self, sensor: str, machines: Machines) -> Callable[[], tuple[Segment, ...]]:
        """Return a function that yields all that is around a sensor at the time of the call."""
        spot, postures = machines.spot(sensor), machines.postures()
        posture = spot.posture()
        carried = self.carried(sensor, machines)

        def segments() -> tuple[Segment, ...]:
            at = spot.place(posture)
            back = at.inverse()
            shapes = [
                shape
                for body, surfaces in self.moving.items()
                if (other := machines.spot(body)).machine is not spot.machine
                for shape in _straddling(surfaces, back.then(other.place(postures[other.base])))
            ]
            beside = joined_segments(sections(shapes, 0.0)) if shapes else []
            return (*self.around(at), *carried, *beside)

        return segments

    def carried(self, sensor: str, machines: Machines) -> list[Segment]:
        """Return what the plane of a sensor cuts out of the machine that carries it."""
        if sensor not in self.own:
            spot = machines.spot(sensor)
            machine, back = spot.machine, spot.back(spot.posture())
            surface: list[Triangle] = []
            for body in machine.rest if machine is not None else ():
                place = back.then(machines.place(body))
                surface += _straddling(self.moving.get(body, ()), place)
            self.own[sensor] = joined_segments(sections(surface, 0.0))
        return self.own[sensor]


def _straddling(surfaces: Iterable[Surface], at: Affine) -> Iterator[Triangle]:
    """Yield the triangles of surfaces that stand at `at`, where z = 0 cuts them."""
    for surface in surfaces:
        yield from straddling(surface, at)
