"""The checks of a dry run, by name, and the verdict of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Literal

from msgspec.structs import replace

from lab3_usd.model.dry_run import Check, Verdict
from lab3_usd.sim.execution.drive import Leg
from lab3_usd.sim.judge.causes import DRIVEN
from lab3_usd.sim.judge.expectations import Expected, Look, RunFault, Trial
from lab3_usd.sim.judge.localization import on_map
from lab3_usd.sim.judge.motion import again, follows, limits, moving_frames, odometry, rest
from lab3_usd.sim.judge.sensors import camera, mounted, scan
from lab3_usd.sim.judge.topics import clock, stamps, topics, tree


def graphs(trial: Trial) -> Iterator[RunFault]:
    """All graphs can run, and each wire joins ports that are there."""
    for cause in trial.causes.of_graphs() if trial.causes is not None else ():
        yield RunFault(f"{cause.prim}: {cause.reason}", cause.kind or "unknown-port", cause.prim)


def _came(topics: Callable[[Expected], Sequence[str]]) -> Callable[[Trial], bool]:
    """Return what says whether topics are asked for, and something came on each of them."""

    def has_come(trial: Trial) -> bool:
        return all(name and trial.recording.topic(name) for name in topics(trial.wanted))

    return has_come


def _legs(trial: Trial) -> Sequence[Leg]:
    """Return the legs of the first session of a robot that is commanded."""
    return trial.drive[0].legs if trial.wanted.commands else ()


# The checks of a lab, each with whether checkpoint and drive ask for it, and something came.
CHECKS: dict[str, Look] = {
    "graphs": Look(graphs, lambda trial: bool(trial.recording.fired) or any(graphs(trial))),
    "topics": Look(topics, lambda trial: bool(trial.wanted.types)),
    "rest": Look(rest, lambda trial: bool(trial.wanted.commands)),
    "follows": Look(
        follows, lambda trial: any(leg.command and any(leg.command[::2]) for leg in _legs(trial))
    ),
    "limits": Look(
        limits,
        lambda trial: (
            any(trial.wanted.limits) and any(leg.name in {"fast", "spin"} for leg in _legs(trial))
        ),
    ),
    "odometry": Look(odometry, _came(lambda wanted: [wanted.odometry])),
    "clock": Look(clock, _came(lambda wanted: [wanted.clock])),
    "stamps": Look(stamps, _came(lambda wanted: [wanted.clock if wanted.types else ""])),
    "tree": Look(tree, _came(lambda wanted: [wanted.transforms])),
    "moving frames": Look(
        moving_frames, _came(lambda wanted: [wanted.odometry, wanted.transforms])
    ),
    "mounted": Look(
        mounted, _came(lambda wanted: [wanted.transforms, wanted.scan or wanted.image])
    ),
    "scan": Look(scan, _came(lambda wanted: [wanted.scan])),
    "map": Look(on_map, lambda trial: trial.fit is not None or bool(trial.map_fault)),
    "camera": Look(camera, _came(lambda wanted: [wanted.image, wanted.info])),
    "again": Look(again, lambda trial: bool(trial.wanted.commands) and len(trial.drive) > 1),
}
OF_JOINTS = ("joints", "links", "joint states")  # those of joints that have commands of their own
# What a robot that never moves does not show.
MOVED = ("rest", "limits", "odometry", "moving frames", "mounted", "again")
_OF_SCANS = ("scan", "map")
ESSENTIAL = ("topics", "follows", "joints")  # without which nothing is right


# What a stage or a recording shows as a whole, whichever robot is driven.
OF_ALL = (
    *("graphs", "topics", "clock", "stamps", "messages", "QoS", "rates", "headers"),
    *("localization", "goal"),
)
_OF_TREES = ("tree", "frames")


def judge(trial: Trial, looks: Mapping[str, Look]) -> tuple[Check, ...]:
    """Return the verdict of each check.

    What may come from something that is not simulated is no fault.
    """
    return tuple(verdict(name, list(look.faults(trial)), trial) for name, look in looks.items())


def asked_checks(trial: Trial) -> dict[str, Look]:
    """Return the checks that are asked for, and for which something came."""
    looks = CHECKS | trial.own_checks
    return {name: look for name, look in looks.items() if look.is_asked(trial)}


def of_all(trials: Iterable[Trial]) -> tuple[str, ...]:
    """Return the checks of what several robots share.

    Those whose transforms have topics of their own have a tree each.
    """
    has_trees = len({trial.wanted.transforms for trial in trials}) > 1
    return OF_ALL if has_trees else (*OF_ALL, *_OF_TREES)


def verdict(name: str, faults: list[RunFault], trial: Trial) -> Check:
    """Return the verdict of a check from its faults; what did not happen is not judged."""
    unplayed = why_unplayed(name, trial)
    if unplayed or (not faults and "" in trial.recording.unplayed):
        return Check(name, "not judged", unplayed or trial.recording.unplayed[""])
    unclear = trial.recording.unclear if name in DRIVEN else ""
    causes = trial.causes
    of_graph = [  # a node is why no command comes to the robot, however it would move
        fault
        for fault in faults
        if fault.cause and causes is not None and causes.is_node(fault.prim)
    ]
    if unclear and not of_graph:
        return Check(name, "not judged", unclear)
    silent = _unheard(name, trial)
    if not faults and silent:
        return Check(name, "not judged", f"nothing on {silent}")
    if not faults:
        never = name in MOVED and (not trial.recording.path or trial.never_moves())
        return Check(name, "not judged", "the robot never moved") if never else Check(name, "ok")
    is_assumed = name in _OF_SCANS and bool(trial.recording.assumed)
    sure = [  # what does not come from what is assumed or not known
        fault
        for fault in faults
        if fault.sure and not is_assumed and not (causes is not None and causes.doubt(name, fault))
    ]
    shown = sure or faults
    leading = next((fault for fault in shown if fault.prim), shown[0])
    text = "; ".join(fault.message for fault in shown)
    outcome: Verdict = "bad" if sure else "not judged"
    check = Check(name, outcome, text, leading.prim, leading.kind, leading.cause)
    asset = causes.asset(leading) if causes is not None and not sure and leading.sure else None
    if asset is not None:  # a cause of its own, which no rule about the stage explains
        return replace(check, prim=asset.prim, kind=None, cause=asset.reason)
    return check if causes is None else replace(check, rests_on=causes.basis(name, leading.prim))


def _unheard(name: str, trial: Trial) -> str:
    """Return the topic of a sensor that a check needs and that was never received, else ''."""
    wanted = trial.wanted
    topics = {"scan": (wanted.scan,), "map": (wanted.scan,), "camera": (wanted.image, wanted.info)}
    asked = [topic for topic in topics.get(name, ()) if topic]
    return asked[0] if asked and not any(map(trial.recording.topic, asked)) else ""


def why_unplayed(name: str, trial: Trial) -> str:
    """Return why a check has nothing to judge in a run, '' if it has."""
    recording = trial.recording
    seen = recording.topic(trial.wanted.scan, 0) if name in _OF_SCANS else ()
    sources = (name, *dict.fromkeys(message.node for message in seen))
    return next((recording.unplayed[each] for each in sources if each in recording.unplayed), "")


def whole_verdict(checks: Sequence[Check]) -> tuple[Literal["ok", "bad", "not judged"], str]:
    """Return the verdict, and why it was not judged."""
    if any(check.verdict == "bad" for check in checks):
        return "bad", ""
    for check in checks:
        if check.verdict == "not judged" and check.name in ESSENTIAL:
            return "not judged", check.text
    if any(check.verdict == "ok" for check in checks):
        return "ok", ""
    return "not judged", "no check applies: nothing was required, or nothing was received"
