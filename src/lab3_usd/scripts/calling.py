"""Calls functions: of the script, of OmniGraph, of USD and of Python."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.api import NONE_OF_THESE, call_api
from lab3_usd.scripts.expressions import evaluate
from lab3_usd.scripts.library import call_builtin, call_library, call_method
from lab3_usd.scripts.run import DEEPEST_CALL, Arguments, Run
from lab3_usd.scripts.statements import execute
from lab3_usd.scripts.values import (
    Class,
    External,
    Function,
    Instance,
    Items,
    Method,
    Scope,
    Super,
    Table,
    Text,
    Value,
    joined,
    last_name,
    place,
    unknown,
)


def call_value(function: Value, given: Arguments, node: ast.AST, scope: Scope, run: Run) -> Value:
    """Call anything: functions of the script, of OmniGraph, of USD, of Python."""
    if isinstance(function, Function):
        return call_function(function, given, run, node)
    if isinstance(function, Class):
        return construct(function, given, run, node)
    if not isinstance(node, ast.Call):
        return unknown(node)
    name = last_name(node)
    if isinstance(function, External):
        name = function.last
    elif isinstance(function, Method):
        name = function.name
    if name == "super" and isinstance(function, External):
        around = scope.function()
        own = next(iter(around.names.values()), None)
        if own is None or around.owner is None:
            return unknown(node)
        return Super(own, around.owner)
    result = call_api(function, name, given, node, run)
    if result is not NONE_OF_THESE:
        return result
    if isinstance(function, Method):
        return call_method(function.own, name, given, node)
    if isinstance(function, External):
        if function.name.startswith("builtins.") or name == "OrderedDict":
            return call_builtin(name, given, node)
        return call_library(function.name, given, node)
    return unknown(node)


def construct(kind: Class, given: Arguments, run: Run, node: ast.AST) -> Value:
    """Make an object of a class, and call what initialises it."""
    made = Instance(kind)
    run.instances.append(made)
    start = kind.method("__init__", made)
    if start is not None:
        call_function(start, given, run, node)
        return made
    bodies = (line for base in reversed([*kind.lines()]) for line in base.node.body)
    # Names that a class only declares or gives a default are its fields, as in data classes.
    targets = (line.target for line in bodies if isinstance(line, ast.AnnAssign))
    names = [target.id for target in targets if isinstance(target, ast.Name)]
    for number, name in enumerate(dict.fromkeys(names)):
        if given.has(number, name):
            made.attributes[name] = given.get(number, name)
        elif kind.find(name) is None:
            made.attributes[name] = Unknown(name, getattr(node, "lineno", 1))
    after = kind.method("__post_init__", made)
    if after is not None:
        call_function(after, Arguments(), run, node)
    return made


def call_function(function: Function, given: Arguments, run: Run, node: ast.AST) -> Value:
    """Call a function of the script, and return what it gives."""
    code = function.node
    if run.calls.count(id(code)) > 2 or len(run.calls) >= DEEPEST_CALL:  # noqa: PLR2004
        return unknown(node)
    run.entered.add(id(code))
    inner = Scope("function", function.scope, function.owner)
    _bind(function, given, inner)
    run.calls.append(id(code))
    try:
        if isinstance(code, ast.Lambda):
            return evaluate(code.body, inner, run)
        if _yields(code, run):
            inner.yields = []
        execute(code.body, inner, run)
    finally:
        run.calls.pop()
    if inner.yields is not None:
        return Items(inner.yields, place(node), "generator")
    if not inner.returns:
        return None
    value = inner.returns[0]
    for other in inner.returns[1:]:
        value = joined(value, other, Unknown(f"{code.name}()", getattr(node, "lineno", 1)))
    return value


def _yields(code: ast.FunctionDef | ast.AsyncFunctionDef, run: Run) -> bool:
    yields = run.looked_at.get(id(code))
    if yields is None:
        parts = (isinstance(part, (ast.Yield, ast.YieldFrom)) for part in _own_parts(code))
        yields = run.looked_at[id(code)] = any(parts)
    return yields


def _own_parts(code: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[ast.AST]:
    """Yield the parts of a function without those of functions in it."""
    ahead: list[ast.AST] = list(code.body)
    while ahead:
        part = ahead.pop()
        yield part
        if not isinstance(part, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.ClassDef)):
            ahead += ast.iter_child_nodes(part)


def _bind(function: Function, given: Arguments, inner: Scope) -> None:
    """Give the parameters their values: those of the call, their defaults, or unknown ones."""
    arguments = function.node.args
    names = [each.arg for each in (*arguments.posonlyargs, *arguments.args)]
    values = list(given.given)
    if function.own is not None:
        values.insert(0, function.own)
    line = function.node.lineno
    at = (line, 0, line, 0)
    parameters = [*names, *(each.arg for each in arguments.kwonlyargs)]
    for number, name in enumerate(parameters):
        if number < min(len(values), len(names)):
            inner.names[name] = values[number]
        elif name in given.named:
            inner.names[name] = given.named[name]
        elif name in function.defaults and not given.is_open:
            inner.names[name] = function.defaults[name]
        else:
            inner.names[name] = Unknown(name, line)
    if arguments.vararg is not None:
        name = arguments.vararg.arg
        rest = Unknown(name, line) if given.is_open else None
        inner.names[name] = Items(values[len(names) :], at, "tuple", rest)
    if arguments.kwarg is not None:
        name = arguments.kwarg.arg
        table = inner.names[name] = Table(at, Unknown(name, line) if given.is_open else None)
        for key, value in given.named.items():
            if key not in parameters:
                table.set(Text(key, at), value)
