"""The behaviour of a stage for a terminal and as JSON in the form of `schema/sim-1.json`."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from msgspec.structs import asdict

from lab3_usd.check.explanations import explaining_rule
from lab3_usd.model.dry_run import Behaviour, Check, Leg, Topic
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.safe_text import paint, printable, truncated_values

WHAT_IT_IS = "a dry run from published node source, not Isaac Sim"
WHAT_A_RECORDING_IS = "a recording of the running system"
LOOKS = {
    "topics": "every topic comes, of its type, from one node, in the lab's domain",
    "rest": "stands still without a command, after one, and when told to go sideways",
    "follows": "follows commands in sense and size",
    "limits": "commands beyond the limits are cut down to them",
    "odometry": "odometry starts at 0 and agrees with the motion",
    "clock": "the clock runs, and never back",
    "stamps": "all stamps are of the clock",
    "tree": "TF is one tree, with one parent and one publisher for each frame",
    "moving frames": "TF moves the base as odometry does",
    "mounted": "lidar and camera go with the robot",
    "scan": "scans come at their rate and show the walls where they are",
    "camera": "image and info belong together, in the frame of an upright camera that looks ahead",
    "again": "drives again after Stop and Play, whatever ROS_DOMAIN_ID says",
}


LOOKS_OF_A_RECORDING = {
    **LOOKS,
    "topics": "every topic comes, of its type",
    "odometry": "the speeds of odometry are those of its way",
    "tree": "TF is one tree, with one parent for each frame",
    "scan": "scans come at their rate, and rays come back",
    "messages": "every message is of the type that its topic says",
    "QoS": "each topic is offered as it is asked for",
    "rates": "what is to stream streams, and its stamps go on",
    "headers": "the headers name the frames that are asked for",
    "frames": "each frame keeps its parent, and its transforms come without gaps",
    "way": "all in all the robot goes as far as it is told",
    "localization": "localization ties the map to odometry",
    "goal": "the last goal was reached",
}


def rate(hz: float) -> str:
    """Return a rate in messages a second; what comes once has none."""
    return f"{hz:.1f}".removesuffix(".0") + " Hz" if hz else "once"


def leg_text(leg: Leg) -> str:
    """Return what was told and done in one leg."""
    parts = []
    if leg.told[0]:
        parts.append(f"{leg.done[0]:+.2f} m of {leg.told[0]:+.2f}")
    if leg.told[1]:
        parts.append(f"{leg.done[1]:+.0f} degrees of {leg.told[1]:+.0f}")
    return f"{leg.name} {' and '.join(parts) or f'{leg.done[0]:.2f} m'}"


def sum_text(found: Behaviour) -> str:
    """Return how the checks came out."""
    verdicts = [check.verdict for check in found.checks]
    bad, unsure = verdicts.count("bad"), verdicts.count("not-simulated")
    said = f"{len(verdicts)} checks: {verdicts.count('ok')} ok, {bad} bad"
    return f"{said}, {unsure} not simulated" if unsure else said


_COLOURS = {"ok": "met", "bad": "error", "not-simulated": "warning"}
_SHORT = {"ok": "ok", "bad": "bad", "not-simulated": "?"}
_NAME = 15


def render(found: Behaviour, width: int, *, color: bool) -> str:
    """Return the behaviour as text."""
    what = WHAT_A_RECORDING_IS if found.recording else WHAT_IT_IS
    name = printable(found.recording or found.stage)
    lines = [f"{paint(name, 'heading', color=color)}: {what}"]
    if found.verdict == "unreadable":
        lines += [f"  {printable(unknown.reason)}" for unknown in found.not_simulated]
        return "\n".join(lines) + "\n"
    lines += ["", *_topics(found), ""]
    looks = LOOKS_OF_A_RECORDING if found.recording else LOOKS
    for check in found.checks:
        lines += _check(check, looks, width, color=color)
    lines += ["", *_drive(found, width), *_others(found, width), sum_text(found)]
    return "\n".join(lines) + "\n"


def _topics(found: Behaviour) -> Iterator[str]:
    rows: list[tuple[str, ...]] = [("topic", "type", "rate", "frame")]
    rows += [(topic.name, topic.type, rate(topic.hz), topic.frame) for topic in found.topics]
    if found.recording:
        more = [("arrival", "QoS"), *(_as_offered(topic) for topic in found.topics)]
        rows = [(*row, *cells) for row, cells in zip(rows, more, strict=True)]
    yield from _table([tuple(map(printable, row)) for row in rows])
    if not found.topics:
        yield "nothing is published"


def _as_offered(topic: Topic) -> tuple[str, str]:
    """Return at what rate a topic arrived, and how it was offered."""
    counted = Counter(topic.qos)
    qos = (f"{number} x {said}" if number > 1 else said for said, number in counted.items())
    return rate(topic.arrival_hz or 0.0), "; ".join(qos)


def _table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(wide) for cell, wide in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()


def _check(check: Check, looks: Mapping[str, str], width: int, *, color: bool) -> Iterator[str]:
    mark = paint(_SHORT[check.verdict].ljust(4), _COLOURS[check.verdict], color=color)
    said = looks[check.name] if check.verdict == "ok" else printable(check.message)
    first, *more = textwrap.wrap(said, max(width - _NAME - 4, 30)) or [""]
    yield f"{mark}{check.name.ljust(_NAME)}{first}"
    lead = " " * (_NAME + 4)
    yield from (lead + each for each in more)
    rule = explaining_rule(check)
    if check.verdict != "ok" and (check.prim or rule):
        see = f" (lab3 rule {rule})" if rule else ""
        named = ": ".join(printable(each) for each in (check.prim, check.cause) if each)
        yield f"{lead}{named}{see}".rstrip()


def _drive(found: Behaviour, width: int) -> Iterator[str]:
    said = "; ".join(map(leg_text, found.legs)) or "no command is asked for"
    text = f"drive: {found.seconds:.1f} s; {said}"
    yield from textwrap.wrap(text, max(width, 40), subsequent_indent="  ")


def _others(found: Behaviour, width: int) -> Iterator[str]:
    said = [f"not simulated: {unknown.prim}: {unknown.reason}" for unknown in found.not_simulated]
    if found.differences is not None:
        said += [
            f"unlike the dry run: {difference.name} {difference.message}"
            for difference in found.differences
        ]
        said += [] if found.differences else ["topics and frames are those of the dry run"]
    for remark in (*found.remarks, *said):
        yield from textwrap.wrap(printable(remark), max(width, 40), subsequent_indent="  ")


VERSION = 1


def render_json(found: Behaviour) -> str:
    """Return the behaviour as JSON text in ASCII."""
    return json.dumps(truncated_values(behaviour_json(found)), indent=1) + "\n"


def behaviour_json(found: Behaviour) -> dict[str, Any]:
    """Return the behaviour as plain data, keys in the order of the schema."""
    more = (
        []
        if found.differences is None
        else [asdict(difference) for difference in found.differences]
    )
    return {
        "version": VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        **({"recording": found.recording} if found.recording else {"stage": found.stage}),
        "seconds": round(found.seconds, 3),
        "verdict": found.verdict,
        "topics": [_topic(topic) for topic in found.topics],
        "frames": [asdict(frame) for frame in found.frames],
        "checks": [_check_json(check) for check in found.checks],
        "path": [list(each) for each in found.path],
        "not_simulated": [asdict(unknown) for unknown in found.not_simulated],
        **({} if found.differences is None else {"differences": more}),
    }


def _topic(topic: Topic) -> dict[str, Any]:
    """Return a topic; only a recording has a rate of arrival and QoS."""
    said = asdict(topic)
    arrival, qos = said.pop("arrival_hz"), said.pop("qos")
    return said if arrival is None else {**said, "arrival_hz": arrival, "qos": list(qos)}


def _check_json(check: Check) -> dict[str, str]:
    return {
        "name": check.name,
        "verdict": check.verdict,
        "prim": check.prim,
        "message": check.text,
        "rule": explaining_rule(check),
    }
