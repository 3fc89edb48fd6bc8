"""The TF tree of a stage as text for people, as dot for drawing and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct, field
from msgspec.structs import asdict

from lab3_usd.check.tf.frames import Edge, frames_in_cycles
from lab3_usd.check.tf.targets import UnresolvedFrames
from lab3_usd.report.safe_text import dot_string, printable, truncated_values

_MARK = "  ! "


class TreeReport(Struct, frozen=True):
    """What a stage publishes: its transforms, and the nodes whose transforms are unknown.

    `reserved` are the frames that only something outside the stage may place, with its name, and
    `hidden` those that only an asset could tell which cannot be found.
    """

    path: str
    edges: tuple[Edge, ...]
    unknown: tuple[str, ...] = ()
    reserved: Mapping[str, str] = field(default_factory=dict)
    hidden: tuple[UnresolvedFrames, ...] = ()


class TreeFault(Struct, frozen=True):
    """Something that tf2 cannot make a tree of, at one frame."""

    frame: str
    kind: str
    message: str


def tree_faults(report: TreeReport) -> list[TreeFault]:
    """Return what is wrong with the tree, in the order of the frames."""
    faults = []
    ring = set(frames_in_cycles(report.edges))
    for frame, above in _by_child(report.edges).items():
        names = list(dict.fromkeys(edge.parent for edge in above if edge.parent != frame))
        if frame in report.reserved:
            faults.append(
                TreeFault(frame, "reserved", f"only {report.reserved[frame]} may place it")
            )
        if len(names) > 1:
            faults.append(
                TreeFault(frame, "two parents", f"{len(names)} parents: {', '.join(names)}")
            )
        for name in names:
            times = len({edge.publisher for edge in above if edge.parent == name})
            if times > 1:
                faults.append(
                    TreeFault(frame, "published twice", f"{times} publishers below {name}")
                )
        if any(edge.parent == frame for edge in above):
            faults.append(TreeFault(frame, "own parent", "its own parent"))
        elif frame in ring:
            faults.append(TreeFault(frame, "ring", "part of a ring"))
    return faults


def roots(edges: Sequence[Edge]) -> list[str]:
    """Return the frames below no other, then one frame of every ring that hangs below none."""
    children = _by_parent(edges)
    placed = _by_child(edges)
    tops = [name for name in children if name not in placed]
    reached: set[str] = set()
    for top in [*tops, *children]:
        if top not in reached and top not in tops:
            tops.append(top)
        ahead = [top]
        while ahead:
            name = ahead.pop()
            if name not in reached:
                reached.add(name)
                ahead.extend(edge.child for edge in children.get(name, ()))
    return tops


def _by_child(edges: Sequence[Edge]) -> dict[str, list[Edge]]:
    edges_by_child: dict[str, list[Edge]] = {}
    for edge in edges:
        edges_by_child.setdefault(edge.child, []).append(edge)
    return edges_by_child


def _by_parent(edges: Sequence[Edge]) -> dict[str, list[Edge]]:
    edges_by_parent: dict[str, list[Edge]] = {}
    for edge in edges:
        edges_by_parent.setdefault(edge.parent, []).append(edge)
    return edges_by_parent


def as_text(report: TreeReport, *, verbose: bool = False) -> Iterator[str]:
    """Yield the lines of the tree; `verbose` names the publisher of each transform.

    A frame with two parents stands below both, its own children below the first; what tf2 cannot
    take is marked with `!`, what cannot be known with `?`. Unknown frames may join the roots.
    """
    if not report.edges and not report.unknown and not report.hidden:
        yield "no transforms are published"
    tops = roots(report.edges)
    drawn: set[str] = set()
    for top in tops:
        yield printable(top)
        yield from _branches(top, report, drawn, verbose=verbose)
    if len(tops) > 1 and not report.hidden:
        yield f"! {len(tops)} roots, where there must be one: {', '.join(map(printable, tops))}"
    for path in report.unknown:
        yield f"! {printable(path)} publishes frames that the stage does not tell"
    for hidden in report.hidden:
        by = f"  <- {printable(hidden.publisher)} ({hidden.topic})" if verbose else ""
        yield f"? {printable(hidden.what)}: asset not found: {printable(hidden.asset)}{by}"


def _branches(top: str, report: TreeReport, drawn: set[str], *, verbose: bool) -> Iterator[str]:
    """Yield the lines below one root; `drawn` are the frames whose children stand already."""
    children = _by_parent(report.edges)
    marks: dict[str, list[str]] = {}
    for fault in tree_faults(report):
        marks.setdefault(fault.frame, []).append(fault.message)
    drawn.add(top)
    ahead = _rows(top, "", children)
    while ahead:
        edge, lead, is_last = ahead.pop()
        line = lead + ("└── " if is_last else "├── ") + printable(edge.child)
        line += "  (static)" if edge.static else ""
        line += "" if edge.sure else "  (perhaps)"
        line += f"  <- {printable(edge.publisher)} ({edge.topic})" if verbose else ""
        yield line + "".join(_MARK + printable(mark) for mark in marks.get(edge.child, ()))
        if edge.child not in drawn:
            drawn.add(edge.child)
            ahead += _rows(edge.child, lead + ("    " if is_last else "│   "), children)


def _rows(parent: str, lead: str, children: dict[str, list[Edge]]) -> list[tuple[Edge, str, bool]]:
    """Return the children of a frame in reverse, to be taken from the end."""
    below = children.get(parent, [])
    return [(edge, lead, edge is below[-1]) for edge in reversed(below)]


def as_dot(report: TreeReport) -> str:
    """Return the tree for Graphviz: each edge is labelled with its publisher, faults are red.

    What cannot be known is grey.
    """
    wrong = {fault.frame for fault in tree_faults(report)}
    frames = dict.fromkeys(name for edge in report.edges for name in (edge.parent, edge.child))
    lines = ["digraph tf {", "  node [shape=box, fontname=sans];", "  edge [fontname=sans];"]
    lines += [f"  {dot_string(name)}{' [color=red]' if name in wrong else ''};" for name in frames]
    for edge in report.edges:
        looks = [f"label={dot_string('/'.join(edge.publisher.split('/')[-2:]))}"]
        looks += [f"tooltip={dot_string(edge.publisher)}"]
        looks += ["color=red"] if edge.child in wrong else []
        looks += ["style=dashed"] if edge.static else [] if edge.sure else ["style=dotted"]
        lines.append(
            f"  {dot_string(edge.parent)} -> {dot_string(edge.child)} [{', '.join(looks)}];"
        )
    for hidden in report.hidden:
        name = dot_string(f"{hidden.what}: asset not found")
        lines.append(f"  {name} [style=dashed, color=gray];")
        lines.append(f"  {dot_string(hidden.parent)} -> {name} [style=dashed, color=gray];")
    return "\n".join([*lines, "}"])


def as_json(report: TreeReport) -> str:
    """Return the transforms, the roots and what is wrong with the shape, as one JSON object."""
    data = {
        "file": report.path,
        "roots": roots(report.edges),
        "transforms": [{**asdict(edge), "domain": edge.domain.number} for edge in report.edges],
        "unknown_publishers": list(report.unknown),
        "unknown_frames": [asdict(hidden) for hidden in report.hidden],
        "problems": [asdict(fault) for fault in tree_faults(report)],
    }
    return json.dumps(truncated_values(data), indent=2)
