"""Executes statements of a script as far as its values are known."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.attributes import assign_attribute
from lab3_usd.scripts.expressions import evaluate
from lab3_usd.scripts.operations import added, as_unknown, computed, listed
from lab3_usd.scripts.run import FEW_ROUNDS, MOST_ROUNDS, Arguments, Run
from lab3_usd.scripts.values import (
    Class,
    External,
    Function,
    Instance,
    Items,
    Scope,
    Table,
    Value,
    joined,
    place,
    same,
    truth,
    unknown,
)

# How a list of statements ends: at its last one, or by one that leaves it.
Ending = Literal["", "return", "break", "continue", "raise"]


def execute(body: Sequence[ast.stmt], scope: Scope, run: Run) -> Ending:
    """Execute statements one after the other, and say what ended them."""
    for statement in body:
        run.step(statement)
        handler = _HANDLERS.get(type(statement))
        ending = handler(statement, scope, run) if handler else ""
        if ending:
            return ending
    return ""


def _expression(node: ast.Expr, scope: Scope, run: Run) -> Ending:
    evaluate(node.value, scope, run)
    return "raise" if _leaves_program(node) else ""


def _leaves_program(node: ast.stmt) -> bool:
    """Whether a statement ends the program."""
    call = node.value if isinstance(node, ast.Expr) else None
    if not isinstance(call, ast.Call):
        return False
    name = ast.unparse(call.func) if isinstance(call.func, (ast.Name, ast.Attribute)) else ""
    return name in ("exit", "quit", "sys.exit", "os._exit")


def _assign(node: ast.Assign, scope: Scope, run: Run) -> Ending:
    value = evaluate(node.value, scope, run)
    for target in node.targets:
        assign(target, value, scope, run)
    return ""


def _annotated(node: ast.AnnAssign, scope: Scope, run: Run) -> Ending:
    if node.value is not None:
        assign(node.target, evaluate(node.value, scope, run), scope, run)
    return ""


def assign(target: ast.expr, value: Value, scope: Scope, run: Run) -> None:
    """Give a name, an attribute, an item or several of them a value."""
    if isinstance(target, ast.Name):
        scope.set(target.id, value)
    elif isinstance(target, ast.Attribute):
        assign_attribute(evaluate(target.value, scope, run), target.attr, value)
    elif isinstance(target, ast.Subscript):
        _assign_item(target, value, scope, run)
    elif isinstance(target, ast.Starred):
        assign(target.value, value, scope, run)
    elif isinstance(target, (ast.Tuple, ast.List)):
        _unpack(target.elts, value, scope, run)


def _assign_item(target: ast.Subscript, value: Value, scope: Scope, run: Run) -> None:
    owner = evaluate(target.value, scope, run)
    index = evaluate(target.slice, scope, run)
    if isinstance(owner, Table):
        owner.set(index, value)
    elif isinstance(owner, Items):
        count = len(owner.items)
        if isinstance(index, int) and -count <= index < count and owner.rest is None:
            owner.items[index] = value
        else:
            owner.rest = owner.rest or unknown(target)


def _unpack(targets: list[ast.expr], value: Value, scope: Scope, run: Run) -> None:
    items = listed(value)
    stars = [number for number, each in enumerate(targets) if isinstance(each, ast.Starred)]
    values = [] if items is None else items.items
    if items is not None and stars and len(values) >= len(targets) - 1:
        first, behind = stars[0], len(values) - (len(targets) - stars[0] - 1)
        middle = Items(values[first:behind], items.at)
        values = [*values[:first], middle, *values[behind:]]
    elif stars:
        values = []
    for number, target in enumerate(targets):
        item = values[number] if number < len(values) else unknown(target)
        assign(target, item, scope, run)


def _augmented(node: ast.AugAssign, scope: Scope, run: Run) -> Ending:
    before, value = evaluate(node.target, scope, run), evaluate(node.value, scope, run)
    if isinstance(before, Items) and before.kind == "list" and isinstance(node.op, ast.Add):
        more = listed(value)
        rest = as_unknown(value, node) if more is None else more.rest
        before.extend([] if more is None else list(more.items), rest)
        return ""
    is_sum = isinstance(node.op, ast.Add)
    new = added(before, value, node) if is_sum else computed(node.op, before, value, node)
    assign(node.target, new, scope, run)
    return ""


def _import(node: ast.Import, scope: Scope, _run: Run) -> Ending:
    for name in node.names:
        top = name.name.partition(".")[0]
        full = name.name if name.asname else top
        scope.set(name.asname or top, External(full))
    return ""


def _import_from(node: ast.ImportFrom, scope: Scope, run: Run) -> Ending:
    module = "." * node.level + (node.module or "")
    for name in node.names:
        if name.name == "*":
            if module == run.building.module:
                scope.top().stars.append(module)
            continue
        scope.set(name.asname or name.name, External(f"{module}.{name.name}"))
    return ""


def _define(node: ast.FunctionDef | ast.AsyncFunctionDef, scope: Scope, run: Run) -> Ending:
    function = Function(node, scope, None, scope.owner, _defaults(node, scope, run))
    scope.set(node.name, function)
    if scope.kind == "function":
        run.inner.append(function)
    return ""


def _defaults(
    node: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda, scope: Scope, run: Run
) -> dict[str, Value]:
    """Return the defaults of parameters, which Python evaluates with the definition."""
    arguments = node.args
    places = [*arguments.posonlyargs, *arguments.args]
    behind = places[len(places) - len(arguments.defaults) :]
    pairs: list[tuple[ast.arg, ast.expr | None]] = [
        *zip(behind, arguments.defaults, strict=True),
        *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
    ]
    return {name.arg: evaluate(value, scope, run) for name, value in pairs if value is not None}


def _define_class(node: ast.ClassDef, scope: Scope, run: Run) -> Ending:
    inner = Scope("class", scope)
    made = Class(node, inner, [evaluate(base, scope, run) for base in node.bases])
    inner.owner = made
    execute(node.body, inner, run)
    scope.set(node.name, made)
    return ""


def _return(node: ast.Return, scope: Scope, run: Run) -> Ending:
    value = None if node.value is None else evaluate(node.value, scope, run)
    scope.function().returns.append(value)
    return "return"


def _if(node: ast.If, scope: Scope, run: Run) -> Ending:
    outcome = truth(evaluate(node.test, scope, run))
    if outcome is not None:
        return execute(node.body if outcome else node.orelse, scope, run)
    return _branch(node.test, node.body, node.orelse, scope, run)


def _branch(
    test: ast.AST,
    body: Sequence[ast.stmt],
    other: Sequence[ast.stmt],
    scope: Scope,
    run: Run,
) -> Ending:
    """Go on behind a test whose outcome is unknown.

    A way that only leaves is not taken. Where graphs or lists differ by the way, one is taken.
    """
    for leaving, staying in ((body, other), (other, body)):
        if leaving and _only_leaves(leaving, run) and not (staying and _only_leaves(staying, run)):
            last = leaving[-1]
            value = last.value if isinstance(last, ast.Return) else None
            # What the way that is not taken would return is kept.
            if value is not None and not (isinstance(value, ast.Constant) and value.value is None):
                scope.function().returns.append(evaluate(value, scope, run))
            return execute(staying, scope, run)
    if _matters(body, run) or _matters(other, run):
        return execute(body if run.decide(test) else other, scope, run)
    return _both(body, other, scope, run)


def _only_leaves(body: Sequence[ast.stmt], run: Run) -> bool:
    """Whether statements build nothing, and then leave the function, the loop or the program."""
    last = body[-1]
    leaves = isinstance(last, (ast.Return, ast.Raise, ast.Continue, ast.Break)) or _leaves_program(
        last
    )
    if not leaves:
        return False
    only_leaves = run.looked_at.get(-id(body))
    if only_leaves is None:
        only_leaves = not any(id(part) in run.builders for part in _walk(body))
        run.looked_at[-id(body)] = only_leaves
    return only_leaves


def _walk(body: Sequence[ast.stmt]) -> Iterator[ast.AST]:
    return (part for statement in body for part in ast.walk(statement))


_MUTATES = frozenset(
    ["append", "extend", "insert", "add", "update", "remove", "pop", "setdefault", "clear"]
)


def _matters(body: Sequence[ast.stmt], run: Run) -> bool:
    """Whether statements build graphs, or change lists."""
    matters = run.looked_at.get(id(body))
    if matters is None:
        matters = run.looked_at[id(body)] = any(_is_of_weight(part, run) for part in _walk(body))
    return matters


def _is_of_weight(part: ast.AST, run: Run) -> bool:
    if id(part) in run.builders:
        return True
    if isinstance(part, ast.Call) and isinstance(part.func, ast.Attribute):
        return part.func.attr in _MUTATES
    if isinstance(part, ast.AugAssign):
        return isinstance(part.value, (ast.List, ast.ListComp))
    listing = (ast.List, ast.Dict, ast.ListComp, ast.Tuple)
    if isinstance(part, ast.Assign) and isinstance(part.value, listing):
        return any(isinstance(inner, ast.Tuple) for inner in ast.walk(part.value))
    return False


def _both(body: Sequence[ast.stmt], other: Sequence[ast.stmt], scope: Scope, run: Run) -> Ending:
    """Take both ways, one after the other from the same names, and join what they leave."""
    function = scope.function()
    tables = [scope.names, function.names, *[each.attributes for each in run.instances]]
    tables = list({id(table): table for table in tables}.values())
    before = [dict(table) for table in tables]
    one = execute(body, scope, run)
    after = [dict(table) for table in tables]
    for table, old in zip(tables, before, strict=True):
        table.clear()
        table.update(old)
    two = execute(other, scope, run)
    for table, first in zip(tables, after, strict=True):
        for name, value in first.items():
            if name not in table:
                table[name] = value
            elif table[name] is not value:
                table[name] = joined(value, table[name], Unknown(name, run.line))
    return one if one == two else ""


def _for(node: ast.For | ast.AsyncFor, scope: Scope, run: Run) -> Ending:
    value = evaluate(node.iter, scope, run)
    items = listed(value)
    most = MOST_ROUNDS if _matters(node.body, run) else FEW_ROUNDS
    rounds: list[Value] = [] if items is None else items.items[:most]
    if items is None or (items.rest is not None and not rounds):
        rounds = [_element(node.target)]
    for item in rounds:
        assign(node.target, item, scope, run)
        ending = execute(node.body, scope, run)
        if ending in ("return", "raise"):
            return ending
        if ending == "break":
            return ""
    return execute(node.orelse, scope, run)


def _element(target: ast.expr) -> Value:
    """Return what stands for the items of a list that is unknown."""
    if isinstance(target, (ast.Tuple, ast.List)):
        return Items([unknown(each) for each in target.elts], place(target), "tuple")
    return unknown(target)


def _while(node: ast.While, scope: Scope, run: Run) -> Ending:
    for _ in range(MOST_ROUNDS if _matters(node.body, run) else FEW_ROUNDS):
        outcome = truth(evaluate(node.test, scope, run))
        if outcome is False:
            return execute(node.orelse, scope, run)
        ending = execute(node.body, scope, run)
        if ending in ("return", "raise"):
            return ending
        # What goes on for ever, or nobody knows how long, is gone through once.
        if ending == "break" or outcome is None or isinstance(node.test, ast.Constant):
            return ""
    return ""


def _try(node: Any, scope: Scope, run: Run) -> Ending:
    """Go through the body, or through a handler that builds graphs instead.

    What fails in a body that such a handler guards is meant to.
    """
    handlers = [each for each in node.handlers if _matters(each.body, run)]
    if handlers and any(id(part) in run.builders for part in _walk(node.body)):
        if run.decide(ast.Constant(f"line {node.lineno}")):
            run.world.guarded.append((node.lineno, node.handlers[0].lineno))
            execute(node.body, scope, run)
        else:
            execute(handlers[0].body, scope, run)
        return execute(node.finalbody, scope, run)
    ending = execute(node.body, scope, run)
    if ending == "raise" and node.handlers:
        ending = execute(node.handlers[0].body, scope, run)
    elif not ending:
        ending = execute(node.orelse, scope, run)
    return execute(node.finalbody, scope, run) or ending


def _with(node: ast.With | ast.AsyncWith, scope: Scope, run: Run) -> Ending:
    for item in node.items:
        value = evaluate(item.context_expr, scope, run)
        if isinstance(value, Instance):
            method = value.type.method("__enter__", value) or value.type.method("__aenter__", value)
            if method is not None:
                value = run.call_value(method, Arguments(), node, scope, run)
        elif isinstance(value, Items) and value.kind == "generator" and value.items:
            value = value.items[0]
        if item.optional_vars is not None:
            assign(item.optional_vars, value, scope, run)
    return execute(node.body, scope, run)


def _match(node: ast.Match, scope: Scope, run: Run) -> Ending:
    """Take the case of a known value, else one as at any test whose outcome is unknown."""
    value = evaluate(node.subject, scope, run)
    for case in node.cases:
        pattern = case.pattern
        if isinstance(pattern, ast.MatchAs) and pattern.pattern is None:
            return execute(case.body, scope, run)
        if isinstance(pattern, ast.MatchValue):
            test = ast.Compare(node.subject, [ast.Eq()], [pattern.value])
            outcome = same(value, evaluate(pattern.value, scope, run))
            if outcome or (outcome is None and run.decide(test)):
                return execute(case.body, scope, run)
    return ""


def _public(node: ast.Global | ast.Nonlocal, scope: Scope, _run: Run) -> Ending:
    for name in node.names:
        outer = scope.top()
        if isinstance(node, ast.Nonlocal) and scope.outer is not None:
            inner = scope.outer
            while inner.outer is not None and name not in inner.names:
                inner = inner.outer
            outer = inner
        if outer is not scope:
            scope.public[name] = outer
    return ""


def _delete(node: ast.Delete, scope: Scope, _run: Run) -> Ending:
    for target in node.targets:
        if isinstance(target, ast.Name):
            scope.names.pop(target.id, None)
    return ""


_HANDLERS: dict[type[ast.stmt], Callable[[Any, Scope, Run], Ending]] = {
    ast.Expr: _expression,
    ast.Assign: _assign,
    ast.AnnAssign: _annotated,
    ast.AugAssign: _augmented,
    ast.Import: _import,
    ast.ImportFrom: _import_from,
    ast.FunctionDef: _define,
    ast.AsyncFunctionDef: _define,
    ast.ClassDef: _define_class,
    ast.Return: _return,
    ast.If: _if,
    ast.For: _for,
    ast.AsyncFor: _for,
    ast.While: _while,
    ast.Try: _try,
    ast.With: _with,
    ast.AsyncWith: _with,
    ast.Match: _match,
    ast.Raise: lambda _node, _scope, _run: "raise",
    ast.Break: lambda _node, _scope, _run: "break",
    ast.Continue: lambda _node, _scope, _run: "continue",
    ast.Global: _public,
    ast.Nonlocal: _public,
    ast.Delete: _delete,
}
if hasattr(ast, "TryStar"):
    _HANDLERS[ast.TryStar] = _try
