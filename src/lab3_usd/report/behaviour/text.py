"""The behaviour of a stage for a terminal: topics, checks, the drive."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from lab3_usd.model.dry_run.behaviour import Behaviour, Check, Topic
from lab3_usd.report.behaviour.words import (
    LOOKS,
    LOOKS_OF_A_RECORDING,
    WHAT_A_RECORDING_IS,
    WHAT_IT_IS,
    leg_text,
    rate,
    sum_text,
)
from lab3_usd.report.safe_text import printable
from lab3_usd.report.text.ansi import paint

_COLOURS = {"ok": "met", "bad": "error", "not-simulated": "warning"}
_SHORT = {"ok": "ok", "bad": "bad", "not-simulated": "?"}
_NAME = 15


def render(found: Behaviour, width: int, *, color: bool) -> str:
    """Return the behaviour as text."""
    what = WHAT_A_RECORDING_IS if found.recording else WHAT_IT_IS
    name = printable(found.recording or found.stage)
    lines = [f"{paint(name, 'heading', color=color)}: {what}"]
    if found.verdict == "unreadable":
        lines += [f"  {printable(each.reason)}" for each in found.not_simulated]
        return "\n".join(lines) + "\n"
    lines += ["", *_topics(found), ""]
    looks = LOOKS_OF_A_RECORDING if found.recording else LOOKS
    for check in found.checks:
        lines += _check(check, looks, width, color=color)
    lines += ["", *_drive(found, width), *_others(found, width), sum_text(found)]
    return "\n".join(lines) + "\n"


def _topics(found: Behaviour) -> Iterator[str]:
    rows: list[tuple[str, ...]] = [("topic", "type", "rate", "frame")]
    rows += [(each.name, each.type, rate(each.hz), each.frame) for each in found.topics]
    if found.recording:
        more = [("arrival", "QoS"), *(_as_offered(each) for each in found.topics)]
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
    if check.verdict != "ok" and (check.prim or check.rule):
        see = f" (lab3 rule {check.rule})" if check.rule else ""
        named = ": ".join(printable(each) for each in (check.prim, check.cause) if each)
        yield f"{lead}{named}{see}".rstrip()


def _drive(found: Behaviour, width: int) -> Iterator[str]:
    said = "; ".join(map(leg_text, found.legs)) or "no command is asked for"
    text = f"drive: {found.seconds:.1f} s; {said}"
    yield from textwrap.wrap(text, max(width, 40), subsequent_indent="  ")


def _others(found: Behaviour, width: int) -> Iterator[str]:
    said = [f"not simulated: {each.prim}: {each.reason}" for each in found.not_simulated]
    if found.differences is not None:
        said += [f"unlike the dry run: {each.name} {each.message}" for each in found.differences]
        said += [] if found.differences else ["topics and frames are those of the dry run"]
    for each in (*found.remarks, *said):
        yield from textwrap.wrap(printable(each), max(width, 40), subsequent_indent="  ")
