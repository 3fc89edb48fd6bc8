"""Does the robot do what it is told, and only that?"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from lab3_usd.sim.behaviour.evidence import (
    SIZE,
    SOON,
    Evidence,
    Fault,
    Stretch,
    angle,
    displacement,
    is_about,
)


def rest(evidence: Evidence) -> Iterator[Fault]:
    """It stands still without a command, after one, and when told to go sideways."""
    for leg, before, poses in evidence.stretches("idle", "sideways"):
        if _moves(evidence, displacement(before, poses[-1])):
            rule = "S10" if leg.name == "idle" else "W02"
            yield evidence.motion_fault(f"moves while told {leg.name}", rule)
    poses = [each for each in evidence.recording.path if not each.session]
    for at, (one, other) in enumerate(pairwise(poses), start=1):
        if one.leg != "stop" and other.leg == "stop":
            later = poses[at + SOON : at + 2 * SOON + 1]
            if later and _moves(evidence, displacement(later[0], later[-1])):
                yield evidence.motion_fault(f"does not stop after {one.leg}", "S10")
                return


def _moves(evidence: Evidence, way: tuple[float, float, float]) -> bool:
    ahead, left, turned = way
    near, turn = evidence.tolerance.still
    return math.hypot(ahead, left) > near or abs(turned) > turn


def follows(evidence: Evidence) -> Iterator[Fault]:
    """It goes ahead, back and to the left as told, in sense and size."""
    if not any(leg.command and any(leg.command[::2]) for leg in evidence.drive[0].legs):
        return
    if evidence.stands():
        yield evidence.motion_fault("does not move", "S10")
        return
    for names, look in ((("ahead", "back"), _straight), (("left", "right"), _turn)):
        for stretch in evidence.stretches(*names):
            fault = look(evidence, stretch)
            if fault is not None:
                yield fault
                break
    yield from _arcs(evidence)


def _straight(evidence: Evidence, stretch: Stretch) -> Fault | None:
    leg, before, poses = stretch
    ahead, left, turned = displacement(before, poses[-1])
    told = leg.forward * leg.seconds
    if any(each.blocked for each in poses) and 0 <= ahead / told < SIZE[0]:
        said = f"told to go {told:.2f} m, a wall stops it after {ahead:.2f} m"
        return Fault(said, "S03", sure=False)
    if not is_about(ahead, told):
        return evidence.motion_fault(f"told to go {told:.2f} m, went {ahead:.2f} m", "P01")
    if abs(left) > evidence.tolerance.slip[0] or abs(turned) > evidence.tolerance.slip[1]:
        return evidence.motion_fault(f"told to go {leg.name}, went aside", "S09")
    return None


def _turn(evidence: Evidence, stretch: Stretch) -> Fault | None:
    leg, before, poses = stretch
    ahead, left, _ = displacement(before, poses[-1])
    told, turned = leg.turn * leg.seconds, _turned(stretch)
    if not is_about(turned, told):
        said = f"told {math.degrees(abs(told)):.0f} degrees {leg.name}, turned"
        sense = -1.0 if leg.name == "right" else 1.0
        return evidence.motion_fault(f"{said} {math.degrees(sense * turned):.1f}", "P07")
    if math.hypot(ahead, left) > evidence.tolerance.slip[0]:
        return evidence.motion_fault("told to turn, went away", "S09")
    return None


def _turned(stretch: Stretch) -> float:
    _, before, poses = stretch
    pairs = zip([before, *poses], poses, strict=False)
    return sum(angle(other.heading - one.heading) for one, other in pairs)


def _arcs(evidence: Evidence) -> Iterator[Fault]:
    for stretch in evidence.stretches("arc"):
        leg, before, poses = stretch
        way = sum(
            math.hypot(other.x - one.x, other.y - one.y)
            for one, other in zip([before, *poses], poses, strict=False)
        )
        told = (abs(leg.forward) * leg.seconds, leg.turn * leg.seconds)
        if not is_about(way, told[0]) or not is_about(_turned(stretch), told[1]):
            said = f"told to go {told[0]:.2f} m and turn {math.degrees(told[1]):.0f} degrees,"
            turned = math.degrees(_turned(stretch))
            yield evidence.motion_fault(f"{said} did {way:.2f} m and {turned:.0f}", "P01")
            return


def limits(evidence: Evidence) -> Iterator[Fault]:
    """Commands beyond the robot's limits are cut down to them."""
    if evidence.stands():
        return
    for name, limit in zip(("fast", "spin"), evidence.wanted.limits, strict=True):
        for leg, before, poses in evidence.stretches(name):
            ahead, left, turned = displacement(before, poses[-1])
            done = math.hypot(ahead, left) if name == "fast" else abs(turned)
            told = limit * leg.seconds
            stopped = done < told and any(each.blocked for each in poses)
            if not is_about(done, told) and not stopped:
                unit = "m" if name == "fast" else "rad"
                said = f"told to go {name}, does {done / leg.seconds:.2f} of {limit} {unit}/s"
                yield evidence.motion_fault(said, "P01")
                break


def again(evidence: Evidence) -> Iterator[Fault]:
    """After Stop and Play it drives again, also where ROS_DOMAIN_ID is another."""
    if evidence.stands():
        return
    for number, session in enumerate(evidence.drive):
        poses = [each for each in evidence.recording.path if each.session == number]
        leg = session.legs[-1]
        if not number or leg.command is None or not poses:
            continue
        start = next(each for each in poses if each.leg == leg.name)
        ahead, left, _ = displacement(start, poses[-1])
        if not is_about(ahead, leg.forward * leg.seconds) or abs(left) > evidence.tolerance.slip[0]:
            said = f"does not follow {evidence.wanted.commands}{evidence.when([number])}"
            yield evidence.motion_fault(said, "P02")
