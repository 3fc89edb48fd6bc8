"""The rows of a box: the ports of a node, with their values, and how each was judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct, field

from lab3_usd.model.stage import Node
from lab3_usd.report.layout.text_width import clip_end, clip_path
from lab3_usd.report.picture import Row, Side, State
from lab3_usd.report.pictures.site_findings import SiteFindings
from lab3_usd.spec.catalog import INPUT, NodeType, Port, Value
from lab3_usd.spec.graph import NodeSpec

MOST_LABEL = 44
MOST_NOTE = 400
MOST_LINES = 24
MOST_VALUE = 34  # characters of a value in a box; the pointer resting on it reads more
MOST_PRIMS = 12


class BoxSubject(Struct, frozen=True):
    """The node that one box shows: its spec (None without a role), itself, and its wires."""

    key: str
    spec: NodeSpec | None
    node: Node | None
    arriving: Mapping[str, State]
    leaving: Mapping[str, State]
    found: SiteFindings = field(default_factory=SiteFindings)
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


def rows(subject: BoxSubject) -> Iterator[Row]:
    """Yield a row for every port, in the order of the type; not all of them need be drawn."""
    for name in _names(subject):
        yield _row(subject, name, subject.port(name))


def _names(subject: BoxSubject) -> list[str]:
    """Name the ports in the order of the type; then those that only the file or wires have."""
    names = dict.fromkeys([] if subject.type is None else subject.type.ports)
    if subject.spec is not None and subject.type is subject.spec.type:
        names |= dict.fromkeys(subject.spec.grown)
    if subject.type is None and subject.node is not None:
        names |= dict.fromkeys(subject.node.ports)
    names |= dict.fromkeys([*subject.arriving, *subject.leaving])
    return list(names | dict.fromkeys(sorted(subject.found.ports(subject.key))))


def _row(subject: BoxSubject, name: str, port: Port | None) -> Row:
    state = subject.found.state(subject.key, name)
    wire = subject.arriving.get(name, "ok")
    if state == "ok" or (state == "wrong" and wire == "missing"):
        state = wire
    value, muted = _value(subject, name, port)
    expected = subject.found.expected(subject.key, name) if state != "ok" and value else None
    return Row(
        port=name,
        label=clip_end(short(name), MOST_LABEL),
        side=_side(subject, name, port),
        execution=port is not None and port.is_execution,
        wired=name in subject.arriving or name in subject.leaving,
        value=value,
        expected=() if expected is None else (clip_end(_bare(expected), MOST_LABEL),),
        state=state,
        note=subject.found.note(subject.key, name) or _whole(subject, name),
        muted=muted,
    )


def _side(subject: BoxSubject, name: str, port: Port | None) -> Side:
    if name in subject.arriving and name in subject.leaving:
        return "both"
    if name in subject.leaving or (port is not None and port.is_source):
        return "out"
    if name.startswith(INPUT) or name in subject.arriving:
        return "in"
    return "out"


def _value(subject: BoxSubject, name: str, port: Port | None) -> tuple[tuple[str, ...], bool]:
    """Return the lines to show for an input, and whether it is a default that nobody set."""
    if not name.startswith(INPUT) or (port is not None and port.is_execution):
        return (), False
    asked = _asked(subject.spec, name)
    if subject.node is None:
        return asked, False
    if subject.node.targets(name):
        return prim_lines(subject.node.targets(name)), False
    if port is not None and port.is_target:
        return (prim_lines(()) if asked else ()), True
    return _attribute(subject, subject.node, name, is_asked=bool(asked))


def _attribute(
    subject: BoxSubject, node: Node, name: str, *, is_asked: bool
) -> tuple[tuple[str, ...], bool]:
    """Return the value of an attribute where it matters: a wire takes its place."""
    state = node.state(name)
    is_default = state is None or state.value is None
    value = node.value(name)
    if value is None:
        return (("not set",) if is_asked else ()), True
    if name in subject.arriving and not is_asked:
        return (), False
    matters = is_asked or subject.every_port or subject.found.state(subject.key, name) != "ok"
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


def _whole(subject: BoxSubject, name: str) -> str:
    """Return the value at a length that the row has no room for."""
    state = None if subject.node is None else subject.node.state(name)
    if state is None:
        return ""
    if state.targets:
        return "\n".join(clip_path(prim, MOST_NOTE) for prim in state.targets[:MOST_LINES])
    return "" if state.value is None else clip_end(value_text(state.value), MOST_NOTE)


def _bare(text: str) -> str:
    """Return a value as rows show it, without the quotes that it has in messages."""
    quoted = len(text) > 2 and text[0] == text[-1] == "'"  # noqa: PLR2004 - the two quotes
    return text[1:-1] if quoted else text


def short(name: str) -> str:
    """Return a port's name without `inputs:` or `outputs:`."""
    return name.partition(":")[2] or name


def value_text(value: Value) -> str:
    """Write a value as short as it stays readable."""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, tuple):
        return f"[{', '.join(value_text(part) for part in value)}]"
    return str(value) if value != "" else '""'


def value_line(value: Value) -> tuple[str, ...]:
    """Return a value as the one line of a row."""
    return (clip_end(value_text(value), MOST_VALUE),)


def prim_lines(prims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the targets of a relationship, one line each."""
    lines = [clip_path(prim, MOST_VALUE) for prim in prims[:MOST_PRIMS]]
    if len(prims) > MOST_PRIMS:
        lines.append(f"and {len(prims) - MOST_PRIMS} more")
    return tuple(lines) or ("no prim",)
