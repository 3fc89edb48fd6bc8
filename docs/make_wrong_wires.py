"""Writes `what-a-wrong-wire-does.md`: what dry runs show of single faults.

Run `python docs/make_wrong_wires.py` after graphs or the dry run have changed: it drives each.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from two_judges import Verdicts, all_faults, known_rows, verdicts

MOST = 2  # of the things that go wrong are told
PAGE = Path(__file__).with_name("what-a-wrong-wire-does.md")
INTRODUCTION = """\
# What a wrong wire does to the robot

<!-- Written by docs/make_wrong_wires.py from dry runs and tests/disagreements.yaml. -->

Each stage here is the correct one of checkpoint 05 with a single fault. A dry run, made from the
published source of Isaac Sim's nodes and not from the handout, drove it: stand, 0.3 m ahead, back,
90 degrees left, faster than allowed, Stop, Play, and once more with `ROS_DOMAIN_ID=7`. Nothing was
run in Isaac Sim itself. The dry run knows no forces, no pixels, and no loss on the network.
"""
WIRES = """\
## A wire is missing

| Graph | Wire | What the robot does |
|---|---|---|"""
VALUES = """\
## A value is wrong

Texts have `_x` at their end, numbers are larger by one, switches are the other way round.

| Graph | Input | What the robot does |
|---|---|---|"""
KNOWN = """\
## Where the robot does not mind

The rules find each of these, and the robot of the dry run drives all the same. `make crosscheck`
makes every single fault and fails where this table is not true.

| Fault | What happens | Why it is a fault |
|---|---|---|"""


def page(found: Sequence[Verdicts]) -> str:
    """Return the whole page."""
    tables = (
        [WIRES, *_told(found, " cut", ": ")],
        [VALUES, *_told(found, " wrong", "/")],
        [KNOWN, *(f"| {row.title} | {row.happens} | {row.reason} |" for row in known_rows())],
    )
    return "\n".join([INTRODUCTION, *("\n".join(table) + "\n" for table in tables)])


def _told(found: Sequence[Verdicts], end: str, mark: str) -> Iterator[str]:
    for each in found:
        graph, _, what = each.fault.partition(mark)
        if what and graph.startswith("ROS_") and each.fault.endswith(end):
            row = next((row for row in known_rows() if row.holds(each.fault)), None)
            text = row.happens if row is not None else "; ".join(each.says.split("; ")[:MOST])
            yield f"| {graph} | `{what.removesuffix(end)}` | {text} |"


def is_shown(fault: str) -> bool:
    """Whether a row of the first two tables is about this fault."""
    return fault.startswith("ROS_") and fault.endswith((" cut", " wrong"))


def main() -> None:
    """Drive every stage of the page and write it."""
    found = [verdicts(fault) for fault in all_faults() if is_shown(fault.name)]
    PAGE.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
