"""What a dry run or a recording shows, and what is said of it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

Verdict = Literal["ok", "bad", "not-simulated"]


class Topic(Struct, frozen=True):
    """A topic: its rate in messages a second, and the frame that its messages are in.

    A recording also has the rate of arrival, and the QoS that each publisher offered.
    """

    name: str
    type: str
    hz: float
    frame: str
    arrival_hz: float | None = None
    qos: tuple[str, ...] = ()


class Frame(Struct, frozen=True):
    """A transform between two frames."""

    parent: str
    child: str
    static: bool


class Check(Struct, frozen=True):
    """A verdict: what was looked at, what is wrong, the prim at fault, and the rule of such faults.

    `cause` is what the prim at fault does or does not do, where that is known.
    """

    name: str
    verdict: Verdict
    message: str = ""
    prim: str = ""
    rule: str = ""
    cause: str = ""

    @property
    def text(self) -> str:
        """What is wrong, with its cause."""
        return f"{self.message}; {self.cause}" if self.cause else self.message


class Unknown(Struct, frozen=True):
    """Something that a dry run does not do, or does by assumption."""

    prim: str
    reason: str


class Difference(Struct, frozen=True):
    """What a topic or frame does otherwise in a recording than in the dry run of its stage."""

    name: str
    message: str


class Leg(Struct, frozen=True):
    """A part of the drive: what was told, and what the robot did (metres, degrees)."""

    name: str
    seconds: float
    told: tuple[float, float]
    done: tuple[float, float]


class Behaviour(Struct, frozen=True):
    """What one stage does in a dry run.

    `path` are (seconds, x, y, heading) in metres and radians; `legs` the drive of the first
    session, `remarks` what else is to be said of the robot.
    """

    stage: str
    checkpoint: str
    seconds: float
    verdict: Literal["ok", "bad", "unreadable"]
    topics: tuple[Topic, ...] = ()
    frames: tuple[Frame, ...] = ()
    checks: tuple[Check, ...] = ()
    path: tuple[tuple[float, float, float, float], ...] = ()
    not_simulated: tuple[Unknown, ...] = ()
    legs: tuple[Leg, ...] = ()
    remarks: tuple[str, ...] = ()
    recording: str = ""  # what was judged, where it is no dry run
    differences: tuple[Difference, ...] | None = None  # from the dry run of its stage, if played


Place = tuple[float, float, float]  # x, y, heading
Segment = tuple[float, float, float, float]  # from x, y to x, y


class Moment(Struct, frozen=True):
    """A moment of the first session: the robot, what odometry says of it, and what the lidar sees.

    `odometry` is from the start of the robot on, `points` are in the world; metres.
    """

    seconds: float
    leg: str
    robot: Place
    odometry: Place | None = None
    points: tuple[tuple[float, float], ...] = ()


class Replay(Struct, frozen=True):
    """What there is to draw of a run: the room, the robot in it, and how often nodes computed."""

    walls: tuple[Segment, ...]
    radius: float
    moments: tuple[Moment, ...]
    computed: dict[str, int]
