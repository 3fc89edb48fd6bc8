"""The scene that a dry run plays, and its results, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, Literal, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.fault import FaultKind
from lab3_usd.model.occupancy import MapFit
from lab3_usd.model.physics import BODIES, GRAVITY_DIRECTION, SCENE, vector
from lab3_usd.model.transforms import Vector, length

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Rows = tuple[Vector, Vector, Vector]
FOLLOWS = 0.05  # the part of a command by which a robot without mass may miss it
_HALF_TURN = 1e-3  # w of a quaternion, below which another part is larger
_UPRIGHT: Rows = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # Y up to Z up
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
        """Return the composition with `inner`, a pose in this frame."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        (p, q, r), (s, t, u), (v, w, x) = inner.rows
        rows = (
            (a * p + b * s + c * v, a * q + b * t + c * w, a * r + b * u + c * x),
            (d * p + e * s + f * v, d * q + e * t + f * w, d * r + e * u + f * x),
            (g * p + h * s + i * v, g * q + h * t + i * w, g * r + h * u + i * x),
        )
        y, z, j = inner.origin
        k, m, n = self.origin
        origin = (a * y + b * z + c * j + k, d * y + e * z + f * j + m, g * y + h * z + i * j + n)
        return tuple.__new__(Affine, (rows, origin))  # in half the time

    def inverse(self) -> Affine:
        """Return the inverse; zeros for a singular matrix."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        u, v, w = e * i - f * h, f * g - d * i, d * h - e * g  # the cofactors of the first row
        volume = a * u + b * v + c * w
        k = 1.0 / volume if volume else 0.0
        rows = (
            (u * k, (c * h - b * i) * k, (b * f - c * e) * k),
            (v * k, (a * i - c * g) * k, (c * d - a * f) * k),
            (w * k, (b * g - a * h) * k, (a * e - b * d) * k),
        )
        x, y, z = turned(rows, self.origin)
        return tuple.__new__(Affine, (rows, (-x, -y, -z)))

    def rigid(self) -> Affine:
        """Return the same place without scale."""
        columns = [column(self.rows, axis) for axis in range(3)]
        lengths = [length(vector) or 1.0 for vector in columns]
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
    (a, b, c), (d, e, f), (g, h, i) = rows
    x, y, z = direction
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


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
    """Return the yaw of a pose: its angle about Z from +X."""
    return math.atan2(place.rows[1][0], place.rows[0][0])


class Input(Struct, frozen=True):
    """An input of a node as it is saved: the type it is declared with, its value, its wires."""

    type: str
    value: Any = None
    literal: Any = None  # what an extended port holds beside its value
    sources: tuple[str, ...] = ()


class SceneNode(Struct, frozen=True):
    """A node prim."""

    path: str
    type: str
    version: int
    inputs: dict[str, Input]
    targets: dict[str, tuple[str, ...]]
    namespace: str = ""


class SceneGraph(Struct, frozen=True):
    """A graph prim and its nodes, in the order of the stage; `inner` are those of compounds."""

    path: str
    evaluator: str
    pipeline: str
    mode: str
    nodes: tuple[SceneNode, ...]
    variables: dict[str, Any] = {}
    instanced: bool = False  # it is part of an instance
    inner: tuple[str, ...] = ()


RENDER_PRODUCT = "RenderProduct"


LARGEST = 1e9


def bounded(number: float) -> float:
    """Return a usable number: NaN becomes 0, and large magnitudes are clamped."""
    return max(-LARGEST, min(LARGEST, number)) if number == number else 0.0  # noqa: PLR0124 - NaN


class ScenePrim(Struct, frozen=True):
    """A prim that is not a node; `world` is its authored pose.

    Among `values` the arrays of a mesh are buffers; arrays of other geometry are left out.
    """

    path: str
    type: str
    apis: frozenset[str]
    world: Affine
    values: dict[str, Any]
    targets: dict[str, tuple[str, ...]]
    seen: bool
    loose: bool = False  # `!resetXformStack!`: it does not go with what is above it

    @property
    def ends(self) -> tuple[str, str]:
        """The prims that a joint ties, '' for the world."""
        first, second = (next(iter(self.targets.get(name, ())), "") for name in BODIES)
        return first, second


class Scene(Struct, frozen=True, dict=True):
    """A stage: its units, its graphs, and its prims by path in the order of the stage.

    `missing` are the assets that cannot be found, by the prim that refers to them.
    """

    meters_per_unit: float
    up: str
    graphs: tuple[SceneGraph, ...]
    prims: dict[str, ScenePrim]
    missing: dict[str, str]

    def upright(self) -> Scene:
        """Return it turned so that Z is up: where prims are, and which way gravity pulls."""
        if self.up != "Y":
            return self
        turn = Affine(_UPRIGHT)
        prims = {
            path: replace(prim, world=turn.then(prim.world)) for path, prim in self.prims.items()
        }
        for path, prim in prims.items():
            if GRAVITY_DIRECTION in prim.values:
                pull = turn.turn(vector(prim.values[GRAVITY_DIRECTION]))
                prims[path] = replace(prim, values={**prim.values, GRAVITY_DIRECTION: pull})
        return replace(self, up="Z", prims=prims)

    def below(self, path: str) -> Iterator[ScenePrim]:
        """Yield a prim and all below it: what follows it in the stage."""
        inside, paths = f"{path}/", self._paths
        first = self._places.get(path)
        if first is not None:
            yield self.prims[path]
            first += 1
        else:  # a node, or no prim at all
            first = next(
                (k for k, below in enumerate(paths) if below.startswith(inside)), len(paths)
            )
        for place in range(first, len(paths)):
            if not paths[place].startswith(inside):
                break
            yield self.prims[paths[place]]

    @cached_property
    def _paths(self) -> list[str]:
        return list(self.prims)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {path: place for place, path in enumerate(self._paths)}

    @cached_property
    def physics(self) -> Mapping[str, Any]:
        """The values of the first physics scene; none where there is none."""
        return next((prim.values for prim in self.prims.values() if prim.type == SCENE), {})

    def above(self, path: str) -> Iterator[ScenePrim]:
        """Yield a prim and all above it, nearest first."""
        while path:
            if path in self.prims:
                yield self.prims[path]
            path = path.rpartition("/")[0]


Verdict = Literal["ok", "bad", "not judged"]


class Topic(Struct, frozen=True):
    """A topic: its rate in messages a second, and the frame that its messages are in.

    A recording also has the rate of arrival, and the QoS that each publisher offered, a dry run
    the domain.
    """

    name: str
    type: str
    hz: float
    frame: str
    arrival_hz: float | None = None
    qos: tuple[str, ...] = ()
    domain: int | None = None


class Frame(Struct, frozen=True):
    """A transform between two frames."""

    parent: str
    child: str
    static: bool


class Check(Struct, frozen=True):
    """A verdict: what was looked at, what is wrong, the prim at fault, and the kind of the fault.

    The message of a check that is not judged says what did not happen. `cause` is what the prim at
    fault does or does not do, where that is known; `of` names one of several robots or topics.
    A failed check also has what it `rests_on`: the prims that could be why, nearest first.
    """

    name: str
    verdict: Verdict
    message: str = ""
    prim: str = ""
    kind: FaultKind | None = None
    cause: str = ""
    of: str = ""
    rests_on: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """What is wrong, with its cause."""
        return f"{self.message}; {self.cause}" if self.cause else self.message


class Unknown(Struct, frozen=True):
    """Something that a dry run does not simulate, or assumes."""

    prim: str
    reason: str


class Difference(Struct, frozen=True):
    """A difference of one topic or frame between a recording and the dry run of its stage."""

    name: str
    message: str


class Leg(Struct, frozen=True):
    """A part of the drive: what was commanded, and what the robot drove (metres, degrees).

    `fault` says what is wrong with it, where a check failed by it.
    """

    name: str
    seconds: float
    commanded: tuple[float, float]
    driven: tuple[float, float]
    fault: str = ""


class Driven(Struct, frozen=True):
    """A robot that was driven: the prim that stands for it, and where its commands came."""

    prim: str
    topic: str
    domain: int


class Behaviour(Struct, frozen=True):
    """The results of a dry run; without a checkpoint, no requirements of a lab apply.

    `path` are (seconds, x, y, heading) in metres and radians; `legs` the drive of the first
    session, `sizes` why it goes another way than commanded, `remarks` what else is known of the
    robot. `missing` says why it is not judged, and `is_early` that the lab has nothing to run yet.
    """

    stage: str
    checkpoint: str  # '' for a stage of none
    seconds: float
    verdict: Literal["ok", "bad", "not judged", "unreadable"]
    topics: tuple[Topic, ...] = ()
    frames: tuple[Frame, ...] = ()
    checks: tuple[Check, ...] = ()
    path: tuple[tuple[float, float, float, float], ...] = ()
    not_simulated: tuple[Unknown, ...] = ()
    legs: tuple[Leg, ...] = ()
    remarks: tuple[str, ...] = ()
    recording: str = ""  # what was judged, where it is no dry run
    differences: tuple[Difference, ...] | None = None  # from the dry run of its stage, if played
    missing: str = ""
    is_early: bool = False
    fit: MapFit | None = None  # of its scans on the map of localization
    robots: tuple[Driven, ...] = ()
    sizes: tuple[str, ...] = ()


Place = tuple[float, float, float]  # x, y, heading
Segment = tuple[float, float, float, float]  # from x, y to x, y


class Moment(Struct, frozen=True):
    """A moment of the first session: the robot, its odometry, and the points of the lidar.

    `odometry` is from the start of the robot on, `points` are in the world; metres.
    """

    seconds: float
    leg: str
    robot: Place
    odometry: Place | None = None
    points: tuple[tuple[float, float], ...] = ()


class Speeds(Struct, frozen=True):
    """How fast the robot was commanded to go and went, metres and radians a second (turning left).

    `wheels` are the speeds of its wheels, radians a second; None was commanded before the first
    command.
    """

    seconds: float
    driven: tuple[float, float]
    commanded: tuple[float, float] | None = None
    wheels: tuple[float, ...] = ()


class HeardFrame(Struct, frozen=True):
    """A transform, who sends it (a node, '' where that is unknown), and who hears it."""

    parent: str
    child: str
    static: bool
    publisher: str = ""
    topic: str = ""
    domain: int = 0


class Replay(Struct, frozen=True):
    """The data of the drawings of a run: the room, the robot, how often nodes computed, the map.

    `wheels` are the names of the joints whose speeds are in `speeds`.
    """

    walls: tuple[Segment, ...]
    radius: float
    moments: tuple[Moment, ...]
    computed: dict[str, int]
    fit: MapFit | None = None
    speeds: tuple[Speeds, ...] = ()
    wheels: tuple[str, ...] = ()
    frames: tuple[HeardFrame, ...] = ()
