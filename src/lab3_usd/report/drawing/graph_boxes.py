"""The boxes of an Action Graph: title, rows and size of each."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lab3_usd.report.drawing.measure import measured
from lab3_usd.report.drawing.rows import Plan, rows, short
from lab3_usd.report.drawing.text_width import clip_end
from lab3_usd.report.picture_model import Box, Curve, End, Family, Row, State
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


def node_box(plan: Plan, state: State) -> Box:
    """Return the box of a node, sized but not placed."""
    every = [_in_box(row, state) for row in rows(plan)]
    settings = tuple(row for row in every if row.value)
    ports = [row for row in every if not row.value and _is_drawn(row, plan)]
    hidden = len(every) - len(settings) - len(ports)
    box = Box(
        key=plan.key,
        title=clip_end(_title(plan), MOST_TITLE),
        subtitle=_subtitle(plan, state),
        family=family(plan.type),
        inputs=tuple(row for row in ports if row.side != "out"),
        outputs=tuple(row for row in ports if row.side == "out"),
        settings=settings,
        more=f"+ {hidden} more port{'s' * (hidden > 1)}" if hidden else "",
        state=state,
        note=plan.found.note(plan.key),
        at=_position(plan),
    )
    return measured(box)


def _in_box(row: Row, state: State) -> Row:
    """Return the row as it looks in its box: a missing box says for all its rows that it is."""
    return replace(row, state="ok") if state == "missing" else row


def _is_drawn(row: Row, plan: Plan) -> bool:
    return row.wired or row.execution or row.state != "ok" or plan.every_port


def absent_box(key: str, ports: Sequence[str], reason: str, state: State) -> Box:
    """Return the box at the end of wires that come from no node of the graph."""
    outputs = tuple(
        Row(port, clip_end(short(port), MOST_TITLE), "out", wired=True, state=state)
        for port in ports
    )
    return measured(
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


def _title(plan: Plan) -> str:
    if plan.type is not None:
        return plan.type.ui_name
    return (
        "" if plan.node is None else plan.node.type_name.rpartition(".")[2] or "node without a type"
    )


def _subtitle(plan: Plan, state: State) -> str:
    name = clip_end(plan.key.rpartition("/")[2], MOST_TITLE)
    if state == "missing" and plan.spec is not None:
        return f"{plan.spec.role} · missing"
    if plan.spec is not None and plan.type is not plan.spec.type:
        return f"{name} · expected {plan.spec.type.ui_name}"
    return name if state == "ok" else f"{name} · {state}"


def _position(plan: Plan) -> tuple[float, float] | None:
    if plan.node is not None:
        return plan.node.position
    return None if plan.spec is None else plan.spec.at
