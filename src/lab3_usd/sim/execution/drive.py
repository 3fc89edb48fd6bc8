"""The commands of a drive: sessions from Play to Stop, each a row of legs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.model.joint_drives import JointCommand
from lab3_usd.sim.execution.recording import JointStates

RATE = 60.0  # frames a second
COMMANDS = 10.0  # a second
LONGEST = 3600.0  # seconds of a drive
LONGEST_LEG = 10.0  # seconds of a leg of the fixed one
NO_LIMITS = (math.inf, math.inf)  # metres and radians a second
USUAL, BEYOND = (0.15, 0.8), (1.0, 4.0)  # metres and radians a second
STEERED = "steered"  # a leg in which a car is to turn
_NUMBERS = 3


class Leg(Struct, frozen=True):
    """A time with one command on the topic of commands; None sends nothing.

    A leg of `joints` sends where they are to go, radians and units of the stage, or how fast, or
    an effort; one with a `steer` the speed ahead and the angle to which a car is steered.
    """

    name: str
    seconds: float
    command: tuple[float, float, float] | None = None  # forward, to the left, turning
    joints: tuple[tuple[str, float], ...] = ()
    steer: float | None = None
    kind: JointCommand = "position"  # of what joints are told

    @property
    def forward(self) -> float:
        """Metres a second ahead."""
        return self.command[0] if self.command is not None else 0.0

    @property
    def turn(self) -> float:
        """Radians a second to the left."""
        return self.command[2] if self.command is not None else 0.0


def joint_command(leg: Leg) -> JointStates:
    """Return the message of a leg of joints, which leaves out what it does not command."""
    names, values = zip(*leg.joints, strict=True)
    if leg.kind == "position":
        return JointStates(names, values)
    if leg.kind == "velocity":
        return JointStates(names, velocities=values)
    return JointStates(names, efforts=values)


class Session(Struct, frozen=True):
    """From Play to Stop, with the ROS_DOMAIN_ID that the process has."""

    legs: tuple[Leg, ...]
    environment: str = ""


def command_frames(session: Session) -> Iterator[tuple[int, Leg]]:
    """Yield the frames of a session in which a command is sent, each with its leg."""
    every, first = round(RATE / COMMANDS), 0
    for leg in session.legs:
        count = round(leg.seconds * RATE)
        if leg.command is not None or leg.joints:
            yield from ((first + number, leg) for number in range(0, count, every))
        first += count


def fixed_drive(limits: tuple[float, float] = (0.0, 0.0), slow: float = 1.0) -> tuple[Session, ...]:
    """Return the drive that every stage is judged by; `slow` makes it longer.

    It stays within the robot's limits, and exceeds them where they are to be shown: metres and
    radians a second, 0 for none.
    """
    steady, turn = (min(v, 0.8 * most or v) for v, most in zip(USUAL, limits, strict=True))
    fast, spin = (max(v, 2 * most) for v, most in zip(BEYOND, limits, strict=True))
    ahead, turn, rest = steady / slow, turn / slow, 0.3 * slow
    straight, quarter = (min(LONGEST_LEG * slow, way) for way in (0.3 / ahead, math.pi / 2 / turn))
    legs = (
        Leg("idle", 0.5 * slow),
        Leg("ahead", straight, (ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("back", straight, (-ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("left", quarter, (0.0, 0.0, turn)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("sideways", rest, (0.0, 0.2, 0.0)),
        Leg("fast", 0.4, (fast, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("spin", 0.4, (0.0, 0.0, spin)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
    )
    again = (Leg("idle", rest), Leg("ahead", 0.5, (steady, 0.0, 0.0)))
    return (Session(legs), Session(again), Session(again, "7"))


def drive_of(text: str, limits: tuple[float, float]) -> tuple[Session, ...]:
    """Return the test drive that a file or a text describes.

    A segment `v,w,s` is metres a second, radians a second, and seconds. A text separates segments
    by spaces, a file by lines; a `#` begins a comment.

    Raises:
        UsageError: it is neither a file nor a drive.
    """
    legs = tuple(_legs(_lines(text), limits))
    if not legs or sum(leg.seconds for leg in legs) > LONGEST:
        raise UsageError(f"--drive '{text}': is not a drive of at most {LONGEST:.0f} seconds")
    return (Session((Leg("idle", 0.5), *legs)),)


def _lines(text: str) -> list[str]:
    """Return the legs as they are written, in a file or in the text itself."""
    try:
        if Path(text).is_file():
            return Path(text).read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise UsageError(f"--drive {text}: is not text") from error
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
            raise UsageError(f"--drive: '{text}' is not a segment; write m/s, rad/s and seconds")
        v, w, seconds = numbers
        yield Leg(leg_name(v, w, limits), seconds, (v, 0.0, w))


def leg_name(v: float, w: float, limits: tuple[float, float]) -> str:
    """Name a leg by the motion that it commands, as checks look it up."""
    if abs(v) > limits[0] or abs(w) > limits[1]:
        return "beyond" if v and w else "fast" if v else "spin"
    if v and w:
        return "arc"
    if v:
        return "ahead" if v > 0 else "back"
    return "stop" if not w else "left" if w > 0 else "right"
