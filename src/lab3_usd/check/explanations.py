"""What explains a fault of a dry run: a finding that the rules really have about the stage.

A recording has no stage beside it: there each kind of fault has a rule whose manual explains it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from lab3_usd.model.dry_run import Behaviour, Check
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.finding import SEVERITIES, Finding

ONLY_IN_A_DRY_RUN = "F07"  # the rule of a fault that no other rule finds
_MISSING_WIRE, _MISSING_NODE = "W01", "N01"  # a node takes its wires along
# What only such rules find, wherever in the stage: the robot, at which the fault shows, is right.
_ELSEWHERE: tuple[FaultKind, ...] = ("no-gravity", "no-ground", "duplicate-publisher")

# The rules that most often find what shows itself as a fault of each kind: of the lab, and of lint
# ('' where none does). They choose among findings, and explain the faults of recordings.
EXPLAINED_BY: Mapping[FaultKind, tuple[str, str]] = {
    # nodes and their graphs
    "graph-not-evaluated": ("G03", "K03"),
    "simulation-stopped": ("N13", "K09"),
    "unknown-type": ("N03", "K30"),
    "unknown-port": ("W03", "K21"),
    "refused-wire": ("W09", "K22"),
    "not-executed": ("W01", "K01"),
    "switched-off": ("P01", ""),
    "zero-gate-step": ("P01", "K06"),
    "invalid-conversion": ("P01", "K35"),
    "no-number-input": ("W01", ""),
    "no-vector-input": ("W01", ""),
    "wrong-array-type": ("P01", "K22"),
    "invalid-context": ("W02", "K12"),
    "invalid-qos-profile": ("P04", "K42"),
    "unmatched-peer": ("P04", "K98"),
    "invalid-topic-name": ("P01", "K37"),
    # commands and the drive
    "ramp-without-time-step": ("P11", "K63"),
    "invalid-wheel-size": ("P02", "K10"),
    "no-joint-controller": ("N01", ""),
    "no-articulation": ("R02", "K60"),
    "excluded-joint": ("S07", "K61"),
    "unknown-joint": ("P01", "K61"),
    "empty-joint-name": ("W01", "K11"),
    "wrong-command-count": ("P01", "K68"),
    "non-numeric-command": ("W02", "K22"),
    "several-commands": ("Q01", "K65"),
    "no-position-drive": ("S10", "K86"),
    "no-chassis-body": ("R02", "K67"),
    "unequal-joint-arrays": ("W01", ""),
    "joint-off-target": ("S10", ""),
    "wrong-joint-state": ("W01", ""),
    "link-off-frame": ("W01", ""),
    "no-inertial-sensor": ("R02", ""),
    # the robot
    "no-driven-robot": ("S07", ""),
    "kinematic-link": ("S05", "K82"),
    "base-fixed-to-world": ("S21", "K81"),
    "no-gravity": ("S15", "Y03"),
    "no-ground": ("S13", ""),
    "no-wheel-contact": ("S19", ""),
    "tips-over": ("S19", ""),
    "locked-joint": ("S23", "K82"),
    "no-velocity-drive": ("S10", "K62"),
    "weak-drive": ("S10", ""),
    "no-grip": ("S25", ""),
    "limited-joint": ("S07", "K82"),
    # motion
    "moves-uncommanded": ("S10", ""),
    "moves-sideways": ("W02", ""),
    "does-not-stop": ("S10", ""),
    "does-not-move": ("S10", ""),
    "wall-ahead": ("S03", ""),
    "wrong-distance": ("P01", ""),
    "wrong-turn": ("P07", ""),
    "wrong-arc": ("P01", ""),
    "sideways-drift": ("S09", ""),
    "turn-off-centre": ("S09", ""),
    "wrong-speed-limit": ("P01", ""),
    # odometry and time
    "wrong-odometry-frame": ("P02", "K56"),
    "wrong-odometry-pose": ("W02", ""),
    "wrong-odometry-velocity": ("W02", ""),
    "clock-jumps-back": ("P02", ""),
    "wrong-clock-rate": ("W01", "K10"),
    "stopped-clock": ("W01", ""),
    "wrong-stamp": ("W01", ""),
    "stamp-not-advancing": ("W01", "K08"),
    # topics
    "silent-topic": ("N01", ""),
    "wrong-topic": ("P01", ""),
    "namespaced-topic": ("P06", ""),
    "wrong-domain": ("P02", ""),
    "wrong-message-type": ("Q02", ""),
    "duplicate-publisher": ("Q01", "K40"),
    "extra-publisher": ("E14", ""),
    "wrong-durability": ("E07", ""),
    "unreadable-message": ("E05", ""),
    "single-message": ("E04", ""),
    "wrong-header-frame": ("E05", ""),
    # frames
    "no-target-prim": ("R01", "K10"),
    "no-frames-input": ("W01", "K10"),
    "unequal-frame-arrays": ("W01", "K10"),
    "missing-frame": ("T01", ""),
    "self-parent": ("T09", "K51"),
    "several-parents": ("T03", "K50"),
    "several-publishers": ("T04", "K54"),
    "changing-parent": ("E12", ""),
    "frame-cycle": ("T05", "K52"),
    "disconnected-frame": ("T06", "K53"),
    "unknown-frame": ("T11", "K55"),
    "transform-ends": ("Q03", "K57"),
    "transform-gap": ("E11", ""),
    "transform-unlike-odometry": ("W01", ""),
    # sensors
    "no-camera-target": ("R01", "K10"),
    "missing-camera-prim": ("R02", "K14"),
    "empty-image": ("P01", "K75"),
    "no-render-product": ("W01", "K10"),
    "wrong-render-product": ("R04", "K75"),
    "unknown-output": ("P01", "K18"),
    "not-a-camera": ("C03", "K70"),
    "not-a-lidar": ("L03", "K70"),
    "no-lidar-schema": ("L06", "K71"),
    "invalid-scan-profile": ("L09", "K72"),
    "loose-sensor": ("S12", ""),
    "wrong-scan-rate": ("L05", ""),
    "wrong-turn-rate": ("L05", ""),
    "no-ray-returns": ("L09", ""),
    "scan-off-walls": ("L04", ""),
    "image-info-frames-differ": ("P02", "K78"),
    "image-info-sizes-differ": ("P02", "K78"),
    "image-info-rates-differ": ("P04", ""),
    "low-image-rate": ("C07", ""),
    "misplaced-camera-frame": ("T02", ""),
    "camera-not-ahead": ("C05", ""),
    "camera-not-upright": ("C05", ""),
    # localization and navigation
    "map-shifted": ("M07", ""),
    "map-inverted": ("M06", ""),
    "scan-off-map": ("M09", ""),
    "no-localization": ("E11", ""),
    "localization-ends": ("E11", ""),
    "no-goal-sent": ("E16", ""),
    "goal-not-reached": ("E16", ""),
}

_FIRST_OF_ROBOTS = "K60"  # and those after it; the rules before are about graphs
# Other rules that find them: of a robot that moves otherwise than commanded, those of its wheels.
_OF_WHEELS = (
    *("S06", "S07", "S09", "S10", "S20", "S24", "S25", "S31"),
    *("K62", "K64", "K66", "K82", "K84", "Y01", "Y05"),
)
_WRONG_MOTION: tuple[FaultKind, ...] = (
    *("does-not-move", "moves-uncommanded", "moves-sideways", "wrong-turn", "wrong-arc"),
    *("sideways-drift", "turn-off-centre", "no-wheel-contact", "base-fixed-to-world"),
    *("tips-over", "no-velocity-drive"),
)
_ALSO: Mapping[FaultKind, Sequence[str]] = {
    **dict.fromkeys(_WRONG_MOTION, _OF_WHEELS),
    "wrong-distance": ("P02", *_OF_WHEELS),
    "no-ground": ("Y02", "K96", "S28"),
    "unknown-joint": ("S07", "K82"),
    "no-articulation": ("K82", "S05"),
    "locked-joint": ("K86", *_OF_WHEELS),
    "limited-joint": ("K86",),
    "joint-off-target": ("K86",),
    "no-ray-returns": ("K72",),
    "wrong-domain": ("P01",),
    "duplicate-publisher": ("L07", "N07"),
    "several-parents": ("K59",),
    "several-publishers": ("K59",),
    "image-info-sizes-differ": ("K79",),
    "silent-topic": ("G01",),
    "wrong-stamp": ("P09", "K45", "K46"),
}


def explaining_rule(check: Check) -> str:
    """Return the id of the rule of the lab that explains faults of this kind; '' for no fault."""
    return EXPLAINED_BY[check.kind][0] if check.kind is not None else ""


def explaining_finding(check: Check, findings: Sequence[Finding]) -> Finding | None:
    """Return what the rules found that explains a failed check; None if only it shows that.

    It is of a rule that finds such faults, or an error about a graph or the lab, and stands at the
    prim at fault or at what feeds that. Of such a rule it may name what a node misses, and stand
    anywhere where nothing is known to be at fault, as the node itself is missing. Errors count
    before warnings, then what is near, then such rules. What is wrong with the whole stage comes
    last.
    """
    if check.kind is None:
        return None
    usual = {*EXPLAINED_BY[check.kind], *_ALSO.get(check.kind, ())} - {""}
    if _MISSING_WIRE in usual:
        usual.add(_MISSING_NODE)
    is_strict = check.kind in _ELSEWHERE or check.verdict != "bad"
    sites = {prim: number for number, prim in enumerate(check.rests_on)}
    far = 2 * len(sites) + 1
    missed = {*re.findall(r"'([^']+)'", check.cause)}  # names that a node looks for

    def away(finding: Finding) -> int | None:
        """Return how far it is from the fault, None where it does not speak of it."""
        is_usual = finding.rule in usual
        if not is_usual and (is_strict or finding.severity != "error" or _is_of_part(finding)):
            return None
        places = {finding.prim, *(path for path, _ in finding.covers)}
        named = {path.partition(".")[0] for path in finding.related}
        if check.prim in places:
            return 0
        if is_usual and check.prim in named:
            return 1
        if is_usual and missed.intersection(path.rpartition("/")[2] for path in named):
            return 0
        # What is missing or switched off is no part of the scene, but what it stands in is.
        above = (path.rpartition("/")[0] or "/" for path in places)
        near = [sites[place] for place in places if place in sites]
        near += [sites[place] + len(sites) for place in above if place in sites]
        is_anywhere = is_usual and (not check.prim or check.kind in _ELSEWHERE)
        return min(near, default=far if is_anywhere or finding.prim == "/" else None)

    ranked = [
        (
            SEVERITIES.index(finding.severity),
            far == distance,
            finding.rule not in usual,
            distance,
            k,
        )
        for k, finding in enumerate(findings)
        if finding.severity != "note" and (distance := away(finding)) is not None
    ]
    if ranked:
        return findings[min(ranked)[-1]]
    # Where nothing is known to be at fault, the only error there is.
    errors = [each for each in findings if each.severity == "error" and not _is_of_part(each)]
    return errors[0] if len(errors) == 1 and not (check.prim or is_strict) else None


def _is_of_part(finding: Finding) -> bool:
    """Whether a finding of lint is about a body, a joint or a shape: of which, no check tells."""
    if finding.rule[0] not in "KY":
        return False
    if not finding.property:
        return finding.rule >= _FIRST_OF_ROBOTS
    return not finding.property.startswith(("inputs:", "outputs:", "node:", "evaluat", "omni:"))


def rules_named(behaviour: Behaviour, findings: Sequence[Finding]) -> Callable[[Check], str]:
    """Return what names the rule that explains a check, '' where none does.

    `findings` are those about the stage of a dry run. Of a recording it is a rule of the lab, if a
    lab asks something of it.
    """
    if behaviour.recording:
        return explaining_rule if behaviour.checkpoint else lambda _: ""

    def rule_found(check: Check) -> str:
        finding = explaining_finding(check, findings) if check.verdict != "ok" else None
        return finding.rule if finding is not None else ""

    return rule_found
