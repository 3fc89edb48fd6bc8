"""The TF tree of a stage as text for people and as JSON for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct, field
from msgspec.structs import asdict

from lab3_usd.facts.frame_targets import UnresolvedFrames
from lab3_usd.facts.frames import Edge, HeardTree, trees_of
from lab3_usd.facts.tree import FrameFault, Tree, frame_faults
from lab3_usd.report.safe_text import printable, truncated_values

FAULT = "  ! "  # before what is wrong with a frame


class TreeReport(Struct, frozen=True):
    """What a stage publishes: its transforms, and the nodes whose transforms are unknown.

    `reserved` are the frames that only something outside the stage may place, with its name, and
    `hidden` those that only a missing asset could define. `rates` say how often each publisher
    sends, by its path. `tops` are the frames at the top of the trees of robots.
    """

    path: str
    edges: tuple[Edge, ...]
    unknown: tuple[str, ...] = ()
    reserved: Mapping[str, str] = field(default_factory=dict)
    hidden: tuple[UnresolvedFrames, ...] = ()
    rates: Mapping[str, str] = field(default_factory=dict)
    tops: frozenset[str] = frozenset()

    @property
    def heard(self) -> tuple[HeardTree, ...]:
        """What tf2 makes of the transforms, by domain and topic."""
        return trees_of(self.edges)

    @property
    def roots(self) -> list[str]:
        """The frames at the top of the trees."""
        return [top for heard in self.heard for top in heard.tree.roots]

    @property
    def faults(self) -> list[FrameFault]:
        """What tf2 cannot make a tree of, and the tops of trees that nothing connects."""
        faults: list[FrameFault] = []
        for heard in self.heard:
            islands, main = self.islands(heard)
            faults += frame_faults(heard.tree, self.reserved)
            faults += (
                FrameFault(top, "another tree", f"not connected to {main}")
                for top in dict.fromkeys(islands.values())
            )
        return faults

    def islands(self, heard: HeardTree) -> tuple[dict[str, str], str]:
        """Return frames of trees that nothing connects with the largest, with their tops, and its.

        There are none where frames are unknown, which may connect them.
        """
        islands = {} if self.hidden else heard.tree.islands
        main = next((top for top in heard.tree.roots if top not in islands), "")
        return {frame: top for frame, top in islands.items() if top not in self.tops}, main

    def how(self, publisher: str, topic: str) -> str:
        """Return the publisher of a transform, its topic and its rate, in words."""
        rate = self.rates.get(publisher)
        return f"  <- {printable(publisher)} ({topic}{f', {printable(rate)}' if rate else ''})"


def shown_frame(name: str) -> str:
    """Return a frame as a line shows it: in quotes where white space around it would not show."""
    return printable(name if name == name.strip() else f"'{name}'")


def tree_name(heard: HeardTree, trees: Sequence[HeardTree]) -> str:
    """Return the name of one of several trees: its topic, with its domain if these differ."""
    is_one = len({each.domain for each in trees}) == 1
    return heard.topic if is_one else f"{heard.topic} in domain {heard.domain}"


def as_lines(
    report: TreeReport, width: int = sys.maxsize, *, verbose: bool = False
) -> Iterator[str]:
    """Yield the lines of the tree; `verbose` names publisher and rate of each transform.

    A publisher that does not fit stands below its frame.

    A frame with two parents stands below both, its own children below the first; what tf2 cannot
    take is marked with `!`, what cannot be known with `?`. Unknown frames may join the roots.
    """
    if not report.edges and not report.unknown and not report.hidden:
        yield "no transforms are published"
    trees = report.heard
    for heard in trees:
        if len(trees) > 1:
            yield f"{printable(tree_name(heard, trees))}:"
        drawn: set[str] = set()
        roots = heard.tree.roots
        for top in roots:
            yield shown_frame(top)
            yield from _branches(top, heard.tree, report, drawn, width, verbose=verbose)
        most = max(1, len(report.tops.intersection(roots)))
        if len(roots) > most and not report.hidden:
            tops, right = ", ".join(map(shown_frame, roots)), "one" if most == 1 else most
            yield f"! {len(roots)} roots, where there must be {right}: {tops}"
    for path in report.unknown:
        yield f"! {printable(path)} publishes frames that the stage does not define"
    for hidden in report.hidden:
        by = report.how(hidden.publisher, hidden.topic) if verbose else ""
        yield f"? {printable(hidden.what)}: asset not found: {printable(hidden.asset)}{by}"


def _branches(
    top: str, heard: Tree[Edge], report: TreeReport, drawn: set[str], width: int, *, verbose: bool
) -> Iterator[str]:
    """Yield the lines below one root; `drawn` are the frames whose children stand already."""
    children = heard.by_parent
    marks: dict[str, list[str]] = {}
    for fault in frame_faults(heard, report.reserved):
        marks.setdefault(fault.frame, []).append(fault.message)
    drawn.add(top)
    ahead = _rows(top, "", children)
    while ahead:
        edge, lead, is_last = ahead.pop()
        line = lead + ("└── " if is_last else "├── ") + shown_frame(edge.child)
        line += "  (static)" if edge.static else ""
        line += "" if edge.sure else "  (perhaps)"
        how = report.how(edge.publisher, edge.topic) if verbose else ""
        ending = "".join(FAULT + printable(mark) for mark in marks.get(edge.child, ()))
        if len(line + how + ending) <= width:
            yield line + how + ending
        else:
            yield line + ending
            yield lead + ("    " if is_last else "│   ") + how
        if edge.child not in drawn:
            drawn.add(edge.child)
            ahead += _rows(edge.child, lead + ("    " if is_last else "│   "), children)


def _rows(parent: str, lead: str, children: dict[str, list[Edge]]) -> list[tuple[Edge, str, bool]]:
    """Return the children of a frame in reverse, to be taken from the end."""
    below = children.get(parent, [])
    return [(edge, lead, edge is below[-1]) for edge in reversed(below)]


def tree_json(report: TreeReport) -> str:
    """Return the transforms, the roots and what is wrong with the shape, as one JSON object."""
    data = {
        "file": report.path,
        "roots": report.roots,
        "trees": [
            {"domain": heard.number, "topic": heard.topic, "roots": heard.tree.roots}
            for heard in report.heard
        ],
        "transforms": [
            {
                **asdict(edge),
                "domain": edge.domain.number,
                "rate": report.rates.get(edge.publisher),
            }
            for edge in report.edges
        ],
        "unknown_publishers": list(report.unknown),
        "unknown_frames": [asdict(hidden) for hidden in report.hidden],
        "problems": [asdict(fault) for fault in report.faults],
    }
    return json.dumps(truncated_values(data), indent=2)
