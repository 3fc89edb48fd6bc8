"""What operators give: sums of texts and lists, arithmetic, comparisons."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.run import MOST_ROUNDS
from lab3_usd.scripts.values import (
    MOST_ITEMS,
    MOST_LETTERS,
    External,
    Items,
    Table,
    Text,
    UnknownValueError,
    Value,
    as_text,
    concatenated,
    lifted,
    place,
    plain,
    same,
    unknown,
)

_MOST_BITS = 4096
WIDE = re.compile(r"\*|\d{4,}")  # of a format that makes a text as long as it says
_LONGEST_VALUES = 10_000


def as_unknown(value: Value, node: ast.AST) -> Unknown:
    """Return what is unknown of a value that is not what is needed."""
    return value if isinstance(value, Unknown) else unknown(node)


def listed(value: Value) -> Items | None:
    """Return what one goes through in a loop over a value, None where that is unknown."""
    if isinstance(value, Items):
        return value
    if isinstance(value, Table):
        return Items(list(value.keys.values()), value.at, "list", value.rest)
    if isinstance(value, Text) and value.unknown is None and len(value.text) < MOST_ROUNDS:
        return Items([lifted(letter, value.at) for letter in value.text], value.at)
    return None


def percent(left: Text, right: Value, node: ast.BinOp) -> Value:
    """Return a text with values put into it by %."""
    with suppress(UnknownValueError, ValueError, TypeError):
        values = plain(right)
        values = tuple(values) if isinstance(values, list) else values
        if (
            len(left.text) < MOST_LETTERS
            and WIDE.search(left.text) is None
            and len(str(values)) < _LONGEST_VALUES
        ):
            return lifted(plain(left) % values, place(node))
    parts = left.text.split("%s")
    given = right.items if isinstance(right, Items) and right.kind == "tuple" else [right]
    if left.unknown is None and len(parts) == len(given) + 1 and "%" not in "".join(parts):
        at = place(node)
        texts = [Text(parts[0], at)]
        for value, part in zip(given, parts[1:], strict=True):
            texts += [as_text(value, at), Text(part, at)]
        return concatenated(texts, at)
    return unknown(node)


def added(one: Value, other: Value, node: ast.AST) -> Value:
    """Return the sum of two values."""
    at = place(node)
    if isinstance(one, Text) or isinstance(other, Text):
        parts = (Text, Unknown, External)
        if isinstance(one, parts) and isinstance(other, parts):
            return concatenated([as_text(one, at), as_text(other, at)], at)
        return unknown(node)
    if isinstance(one, Items):
        more = listed(other)
        if more is None:
            return Items(list(one.items), one.at, one.kind, one.rest or as_unknown(other, node))
        if len(one.items) + len(more.items) > MOST_ITEMS:
            return unknown(node)
        return Items([*one.items, *more.items], one.at, one.kind, one.rest or more.rest)
    if isinstance(other, Items) and isinstance(one, Unknown):
        return Items(list(other.items), other.at, other.kind, other.rest or one)
    return computed(ast.Add(), one, other, node)


_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}


def computed(op: ast.operator, one: Value, other: Value, node: ast.AST) -> Value:
    """Return the result of an operation with numbers, lists and texts."""
    numbers = (bool, int, float)
    if isinstance(op, ast.Mult) and isinstance(other, (Text, Items)):
        one, other = other, one
    if isinstance(op, ast.Mult) and isinstance(one, Items) and isinstance(other, int):
        if one.rest is None and 0 <= other * len(one.items) <= MOST_ITEMS:
            return Items(one.items * other, one.at, one.kind)
        return unknown(node)
    if isinstance(op, ast.Mult) and isinstance(one, Text) and isinstance(other, int):
        fits = one.unknown is None and 0 <= other * len(one.text) <= MOST_LETTERS
        return lifted(one.text * other, place(node)) if fits else unknown(node)
    if isinstance(op, ast.BitOr) and isinstance(one, Table) and isinstance(other, Table):
        merged = one.copy()
        merged.update(other)
        return merged
    function = _OPERATORS.get(type(op))
    if function is None or not (isinstance(one, numbers) and isinstance(other, numbers)):
        return unknown(node)
    if isinstance(op, ast.Pow) and abs(other) > 64:  # noqa: PLR2004
        return unknown(node)
    with suppress(ArithmeticError, ValueError, TypeError):
        value = function(one, other)
        is_small = not isinstance(value, int) or value.bit_length() < _MOST_BITS
        if isinstance(value, numbers) and is_small:
            return value
    return unknown(node)


_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


def compared(op: ast.cmpop, left: Value, right: Value) -> bool | None:
    """Return the outcome of a comparison, None where that is unknown."""
    if isinstance(op, (ast.Eq, ast.Is, ast.NotEq, ast.IsNot)):
        is_same = same(left, right)
        return is_same if is_same is None or isinstance(op, (ast.Eq, ast.Is)) else not is_same
    if isinstance(op, (ast.In, ast.NotIn)):
        if isinstance(left, Text) and isinstance(right, Text):
            whole = left.unknown is None and right.unknown is None
            among = left.text in right.text if whole else None
        else:
            items = listed(right)
            each = [] if items is None else [same(left, item) for item in items.items]
            is_open = items is None or items.rest is not None or None in each
            among = True if True in each else None if is_open else False
        return among if among is None or isinstance(op, ast.In) else not among
    function = _COMPARISONS.get(type(op))
    with suppress(UnknownValueError, TypeError):
        return None if function is None else bool(function(plain(left), plain(right)))
    return None
