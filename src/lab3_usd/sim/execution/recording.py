"""The recording of a run: its messages and the robot's path."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, TypeVar, overload

from msgspec import Struct, field

from lab3_usd.model.dry_run import Affine, Quaternion
from lab3_usd.model.joint_drives import JointCommand
from lab3_usd.model.qos import Qos
from lab3_usd.model.transforms import Vector

T = TypeVar("T")


class Later(Sequence[T]):
    """An array of so many elements, which are not computed before one looks at them."""

    __slots__ = ("_count", "_known", "_make")

    def __init__(self, count: int, make: Callable[[], tuple[T, ...]]) -> None:
        self._count = count
        self._make = make
        self._known: tuple[T, ...] | None = None

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> T: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[T, ...]: ...
    def __getitem__(self, at: int | slice) -> T | tuple[T, ...]:
        return self.all()[at]

    def __iter__(self) -> Iterator[T]:
        return iter(self.all())

    def all(self) -> tuple[T, ...]:
        """Return the elements."""
        if self._known is None:
            self._known = self._make()
            del self._make  # and what it needs
        return self._known


class Transform(Struct, frozen=True):
    """One transform of a TF message."""

    parent: str
    child: str
    translation: Vector
    rotation: Quaternion


class Transforms(Struct, frozen=True):
    """The transforms of a TF message: which frames, and their translations and rotations."""

    frames: tuple[tuple[str, str], ...]
    poses: Sequence[tuple[Vector, Quaternion]]

    def each(self) -> tuple[Transform, ...]:
        """Return the transforms."""
        pairs = zip(self.frames, self.poses, strict=True)
        return tuple(Transform(*frames, *pose) for frames, pose in pairs)


class Odometry(Struct, frozen=True):
    """What an odometry message says beside its header."""

    child: str
    position: Vector
    orientation: Quaternion
    linear: Vector
    angular: Vector


class JointStates(Struct, frozen=True):
    """What a message of joint states says beside its header; as a command it may leave some out."""

    names: tuple[str, ...]
    positions: tuple[float, ...] = ()
    velocities: tuple[float, ...] = ()
    efforts: tuple[float, ...] = ()


class Inertia(Struct, frozen=True):
    """What a message of an inertial sensor says; None is not measured."""

    orientation: Quaternion | None
    angular: Vector | None
    linear: Vector | None


class Fields(Struct, frozen=True):
    """The fields of a message of any type, by the names of the inputs that they come from."""

    values: dict[str, Any]


class Steering(Struct, frozen=True):
    """What a command to a car says: metres a second, and radians to which its front is steered."""

    speed: float
    angle: float


class Scan(Struct, frozen=True):
    """What a scan says beside its header; a ray without return is -1.

    `scan_time` is how long the lidar takes for a turn, 0 where that is unknown.
    """

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: Sequence[float]
    place: Affine | None = None  # of the lidar, where it is known; metres
    scan_time: float = 0.0
    whole: bool = True  # whether `ranges` are those of all directions
    sensor: str = ""  # the prim, where it is known


class View(Struct, frozen=True):
    """What an image or camera info says beside its header, without pixels."""

    width: int
    height: int
    matrix: tuple[float, ...] = ()
    place: Affine | None = None  # of the optical frame, where it is known; metres
    sensor: str = ""  # the prim, where it is known


class Points(Struct, frozen=True):
    """What is known of a point cloud of a lidar, whose points are not played: its lidar."""

    place: Affine
    sensor: str


class Message(Struct):
    """A message: when it was sent, in which session between Play and Stop, and its header."""

    type: str
    stamp: float
    frame: str = ""
    data: Any = None
    away: int | None = None  # the domain it came in, where that is not the lab's
    topic: str = ""
    node: str = ""
    session: int = 0
    at: float = 0.0
    static: bool = False
    profile: Qos = Qos()

    @property
    def transforms(self) -> tuple[Transform, ...]:
        """The transforms of a TF message, as tf2 takes them."""
        data = self.data.each() if isinstance(self.data, Transforms) else self.data
        return tuple(map(_taken, data)) if isinstance(data, tuple) else ()

    @property
    def frames(self) -> tuple[tuple[str, str], ...]:
        """The frames of its transforms, parent and child, as tf2 takes them."""
        data = self.data
        if isinstance(data, Transforms):
            return _names_taken(data.frames)
        if not isinstance(data, tuple):
            return ()
        return tuple((each.parent, each.child) for each in self.transforms)


def _taken(transform: Transform) -> Transform:
    """Take a slash off before the frames (geometry2, humble: tf2/src/buffer_core.cpp)."""
    if not transform.parent.startswith("/") and not transform.child.startswith("/"):
        return transform
    ((parent, child),) = _names_taken(((transform.parent, transform.child),))
    return Transform(parent, child, transform.translation, transform.rotation)


@lru_cache(maxsize=1024)
def _names_taken(frames: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    return tuple((p.removeprefix("/"), c.removeprefix("/")) for p, c in frames)


def kept_transforms(messages: Iterable[Message]) -> tuple[tuple[Transform, str], ...]:
    """Return the transforms that hold throughout, with the nodes that send them."""
    static = (message for message in messages if message.static)
    return tuple((frame, message.node) for message in static for frame in message.transforms)


class Pose(Struct, frozen=True):
    """Where the robot was: session, seconds since Play, and the way it had gone by then."""

    session: int
    at: float
    leg: str
    x: float
    y: float
    heading: float
    z: float = 0.0
    blocked: str = ""  # what stops it, as a wall
    wheels: tuple[float, ...] = ()  # how fast they turn, radians a second


class Held(Struct, frozen=True):
    """Where joints and links were when a leg of joint commands, or of steering, ended.

    Links are in the world; `commanded` are positions, velocities or efforts, as `kind` says.
    """

    session: int
    at: float
    commanded: dict[str, float]
    positions: dict[str, float]
    velocities: dict[str, float]
    links: dict[str, Affine]
    kind: JointCommand = "position"


class TransformMessages(Struct):
    """TF messages, and by the child of each transform the numbers of its messages."""

    times: list[float] = field(default_factory=list)  # of the messages, none before another
    messages: list[Message] = field(default_factory=list)
    numbers: dict[str, list[int]] = field(default_factory=dict)

    def add(self, message: Message) -> None:
        """Add the transforms of the next message."""
        number = len(self.times)
        for _, child in message.frames:
            self.numbers.setdefault(child, []).append(number)
        if self.numbers:
            self.times.append(max([message.at, *self.times[-1:]]))
            self.messages.append(message)

    def at(self, time: float) -> dict[str, Transform]:
        """Return the last transform of each frame at a time, at least those that came first."""
        sent = max(bisect_right(self.times, time), 1)
        counts = {child: bisect_left(numbers, sent) for child, numbers in self.numbers.items()}
        last = {child: self.numbers[child][count - 1] for child, count in counts.items() if count}
        by_child = {
            number: {each.child: each for each in self.messages[number].transforms}
            for number in dict.fromkeys(last.values())
        }
        return {child: by_child[number][child] for child, number in last.items()}


class Recording(Struct):
    """A run."""

    seconds: float = 0.0
    messages: list[Message] = field(default_factory=list)
    path: list[Pose] = field(default_factory=list)
    held: list[Held] = field(default_factory=list)
    not_simulated: dict[str, str] = field(default_factory=dict)
    # Why it shows nothing of a check, or of what a node sends: in truth that may be otherwise.
    unplayed: dict[str, str] = field(default_factory=dict)
    unclear: str = ""  # why nobody knows how the robot would move, if it is commanded
    assumed: dict[str, str] = field(default_factory=dict)
    gives: dict[str, tuple[Vector, ...]] = field(default_factory=dict)  # as of the world
    remarks: list[str] = field(default_factory=list)
    wheels: tuple[str, ...] = ()  # the joints of the wheels of which poses have the speeds
    radii: tuple[float, float] | None = None  # of wheels, and as the controller has it, in metres
    fired: dict[str, int] = field(default_factory=dict)
    # Those that hold throughout, sent for those who come late, with the node that sends them.
    static: tuple[tuple[Transform, str], ...] = ()

    _sorted: dict[tuple[str, int | None], list[Message]] = field(default_factory=dict)
    _trees: dict[tuple[str, int], TransformMessages] = field(default_factory=dict)

    def forget_messages(self) -> None:
        """Drop what was sent, once it is judged: of many plays it fills the memory."""
        self.messages.clear()
        self._sorted.clear()
        self._trees.clear()

    def topic(self, name: str, session: int | None = None) -> list[Message]:
        """Return what was sent on a topic in the lab's domain."""
        if not self._sorted:
            for message in self.messages:
                if message.away is None:
                    self._sorted.setdefault((message.topic, message.session), []).append(message)
                    self._sorted.setdefault((message.topic, None), []).append(message)
        return self._sorted.get((name, session), [])

    def tree(self, topic: str, session: int) -> TransformMessages:
        """Return the transforms that were sent on a topic in a session."""
        key = (topic, session)
        if key not in self._trees:
            self._trees[key] = TransformMessages()
            for message in self.topic(*key):
                self._trees[key].add(message)
        return self._trees[key]
