"""Goes through a recording once, and keeps what is judged: no more than a bounded part of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec import Struct, field

from lab3_usd.errors import RecordingError
from lab3_usd.model.dry_run.affine import Affine, heading, rotation
from lab3_usd.model.dry_run.behaviour import Frame, Place
from lab3_usd.sim.bag.decoding import Decoded, Goal, decode, has_header, header
from lab3_usd.sim.bag.files import Offered, Raw
from lab3_usd.sim.bag.timeline import Timeline
from lab3_usd.sim.behaviour.evidence import Interface
from lab3_usd.sim.execution.record import Message, Odometry, Recording, Transform

DETAIL = 300.0  # seconds of the simulation that are judged message by message
MOST_KEPT = 60_000  # messages of these
MOST_TRANSFORMS = 250_000  # in these
MOST_NAMES = 2000  # frames, goals
FEW = 5  # frames of one topic that are named


class Tally(Struct):
    """What is known of a topic however long it is: `at` in seconds of the simulation."""

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


class Link(Struct):
    """Transforms between two frames over time."""

    count: int = 0
    last: float = 0.0
    gap: float = 0.0  # the longest


class Topics(Struct, frozen=True):
    """Which topics are read: those of the interface, static transforms, and the goal's status."""

    wanted: Interface
    static: frozenset[str]
    goal: str

    def judged(self) -> frozenset[str]:
        """Return the topics whose messages are read as a whole."""
        wanted = self.wanted
        return frozenset({*wanted.types, wanted.commands, *self.lasting()} - {""})

    def lasting(self) -> frozenset[str]:
        """Return those of them that are read to the end."""
        wanted = self.wanted
        return frozenset({wanted.clock, wanted.transforms, self.goal, *self.static} - {""})


class Gathered(Struct):
    """What a recording comes to."""

    timeline: Timeline
    recording: Recording = field(default_factory=Recording)
    tallies: dict[tuple[str, str], Tally] = field(default_factory=dict)
    commands: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    places: list[tuple[float, Place]] = field(default_factory=list)
    links: dict[tuple[str, str], Link] = field(default_factory=dict)
    frames: dict[Frame, None] = field(default_factory=dict)
    goals: dict[bytes, int] = field(default_factory=dict)
    listed: int = 0  # transforms and goals that were read
    transforms: int = 0  # that are kept
    until: float | None = None  # when more came than is judged message by message

    @property
    def seconds(self) -> float:
        """How long it was judged message by message."""
        return min(DETAIL, self.timeline.now) if self.until is None else self.until

    def of_topic(self, name: str) -> list[Tally]:
        """Return what came on a topic, by type."""
        return [each for (topic, _), each in self.tallies.items() if topic == name]


def gather(
    messages: Iterable[Raw],
    offered: Mapping[tuple[str, str], tuple[Offered, ...]],
    topics: Topics,
    most_listed: int,
) -> Gathered:
    """Go through the messages in the order in which they arrived.

    Raises:
        RecordingError: they list more transforms and goals than are read.
    """
    timeline = Timeline(any(topic == topics.wanted.clock for topic, _ in offered))
    found = Gathered(timeline)
    for key, each in offered.items():
        found.tallies[key] = Tally(offered=each)
    judged, lasting = topics.judged(), topics.lasting()
    for raw in messages:
        _take(found, raw, topics, whole=raw.topic in (judged if found.until is None else lasting))
        if found.listed > most_listed:
            message = f"has more than {most_listed} transforms and goals"
            raise RecordingError(message)
    found.recording.messages.sort(key=lambda each: each.at)
    return found


def _take(found: Gathered, raw: Raw, topics: Topics, *, whole: bool) -> None:
    timeline = found.timeline
    timeline.arrive(raw.arrival)
    tally = found.tallies.setdefault((raw.topic, raw.type), Tally())
    read = _read(raw, whole=whole)
    if read is None:
        tally.unreadable += 1
        read = Decoded(None, None)
    wanted = topics.wanted
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
        _keep(found, message, topics)


def _read(raw: Raw, *, whole: bool) -> Decoded | None:
    if whole:
        return decode(raw.type, raw.data)
    return Decoded(header(raw.data) if has_header(raw.type) else None, None)


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


def _keep(found: Gathered, message: Message, topics: Topics) -> None:
    wanted, data = topics.wanted, message.data
    if message.topic == topics.goal and isinstance(data, tuple):
        found.listed += len(data)
        _goals(found, data)
        return
    if _is_enough(found, message):
        found.until = min(found.until or DETAIL, found.timeline.now)
    if message.topic in {wanted.transforms, *topics.static} and isinstance(data, tuple):
        found.listed += len(data)
        static = message.topic in topics.static
        inner = _links(found, message.transforms, message.at, wanted.root, static=static)
        if static or not inner:
            return
        message.data = inner
        found.transforms += len(inner)
    if found.until is None:
        _keep_whole(found, message, wanted)


def _is_enough(found: Gathered, message: Message) -> bool:
    kept = len(found.recording.messages)
    return message.at > DETAIL or kept >= MOST_KEPT or found.transforms > MOST_TRANSFORMS


def _keep_whole(found: Gathered, message: Message, wanted: Interface) -> None:
    data = message.data
    if message.topic == wanted.commands:
        if isinstance(data, tuple):
            found.commands.append((message.at, data))
        return
    found.recording.messages.append(message)
    if isinstance(data, Odometry):
        turned = heading(Affine(rotation(data.orientation)))
        x, y, _ = data.position
        found.places.append((message.at, (x, y, turned)))


def _goals(found: Gathered, goals: tuple[Goal, ...]) -> None:
    for each in goals[:MOST_NAMES]:
        if each.id in found.goals or len(found.goals) < MOST_NAMES:
            found.goals[each.id] = each.status


def _links(
    found: Gathered, transforms: tuple[Transform, ...], at: float, root: str, *, static: bool
) -> tuple[Transform, ...]:
    """Note who is whose parent, and return what is below the root."""
    for each in transforms:
        key = (each.parent, each.child)
        link = found.links.get(key)
        if link is None:
            if len(found.links) >= MOST_NAMES:
                continue
            link = found.links[key] = Link(last=at)
            found.frames[Frame(*key, static)] = None
            if static:
                found.recording.static = (*found.recording.static, (each, ""))
        link.gap = max(link.gap, 0.0 if static else at - link.last)
        link.count, link.last = link.count + 1, at
    return tuple(each for each in transforms if each.child != root)
