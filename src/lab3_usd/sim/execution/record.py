"""The commands of a drive, and the record of a run: its messages and the robot's path."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from lab3_usd.errors import UsageError
from lab3_usd.model.dry_run import Affine, Quaternion
from lab3_usd.model.transforms import Vector

RATE = 60.0  # frames a second
COMMANDS = 10.0  # a second
LONGEST = 3600.0  # seconds of a drive
_NUMBERS = 3


class Leg(Struct, frozen=True):
    """A time with one command on the topic of commands; None sends nothing."""

    name: str
    seconds: float
    command: tuple[float, float, float] | None = None  # forward, to the left, turning

    @property
    def forward(self) -> float:
        """Metres a second ahead."""
        return self.command[0] if self.command is not None else 0.0

    @property
    def turn(self) -> float:
        """Radians a second to the left."""
        return self.command[2] if self.command is not None else 0.0


class Session(Struct, frozen=True):
    """From Play to Stop, with the ROS_DOMAIN_ID that the process has."""

    legs: tuple[Leg, ...]
    environment: str = ""


def command_frames(session: Session) -> Iterator[tuple[int, Leg]]:
    """Yield the frames of a session in which a command is sent, each with its leg."""
    every, first = round(RATE / COMMANDS), 0
    for leg in session.legs:
        count = round(leg.seconds * RATE)
        if leg.command is not None:
            yield from ((first + number, leg) for number in range(0, count, every))
        first += count


def _turn(angle: float, speed: float) -> Leg:
    return Leg("left", angle / speed, (0.0, 0.0, speed))


def fixed_drive(slow: float = 1.0) -> tuple[Session, ...]:
    """Return the drive that every stage is judged by; `slow` makes it longer."""
    ahead, rest = 0.15 / slow, 0.3 * slow
    legs = (
        Leg("idle", 0.5 * slow),
        Leg("ahead", 0.3 / ahead, (ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("back", 0.3 / ahead, (-ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        _turn(math.pi / 2, 0.8 / slow),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("sideways", rest, (0.0, 0.2, 0.0)),
        Leg("fast", 0.4, (1.0, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("spin", 0.4, (0.0, 0.0, 4.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
    )
    again = (Leg("idle", rest), Leg("ahead", 0.5, (0.15, 0.0, 0.0)))
    return (Session(legs), Session(again), Session(again, "7"))


def drive_of(text: str, limits: tuple[float, float]) -> tuple[Session, ...]:
    """Return the drive that somebody wrote: a file, or legs `v,w,s` between spaces.

    A leg is metres a second, radians a second, and seconds. In a file each stands on a line, and
    what follows a `#` is a remark.

    Raises:
        UsageError: it is neither a file nor a drive.
    """
    legs = tuple(_legs(_lines(text), limits))
    if not legs or sum(leg.seconds for leg in legs) > LONGEST:
        raise UsageError(f"--drive '{text}': is no drive of up to {LONGEST:.0f} seconds")
    return (Session((Leg("idle", 0.5), *legs)),)


def _lines(text: str) -> list[str]:
    """Return the legs as they are written, in a file or in the text itself."""
    try:
        if Path(text).is_file():
            return Path(text).read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise UsageError(f"--drive {text}: is no text") from error
    except (OSError, ValueError):  # no name of a file can be so long, or hold such characters
        pass
    return text.split()


def _legs(lines: list[str], limits: tuple[float, float]) -> Iterator[Leg]:
    for line in lines:
        text = line.partition("#")[0].strip()
        if not text:
            continue
        try:
            numbers = [float(part) for part in re.split(r"[,\s]+", text)]
        except ValueError:
            numbers = []
        if len(numbers) != _NUMBERS or not all(map(math.isfinite, numbers)) or numbers[2] <= 0:
            raise UsageError(
                f"--drive: '{text}' is no leg; write metres a second, radians a second, seconds"
            )
        v, w, seconds = numbers
        yield Leg(leg_name(v, w, limits), seconds, (v, 0.0, w))


def leg_name(v: float, w: float, limits: tuple[float, float]) -> str:
    """Name a leg by what it tells, as the checks ask for it."""
    if abs(v) > limits[0] or abs(w) > limits[1]:
        return "beyond" if v and w else "fast" if v else "spin"
    if v and w:
        return "arc"
    if v:
        return "ahead" if v > 0 else "back"
    return "stop" if not w else "left" if w > 0 else "right"


class Transform(Struct, frozen=True):
    """One transform of a TF message."""

    parent: str
    child: str
    translation: Vector
    rotation: Quaternion


class Odometry(Struct, frozen=True):
    """What an odometry message says beside its header."""

    child: str
    position: Vector
    orientation: Quaternion
    linear: Vector
    angular: Vector


class Scan(Struct, frozen=True):
    """What a scan says beside its header; a ray without return is -1."""

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: tuple[float, ...]
    place: Affine | None = None  # of the lidar, where it is known; metres


class View(Struct, frozen=True):
    """What an image or camera info says beside its header, without pixels."""

    width: int
    height: int
    matrix: tuple[float, ...] = ()
    place: Affine | None = None  # of the optical frame, where it is known; metres


class Profile(Struct, frozen=True):
    """How a publisher offers its messages (QoS); a depth of 0 keeps all."""

    depth: int = 10
    is_reliable: bool = True
    is_durable: bool = False  # kept for subscribers that come late: "transient local"


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
    profile: Profile = Profile()

    @property
    def transforms(self) -> tuple[Transform, ...]:
        """The transforms of a TF message, as tf2 takes them."""
        return tuple(map(_taken, self.data)) if isinstance(self.data, tuple) else ()


def _taken(transform: Transform) -> Transform:
    """Take a slash off before the frames (geometry2, humble: tf2/src/buffer_core.cpp)."""
    if not transform.parent.startswith("/") and not transform.child.startswith("/"):
        return transform
    parent, child = transform.parent.removeprefix("/"), transform.child.removeprefix("/")
    return Transform(parent, child, transform.translation, transform.rotation)


class Pose(Struct, frozen=True):
    """Where the robot was: session, seconds since Play, and the way it had gone by then."""

    session: int
    at: float
    leg: str
    x: float
    y: float
    heading: float
    z: float = 0.0
    blocked: bool = False  # by a wall


class Recording(Struct):
    """A run."""

    seconds: float = 0.0
    messages: list[Message] = field(default_factory=list)
    path: list[Pose] = field(default_factory=list)
    not_simulated: dict[str, str] = field(default_factory=dict)
    assumed: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    fired: dict[str, int] = field(default_factory=dict)
    # Those that hold throughout, sent for those who come late, with the node that sends them.
    static: tuple[tuple[Transform, str], ...] = ()

    _sorted: dict[tuple[str, int | None], list[Message]] = field(default_factory=dict)

    def topic(self, name: str, session: int | None = None) -> list[Message]:
        """Return what was sent on a topic in the lab's domain."""
        if not self._sorted:
            for message in self.messages:
                if message.away is None:
                    self._sorted.setdefault((message.topic, message.session), []).append(message)
                    self._sorted.setdefault((message.topic, None), []).append(message)
        return self._sorted.get((name, session), [])
