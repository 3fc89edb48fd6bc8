"""Formulas over values: what the data of sensors asks of several attributes together."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise
from typing import Any

_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.Eq: operator.eq,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": abs,
    "ceil": math.ceil,
    "sin": lambda degrees: math.sin(math.radians(degrees)),
    "count": len,
    "min": min,
    "sum": sum,
    "column": lambda pairs, number: [pair[number] for pair in pairs],
    "rising": lambda values: all(low < high for low, high in pairwise(values)),
    "climbing": lambda values: all(low <= high for low, high in pairwise(values)),
}
_CONSTANTS = {"pi": math.pi}
NAMES = (*_FUNCTIONS, *_CONSTANTS)  # that no attribute has


def result(formula: str, values: Mapping[str, Any]) -> Any:
    """Return what a formula comes to with these values, None where it cannot be told.

    It has numbers, names, `+ - * / **`, comparisons, `and` and `or`, entries of lists, and the
    functions above; `sin` takes degrees.

    Raises:
        ValueError: it has anything else.
    """
    try:
        return _value(_tree(formula), {**_CONSTANTS, **values})
    except (ArithmeticError, IndexError, TypeError):
        return None


@cache
def _tree(formula: str) -> ast.expr:
    return ast.parse(formula, mode="eval").body


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:  # noqa: PLR0911 - one for each kind
    match node:
        case ast.Constant(value):
            return value
        case ast.Name(name):
            return values[name]
        case ast.UnaryOp(kind, inner):
            return _OPERATORS[type(kind)](_value(inner, values))
        case ast.BinOp(left, kind, right):
            return _OPERATORS[type(kind)](_value(left, values), _value(right, values))
        case ast.BoolOp(kind, parts):
            operands = (_value(part, values) for part in parts)
            return any(operands) if isinstance(kind, ast.Or) else all(operands)
        case ast.Compare(left, kinds, rest):
            sides = [_value(part, values) for part in (left, *rest)]
            pairs = zip(kinds, pairwise(sides), strict=True)
            return all(_OPERATORS[type(kind)](*pair) for kind, pair in pairs)
        case ast.Subscript(inner, index):
            return _value(inner, values)[_value(index, values)]
        case ast.Call(ast.Name(name), arguments, []):
            return _FUNCTIONS[name](*(_value(part, values) for part in arguments))
    raise ValueError(f"no part of a formula: {ast.unparse(node)}")
