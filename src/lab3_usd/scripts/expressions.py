"""Evaluates expressions of a script, without running any of it."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.attributes import attribute_of
from lab3_usd.scripts.library import BUILTINS
from lab3_usd.scripts.operations import WIDE, added, as_unknown, compared, computed, listed, percent
from lab3_usd.scripts.run import DEEPEST_PART, Arguments, Run, StepLimitError
from lab3_usd.scripts.values import (
    MOST_ITEMS,
    External,
    Function,
    Items,
    Scope,
    Table,
    Text,
    UnknownValueError,
    Value,
    as_text,
    concatenated,
    joined,
    key_of,
    lifted,
    place,
    plain,
    truth,
    unknown,
)

_FEW = 8


def evaluate(node: ast.AST, scope: Scope, run: Run) -> Value:
    """Return the value of an expression.

    Raises:
        StepLimitError: that takes too long, or it is nested too deeply.
    """
    run.step(node)
    handler = _HANDLERS.get(type(node))
    if handler is None:
        return unknown(node)
    run.depth += 1
    if run.depth > DEEPEST_PART:
        raise StepLimitError
    try:
        return handler(node, scope, run)
    finally:
        run.depth -= 1


def _constant(node: ast.Constant, _scope: Scope, _run: Run) -> Value:
    value = node.value
    if isinstance(value, str):
        return Text(value, place(node))
    return value if value is None or isinstance(value, (bool, int, float)) else unknown(node)


def _name(node: ast.Name, scope: Scope, _run: Run) -> Value:
    holder = scope.holder(node.id)
    if holder is not None:
        return holder.names.get(node.id)
    if node.id == "__name__":
        return lifted("__main__", place(node))
    if node.id in BUILTINS:
        return External(f"builtins.{node.id}")
    for module in scope.top().stars:
        return External(f"{module}.{node.id}")
    return Unknown(node.id, node.lineno)


def _joined_text(node: ast.JoinedStr, scope: Scope, run: Run) -> Value:
    at = place(node)
    parts = [
        _formatted(part, scope, run)
        if isinstance(part, ast.FormattedValue)
        else as_text(evaluate(part, scope, run), at)
        for part in node.values
    ]
    return concatenated(parts, at)


def _formatted(node: ast.FormattedValue, scope: Scope, run: Run) -> Text:
    value = evaluate(node.value, scope, run)
    at = place(node)
    if node.format_spec is not None or node.conversion not in (-1, ord("s")):
        spec = "" if node.format_spec is None else evaluate(node.format_spec, scope, run)
        with suppress(UnknownValueError, ValueError, TypeError):
            text = plain(spec) if spec != "" else ""
            if WIDE.search(str(text)) is not None:
                return as_text(unknown(node.value), at)
            shown = format(plain(value), str(text))
            return as_text(lifted(shown, at), at)
        return as_text(unknown(node.value), at)
    return as_text(value, at)


def _list(node: ast.List | ast.Tuple | ast.Set, scope: Scope, run: Run) -> Value:
    made = Items([], place(node), type(node).__name__.lower())
    for element in node.elts:
        if isinstance(element, ast.Starred):
            value = evaluate(element.value, scope, run)
            items = listed(value)
            if items is None:
                made.rest = made.rest or as_unknown(value, element.value)
                continue
            made.items += items.items
            made.rest = made.rest or items.rest
        else:
            made.items.append(evaluate(element, scope, run))
    return made


def _dict(node: ast.Dict, scope: Scope, run: Run) -> Value:
    table = Table(place(node))
    for key_node, value_node in zip(node.keys, node.values, strict=True):
        value = evaluate(value_node, scope, run)
        if key_node is None:
            if isinstance(value, Table):
                table.update(value)
            else:
                table.rest = table.rest or as_unknown(value, value_node)
            continue
        key = evaluate(key_node, scope, run)
        name = key_of(key)
        if name is not None and name in table.values:
            table.lost.append((table.keys[name], table.values[name]))
        table.set(key, value)
    return table


def _sum_parts(node: ast.BinOp) -> list[ast.expr]:
    """Return what a sum adds: one of many terms nests as deeply as it has terms."""
    parts: list[ast.expr] = []
    left: ast.expr = node
    while isinstance(left, ast.BinOp) and isinstance(left.op, ast.Add):
        parts.append(left.right)
        left = left.left
    return [left, *reversed(parts)]


def _operation(node: ast.BinOp, scope: Scope, run: Run) -> Value:
    if isinstance(node.op, ast.Add):
        first, *further = [evaluate(part, scope, run) for part in _sum_parts(node)]
        at = place(node)
        texts = [first, *further]
        if all(isinstance(part, Text) for part in texts):
            return concatenated(texts, at)
        for value in further:
            first = added(first, value, node)
        return first
    left, right = evaluate(node.left, scope, run), evaluate(node.right, scope, run)
    if isinstance(node.op, ast.Mod) and isinstance(left, Text):
        return percent(left, right, node)
    if isinstance(node.op, ast.Div) and isinstance(left, (Text, External, Unknown)):
        if isinstance(right, Text) and not isinstance(left, Text):
            return unknown(node)
        if isinstance(right, Text) and isinstance(left, Text):  # a path of a file
            return concatenated([left, as_text(lifted("/", left.at), left.at), right], place(node))
    return computed(node.op, left, right, node)


def _unary(node: ast.UnaryOp, scope: Scope, run: Run) -> Value:
    value = evaluate(node.operand, scope, run)
    if isinstance(node.op, ast.Not):
        truth_value = truth(value)
        return unknown(node) if truth_value is None else not truth_value
    if isinstance(value, (int, float)):
        return -value if isinstance(node.op, ast.USub) else +value
    return unknown(node)


def _logic(node: ast.BoolOp, scope: Scope, run: Run) -> Value:
    stops_at = isinstance(node.op, ast.Or)
    value: Value = None
    is_open = False
    for part in node.values:
        value = evaluate(part, scope, run)
        outcome = truth(value)
        if outcome is stops_at:
            break
        is_open |= outcome is None
    if not is_open or (isinstance(node.op, ast.And) and truth(value) is False):
        return value
    return unknown(node.values[0])


def _comparison(node: ast.Compare, scope: Scope, run: Run) -> Value:
    left = evaluate(node.left, scope, run)
    result: bool | None = True
    for op, right_node in zip(node.ops, node.comparators, strict=True):
        right = evaluate(right_node, scope, run)
        outcome = compared(op, left, right)
        if outcome is False:
            return False
        result = None if outcome is None else result
        left = right
    return unknown(node) if result is None else True


def _choice(node: ast.IfExp, scope: Scope, run: Run) -> Value:
    outcome = truth(evaluate(node.test, scope, run))
    if outcome is not None:
        return evaluate(node.body if outcome else node.orelse, scope, run)
    one, other = evaluate(node.body, scope, run), evaluate(node.orelse, scope, run)
    if isinstance(one, (Items, Table)) and isinstance(other, (Items, Table)):
        return one if run.decide(node.test) else other
    return joined(one, other, unknown(node.test))


def _subscript(node: ast.Subscript, scope: Scope, run: Run) -> Value:
    value = evaluate(node.value, scope, run)
    if isinstance(node.slice, ast.Slice):
        return _sliced(value, node, scope, run)
    index = evaluate(node.slice, scope, run)
    if isinstance(value, Table):
        name = key_of(index)
        if name is not None and name in value.values:
            return value.values[name]
        return unknown(node)
    if isinstance(value, Items) and value.rest is None and isinstance(index, int):
        count = len(value.items)
        return value.items[index] if -count <= index < count else unknown(node)
    if isinstance(value, Text) and value.unknown is None and isinstance(index, int):
        count = len(value.text)
        fits = -count <= index < count
        return lifted(value.text[index], place(node)) if fits else unknown(node)
    if isinstance(value, Items) and isinstance(index, int) and 0 <= index < len(value.items):
        return value.items[index]
    return unknown(node)


def _sliced(value: Value, node: ast.Subscript, scope: Scope, run: Run) -> Value:
    bounds = node.slice
    ends = []
    for part in (bounds.lower, bounds.upper, bounds.step) if isinstance(bounds, ast.Slice) else ():
        end = None if part is None else evaluate(part, scope, run)
        if not (end is None or isinstance(end, int)):
            return unknown(node)
        ends.append(end)
    cut = slice(*ends)
    with suppress(ValueError):
        if isinstance(value, Items) and value.rest is None:
            return Items(value.items[cut], value.at, value.kind)
        if isinstance(value, Text) and value.unknown is None:
            return lifted(value.text[cut], place(node))
    return unknown(node)


def _call(node: ast.Call, scope: Scope, run: Run) -> Value:
    function = evaluate(node.func, scope, run)
    given: list[Value] = []
    named: dict[str, Value] = {}
    is_open = False
    for argument in node.args:
        if isinstance(argument, ast.Starred):
            items = listed(evaluate(argument.value, scope, run))
            is_open |= items is None or items.rest is not None
            given += [] if items is None else items.items
        else:
            given.append(evaluate(argument, scope, run))
    for keyword in node.keywords:
        value = evaluate(keyword.value, scope, run)
        if keyword.arg is not None:
            named[keyword.arg] = value
        elif isinstance(value, Table):
            named.update(
                (name, entry) for name, entry in value.values.items() if isinstance(name, str)
            )
            is_open |= value.rest is not None
        else:
            is_open = True
    return run.call_value(function, Arguments(given, named, is_open), node, scope, run)


def _comprehension(
    node: ast.ListComp | ast.SetComp | ast.GeneratorExp, scope: Scope, run: Run
) -> Value:
    made = Items([], place(node), "generator" if isinstance(node, ast.GeneratorExp) else "list")
    for inner in _rounds(node.generators, scope, run, made):
        made.items.append(evaluate(node.elt, inner, run))
        if len(made.items) > MOST_ITEMS:
            raise StepLimitError
        if len(made.items) == _FEW and all(isinstance(item, Unknown) for item in made.items):
            made.rest = made.rest or unknown(node)  # the others are no better
            break
    return made


def _table_comprehension(node: ast.DictComp, scope: Scope, run: Run) -> Value:
    table = Table(place(node))
    rest = Items([], place(node))
    for inner in _rounds(node.generators, scope, run, rest):
        table.set(evaluate(node.key, inner, run), evaluate(node.value, inner, run))
    table.rest = table.rest or rest.rest
    return table


def _rounds(
    generators: list[ast.comprehension], scope: Scope, run: Run, made: Items
) -> Iterator[Scope]:
    """Yield a scope for each round of a comprehension; what is unknown of it makes the list so."""
    if not generators:
        yield scope
        return
    first, *rest = generators
    value = evaluate(first.iter, scope, run)
    items = listed(value)
    if items is None or items.rest is not None:
        made.rest = made.rest or (items.rest if items else None) or as_unknown(value, first.iter)
    for item in [] if items is None else items.items:
        inner = Scope("comprehension", scope)
        run.assign(first.target, item, inner, run)
        tests = [truth(evaluate(test, inner, run)) for test in first.ifs]
        if False in tests:
            continue
        if None in tests:
            made.rest = made.rest or unknown(first.ifs[tests.index(None)])
        yield from _rounds(rest, inner, run, made)


def _named(node: ast.NamedExpr, scope: Scope, run: Run) -> Value:
    value = evaluate(node.value, scope, run)
    scope.set(node.target.id, value)
    return value


def _yield(node: ast.Yield, scope: Scope, run: Run) -> Value:
    value = None if node.value is None else evaluate(node.value, scope, run)
    yields = scope.function().yields
    if yields is not None:
        yields.append(value)
    return unknown(node)


_HANDLERS: dict[type[ast.AST], Callable[[Any, Scope, Run], Value]] = {
    ast.Constant: _constant,
    ast.Name: _name,
    ast.Attribute: lambda node, scope, run: attribute_of(
        evaluate(node.value, scope, run), node, run
    ),
    ast.JoinedStr: _joined_text,
    ast.List: _list,
    ast.Tuple: _list,
    ast.Set: _list,
    ast.Dict: _dict,
    ast.BinOp: _operation,
    ast.UnaryOp: _unary,
    ast.BoolOp: _logic,
    ast.Compare: _comparison,
    ast.IfExp: _choice,
    ast.Subscript: _subscript,
    ast.Call: _call,
    ast.Lambda: lambda node, scope, _run: Function(node, scope),
    ast.ListComp: _comprehension,
    ast.SetComp: _comprehension,
    ast.GeneratorExp: _comprehension,
    ast.DictComp: _table_comprehension,
    ast.Await: lambda node, scope, run: evaluate(node.value, scope, run),
    ast.NamedExpr: _named,
    ast.Yield: _yield,
}
