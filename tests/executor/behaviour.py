"""Judges what was recorded, whoever recorded it: does the robot do what it is told, and say so?

It knows what is asked for over ROS (an `Interface`) and the drive, and nothing of graphs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from msgspec import Struct

from executor.affine import HERE, Affine, length, minus, rotation
from executor.drive import RATE, Leg, Session
from executor.record import Message, Odometry, Pose, Recording, Scan, Transform, View

SIZE = (0.6, 1.5)  # how much of a command a robot that follows it may do
STILL = (2e-3, math.radians(0.3))
SLIP = (0.02, math.radians(3.0))
ODOMETRY = (0.02, math.radians(2.0))
SPEED = 0.03  # m/s and rad/s between what odometry says and what is
LAG = 0.1  # seconds between a stamp and the clock
PLACE = (0.02, math.radians(2.0))  # of a sensor, between TF and where it is
WALL = 0.03  # metres between a scan and the walls
MISSED = 0.1  # the part of a scan that may be elsewhere
STALE = 0.5  # seconds without a new transform
SOON = 6  # frames in which a robot may come to rest


class Interface(Struct, frozen=True):
    """What is asked for over ROS: topics, frames, rates and limits."""

    types: dict[str, str]  # message type by topic
    clock: str
    odometry: str
    transforms: str
    scan: str
    image: str
    info: str
    root: str
    base: str
    scan_rate: float
    image_rate: float
    limits: tuple[float, float]
    looks: tuple[float, float, float]


class Check(Struct, frozen=True):
    """A verdict: what was looked at, `ok`, `bad` or `not-simulated`, and what is wrong where."""

    name: str
    verdict: str
    message: str = ""
    prim: str = ""


class Evidence(Struct):
    """What there is to judge; `walls` gives the scan that is to be expected at a place."""

    recording: Recording
    drive: Sequence[Session]
    wanted: Interface
    start: Affine = HERE
    walls: Callable[[Affine, Scan], tuple[float, ...]] | None = None

    def leg(self, name: str) -> tuple[Leg, Pose, list[Pose]]:
        """Return a leg of the first session, the pose before it, and the poses in it."""
        poses = [each for each in self.recording.path if not each.session]
        leg = next(each for each in self.drive[0].legs if each.name == name)
        first = next(number for number, each in enumerate(poses) if each.leg == name)
        count = round(leg.seconds * RATE)
        return leg, poses[max(0, first - 1)], poses[first : first + count]

    def pose(self, message: Message) -> Pose:
        """Return where the robot was when a message was sent."""
        poses = [each for each in self.recording.path if each.session == message.session]
        return poses[min(len(poses), max(1, round(message.at * RATE))) - 1]


def judge(evidence: Evidence) -> list[Check]:
    """Return a verdict for each thing that is looked at."""
    found = []
    for name, check in CHECKS.items():
        faults = list(check(evidence))
        verdict = "bad" if faults else "ok"
        if faults and evidence.recording.not_simulated:
            verdict = "not-simulated"
        said = "; ".join(fault for fault, _ in faults)
        found.append(Check(name, verdict, said, faults[0][1] if faults else ""))
    return found


Fault = tuple[str, str]  # what is wrong, and the prim at fault if one is known


def topics(evidence: Evidence) -> Iterator[Fault]:
    """Each topic is there, of its type, from one node, in each session, on domain 0."""
    wanted, recording = evidence.wanted, evidence.recording
    sessions = range(len(evidence.drive))
    for topic, kind in wanted.types.items():
        silent = [each for each in sessions if not recording.topic(topic, each)]
        if silent:
            yield f"nothing on {topic}{_when(evidence, silent)}", ""
        messages = recording.topic(topic)
        odd = next((each for each in messages if each.type != kind), None)
        if odd is not None:
            yield f"{topic} is {odd.type}, not {kind}", odd.node
        senders = list(dict.fromkeys(each.node for each in messages))
        if topic != wanted.transforms and len(senders) > 1:
            yield f"{len(senders)} nodes publish {topic}", senders[1]


def _when(evidence: Evidence, sessions: Sequence[int]) -> str:
    """Say in which sessions, if not in all from the first on."""
    if 0 in sessions:
        return ""
    outside = evidence.drive[sessions[0]].environment
    return f" with ROS_DOMAIN_ID={outside}" if outside else " after Stop and Play"


def _gone(before: Pose, after: Pose) -> tuple[float, float, float]:
    """Return how far it went ahead and to the left, and how far it turned."""
    dx, dy = after.x - before.x, after.y - before.y
    c, s = math.cos(before.heading), math.sin(before.heading)
    return c * dx + s * dy, c * dy - s * dx, _angle(after.heading - before.heading)


def _angle(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)


def _sized(done: float, told: float) -> bool:
    return SIZE[0] <= done / told <= SIZE[1]


def rest(evidence: Evidence) -> Iterator[Fault]:
    """It stands still without a command, after one, and when told to go sideways."""
    for name in ("idle", "sideways"):
        _, before, poses = evidence.leg(name)
        ahead, left, turned = _gone(before, poses[-1])
        if math.hypot(ahead, left) > STILL[0] or abs(turned) > STILL[1]:
            yield f"moves while told {name}", ""
    poses = [each for each in evidence.recording.path if not each.session]
    for one, other in pairwise(poses):
        if one.leg != "stop" and other.leg == "stop":
            at = poses.index(other)
            ahead, left, turned = _gone(poses[at + SOON], poses[at + 2 * SOON])
            if math.hypot(ahead, left) > STILL[0] or abs(turned) > STILL[1]:
                yield f"does not stop after {one.leg}", ""
                return


def follows(evidence: Evidence) -> Iterator[Fault]:
    """It goes ahead, back and to the left as told, in sense and size."""
    if _stands(evidence):
        yield "does not move", ""
        return
    for name in ("ahead", "back"):
        leg, before, poses = evidence.leg(name)
        assert leg.command is not None
        ahead, left, turned = _gone(before, poses[-1])
        told = leg.command[0] * leg.seconds
        if not _sized(ahead, told):
            yield f"told to go {told:.2f} m, went {ahead:.2f} m", ""
            break
        if abs(left) > SLIP[0] or abs(turned) > SLIP[1]:
            yield f"told to go {name}, went aside", ""
            break
    leg, before, poses = evidence.leg("left")
    assert leg.command is not None
    ahead, left, _ = _gone(before, poses[-1])
    turned = sum(
        _angle(other.heading - one.heading)
        for one, other in zip([before, *poses], poses, strict=False)
    )
    if not _sized(turned, leg.command[2] * leg.seconds):
        yield f"told 90 degrees left, turned {math.degrees(turned):.1f}", ""
    elif math.hypot(ahead, left) > SLIP[0]:
        yield "told to turn, went away", ""


def _stands(evidence: Evidence) -> bool:
    """Whether it never goes anywhere."""
    first = evidence.recording.path[0]
    poses = [each for each in evidence.recording.path if not each.session]
    gone = [_gone(first, each) for each in poses[::SOON]]
    return all(math.hypot(x, y) < STILL[0] and abs(turned) < STILL[1] for x, y, turned in gone)


def limits(evidence: Evidence) -> Iterator[Fault]:
    """Commands beyond the robot's limits are cut down to them."""
    if _stands(evidence):
        return
    for name, limit in zip(("fast", "spin"), evidence.wanted.limits, strict=True):
        leg, before, poses = evidence.leg(name)
        ahead, left, turned = _gone(before, poses[-1])
        done = math.hypot(ahead, left) if name == "fast" else abs(turned)
        if not _sized(done, limit * leg.seconds):
            unit = "m" if name == "fast" else "rad"
            yield f"told to go {name}, does {done / leg.seconds:.2f} of {limit} {unit}/s", ""


def odometry(evidence: Evidence) -> Iterator[Fault]:
    """/odom starts at 0, agrees with the motion, and names the frames."""
    wanted = evidence.wanted
    messages = [
        each
        for each in evidence.recording.topic(wanted.odometry, 0)
        if isinstance(each.data, Odometry)
    ]
    if not messages:
        return
    first = messages[0]
    frames = (first.frame, first.data.child)
    if frames != (wanted.root, wanted.base):
        yield (
            f"odometry names {frames[0]} and {frames[1]}, not {wanted.root} and {wanted.base}",
            first.node,
        )
    origin = evidence.recording.path[0]
    for message in messages[:: max(1, len(messages) // 40)]:
        fault = _odometry_fault(message.data, origin, evidence.pose(message))
        if fault:
            yield fault, message.node
            return
    yield from _velocity_faults(evidence, messages)


def _odometry_fault(data: Odometry, origin: Pose, pose: Pose) -> str:
    ahead, left, _ = _gone(origin, pose)
    x, y, _ = data.position
    if math.hypot(x - ahead, y - left) > ODOMETRY[0]:
        return f"odometry says ({x:.2f}, {y:.2f}), it went ({ahead:.2f}, {left:.2f})"
    turned = Affine(rotation(data.orientation)).rows
    says = math.atan2(turned[1][0], turned[0][0])
    if abs(_angle(says - (pose.heading - origin.heading))) > ODOMETRY[1]:
        return f"odometry says {math.degrees(says):.0f} degrees, it turned otherwise"
    return ""


def _velocity_faults(evidence: Evidence, messages: list[Message]) -> Iterator[Fault]:
    for name in ("ahead", "left", "back", "fast"):
        _, _, poses = evidence.leg(name)
        one, other = poses[-4], poses[-3]
        at = [each for each in messages if abs(each.at - other.at) < 0.5 / RATE]
        if not at:
            continue
        ahead, left, turned = (each * RATE for each in _gone(one, other))
        says, data = at[0], at[0].data
        if (
            math.hypot(data.linear[0] - ahead, data.linear[1] - left) > SPEED
            or abs(data.angular[2] - turned) > SPEED
        ):
            yield f"the velocities of odometry are wrong while going {name}", says.node
            return


def clock(evidence: Evidence) -> Iterator[Fault]:
    """The clock runs at the speed of the simulation, and never back."""
    messages = evidence.recording.topic(evidence.wanted.clock)
    for one, other in pairwise(messages):
        if other.stamp < one.stamp:
            yield (
                f"{evidence.wanted.clock} jumps back by {one.stamp - other.stamp:.2f} s",
                other.node,
            )
            return
    first = [each for each in messages if not each.session]
    if first:
        ran, passed = first[-1].stamp - first[0].stamp, first[-1].at - first[0].at
        if abs(ran - passed) > LAG:
            yield f"{evidence.wanted.clock} runs {ran:.1f} s in {passed:.1f} s", first[0].node


def stamps(evidence: Evidence) -> Iterator[Fault]:
    """All stamps are of the clock; those of the sensors may start anew after Stop."""
    wanted = evidence.wanted
    for topic in wanted.types:
        late = topic in {wanted.odometry, wanted.transforms}
        for session in range(len(evidence.drive) if late else 1):
            fault = next(_late(evidence, topic, session), None)
            if fault is not None:
                yield fault
                break


def _late(evidence: Evidence, topic: str, session: int) -> Iterator[Fault]:
    clocks = {
        round(each.at * RATE): each.stamp
        for each in evidence.recording.topic(evidence.wanted.clock, session)
    }
    for message in evidence.recording.topic(topic, session):
        now = clocks.get(round(message.at * RATE))
        if now is not None and not message.static and abs(now - message.stamp) > LAG:
            when = _when(evidence, [session])
            yield f"{topic} is stamped {message.stamp:.1f} s at {now:.1f} s{when}", message.node


def tree(evidence: Evidence) -> Iterator[Fault]:
    """One parent and one publisher for each frame, one root, and every frame that is named."""
    for session in range(len(evidence.drive)):
        faults = list(_tree_faults(evidence, session))
        if faults:
            yield faults[0]
            return


def _tree_faults(evidence: Evidence, session: int) -> Iterator[Fault]:
    messages = evidence.recording.topic(evidence.wanted.transforms, session)
    parents: dict[str, dict[tuple[str, str], float]] = {}
    for message in messages:
        for each in message.data if isinstance(message.data, tuple) else ():
            parents.setdefault(each.child, {})[each.parent, message.node] = message.at
    for child, several in parents.items():
        own = next((node for parent, node in several if parent == child), None)
        if own is not None:
            yield f"{child} is its own parent", own
        if len(several) > 1:
            yield f"{child} has {len(several)} parents or publishers", list(several)[1][1]
        if min(several.values()) < messages[-1].at - STALE:
            yield f"the transform of {child} ends", next(iter(several))[1]
    if parents:
        up = {child: next(iter(several))[0] for child, several in parents.items()}
        yield from _loose_frames(evidence, up, session)


def _loose_frames(evidence: Evidence, up: dict[str, str], session: int) -> Iterator[Fault]:
    for frame in (*up, *sorted(_named(evidence, session))):
        top, steps = frame, 0
        while top in up and steps <= len(up):
            top, steps = up[top], steps + 1
        if top != evidence.wanted.root:
            yield f"{frame} does not hang below {evidence.wanted.root}", ""
            return


def _named(evidence: Evidence, session: int) -> set[str]:
    found = {evidence.wanted.base}
    for topic in evidence.wanted.types:
        for message in evidence.recording.topic(topic, session):
            found |= {message.frame} - {""}
    return found


def _frames_at(evidence: Evidence, message: Message) -> dict[str, tuple[str, Transform]]:
    found: dict[str, tuple[str, Transform]] = {}
    for each in evidence.recording.topic(evidence.wanted.transforms, message.session):
        if each.at > message.at and found:
            break
        for transform in each.data if isinstance(each.data, tuple) else ():
            found[transform.child] = (transform.parent, transform)
    return found


def _in_root(evidence: Evidence, message: Message) -> Affine | None:
    """Return where TF has the frame of a message, or None where it does not have it."""
    frames = _frames_at(evidence, message)
    frame, place = message.frame, HERE
    for _ in range(len(frames)):
        if frame not in frames:
            break
        frame, each = frames[frame]
        place = Affine(rotation(each.rotation), each.translation).then(place)
    return place if frame == evidence.wanted.root else None


def moving_frames(evidence: Evidence) -> Iterator[Fault]:
    """TF moves the base as odometry does."""
    wanted = evidence.wanted
    messages = [e for e in evidence.recording.topic(wanted.odometry, 0) if e.data is not None]
    for message in messages[len(messages) // 4 :: max(1, len(messages) // 4)]:
        asked = Message("", message.stamp, wanted.base, at=message.at, session=message.session)
        place = _in_root(evidence, asked)
        if place is None or not isinstance(message.data, Odometry):
            continue
        says = Affine(rotation(message.data.orientation), message.data.position)
        if not _agree(place, says):
            yield f"{wanted.root} -> {wanted.base} is not what odometry says", message.node
            return


def mounted(evidence: Evidence) -> Iterator[Fault]:
    """Lidar and camera go with the robot."""
    wanted = evidence.wanted
    for topic in (wanted.scan, wanted.image):
        messages = evidence.recording.topic(topic, 0)
        places = []
        for message in (messages[1], messages[-1]) if len(messages) > 1 else ():
            base = Message("", 0.0, wanted.base, at=message.at, session=message.session)
            there, here = _in_root(evidence, message), _in_root(evidence, base)
            if there is not None and here is not None:
                places.append(here.inverse().then(there))
        if len(places) > 1 and not _agree(*places):
            yield f"{messages[0].frame} does not go with {wanted.base}", messages[0].node


def _agree(one: Affine, other: Affine) -> bool:
    if length(minus(one.origin, other.origin)) > PLACE[0]:
        return False
    w = one.inverse().then(other).rigid().quaternion()[0]
    return 2 * math.acos(min(1.0, abs(w))) <= PLACE[1]


def _rate(messages: Sequence[Message]) -> float:
    passed = messages[-1].at - messages[0].at if len(messages) > 1 else 0.0
    return (len(messages) - 1) / passed if passed else 0.0


def scan(evidence: Evidence) -> Iterator[Fault]:
    """Scans come at their rate, and show the walls where TF puts the lidar."""
    wanted = evidence.wanted
    messages = [e for e in evidence.recording.topic(wanted.scan, 0) if isinstance(e.data, Scan)]
    if not messages:
        return
    rate = _rate(messages)
    if abs(rate - wanted.scan_rate) > 0.2 * wanted.scan_rate:
        yield f"{rate:.1f} scans a second, not {wanted.scan_rate}", messages[0].node
    if all(each < 0 for each in messages[-1].data.ranges):
        yield "no ray comes back", messages[-1].node
    for message in (messages[1], messages[len(messages) // 2], messages[-1]):
        place = _in_root(evidence, message)
        if place is None or evidence.walls is None:
            continue
        seen = message.data.ranges
        expected = evidence.walls(evidence.start.then(place), message.data)
        off = sum(
            abs(one - other) > WALL + 0.02 * abs(other)
            for one, other in zip(seen, expected, strict=True)
        )
        if off > MISSED * len(seen):
            yield f"{off} of {len(seen)} rays do not show the walls", message.node
            return


def camera(evidence: Evidence) -> Iterator[Fault]:
    """Image and info belong together, in the frame of the camera, which looks ahead."""
    wanted = evidence.wanted
    images, infos = (evidence.recording.topic(each, 0) for each in (wanted.image, wanted.info))
    if images and infos:
        yield from _pairs(images, infos, wanted.image_rate)
        yield from _view(evidence, images[-1])


def _pairs(images: Sequence[Message], infos: Sequence[Message], least: float) -> Iterator[Fault]:
    one, other = images[-1], infos[-1]
    if one.frame != other.frame:
        yield f"image in {one.frame}, info in {other.frame}", other.node
    sizes = [
        (each.data.width, each.data.height) for each in (one, other) if isinstance(each.data, View)
    ]
    if len(set(sizes)) > 1:
        yield "image and info differ in size", other.node
    rates = _rate(images), _rate(infos)
    if min(rates) < 0.8 * least:
        yield f"{min(rates):.1f} images a second, not {least}", one.node
    if abs(rates[0] - rates[1]) > 0.1 * max(rates):
        yield f"{rates[0]:.1f} images and {rates[1]:.1f} infos a second", other.node


def _view(evidence: Evidence, image: Message) -> Iterator[Fault]:
    place = _in_root(evidence, image)
    if place is None or not isinstance(image.data, View) or image.data.place is None:
        return
    there = evidence.start.inverse().then(image.data.place)
    if not _agree(place, there):
        yield f"TF does not have {image.frame} where the camera is", image.node
    wanted = evidence.wanted
    base = _in_root(evidence, Message("", 0.0, wanted.base, at=image.at, session=image.session))
    if base is not None:
        ahead = base.inverse().then(there).turn((0.0, 0.0, 1.0))
        if length(minus(ahead, wanted.looks)) > 0.5:
            yield "the camera does not look ahead", image.node


def again(evidence: Evidence) -> Iterator[Fault]:
    """After Stop and Play it drives again, also where ROS_DOMAIN_ID is another."""
    if _stands(evidence):
        return
    for number, session in enumerate(evidence.drive):
        poses = [each for each in evidence.recording.path if each.session == number]
        leg = session.legs[-1]
        if not number or leg.command is None or not poses:
            continue
        start = next(each for each in poses if each.leg == leg.name)
        ahead, left, _ = _gone(start, poses[-1])
        if not _sized(ahead, leg.command[0] * leg.seconds) or abs(left) > SLIP[0]:
            yield f"does not follow /cmd_vel{_when(evidence, [number])}", ""


CHECKS: dict[str, Callable[[Evidence], Iterator[Fault]]] = {
    "topics": topics,
    "rest": rest,
    "follows": follows,
    "limits": limits,
    "odometry": odometry,
    "clock": clock,
    "stamps": stamps,
    "tree": tree,
    "moving frames": moving_frames,
    "mounted": mounted,
    "scan": scan,
    "camera": camera,
    "again": again,
}
