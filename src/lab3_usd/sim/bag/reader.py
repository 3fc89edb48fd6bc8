"""Reads a recording once: its messages in time, and what of them is judged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.errors import RecordingError
from lab3_usd.model.dry_run import Affine, Frame, Place, heading, rotation
from lab3_usd.model.occupancy import OccupancyMap
from lab3_usd.sim.bag.decoder import MOST_NAMES, Decoded, decode, has_header, header, is_read
from lab3_usd.sim.bag.recording_files import Bounds, Offered, Raw
from lab3_usd.sim.execution.recording import Message, Odometry, Recording, Scan, Steering, Transform
from lab3_usd.sim.judge.expectations import Expected

NEAR = 0.5  # seconds from the clock within which a stamp is of that clock
_NANOSECONDS = 1e9


class Timeline(Struct):
    """The time of a recording: that of its clock, without jumps back; else that of arrival."""

    clocked: bool
    now: float = 0.0
    arrived: float = 0.0  # seconds since the first message
    clock: float | None = None
    ticks: int = 0
    first: int | None = None

    def arrive(self, nanoseconds: int) -> None:
        """Note when the next message arrives."""
        if self.first is None:
            self.first = nanoseconds
        self.arrived = max(self.arrived, (nanoseconds - self.first) / _NANOSECONDS)
        if not self.clocked:
            self.now = self.arrived

    def tick(self, clock: float) -> None:
        """Note what the clock says."""
        if self.clock is not None:
            self.now = round(self.now + max(0.0, clock - self.clock), 6)
        self.clock = clock
        self.ticks += 1

    def place(self, stamp: float | None) -> float:
        """Return when a message was made: by its stamp if that is of the clock, else now."""
        if stamp is None or self.clock is None or abs(stamp - self.clock) > NEAR:
            return self.now
        return max(0.0, round(self.now + stamp - self.clock, 6))

    @property
    def speed(self) -> float:
        """Seconds of the simulation in one second."""
        return self.now / self.arrived if self.arrived else 0.0


DETAIL = 300.0  # seconds of the simulation that are judged message by message
MOST_TRANSFORMS = 250_000  # in these
FEW = 5  # frames of one topic that are named
STRAIGHT = 1e-3  # radians to which a car is steered, up to which it goes straight ahead
BETWEEN = 1.0  # seconds between scans that are kept whole, to be laid on the map


class Tally(Struct):
    """Statistics of one topic: `at` in seconds of the simulation."""

    count: int = 0
    unreadable: int = 0
    stuck: int = 0  # messages whose stamp is not after the one before
    first: tuple[float, float] = (0.0, 0.0)  # at, arrival
    last: tuple[float, float] = (0.0, 0.0)
    stamp: float | None = None
    frames: dict[str, None] = field(default_factory=dict)
    offered: tuple[Offered, ...] = ()

    def rates(self) -> tuple[float, float]:
        """Return messages a second by the simulation and by arrival."""
        spans = (last - first for first, last in zip(self.first, self.last, strict=True))
        by_stamp, by_arrival = ((self.count - 1) / span if span > 0 else 0.0 for span in spans)
        return by_stamp, by_arrival


class TransformSeries(Struct):
    """Transforms between two frames over time."""

    count: int = 0
    last: float = 0.0
    gap: float = 0.0  # the longest


def lasting_topics(wanted: Expected) -> frozenset[str]:
    """Return the topics whose messages are read as a whole to the end."""
    lasting = {wanted.clock, wanted.transforms, wanted.goal_status, *wanted.static}
    return frozenset(lasting - {""})


def judged_topics(wanted: Expected) -> frozenset[str]:
    """Return the topics whose messages are read as a whole."""
    told = (wanted.commands, wanted.joint_commands, wanted.map)
    return frozenset({*wanted.types, *told, *lasting_topics(wanted)} - {""})


class Gathered(Struct):
    """The summed-up contents of a recording."""

    timeline: Timeline
    most: int  # messages that are judged one by one
    recording: Recording = field(default_factory=Recording)
    tallies: dict[tuple[str, str], Tally] = field(default_factory=dict)
    commands: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    places: list[tuple[float, Place]] = field(default_factory=list)
    links: dict[tuple[str, str], TransformSeries] = field(default_factory=dict)
    frames: dict[Frame, None] = field(default_factory=dict)
    goals: dict[bytes, int] = field(default_factory=dict)
    map: OccupancyMap | None = None  # the last one
    map_fault: str = ""  # why that of a file cannot be read
    located: list[tuple[float, Affine]] = field(default_factory=list)  # the root of TF in its frame
    scanned: float | None = None  # when the last scan came that is kept whole
    listed: int = 0  # transforms and goals that were read
    transforms: int = 0  # that are kept
    until: float | None = None  # when more came than is judged message by message

    @property
    def seconds(self) -> float:
        """How long it was judged message by message."""
        return min(DETAIL, self.timeline.now) if self.until is None else self.until

    def of_topic(self, name: str) -> list[Tally]:
        """Return what came on a topic, by type."""
        return [tally for (topic, _), tally in self.tallies.items() if topic == name]


def gather(
    messages: Iterable[Raw],
    offered: Mapping[tuple[str, str], tuple[Offered, ...]],
    wanted: Expected,
    bounds: Bounds,
) -> Gathered:
    """Go through the messages in the order in which they arrived.

    Raises:
        RecordingError: they list more transforms and goals than are read.
    """
    timeline = Timeline(any(topic == wanted.clock for topic, _ in offered))
    gathered = Gathered(timeline, bounds.kept)
    for key, profiles in offered.items():
        gathered.tallies[key] = Tally(offered=profiles)
    judged, lasting = judged_topics(wanted), lasting_topics(wanted)
    for raw in messages:
        read_whole = judged if gathered.until is None else lasting
        _take(gathered, raw, wanted, whole=raw.topic in read_whole)
        if gathered.listed > bounds.listed:
            raise RecordingError(f"has more than {bounds.listed} transforms and goals")
    gathered.recording.messages.sort(key=lambda message: message.at)
    return gathered


def _take(gathered: Gathered, raw: Raw, wanted: Expected, *, whole: bool) -> None:
    timeline = gathered.timeline
    timeline.arrive(raw.arrival)
    tally = gathered.tallies.setdefault((raw.topic, raw.type), Tally())
    if whole and is_read(raw.type):
        read = decode(raw.type, raw.data)
    else:
        head = header(raw.data) if has_header(raw.type) else None
        is_damaged = whole and head is None and has_header(raw.type)
        read = None if is_damaged else Decoded(head, None)
    if read is None:
        tally.unreadable += 1
        read = Decoded(None, None)
    if raw.topic == wanted.clock and isinstance(read.data, float):
        timeline.tick(read.data)
        stamp: float | None = read.data
        at = timeline.now
    else:
        stamp = read.header.stamp if read.header is not None else None
        at = timeline.place(stamp)
    _count(tally, read, stamp, (at, timeline.arrived))
    if whole:
        frame = read.header.frame if read.header is not None else ""
        message = Message(raw.type, stamp or 0.0, frame, read.data, topic=raw.topic, at=at)
        _keep(gathered, message, wanted)


def _count(tally: Tally, read: Decoded, stamp: float | None, moment: tuple[float, float]) -> None:
    tally.first = moment if not tally.count else tally.first
    tally.last = max(tally.last, moment)
    tally.count += 1
    if stamp is not None:
        tally.stuck += tally.stamp is not None and stamp <= tally.stamp
        tally.stamp = stamp
    if read.header is not None and len(tally.frames) < FEW:
        tally.frames[read.header.frame] = None
    if isinstance(read.data, Odometry) and len(tally.frames) < FEW:
        tally.frames[read.data.child] = None


def _keep(gathered: Gathered, message: Message, wanted: Expected) -> None:
    data = message.data
    if message.topic == wanted.goal_status and isinstance(data, tuple):
        gathered.listed += len(data)
        for goal in data[:MOST_NAMES]:
            if goal.id in gathered.goals or len(gathered.goals) < MOST_NAMES:
                gathered.goals[goal.id] = goal.status
        return
    if isinstance(data, OccupancyMap):
        gathered.map = data if message.topic == wanted.map else gathered.map
        return
    kept = len(gathered.recording.messages)
    if message.at > DETAIL or kept >= gathered.most or gathered.transforms > MOST_TRANSFORMS:
        gathered.until = min(gathered.until or DETAIL, gathered.timeline.now)
    if message.topic in {wanted.transforms, *wanted.static} and isinstance(data, tuple):
        gathered.listed += len(data)
        static = message.topic in wanted.static
        inner = _links(gathered, message.transforms, message.at, wanted.root, static=static)
        if len(gathered.located) < gathered.most:
            gathered.located += (
                (message.at, Affine(rotation(each.rotation), each.translation))
                for each in message.transforms
                if (each.parent, each.child) == (wanted.map_frame, wanted.root)
            )
        if not (static or inner):
            return
        message.data = () if static else inner
        gathered.transforms += len(inner)
    if gathered.until is None:
        _keep_whole(gathered, message, wanted)


def _keep_whole(gathered: Gathered, message: Message, wanted: Expected) -> None:
    data = message.data
    if message.topic == wanted.commands:
        if isinstance(data, Steering):  # how fast it turns is up to the size of the car
            turning = data.speed * data.angle if abs(data.angle) > STRAIGHT else 0.0
            data = (data.speed, 0.0, turning)
        if isinstance(data, tuple):
            gathered.commands.append((message.at, data))
        return
    if isinstance(data, Scan):
        if gathered.scanned is None or message.at >= gathered.scanned + BETWEEN:
            gathered.scanned = message.at
        else:
            message.data = replace(data, ranges=(max(data.ranges, default=-1.0),), whole=False)
    gathered.recording.messages.append(message)
    if isinstance(data, Odometry):
        turned = heading(Affine(rotation(data.orientation)))
        x, y, _ = data.position
        gathered.places.append((message.at, (x, y, turned)))


def _links(
    gathered: Gathered, transforms: tuple[Transform, ...], at: float, root: str, *, static: bool
) -> tuple[Transform, ...]:
    """Record the parent of each frame, and return the frames below the root."""
    for transform in transforms:
        key = (transform.parent, transform.child)
        link = gathered.links.get(key)
        if link is None:
            if len(gathered.links) >= MOST_NAMES:
                continue
            link = gathered.links[key] = TransformSeries(last=at)
            gathered.frames[Frame(*key, static)] = None
            if static:
                gathered.recording.static = (*gathered.recording.static, (transform, ""))
        link.gap = max(link.gap, 0.0 if static else at - link.last)
        link.count, link.last = link.count + 1, at
    return tuple(transform for transform in transforms if transform.child != root)
