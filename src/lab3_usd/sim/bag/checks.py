"""What only a recording of the real system shows: QoS, rates, frames over time, the goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

from msgspec import Struct

from lab3_usd.sim.bag.gathering import Gathered, Topics
from lab3_usd.sim.behaviour.evidence import Evidence, Fault, displacement, is_about
from lab3_usd.sim.behaviour.sensors import SHORT
from lab3_usd.spec.ros import GoalSpec, TopicSpec

GAP = 0.5  # seconds without a transform
QUIET = 3.0  # seconds without the transform of localization
LEAST = 0.5  # metres to drive, from which on the whole way is judged
TWIST = (0.05, 0.3)  # m/s or rad/s, and part, between speeds and the way
BARELY = 0.1  # of the simulation's time in the time that passes, below which a clock stands
STUCK = 0.1  # part of the messages whose stamp may not advance
_FRAMES = ("header.frame_id", "child_frame_id")


class Recorded(Struct, frozen=True):
    """A recording, what is asked of its topics, and of localization and navigation."""

    found: Gathered
    topics: Topics
    evidence: Evidence
    asked: tuple[TopicSpec, ...]
    map_frame: str
    goal: GoalSpec | None


def unreadable(recorded: Recorded) -> Iterator[Fault]:
    """Every message is of the type that its topic says."""
    for (topic, kind), tally in recorded.found.tallies.items():
        if tally.unreadable:
            said = f"{tally.unreadable} of {tally.count} messages on {topic} are no {kind}"
            yield Fault(said, "E05")


def qos(recorded: Recorded) -> Iterator[Fault]:
    """Each topic is offered with the durability that is asked for, by as many as are asked for."""
    for each in recorded.asked:
        for tally in recorded.found.of_topic(each.name):
            offered = [one.durability for one in tally.offered]
            odd = next((one for one in offered if each.durability not in {None, one}), None)
            if odd is not None:
                yield Fault(f"{each.name} is offered {odd}, not {each.durability}", "E07")
            if each.publishers is not None and len(offered) > each.publishers:
                yield Fault(f"{len(offered)} publishers of {each.name}", "E14")


def rates(recorded: Recorded) -> Iterator[Fault]:
    """What is to stream comes more than once in a while, and its stamps go on."""
    is_short = recorded.found.timeline.arrived < SHORT
    for each in recorded.asked:
        for tally in recorded.found.of_topic(each.name):
            if each.rate is not None and tally.count and not (any(tally.rates()) or is_short):
                yield Fault(f"{each.name} comes only once", "E04")
            elif each.rate is not None and tally.stuck > STUCK * tally.count:
                said = f"{tally.stuck} of {tally.count} stamps of {each.name} are not later"
                yield Fault(f"{said} than the one before", "W01")


def headers(recorded: Recorded) -> Iterator[Fault]:
    """The headers name the frames that are asked for."""
    for each in recorded.asked:
        wanted = [(each.fields or {})[name] for name in _FRAMES if name in (each.fields or {})]
        for tally in recorded.found.of_topic(each.name):
            odd = [frame for frame in tally.frames if frame not in wanted]
            if wanted and odd:
                said = f"{each.name} is in {', '.join(odd)}, not {' and '.join(wanted)}"
                yield Fault(said, "E05")


def running(recorded: Recorded) -> Iterator[Fault]:
    """The clock goes on."""
    timeline = recorded.found.timeline
    if timeline.ticks > 1 and timeline.speed < BARELY and timeline.arrived > 1.0:
        passed = f"{timeline.now:.1f} s in {timeline.arrived:.1f} s"
        yield Fault(f"{recorded.topics.wanted.clock} runs {passed}", "W01")


def frames(recorded: Recorded) -> Iterator[Fault]:
    """Each frame keeps its parent to the end, and its transform comes without gaps."""
    parents: dict[str, list[str]] = {}
    for parent, child in recorded.found.links:
        parents.setdefault(child, []).append(parent)
    for child, several in parents.items():
        if len(several) > 1:
            yield Fault(f"{child} has the parents {', '.join(several)}", "E12")
    static = {(each.parent, each.child) for each in recorded.found.frames if each.static}
    for (parent, child), link in recorded.found.links.items():
        if link.gap > GAP and (parent, child) not in static and child != _root(recorded):
            yield Fault(f"{parent} -> {child} is missing for {link.gap:.1f} s", "E11")
            return


def _root(recorded: Recorded) -> str:
    return recorded.topics.wanted.root


def odometry(recorded: Recorded) -> Iterator[Fault]:
    """The speeds of odometry are those of the way that it tells."""
    evidence, messages = (
        recorded.evidence,
        recorded.evidence.recording.topic(recorded.topics.wanted.odometry, 0),
    )
    times = [each.at for each in messages if each.data is not None]
    end = 0.0
    for leg in evidence.drive[0].legs:
        start, end = end, end + leg.seconds
        if leg.name not in {"ahead", "back", "left", "right"} or not times:
            continue
        inside = [e.data for e in messages if e.data is not None and start < e.at <= end]
        if not inside:
            continue
        stretch = next((s for s in evidence.stretches(leg.name) if s.leg is leg), None)
        if stretch is None:
            continue
        ahead, _, turned = displacement(stretch.before, stretch.poses[-1])
        linear = sum(each.linear[0] for each in inside) / len(inside)
        angular = sum(each.angular[2] for each in inside) / len(inside)
        pairs = [(linear, ahead / leg.seconds)]
        if abs(leg.turn * leg.seconds) < math.pi / 2:
            pairs.append((angular, turned / leg.seconds))
        if any(abs(a - b) > TWIST[0] + TWIST[1] * abs(b) for a, b in pairs):
            yield Fault(f"the speeds of odometry are not those of its way {leg.name}", "W02")
            return


def way(recorded: Recorded) -> Iterator[Fault]:
    """All in all the robot goes about as far as it is told."""
    evidence = recorded.evidence
    most = evidence.wanted.limits[0] or math.inf
    told = sum(min(abs(each.forward), most) * each.seconds for each in evidence.drive[0].legs)
    poses = evidence.recording.path
    done = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))
    if told > LEAST and not is_about(done, told):
        yield Fault(f"told to go {told:.1f} m in all, went {done:.1f} m", "P01")


def localization(recorded: Recorded) -> Iterator[Fault]:
    """Localization ties the map to odometry, alone and to the end."""
    root, found = _root(recorded), recorded.found
    above = {parent: link for (parent, child), link in found.links.items() if child == root}
    link = above.get(recorded.map_frame)
    if link is None:
        yield Fault(f"no {recorded.map_frame} -> {root}", "E11")
    elif link.last < found.timeline.now - QUIET:
        yield Fault(f"{recorded.map_frame} -> {root} ends", "E11")
    if len(above) > 1:
        yield Fault(f"{root} has the parents {', '.join(above)}", "E12")


def goal(recorded: Recorded) -> Iterator[Fault]:
    """The last goal is reached."""
    goals, asked = recorded.found.goals, recorded.goal
    if asked is None:
        return
    if not goals:
        yield Fault("no goal was sent", "E16")
    elif [*goals.values()][-1] != asked.succeeded:
        name = asked.name([*goals.values()][-1])
        yield Fault(f"the last of {len(goals)} goals is {name}", "E16")


Look = Callable[[Recorded], Iterator[Fault]]
CHECKS: dict[str, Look] = {
    "messages": unreadable,
    "QoS": qos,
    "rates": rates,
    "headers": headers,
    "clock": running,
    "frames": frames,
    "odometry": odometry,
    "way": way,
    "localization": localization,
    "goal": goal,
}
