"""How a robot stands: what touches level ground, how it leans by that, and what carries which part.

By statics alone: it comes to rest on the points below which nothing reaches and between which its
centre of mass is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from msgspec import Struct

from lab3_usd.model.dry_run import Affine, about
from lab3_usd.model.solids import Solid
from lab3_usd.model.transforms import Vector, length

CONTACT = 1e-4  # metres above the lowest plane up to which a point counts as touching
BALANCE = 1e-3  # metres by which a centre of mass may be beside what carries it
STEEPEST = math.radians(25.0)  # a robot that leans by more lies on its side
_ROUNDS = 80  # how often a posture is worked out again
_STEP = math.radians(0.5)  # by which it tips at a time
_PIVOTS = 200
_NO_AREA = 1e-9


class Stand(Struct, frozen=True):
    """How something stands on level ground.

    `turn` leads from where it starts to how it leans, `height` is how far its origin is above the
    ground then. `loads` are the parts of the weight by the shapes that touch, and `touching` where
    they do, in the leaning frame. `falls` says whether nothing carries its centre of mass.
    """

    turn: Affine
    height: float
    lean: float  # radians
    loads: dict[str, float]
    touching: dict[str, list[Vector]]
    falls: bool = False


def standing(solids: Sequence[Solid], centre: Vector, metre: float = 1.0) -> Stand:
    """Return how shapes that hang together rigidly stand on level ground below them.

    `centre` is their centre of mass, `metre` how many units of theirs are a metre.
    """
    turn = Affine()
    falls = False
    low = 0.0
    points: list[tuple[Vector, str]] = []
    heart = centre
    for _ in range(_ROUNDS):
        moved = [solid.moved(turn) for solid in solids]
        points = [(point, solid.path) for solid in moved for point in solid.lowest()]
        heart = turn.point(centre)
        every = [point for point, _ in points]
        low = min((z for _, _, z in every), default=0.0)
        firm = [point for point in every if point[2] <= low + CONTACT * metre]
        if _outside(_outline([(x, y) for x, y, _ in firm]), heart[0], heart[1]) <= BALANCE * metre:
            break
        # It tips a little at a time: a chassis may hang on its axle before anything else touches.
        ground = _plane_below(every, heart, BALANCE * metre)
        if ground is None:
            turn = Affine(about(_tipping(every, heart), _STEP)).then(turn)
        else:
            a, b, _ = ground
            slope = math.atan(math.hypot(a, b))
            turn = Affine(about(_level((b, -a, 0.0)), -min(slope, _STEP))).then(turn)
        if math.acos(max(-1.0, min(1.0, turn.rows[2][2]))) > STEEPEST:
            falls = True
            break
    else:
        falls = True
    touching: dict[str, list[Vector]] = {}
    for (x, y, z), path in points:
        if z - low <= CONTACT * metre:
            touching.setdefault(path, []).append((x, y, z))
    lean = math.acos(max(-1.0, min(1.0, turn.rows[2][2])))
    loads = {} if falls else _loads(touching, heart)
    return Stand(turn, -low, lean, loads, touching, falls)


def _level(axis: Vector) -> Vector:
    size = length(axis) or 1.0
    return (axis[0] / size, axis[1] / size, axis[2] / size)


def _tipping(points: Sequence[Vector], heart: Vector) -> Vector:
    """Return the axis about which something tips whose centre of mass nothing carries."""
    hull = _outline([(x, y) for x, y, _ in points])
    x, y = _nearest(hull, heart[0], heart[1])
    return _level((y - heart[1], heart[0] - x, 0.0))


_Plane = tuple[float, float, float]  # the height z = a x + b y + c


def _plane_below(points: Sequence[Vector], centre: Vector, near: float) -> _Plane | None:
    """Return the plane below which no point is, as high as it can be at the centre.

    None where the centre is not above the points, except for what is `near`.
    """
    hull = _outline([(x, y) for x, y, _ in points])
    x, y, _ = centre
    if not hull or _outside(hull, x, y) > near:
        return None
    area = abs(sum(_turning(hull[0], a, b) for a, b in pairwise(hull[1:]))) / 2
    if len(hull) < len("abc") or area < _NO_AREA:
        return _line_below(points, hull, x, y)
    x, y = _drawn_in(hull, x, y)
    highest: dict[tuple[float, float], float] = {}
    for u, v, w in points:
        highest[u, v] = min(w, highest.get((u, v), math.inf))
    corners = [(u, v, highest[u, v]) for u, v in hull]
    first = next(
        (corners[0], one, two)
        for one, two in pairwise(corners[1:])
        if _holds((corners[0], one, two), x, y)
    )
    triple: tuple[Vector, Vector, Vector] = first
    for _ in range(_PIVOTS):
        a, b, c = _through(triple)
        drop, lowest = min((w - (a * u + b * v + c), (u, v, w)) for u, v, w in points)
        if drop > -1e-12:  # noqa: PLR2004
            break
        one, two, three = triple
        triples = ((lowest, two, three), (one, lowest, three), (one, two, lowest))
        # Of a point on an edge more than one holds the centre: the one that is not flat.
        triple = max((each for each in triples if _holds(each, x, y)), key=_size, default=triple)
    return _through(triple)


def _line_below(
    points: Sequence[Vector], hull: Sequence[tuple[float, float]], x: float, y: float
) -> _Plane:
    """Return the plane, level across, on which points on a line rest at the centre."""
    (p, q), (u, v) = min(hull), max(hull)
    size = math.hypot(u - p, v - q) or 1.0
    along = ((u - p) / size, (v - q) / size)
    places = [((u - x) * along[0] + (v - y) * along[1], w) for u, v, w in points]
    chords = (
        (r - k * s, k)
        for s, r in places
        for t, w in places
        if s <= 0 <= t
        for k in ((w - r) / (t - s) if t > s else 0.0,)
    )
    height, slope = min(chords, default=(min(w for _, w in places), 0.0))
    a, b = slope * along[0], slope * along[1]
    return (a, b, height - a * x - b * y)


def _through(triple: tuple[Vector, Vector, Vector]) -> _Plane:
    """Return the plane through three points."""
    (x, y, z), (p, q, r), (u, v, w) = triple
    area = (p - x) * (v - y) - (u - x) * (q - y)
    if abs(area) < 1e-18:  # noqa: PLR2004
        return (0.0, 0.0, min(z, r, w))
    a = ((r - z) * (v - y) - (w - z) * (q - y)) / area
    b = ((p - x) * (w - z) - (u - x) * (r - z)) / area
    return (a, b, z - a * x - b * y)


def _size(triple: tuple[Vector, Vector, Vector]) -> float:
    (x, y, _), (p, q, _), (u, v, _) = triple
    return abs((p - x) * (v - y) - (u - x) * (q - y))


def _holds(triple: tuple[Vector, Vector, Vector], x: float, y: float) -> bool:
    """Whether a place is inside a triangle, its edges included."""
    sides = []
    for (a, b, _), (c, d, _) in (
        (triple[0], triple[1]),
        (triple[1], triple[2]),
        (triple[2], triple[0]),
    ):
        sides.append((c - a) * (y - b) - (d - b) * (x - a))
    near = 1e-12
    return all(side >= -near for side in sides) or all(side <= near for side in sides)


def _outline(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of the convex outline of points, counterclockwise."""
    every = sorted(set(points))
    if len(every) < len("abc"):
        return every
    halves = []
    for row in (every, every[::-1]):
        half: list[tuple[float, float]] = []
        for p in row:
            while len(half) > 1 and _turning(half[-2], half[-1], p) <= 0:
                half.pop()
            half.append(p)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _turning(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _outside(hull: Sequence[tuple[float, float]], x: float, y: float) -> float:
    """Return how far a place is beside an outline, 0 inside."""
    sides = zip(hull, [*hull[1:], hull[0]], strict=True)
    if len(hull) >= len("abc") and all(_turning(a, b, (x, y)) >= 0 for a, b in sides):
        return 0.0
    return math.dist(_nearest(hull, x, y), (x, y))


def _nearest(hull: Sequence[tuple[float, float]], x: float, y: float) -> tuple[float, float]:
    """Return the place on an outline that is the nearest to another one."""
    sides = zip(hull, [*hull[1:], hull[0]], strict=True)
    return min((_on(a, b, x, y) for a, b in sides), key=lambda at: math.dist(at, (x, y)))


def _on(a: tuple[float, float], b: tuple[float, float], x: float, y: float) -> tuple[float, float]:
    """Return the place between two that is the nearest to another one."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    k = ((x - a[0]) * dx + (y - a[1]) * dy) / square if square else 0.0
    k = max(0.0, min(1.0, k))
    return a[0] + k * dx, a[1] + k * dy


def _drawn_in(hull: Sequence[tuple[float, float]], x: float, y: float) -> tuple[float, float]:
    """Return a place inside an outline: one that is beside it, drawn to its middle by a little."""
    u, v = (sum(column) / len(hull) for column in zip(*hull, strict=True))
    part = 1e-9
    if _outside(hull, x, y):
        x, y = _nearest(hull, x, y)
        part = 1e-6
    return x + part * (u - x), y + part * (v - y)


def _loads(touching: dict[str, list[Vector]], heart: Vector) -> dict[str, float]:
    """Return the part of the weight that each shape carries: as even as balance lets it be."""
    points = [(path, x, y) for path, at in touching.items() for x, y, _ in at]
    kept = points
    parts: list[float] = []
    while kept:
        parts = _shares(kept, heart)
        lowest = min(parts)
        if lowest >= -1e-9:  # noqa: PLR2004
            break
        kept = [point for point, part in zip(kept, parts, strict=True) if part > lowest]
    loads = dict.fromkeys(touching, 0.0)
    for (path, _, _), part in zip(kept, parts, strict=False):
        loads[path] += max(0.0, part)
    return loads


def _shares(points: Sequence[tuple[str, float, float]], heart: Vector) -> list[float]:
    """Return the least shares by which points balance a weight, some of which may pull."""
    n = len(points)
    rows = [(1.0, x - heart[0], y - heart[1]) for _, x, y in points]
    ridge = 1e-9 * max(1e-12, sum(r[1] ** 2 + r[2] ** 2 for r in rows) / n)
    matrix = tuple(
        tuple(sum(r[i] * r[j] for r in rows) + (ridge if i == j and i else 0.0) for j in range(3))
        for i in range(3)
    )
    u, v, w = Affine(matrix).inverse().turn((1.0, 0.0, 0.0))  # type: ignore[arg-type]
    return [u + v * x + w * y for _, x, y in rows]
