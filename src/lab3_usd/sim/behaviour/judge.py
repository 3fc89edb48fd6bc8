"""Runs every check of a behaviour, in order, and collects the verdicts."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lab3_usd.model.dry_run.behaviour import Check, Verdict
from lab3_usd.sim.behaviour.evidence import Evidence, Fault
from lab3_usd.sim.behaviour.motion import again, follows, limits, rest
from lab3_usd.sim.behaviour.odometry import moving_frames, odometry
from lab3_usd.sim.behaviour.sensors import camera, mounted, scan
from lab3_usd.sim.behaviour.streams import clock, stamps, topics
from lab3_usd.sim.behaviour.tree import tree

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
SENSED = ("topics", "scan")  # what the assumed profile of a lidar bears on


def judge(evidence: Evidence) -> list[Check]:
    """Return a verdict for each thing that is looked at.

    Where something is not simulated, nothing is a fault: it could be what is missing.
    """
    return [verdict(name, list(look(evidence)), evidence) for name, look in CHECKS.items()]


def verdict(name: str, faults: list[Fault], evidence: Evidence) -> Check:
    """Return the verdict of what was found to be wrong."""
    if not faults:
        return Check(name, "ok")
    unknown = evidence.recording.not_simulated or (name in SENSED and evidence.recording.assumed)
    known = not unknown and any(each.sure for each in faults)
    told = next((each for each in faults if each.prim), faults[0])
    said = "; ".join(each.message for each in faults)
    outcome: Verdict = "bad" if known else "not-simulated"
    return Check(name, outcome, said, told.prim, told.rule, told.cause)
