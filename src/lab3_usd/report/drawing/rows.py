"""The rows of a box: the ports of a node, with their values, and how each was judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct, field

from lab3_usd.check.model import Node
from lab3_usd.report.drawing.faults import Faults
from lab3_usd.report.drawing.text_width import clip_end, clip_path
from lab3_usd.report.drawing.values import prim_lines, shown, value_line
from lab3_usd.report.picture_model import Row, Side, State
from lab3_usd.spec.catalog import INPUT, NodeType, Port
from lab3_usd.spec.spec import NodeSpec

MOST_LABEL = 44
MOST_NOTE = 400
MOST_LINES = 24


class Plan(Struct, frozen=True):
    """What the rows of one box are made of; `spec` is None for a node that plays no role."""

    key: str
    spec: NodeSpec | None
    node: Node | None
    arriving: Mapping[str, State]
    leaving: Mapping[str, State]
    found: Faults = field(default_factory=Faults)
    every_port: bool = False

    @property
    def type(self) -> NodeType | None:
        """The node's own type; that of its role where there is no node."""
        if self.node is not None:
            return self.node.type
        return None if self.spec is None else self.spec.type

    def port(self, name: str) -> Port | None:
        """The port of the node's type; for an unknown type that of its role."""
        found = None if self.type is None else self.type.port(name)
        return found if found is not None or self.spec is None else self.spec.type.port(name)


def rows(plan: Plan) -> Iterator[Row]:
    """Yield a row for every port, in the order of the type; not all of them need be drawn."""
    for name in _names(plan):
        yield _row(plan, name, plan.port(name))


def _names(plan: Plan) -> list[str]:
    """Name the ports in the order of the type; then those that only the file or wires have."""
    names = dict.fromkeys([] if plan.type is None else plan.type.ports)
    if plan.spec is not None and plan.type is plan.spec.type:
        names |= dict.fromkeys(plan.spec.grown)
    if plan.type is None and plan.node is not None:
        names |= dict.fromkeys(plan.node.ports)
    names |= dict.fromkeys([*plan.arriving, *plan.leaving])
    return list(names | dict.fromkeys(sorted(plan.found.ports(plan.key))))


def _row(plan: Plan, name: str, port: Port | None) -> Row:
    state = plan.found.state(plan.key, name)
    wire = plan.arriving.get(name, "ok")
    if state == "ok" or (state == "wrong" and wire == "missing"):
        state = wire
    value, muted = _value(plan, name, port)
    expected = plan.found.expected(plan.key, name) if state != "ok" and value else None
    return Row(
        port=name,
        label=clip_end(short(name), MOST_LABEL),
        side=_side(plan, name, port),
        execution=port is not None and port.is_execution,
        wired=name in plan.arriving or name in plan.leaving,
        value=value,
        expected=() if expected is None else (clip_end(_bare(expected), MOST_LABEL),),
        state=state,
        note=plan.found.note(plan.key, name) or _whole(plan, name),
        muted=muted,
    )


def _side(plan: Plan, name: str, port: Port | None) -> Side:
    if name in plan.arriving and name in plan.leaving:
        return "both"
    if name in plan.leaving or (port is not None and port.is_source):
        return "out"
    if name.startswith(INPUT) or name in plan.arriving:
        return "in"
    return "out"


def _value(plan: Plan, name: str, port: Port | None) -> tuple[tuple[str, ...], bool]:
    """Return the lines to show for an input, and whether it is a default that nobody set."""
    if not name.startswith(INPUT) or (port is not None and port.is_execution):
        return (), False
    asked = _asked(plan.spec, name)
    if plan.node is None:
        return asked, False
    if plan.node.targets(name):
        return prim_lines(plan.node.targets(name)), False
    if port is not None and port.is_target:
        return (prim_lines(()) if asked else ()), True
    return _attribute(plan, plan.node, name, is_asked=bool(asked))


def _attribute(
    plan: Plan, node: Node, name: str, *, is_asked: bool
) -> tuple[tuple[str, ...], bool]:
    """Return the value of an attribute where it matters: a wire takes its place."""
    state = node.state(name)
    is_default = state is None or state.value is None
    value = node.value(name)
    if value is None:
        return (("not set",) if is_asked else ()), True
    if name in plan.arriving and not is_asked:
        return (), False
    matters = is_asked or plan.every_port or plan.found.state(plan.key, name) != "ok"
    return (value_line(value) if matters or not is_default else ()), is_default


def _asked(spec: NodeSpec | None, name: str) -> tuple[str, ...]:
    if spec is None:
        return ()
    for setting in spec.settings:
        if setting.port == name:
            return value_line(setting.value)
    for target in spec.targets:
        if target.port == name:
            return prim_lines(target.prims)
    return ()


def _whole(plan: Plan, name: str) -> str:
    """Return the value at a length that the row has no room for."""
    state = None if plan.node is None else plan.node.state(name)
    if state is None:
        return ""
    if state.targets:
        return "\n".join(clip_path(prim, MOST_NOTE) for prim in state.targets[:MOST_LINES])
    return "" if state.value is None else clip_end(shown(state.value), MOST_NOTE)


def _bare(text: str) -> str:
    """Return a value as rows show it, without the quotes that it has in messages."""
    quoted = len(text) > 2 and text[0] == text[-1] == "'"  # noqa: PLR2004 - the two quotes
    return text[1:-1] if quoted else text


def short(name: str) -> str:
    """Return a port's name without `inputs:` or `outputs:`."""
    return name.partition(":")[2] or name
