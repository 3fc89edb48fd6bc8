"""The checks of a dry run, by name, and the verdict of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

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
# What a robot that never moves does not show.
MOVED = ("rest", "limits", "odometry", "moving frames", "mounted", "again")
ESSENTIAL = ("topics", "follows")  # without which nothing is right


def judge(trial: Trial) -> list[Check]:
    """Return a verdict for each thing that is looked at.

    Where something is not simulated, nothing is a fault: it could be what is missing.
    """
    return [verdict(name, list(look(trial)), trial) for name, look in CHECKS.items()]


def verdict(name: str, faults: list[Fault], trial: Trial) -> Check:
    """Return the verdict of a check from its faults; what did not happen is not judged."""
    if not faults and name in MOVED and (not trial.recording.path or trial.stands()):
        return Check(name, "not judged", "the robot never moved")
    if not faults:
        return Check(name, "ok")
    unknown = trial.recording.not_simulated or (name in SENSED and trial.recording.assumed)
    known = not unknown and any(fault.sure for fault in faults)
    leading = next((fault for fault in faults if fault.prim), faults[0])
    text = "; ".join(fault.message for fault in faults)
    outcome: Verdict = "bad" if known else "not judged"
    return Check(name, outcome, text, leading.prim, leading.kind, leading.cause)


def whole_verdict(checks: Sequence[Check]) -> tuple[Literal["ok", "bad", "not judged"], str]:
    """Return what the checks come to, and what was missing where that is not judged."""
    if any(check.verdict == "bad" for check in checks):
        return "bad", ""
    for check in checks:
        if check.verdict == "not judged" and check.name in ESSENTIAL:
            return "not judged", check.text
    if any(check.verdict == "ok" for check in checks):
        return "ok", ""
    return "not judged", "nothing was asked for, or nothing came, that a check looks at"
