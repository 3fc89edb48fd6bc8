"""The behaviour of a stage for a terminal and as JSON in the form of `schema/sim-2.json`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any

from msgspec.structs import asdict

from lab3_usd.check.explanations import rules_named
from lab3_usd.data import program
from lab3_usd.model.dry_run import Behaviour, Check, Leg, Topic
from lab3_usd.model.finding import Finding
from lab3_usd.model.occupancy import MapFit
from lab3_usd.report.entries import plural
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.safe_text import folded, json_text, paint, printable, truncated_values

WHAT_IT_IS = "a dry run from published node source, not Isaac Sim"
WHAT_A_RECORDING_IS = "a recording of the running system"
ONLY_SHOWN = "no rule finds it: only the dry run shows it"
PASSED = {
    "graphs": "every graph can run, and every wire joins existing ports",
    "topics": "every topic is received, of its type, from one node, in the lab's domain",
    "rest": "stands still before and after commands, and when commanded sideways",
    "follows": "follows commands in direction and size",
    "limits": "commands beyond the limits are cut down to them",
    "odometry": "odometry starts at 0 and agrees with the motion",
    "clock": "the clock runs at the speed of the simulation",
    "stamps": "all stamps agree with the clock",
    "tree": "TF is one tree, with one parent and one publisher for each frame",
    "moving frames": "TF moves the base as odometry does",
    "mounted": "lidar and camera move with the robot",
    "scan": "scans come at their rate and show what stands around the lidar",
    "map": "the scan agrees with the walls of the map",
    "camera": "image and info belong together, in the frame of a camera that looks where it should",
    "again": "drives again after Stop and Play, with any ROS_DOMAIN_ID",
}
PASSED_BY_JOINTS = {
    "joints": "each joint moves as commanded",
    "links": "TF agrees with the links",
    "joint states": "joint states agree with the joints",
    "again": "drives again after Stop and Play",
}
PASSED_IN_ANY_STAGE = {
    **PASSED,
    "topics": "every enabled publisher sends",
    "clock": "the clock runs",
    "stamps": "stamps advance",
    "rest": "stands still before and after commands",
    "moving frames": "TF moves the base as the robot moves",
    "mounted": "each sensor has a frame of its own that moves with the robot",
    "camera": "each image and its camera info belong together",
    "scan": "scans show the walls where TF has the lidar",
    **PASSED_BY_JOINTS,
}
_SCANS = ("sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2")
_BELOW = "below the top of a robot's tree"
PASSED_BY_TREES = {"tree": f"each frame has one parent and one publisher, {_BELOW}"}
_RECORDED_TREES = {"tree": f"each frame has one parent, {_BELOW}"}
PASSED_IN_A_RECORDING = {
    **PASSED,
    "topics": "every topic is received, of its type",
    "odometry": "the speeds of odometry agree with its path",
    "tree": "TF is one tree, with one parent for each frame",
    "scan": "scans come at their rate, and rays come back",
    "camera": "image and info belong together, in one frame",
    "map": "the scan roughly agrees with the walls of the map",
    "messages": "every message has the type of its topic",
    "QoS": "each topic is offered with the required QoS",
    "rates": "streams continue, with advancing stamps",
    "headers": "the headers name the required frames",
    "frames": "each frame keeps its parent, and its transforms come without gaps",
    "way": "in total, the robot goes as far as commanded",
    "joints": "each joint is where it is commanded to",
    "localization": "localization connects the map to odometry",
    "goal": "the last goal was reached",
}


PASSED_IN_ANY_RECORDING = {
    **PASSED_IN_A_RECORDING,
    "rates": "stamps advance",
    "clock": "the clock runs",
    "rest": "stands still before and after commands",
    "follows": "goes ahead and back as commanded, and turns to the side that it is commanded to",
    "moving frames": "TF moves the base as odometry does",
    "scan": "rays come back",
}


def passed_texts(behaviour: Behaviour) -> Mapping[str, str]:
    """Return the text of each check, for when it passes."""
    if not behaviour.checkpoint:
        return PASSED_IN_ANY_RECORDING if behaviour.recording else PASSED_IN_ANY_STAGE
    children = {frame.child for frame in behaviour.frames}
    has_trees = len({frame.parent for frame in behaviour.frames} - children) > 1
    if behaviour.recording:
        return PASSED_IN_A_RECORDING | (_RECORDED_TREES if has_trees else {})
    texts = PASSED | PASSED_BY_JOINTS if behaviour.robots else PASSED
    if all(topic.type not in _SCANS for topic in behaviour.topics):
        texts = texts | {"mounted": "the camera moves with the robot"}
    return texts | (PASSED_BY_TREES if has_trees else {})


def rate(hz: float) -> str:
    """Return a rate in messages a second; what comes once has none."""
    return f"{hz:.1f}".removesuffix(".0") + " Hz" if hz else "once"


def leg_text(leg: Leg) -> str:
    """Return what was commanded and driven in one leg."""
    parts = []
    if leg.commanded[0]:
        parts.append(f"{leg.driven[0]:+.2f} m of {leg.commanded[0]:+.2f}")
    if leg.commanded[1]:
        parts.append(f"{leg.driven[1]:+.0f} degrees of {leg.commanded[1]:+.0f}")
    return f"{leg.name} {' and '.join(parts) or f'{leg.driven[0]:.2f} m'}"


def sum_text(behaviour: Behaviour) -> str:
    """Return how the checks came out."""
    verdicts = [check.verdict for check in behaviour.checks]
    bad, unsure = verdicts.count("bad"), verdicts.count("not judged")
    counts = f"{plural(len(verdicts), 'check')}: {verdicts.count('ok')} ok, {bad} bad"
    return f"{counts}, {unsure} not judged" if unsure else counts


_COLOURS = {"ok": "met", "bad": "error", "not judged": "warning"}
_SHORT = {"ok": "ok", "bad": "bad", "not judged": "?"}
_NAME = 15


def render(
    behaviour: Behaviour, width: int, findings: Sequence[Finding] = (), *, color: bool
) -> str:
    """Return the behaviour as text; `findings` are what the rules say of the stage."""
    what = WHAT_A_RECORDING_IS if behaviour.recording else WHAT_IT_IS
    name = printable(behaviour.recording or behaviour.stage)
    lines = [f"{paint(name, 'heading', color=color)}: {what}"]
    if behaviour.verdict == "unreadable":
        lines += [f"  {printable(unknown.reason)}" for unknown in behaviour.not_simulated]
        return "\n".join(lines) + "\n"
    if behaviour.is_early:
        lines += folded(printable(behaviour.missing), width)
        return "\n".join(lines) + "\n"
    lines += ["", *_topics(behaviour, width), ""]
    passed, rule_of = passed_texts(behaviour), rules_named(behaviour, findings)
    for check in behaviour.checks:
        of_run = not behaviour.recording
        lines += _check(check, passed, rule_of(check), width, color=color, of_run=of_run)
    legs = "; ".join(map(leg_text, behaviour.legs)) or (
        "joints received commands" if behaviour.robots else "no command was sent"
    )
    motion = "test drive" if behaviour.legs and not behaviour.recording else "run"
    drive = f"{motion}: {behaviour.seconds:.1f} s"
    is_any = behaviour.recording and not behaviour.checkpoint
    drive += f"; {legs}" if behaviour.legs or not is_any else ""
    remarks = (*behaviour.sizes, drive, *map(printable, _remarks(behaviour)))
    for robot in behaviour.robots:
        heard = f"{robot.prim}: commands on {robot.topic} in domain {robot.domain}"
        remarks = (*remarks, printable(heard))
    lines += [""] if behaviour.checks else []
    for remark in remarks:
        lines += folded(remark, width, rest="  ")
    lines.append(sum_text(behaviour))
    if behaviour.missing:
        lines += folded(f"not judged: {printable(behaviour.missing)}", width)
    unplayed = errors_unplayed(behaviour, findings)
    lines += folded(unplayed, width, rest="  ") if unplayed else []
    return "\n".join(lines) + "\n"


def errors_unplayed(behaviour: Behaviour, findings: Sequence[Finding]) -> str:
    """Say which errors of the rules no check of a dry run shows, '' where there are none."""
    rule_of = rules_named(behaviour, findings)
    shown = {rule_of(check) for check in behaviour.checks}
    errors = [each.rule for each in findings if each.severity == "error" and each.rule not in shown]
    if not errors:
        return ""
    command = "check" if behaviour.checkpoint else "lint"
    count = f"{len(errors)} error{'s' if errors[1:] else ''}"
    named = ", ".join(sorted({*errors}))
    return f"{program()} {command} has {count} that no check here shows: {named}"


def _topics(behaviour: Behaviour, width: int) -> Iterator[str]:
    """Yield the lines of the table; of each row, the columns that do not fit stand below it."""
    rows: list[tuple[str, ...]] = [("topic", "type", "rate", "frame")]
    rows += [(topic.name, topic.type, rate(topic.hz), topic.frame) for topic in behaviour.topics]
    if len({topic.domain for topic in behaviour.topics}) > 1:
        domains = ("domain", *(str(topic.domain) for topic in behaviour.topics))
        rows = [(*row, domain) for row, domain in zip(rows, domains, strict=True)]
    if behaviour.recording:
        offers = [("arrival", "QoS"), *map(_offer, behaviour.topics)]
        rows = [(*row, *offer) for row, offer in zip(rows, offers, strict=True)]
    rows = [tuple(map(printable, row)) for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    fitting = max(sum(end <= width + 2 for end in accumulate(wide + 2 for wide in widths)), 1)
    for row in rows:
        cells = (cell.ljust(wide) for cell, wide in zip(row, widths[:fitting], strict=False))
        yield "  ".join(cells).rstrip()
        below = [*zip(rows[0], row, strict=True)][fitting:]
        named = (cell if cell == name else f"{name} {cell}" for name, cell in below if cell)
        yield from folded("; ".join(named), width, "    ", "      ")
    if not behaviour.topics:
        yield "nothing is published"


def _offer(topic: Topic) -> tuple[str, str]:
    """Return at what rate a topic arrived, and how it was offered."""
    counted = Counter(topic.qos)
    qos = (
        f"{number} x {profile}" if number > 1 else profile for profile, number in counted.items()
    )
    return rate(topic.arrival_hz or 0.0), "; ".join(qos)


def _check(
    check: Check, passed: Mapping[str, str], rule: str, width: int, *, color: bool, of_run: bool
) -> Iterator[str]:
    mark = paint(_SHORT[check.verdict].ljust(4), _COLOURS[check.verdict], color=color)
    text = passed[check.name] if check.verdict == "ok" else printable(check.message)
    text = f"{printable(check.of)}: {text}" if check.of else text
    first, *more = folded(text, max(width - _NAME - 4, 30)) or [""]
    yield f"{mark}{check.name.ljust(_NAME)}{first}"
    lead = " " * (_NAME + 4)
    yield from (lead + line for line in more)
    if check.verdict == "bad" or (check.verdict != "ok" and (check.prim or rule)):
        see = f"({program()} rule {rule})" if rule else ""
        if check.verdict == "bad" and not rule and of_run:
            see = f"({ONLY_SHOWN})"
        named = ": ".join(printable(part) for part in (check.prim, check.cause) if part)
        lines = folded(named, max(width, 60), lead, lead)
        if see and lines and len(f"{lines[-1]} {see}") <= width:
            lines[-1] += f" {see}"
        elif see:
            lines.append(lead + see)
        yield from lines


def _remarks(behaviour: Behaviour) -> Iterator[str]:
    yield from behaviour.remarks
    for unknown in behaviour.not_simulated:
        yield f"not simulated: {unknown.prim}: {unknown.reason}"
    if behaviour.differences is not None:
        for difference in behaviour.differences:
            yield f"unlike the dry run: {difference.name} {difference.message}"
        if not behaviour.differences:
            yield "topics and frames are those of the dry run"


VERSION = 2


def render_json(behaviour: Behaviour, findings: Sequence[Finding] = ()) -> str:
    """Return the behaviour as JSON text in ASCII, with what the rules find in its stage."""
    return json_text(truncated_values(behaviour_json(behaviour, findings)), 1)


def behaviour_json(behaviour: Behaviour, findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the behaviour as plain data, keys in the order of the schema."""
    rule_of = rules_named(behaviour, findings)
    document = {
        "version": VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        **(
            {"recording": behaviour.recording}
            if behaviour.recording
            else {"stage": behaviour.stage}
        ),
        "seconds": round(behaviour.seconds, 3),
        "verdict": behaviour.verdict,
        "missing": behaviour.missing,
        "topics": [_topic_json(topic) for topic in behaviour.topics],
        "frames": [asdict(frame) for frame in behaviour.frames],
        "checks": [
            {
                "name": check.name,
                "verdict": check.verdict,
                "prim": check.prim,
                "message": check.text,
                "of": check.of,
                "rule": rule_of(check),
            }
            for check in behaviour.checks
        ],
        "robots": [asdict(robot) for robot in behaviour.robots],
        "path": [list(row) for row in behaviour.path],
        "not_simulated": [asdict(unknown) for unknown in behaviour.not_simulated],
    }
    if behaviour.fit is not None:
        document["map"] = _fit_json(behaviour.fit)
    if behaviour.differences is not None:
        document["differences"] = [asdict(difference) for difference in behaviour.differences]
    return document


def _fit_json(fit: MapFit) -> dict[str, Any]:
    """Return how the scans lie on the map; a shift is looked for where they do not."""
    shift = None if fit.shift is None else [round(metres, 3) for metres in fit.shift]
    return {
        "name": fit.map.name,
        "points": fit.count,
        "near": round(fit.near, 4),
        "through": round(fit.through, 4),
        "shift": shift,
        "shifted": None if shift is None else round(fit.shifted, 4),
    }


def _topic_json(topic: Topic) -> dict[str, Any]:
    """Return a topic; only a recording has a rate of arrival and QoS."""
    fields = asdict(topic)
    arrival, qos, domain = (fields.pop(name) for name in ("arrival_hz", "qos", "domain"))
    if domain is not None:
        fields["domain"] = domain
    return fields if arrival is None else {**fields, "arrival_hz": arrival, "qos": list(qos)}
