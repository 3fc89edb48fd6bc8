"""The checks of a dry run, by name, and the verdict of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lab3_usd.model.dry_run import Check, Verdict
from lab3_usd.sim.judge.motion import again, follows, limits, moving_frames, odometry, rest
from lab3_usd.sim.judge.sensors import camera, mounted, scan
from lab3_usd.sim.judge.topics import clock, stamps, topics, tree
from lab3_usd.sim.judge.trial import Fault, Trial

CHECKS: dict[str, Callable[[Trial], Iterator[Fault]]] = {
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


def judge(trial: Trial) -> list[Check]:
    """Return a verdict for each thing that is looked at.

    Where something is not simulated, nothing is a fault: it could be what is missing.
    """
    return [verdict(name, list(look(trial)), trial) for name, look in CHECKS.items()]


def verdict(name: str, faults: list[Fault], trial: Trial) -> Check:
    """Return the verdict of a check from its faults."""
    if not faults:
        return Check(name, "ok")
    unknown = trial.recording.not_simulated or (name in SENSED and trial.recording.assumed)
    known = not unknown and any(fault.sure for fault in faults)
    leading = next((fault for fault in faults if fault.prim), faults[0])
    text = "; ".join(fault.message for fault in faults)
    outcome: Verdict = "bad" if known else "not-simulated"
    return Check(name, outcome, text, leading.prim, leading.kind, leading.cause)
