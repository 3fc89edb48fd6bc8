"""The boxes of an Action Graph: title, rows and size of each."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lab3_usd.report.layout.box_size import sized
from lab3_usd.report.layout.text_width import clip_end
from lab3_usd.report.picture import Box, Curve, End, Family, Row, State
from lab3_usd.report.pictures.port_rows import BoxSubject, rows, short
from lab3_usd.spec.catalog import NodeType

MOST_TITLE = 44


def ends(curves: Sequence[Curve]) -> tuple[dict[End, State], dict[End, State]]:
    """Return the ports where wires arrive and those where they leave, with their worst state."""
    arriving: dict[End, State] = {}
    leaving: dict[End, State] = {}
    for curve in curves:
        if arriving.get(curve.target, "ok") == "ok":
            arriving[curve.target] = curve.state
        if leaving.get(curve.source, "ok") == "ok":
            leaving[curve.source] = curve.state
    return arriving, leaving


def node_box(subject: BoxSubject, state: State) -> Box:
    """Return the box of a node, sized but not placed."""
    every = [_in_box(row, state) for row in rows(subject)]
    settings = tuple(row for row in every if row.value)
    ports = [row for row in every if not row.value and _is_drawn(row, subject)]
    hidden = len(every) - len(settings) - len(ports)
    box = Box(
        key=subject.key,
        title=clip_end(_title(subject), MOST_TITLE),
        subtitle=_subtitle(subject, state),
        family=family(subject.type),
        inputs=tuple(row for row in ports if row.side != "out"),
        outputs=tuple(row for row in ports if row.side == "out"),
        settings=settings,
        more=f"+ {hidden} more port{'s' * (hidden > 1)}" if hidden else "",
        state=state,
        note=subject.found.note(subject.key),
        at=_position(subject),
    )
    return sized(box)


def _in_box(row: Row, state: State) -> Row:
    """Return the row as it looks in its box: a missing box says for all its rows that it is."""
    return replace(row, state="ok") if state == "missing" else row


def _is_drawn(row: Row, subject: BoxSubject) -> bool:
    return row.wired or row.execution or row.state != "ok" or subject.every_port


def absent_box(key: str, ports: Sequence[str], reason: str, state: State) -> Box:
    """Return the box at the end of wires that come from no node of the graph."""
    outputs = tuple(
        Row(port, clip_end(short(port), MOST_TITLE), "out", wired=True, state=state)
        for port in ports
    )
    return sized(
        Box(
            key=key,
            title=clip_end(key.rpartition("/")[2], MOST_TITLE),
            subtitle=reason,
            family="absent",
            outputs=outputs,
            state=state,
            note=key,
        )
    )


def family(node_type: NodeType | None) -> Family:
    """Return what kind of node it is, which colours its header."""
    if node_type is None:
        return "absent"
    if node_type.role:
        return "ros"
    signals = [port for port in node_type.ports.values() if port.is_execution]
    if not signals:
        return "data"
    return "action" if any(not port.is_source for port in signals) else "event"


def _title(subject: BoxSubject) -> str:
    if subject.type is not None:
        return subject.type.ui_name
    return (
        ""
        if subject.node is None
        else subject.node.type_name.rpartition(".")[2] or "node without a type"
    )


def _subtitle(subject: BoxSubject, state: State) -> str:
    name = clip_end(subject.key.rpartition("/")[2], MOST_TITLE)
    if state == "missing" and subject.spec is not None:
        return f"{subject.spec.role} · missing"
    if subject.spec is not None and subject.type is not subject.spec.type:
        return f"{name} · expected {subject.spec.type.ui_name}"
    return name if state == "ok" else f"{name} · {state}"


def _position(subject: BoxSubject) -> tuple[float, float] | None:
    if subject.node is not None:
        return subject.node.position
    return None if subject.spec is None else subject.spec.at
