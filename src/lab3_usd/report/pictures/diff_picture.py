"""Pictures of two versions of a graph: removed, changed and added parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.changes import ChangeKind, StageChange
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import Node
from lab3_usd.report.picture.canvas import on_canvas, position_missing
from lab3_usd.report.picture.model import Box, Curve, End, Picture, Row, State, clip_end, sized
from lab3_usd.report.pictures.graph_picture import MOST_LETTERS, laid_out, outside_boxes
from lab3_usd.report.pictures.node_boxes import (
    MOST_LABEL,
    BoxSubject,
    SiteFindings,
    findings_by_site,
    node_box,
    wire_ends,
    wires_into,
)

NodePair = tuple[Node | None, Node | None]
Wires = dict[tuple[End, End], bool]
STATE_OF: Mapping[ChangeKind, State] = {"added": "extra", "removed": "missing", "changed": "wrong"}
_ON_ROWS = ("value", "target")


class GraphVersions(Struct, frozen=True):
    """A graph before and after: its nodes in pairs, None where one is in one version only.

    `path` says where a prim of the first version is in the second.
    """

    name: str
    path: str
    nodes: tuple[NodePair, ...]
    moved: Callable[[str], str]


def diff_picture(graph: GraphVersions, changes: Sequence[StageChange]) -> Picture:
    """Return the second version of the graph, with removed, changed and added parts marked."""
    keys = dict(_keys(graph))
    curves = tuple(_curves(graph, keys))
    on_rows = [change for change in changes if change.part in _ON_ROWS]
    # Boxes know how to mark faults: values and targets that are not as before are passed as such.
    findings = findings_by_site(
        Finding(
            rule="",
            name="",
            severity="error",
            prim=change.path,
            message=f"{change.property} was {change.was}, is {change.now}",
            property=change.property,
        )
        for change in on_rows
        if change.edit == "changed"
    )
    old_values = {(change.path, change.property): change.was for change in on_rows}
    touched = {
        change.path for change in changes if change.part == "node" and change.edit == "changed"
    }
    boxes = [
        _with_old_values(_box(pair, key, curves, findings, touched), old_values)
        for key, pair in keys.items()
    ]
    boxes += outside_boxes(None, boxes, curves)
    old_positions = {
        key: before.position
        for key, (before, _) in keys.items()
        if before is not None and before.position is not None
    }
    present = frozenset(key for key, (_, after) in keys.items() if after is not None)
    boxes = list(position_missing(boxes, curves, old_positions, present or frozenset(keys)))
    subtitle = _counts_text(graph.path, boxes, curves)
    name = clip_end(graph.name, MOST_LETTERS)
    drawn = laid_out(tuple(boxes), curves)
    return on_canvas(Picture(name, subtitle, *drawn, path=graph.path, judged=True, kind="diff"))


def _keys(graph: GraphVersions) -> Iterator[tuple[str, NodePair]]:
    """Yield each pair with the key of its box: where the node is now, or would be."""
    present = {after.path for _, after in graph.nodes if after is not None}
    for before, after in graph.nodes:
        if after is not None:
            yield after.path, (before, after)
        elif before is not None:
            key = graph.moved(before.path)
            yield (f"{key}_removed" if key in present else key), (before, None)


def _box(
    pair: NodePair, key: str, curves: Sequence[Curve], findings: SiteFindings, touched: set[str]
) -> Box:
    before, after = pair
    arriving, leaving = wire_ends(curves)
    subject = BoxSubject(
        key,
        None,
        after or before,
        arriving.get(key, {}),
        leaving.get(key, {}),
        findings,
    )
    edit: ChangeKind | None = None
    if before is None or after is None:
        edit = "added" if before is None else "removed"
    elif key in touched:
        edit = "changed"
    box = node_box(subject, "ok" if edit is None else STATE_OF[edit])
    name = key.rpartition("/")[2]
    return box if edit is None else replace(box, subtitle=f"{name} · {edit}")


def _with_old_values(box: Box, old_values: Mapping[tuple[str, str], str]) -> Box:
    def with_old_value(row: Row) -> Row:
        old = old_values.get((box.key, row.port))
        if not old or row.state == "ok":
            return row
        return replace(row, value=(*row.value, clip_end(f"was {old}", MOST_LABEL)))

    return sized(replace(box, settings=tuple(map(with_old_value, box.settings))))


def _curves(graph: GraphVersions, keys: Mapping[str, NodePair]) -> Iterator[Curve]:
    old_keys = {before.path: key for key, (before, _) in keys.items() if before is not None}
    old = _wires((pair[0] for pair in graph.nodes), lambda p: old_keys.get(p, graph.moved(p)))
    new = _wires((pair[1] for pair in graph.nodes), lambda path: path)
    for (source, target), is_execution in (old | new).items():
        state: State = "ok"
        if (source, target) not in new:
            state = "missing"
        elif (source, target) not in old:
            state = "extra"
        yield Curve(source, target, is_execution, state)


def _wires(nodes: Iterable[Node | None], key: Callable[[str], str]) -> Wires:
    """Return the ends of each wire, and whether it carries execution."""
    return {
        (End(key(source.key), source.port), End(key(target.key), target.port)): is_execution
        for source, target, is_execution in wires_into(filter(None, nodes))
    }


def _counts_text(path: str, boxes: Sequence[Box], curves: Sequence[Curve]) -> str:
    states = Counter([box.state for box in boxes] + [curve.state for curve in curves])
    states.update(row.state for box in boxes if box.state == "ok" for row in box.settings)
    parts = [f"{states[state]} {edit}" for edit, state in STATE_OF.items() if states[state]]
    return "  ·  ".join([clip_end(path, MOST_LETTERS), *(parts or ["no changes"])])
