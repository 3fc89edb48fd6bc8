"""Which inputs a node needs and does not get."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, Port
from lab3_usd.spec.isaac import Need
from lab3_usd.spec.values import Value


def unmet_needs(node: Node, subject: LintSubject) -> Iterator[Need]:
    """Yield what a node needs by the catalog and does not get."""
    kind = node.type
    for need in subject.types.needs.get(kind.type, ()) if kind is not None else ():
        known = [each for each in need.inputs if kind and INPUT + each in kind.ports]
        if known and _is_asked(node, need) and not any(_is_met(node, each, need) for each in known):
            yield need


def _is_asked(node: Node, need: Need) -> bool:
    if need.when and not (is_given(node, need.when) or _is_on(node, need.when)):
        return False
    if need.when_wired and not node.sources(INPUT + need.when_wired):
        return False
    return not (need.unless and _is_on(node, need.unless))


def _is_met(node: Node, name: str, need: Need) -> bool:
    return is_given(node, name) or _is_zero_on_purpose(node, name, need)


def _is_zero_on_purpose(node: Node, name: str, need: Need) -> bool:
    """Whether somebody wrote a zero that may be meant: it counts, or would be no error."""
    state = node.state(INPUT + name)
    if state is None or state.value in (None, ()):
        return False
    return need.zero_counts or need.severity == "warning"


def _is_on(node: Node, name: str) -> bool:
    """Whether a switch is on, by its default where nobody set it."""
    return node.value(INPUT + name) is True


def is_given(node: Node, name: str) -> bool:
    """Whether an input is wired, names a prim, or holds more than nothing.

    A wire counts wherever it leads: another rule says where it leads to nothing.
    """
    port = INPUT + name
    state = node.state(port)
    if state is not None and (state.sources or state.targets):
        return True
    value = None if state is None else state.value
    if value is None or is_nothing(value):
        return False
    kind = None if node.type is None else node.type.port(port)
    return kind is None or not _is_idle_default(value, kind)


def is_nothing(value: Value) -> bool:
    """Whether a value is 0, false, an empty text or array, or made of zeros."""
    if isinstance(value, tuple):
        return all(is_nothing(each) for each in value)
    return not value


def _is_idle_default(value: Value, port: Port) -> bool:
    """Whether somebody wrote down a pose that says nothing: the default of a quaternion."""
    return isinstance(value, tuple) and value == port.default


class ArrayItems(Struct, frozen=True):
    """The inputs of a node that makes an array: those with something, those without, the rest.

    `beyond` are inputs with something that the size of the array leaves out.
    """

    count_port: str
    count: int
    filled: tuple[str, ...]
    empty: tuple[str, ...]
    beyond: tuple[str, ...]


def array_items(node: Node) -> ArrayItems | None:
    """Return what a node makes its array of, None for one that makes none or of a wired size."""
    dynamic = None if node.type is None else node.type.dynamic
    if dynamic is None:
        return None
    count_port = INPUT + dynamic.count
    count = node.value(count_port)
    if node.sources(count_port) or not isinstance(count, int) or isinstance(count, bool):
        return None
    inside = [f"{INPUT}{dynamic.prefix}{number}" for number in range(min(count, len(node.ports)))]
    filled = tuple(port for port in inside if _has_item(node, port))
    stem = INPUT + dynamic.prefix
    others = (port for port in node.ports if port.startswith(stem) and port not in inside)
    return ArrayItems(
        count_port=count_port,
        count=count,
        filled=filled,
        empty=tuple(port for port in inside if port not in filled),
        beyond=tuple(
            port for port in others if port[len(stem) :].isdecimal() and node.sources(port)
        ),
    )


def _has_item(node: Node, port: str) -> bool:
    """Whether an element of an array is wired or set: an empty text is no element."""
    state = node.state(port)
    return state is not None and (bool(state.sources) or state.value not in (None, ""))
