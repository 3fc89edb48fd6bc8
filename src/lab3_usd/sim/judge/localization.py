"""Does the scan fit the walls of the map, projected through TF and localization?"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from heapq import nlargest
from typing import NamedTuple

from msgspec.structs import replace

from lab3_usd.model.dry_run import Affine
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.occupancy import Cell, MapFit, OccupancyMap
from lab3_usd.physics.surfaces import distance_to_segments
from lab3_usd.sim.execution.recording import Scan
from lab3_usd.sim.judge.expectations import RunFault, Trial, in_root
from lab3_usd.sim.lidar import directions

_DRAWN = 1500  # points of a scan
_CORNERS = 800  # cells that points lie in, by which a map is shifted
_MOST_WALLS = 8000  # cells: a map with more of them is not shifted
_TRIED = 60  # shifts that are compared
_MANY = 4_000_000  # shifts: as many as a list may count
_SHORT = 4  # cells: what is before a point so near is not looked at
_BEFORE = 0.5  # the part of rays that come through walls, from which on a map is inverted
_OF_THIS_ROOM = 0.9  # the part of a map's walls that stand in the room it is of

Located = Sequence[tuple[float, Affine]]  # where the map has the root of TF, from when on


class Ray(NamedTuple):
    """A ray that returned: its end and its middle in the root of TF, and its length."""

    end: tuple[float, float, float]
    middle: tuple[float, float, float]
    length: float


_End = tuple[float, float, bool]
Rays = Sequence[tuple[float, Sequence[Ray]]]  # of each scan, with when it came


def fit(trial: Trial) -> MapFit | None:
    """Return how well the scans of a run fit its map, None without a map or a scan.

    Where the map of a dry run has the odometry frame is unknown. Of the possible places, the one
    at which the map shows this room counts, else the one with the best fit.
    """
    rays = list(_rays(trial)) if trial.map is not None else []
    if trial.map is None or not rays:
        return None
    near = trial.map.walls_within(trial.tolerance.cells)
    fits = [
        replace(_fit(rays, trial.map, near, located), unmet=_unmet(trial, trial.map, located))
        for located in trial.located
    ]
    lying = [map_fit for map_fit in fits if _lies_at_walls(map_fit, trial)]
    if lying or not fits:
        best = max(lying, key=lambda map_fit: map_fit.near - map_fit.through, default=None)
        is_met = best is None or _is_met(best, trial)
        return best if best is None or is_met else replace(best, sure=trial.map.given)
    pairs = list(zip(fits, trial.located, strict=True))
    inside = [pair for pair in pairs if _is_of_the_room(trial, trial.map, pair[1])]
    sure = trial.map.given or bool(inside)
    moved = [
        replace(_shifted(map_fit, rays, near, located), sure=sure)
        for map_fit, located in inside or pairs
    ]
    return max(
        moved, key=lambda map_fit: (round(map_fit.shifted, 1), -math.hypot(*map_fit.shift or ()))
    )


def _lies_at_walls(map_fit: MapFit, trial: Trial) -> bool:
    met = trial.tolerance.met
    return map_fit.near >= met and map_fit.through <= 1.0 - met


def _is_met(map_fit: MapFit, trial: Trial) -> bool:
    return _lies_at_walls(map_fit, trial) and map_fit.unmet <= 1.0 - trial.tolerance.met


def _unmet(trial: Trial, grid: OccupancyMap, located: Located) -> float:
    """Return the part of a dry run's last scan that misses walls which the map has in range."""
    if trial.walls is None or not located:  # rays of a real lidar are lost at glass, and black
        return 0.0
    messages = trial.recording.topic(trial.wanted.scan, 0)
    scans = (message for message in reversed(messages) if isinstance(message.data, Scan))
    message = next((message for message in scans if message.data.whole), None)
    place = in_root(trial, message.frame, message) if message is not None else None
    if message is None or place is None:
        return 0.0
    scan, at, cell = message.data, located[-1][1].then(place), grid.cells()
    margin = (trial.tolerance.cells + 1) * grid.resolution
    first, last = scan.range_min + margin, scan.range_max - margin
    last = min(last, math.hypot(grid.width, grid.height) * grid.resolution)
    steps = [
        first + step * grid.resolution for step in range(int((last - first) / grid.resolution))
    ]
    beam = directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    missed = 0
    for length, cosine, sine in zip(scan.ranges, *beam, strict=True):
        if length < 0:
            along = (at.point((step * cosine, step * sine, 0.0)) for step in steps)
            missed += any(cell(x, y) in grid.walls for x, y, _ in along)
    return missed / max(1, len(scan.ranges))


def _rays(trial: Trial) -> Iterator[tuple[float, Sequence[Ray]]]:
    """Yield the rays of each scan that returned, with when it came."""
    for message in trial.recording.topic(trial.wanted.scan, 0):
        scan = message.data
        if not isinstance(scan, Scan) or not scan.whole:
            continue
        place = in_root(trial, message.frame, message)
        if place is None:
            continue
        rays = [*_followed(scan, place)]
        if rays:
            yield message.at, rays


def _followed(scan: Scan, place: Affine) -> Iterator[Ray]:
    """Yield the rays of a scan that returned."""
    beam = directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    for length, cosine, sine in zip(scan.ranges, *beam, strict=True):
        if length > 0:
            x, y = length * cosine, length * sine
            yield Ray(place.point((x, y, 0.0)), place.point((x / 2, y / 2, 0.0)), length)


def _in_map(scans: Rays, located: Located) -> Iterator[tuple[Sequence[Ray], Affine]]:
    """Yield the rays from when the map has the root of TF, with where it has it then."""
    ahead = -1
    for at, rays in scans:
        while ahead + 1 < len(located) and located[ahead + 1][0] <= at:
            ahead += 1
        if ahead >= 0:
            yield rays, located[ahead][1]


def _fit(scans: Rays, grid: OccupancyMap, near: frozenset[Cell], located: Located) -> MapFit:
    ends: list[_End] = []
    through, cell = 0, grid.cells()
    for rays, place in _in_map(scans, located):
        for ray in rays:
            x, y, _ = place.point(ray.end)
            ends.append((x, y, cell(x, y) in near))
            if ray.length > _SHORT * grid.resolution:
                x, y, _ = place.point(ray.middle)
                through += cell(x, y) in grid.walls
    met = sum(is_met for _, _, is_met in ends)
    count = len(ends)
    drawn = tuple(ends[:: max(1, count // _DRAWN)])
    return MapFit(grid, count, met / max(1, count), through / max(1, count), drawn)


def _shifted(best: MapFit, scans: Rays, near: frozenset[Cell], located: Located) -> MapFit:
    """Return a fit with the shift of the map by which most points lie at walls.

    Each pair of a point and a wall is a vote for the shift that brings the two together.
    """
    grid = best.map
    if not 0 < len(grid.walls) <= _MOST_WALLS:
        return best
    points = Counter(
        grid.cell(x, y)
        for rays, place in _in_map(scans, located)
        for x, y, _ in (place.point(ray.end) for ray in rays)
    )
    corners = points.most_common(_CORNERS)
    # A shift is counted as one number, as there are millions of them.
    rows = [row for _, row in (*grid.walls, *points)]
    half = max(rows) - min(rows) + 1
    walls = [column * 2 * half + row for column, row in grid.walls]
    ends = [(right * 2 * half + up, count) for (right, up), count in corners]
    least = min(ends)[0] - max(walls)
    size = max(ends)[0] - min(walls) - least + 1
    # A list counts in a fifth of the time, where there is room for every shift.
    votes: list[int] | defaultdict[int, int] = [0] * size if size < _MANY else defaultdict(int)
    for end, count in ends:
        first = end - least
        for wall in walls:
            votes[first - wall] += count
    tried = []
    for number in _most_voted(votes, (end - least - wall for end, _ in ends for wall in walls)):
        right, row = divmod(number + least + half, 2 * half)
        up = row - half
        met = sum(count for (u, v), count in points.items() if (u - right, v - up) in near)
        tried.append((met, votes[number], (right, up)))
    met, _, shift = max(tried)
    (x, y), (u, v) = grid.point(0, 0), grid.point(*shift)
    return replace(best, shift=(u - x, v - y), shifted=met / max(1, best.count))


def _most_voted(votes: list[int] | dict[int, int], cast: Iterable[int]) -> Iterable[int]:
    """Return the shifts with the most votes; of those with equally many, those cast first."""
    if isinstance(votes, dict):  # which is in that order
        return nlargest(_TRIED, votes, votes.__getitem__)
    least = nlargest(_TRIED, votes)[-1]
    shifts = {number for number, count in enumerate(votes) if count > least}
    for number in cast:
        if len(shifts) >= _TRIED:
            break
        if votes[number] == least:
            shifts.add(number)
    return shifts


def _is_of_the_room(trial: Trial, grid: OccupancyMap, located: Located) -> bool:
    """Whether the walls of a map stand in the room of a dry run."""
    if not trial.room or not located:
        return False
    back = trial.start.then(located[-1][1].inverse())
    reach = (trial.tolerance.cells + 0.5) * grid.resolution
    room = [
        (wall, min(a, c) - reach, max(a, c) + reach, min(b, d) - reach, max(b, d) + reach)
        for wall in trial.room
        for a, b, c, d in [wall]
    ]
    standing = len(grid.walls)
    for column, row in grid.walls:
        x, y, _ = back.point((*grid.point(column + 0.5, row + 0.5), 0.0))
        standing -= not any(
            left <= x <= right and low <= y <= high and distance_to_segments((wall,), x, y) <= reach
            for wall, left, right, low, high in room
        )
        if standing < _OF_THIS_ROOM * len(grid.walls):
            return False
    return True


def on_map(trial: Trial) -> Iterator[RunFault]:
    """The points of the scan lie at the walls of the map, and nothing is before them."""
    map_fit = trial.fit
    if trial.map_fault:
        yield RunFault(trial.map_fault, "scan-off-map", sure=False)
    if map_fit is None or _is_met(map_fit, trial):
        return
    kind: FaultKind = "scan-off-map"
    text = map_fit.text
    if _lies_at_walls(map_fit, trial):
        text += f", but {map_fit.unmet:.0%} of the rays return nothing where it has a wall"
    elif map_fit.through > _BEFORE:
        kind = "map-inverted"
        text += f", but {map_fit.through:.0%} have a wall before them: the map may be inverted"
    elif map_fit.shift is not None and map_fit.shifted >= trial.tolerance.met:
        x, y = map_fit.shift
        # Localization makes up for an origin that is wrong: only a dry run shows it.
        kind = "map-shifted" if trial.room else kind
        text += f"; moved by ({x:+.2f}, {y:+.2f}) m it would be {map_fit.shifted:.0%}"
    elif map_fit.shift is not None:
        text += f"; no shift brings more than {map_fit.shifted:.0%} there"
    if not map_fit.sure:
        text += ". The room may be another than that of the lab's map: name its map with --maps"
    yield RunFault(text, kind, sure=map_fit.sure)
