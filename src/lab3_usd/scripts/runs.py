"""The ways through a script: which functions are its starts, and which branches each way takes.

The module is one start, with all that it calls. A function or method that builds graphs and is
called by none of the others is one of its own: who calls it is not in the script.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import lru_cache

from msgspec import Struct

from lab3_usd.isaac.behaviour import Building
from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.attributes import attribute_of
from lab3_usd.scripts.calling import call_function, call_value, construct
from lab3_usd.scripts.expressions import evaluate
from lab3_usd.scripts.run import Arguments, Run, StepLimitError
from lab3_usd.scripts.statements import assign, execute
from lab3_usd.scripts.values import Class, Function, Instance, Scope, Value, last_name, unknown
from lab3_usd.scripts.world import SceneGraphs, World

MOST_WAYS = 16  # through one start
MOST_IN_ALL = 120
_SURE = (
    "edit", "create_graph", "create_node", "create_variable", "set_target_prims", "set_targets",
    "SetTargets", "AddTarget", "disconnect", "evaluate_sync", "disconnect_all", "delete_node",
)  # fmt: skip
_OF_OBJECTS = ("connect", "set", "Set", "create_attribute", "evaluate")
_FIRST = ("setUp", "asyncSetUp", "setup_method", "setup", "setUpClass")


class Start(Struct, frozen=True):
    """Where ways begin: the module, a function, or a method of a class."""

    name: str
    owner: str = ""


class Way(Struct, frozen=True, eq=False):
    """What one way through a script builds; at the line `stopped` it ended early."""

    worlds: tuple[World, ...]
    stopped: int = 0


def ways(tree: ast.Module, building: Building, scene: SceneGraphs) -> Iterator[Way]:
    """Yield the ways through a script over a scene, those of one start together."""
    builders = frozenset(_builders(tree))
    looked_at: dict[int, bool] = {}
    entered: set[int] = set()
    count = 0
    for start, code in _starts(tree, builders):
        if code is not None and id(code) in entered:
            continue
        most = min(count + MOST_WAYS, MOST_IN_ALL)
        ahead: list[list[bool]] = [[]]
        while ahead and count < most:
            decisions = ahead.pop(0)
            helpers = call_value, assign, _set_elsewhere
            run = Run(decisions, builders, building, looked_at, World(scene), *helpers)
            yield _follow(tree, start, run)
            count += 1
            entered |= run.entered
            ahead += [
                [*run.taken[:number], not run.taken[number]]
                for number in range(len(decisions), len(run.taken))
            ]


def _follow(tree: ast.Module, start: Start, run: Run) -> Way:
    scope = Scope("module")
    stopped = 0
    try:
        execute(tree.body, scope, run)
        if start.name:
            run.world = World(run.world.scene)
            _enter(start, scope, run)
        for function in run.inner:
            if id(function.node) not in run.entered and _builds(function.node, run.builders):
                call_function(function, Arguments(), run, function.node)
    except StepLimitError:
        stopped = run.line
        for graph in run.world.graphs.values():
            run.world.open_graph(graph.path, Unknown("what follows", stopped))
    return Way((*run.world.past, run.world), stopped)


def _enter(start: Start, scope: Scope, run: Run) -> None:
    """Call the function or method of a start."""
    if not start.owner:
        function = scope.names.get(start.name)
        if isinstance(function, Function):
            call_function(function, Arguments(), run, function.node)
        return
    kind = scope.names.get(start.owner)
    if not isinstance(kind, Class):
        return
    own = construct(kind, Arguments(), run, kind.node)
    run.inner.clear()
    for name in (*(_FIRST if start.name.startswith("test") else ()), start.name):
        if name != "__init__" and kind.find(name) is not None:
            method = attribute_of(own, ast.Attribute(ast.Name(start.owner), name), run)
            if isinstance(method, Function):
                call_function(method, Arguments(), run, method.node)


def _set_elsewhere(own: Instance, node: ast.Attribute, run: Run) -> Value:
    """Return an attribute that another method of the class sets, where only one place does."""
    values = [
        (value, kind)
        for kind in own.type.lines()
        for value in _assigned(kind.node).get(node.attr, ())
        if not (isinstance(value, ast.Constant) and value.value is None)
    ]
    if len(values) != 1:
        return unknown(node)
    value, kind = values[0]
    if any(isinstance(part, (ast.Call, ast.Await, ast.Attribute)) for part in ast.walk(value)):
        return unknown(node)
    result = evaluate(value, Scope("function", kind.scope), run)
    own.attributes[node.attr] = result
    return result


@lru_cache(maxsize=64)
def _assigned(node: ast.ClassDef) -> dict[str, list[ast.expr]]:
    """Return what the methods of a class assign to each attribute of their object."""
    expressions: dict[str, list[ast.expr]] = {}
    for part in ast.walk(node):
        if isinstance(part, (ast.Assign, ast.AnnAssign)) and part.value is not None:
            for target in part.targets if isinstance(part, ast.Assign) else [part.target]:
                if isinstance(target, ast.Attribute) and isinstance(target.value, ast.Name):
                    expressions.setdefault(target.attr, []).append(part.value)
    return expressions


def _starts(tree: ast.Module, builders: frozenset[int]) -> list[tuple[Start, ast.AST | None]]:
    """Return the module, then the functions that may be called from outside, callers first."""
    starts: list[tuple[Start, ast.AST]] = []
    for node in _statements(tree.body):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and _builds(node, builders):
            starts.append((Start(node.name), node))
        elif isinstance(node, ast.ClassDef):
            starts += [
                (Start(inner.name, node.name), inner)
                for inner in node.body
                if isinstance(inner, (ast.FunctionDef, ast.AsyncFunctionDef))
                and _builds(inner, builders)
            ]
    called: set[str] = set()
    for start, code in starts:
        calls = {last_name(part) for part in ast.walk(code) if isinstance(part, ast.Call)}
        called |= calls - {start.name}
        if start.name == "__init__":
            called.discard(start.owner)
    first = [each for each in starts if each[0].name not in called]
    rest = [each for each in starts if each[0].name in called]
    return [(Start(""), None), *first, *rest]


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a module, those in its branches with them."""
    for node in body:
        yield node
        for name in ("body", "orelse", "finalbody"):
            inner = getattr(node, name, None)
            if isinstance(node, (ast.If, ast.Try, ast.With)) and isinstance(inner, list):
                yield from _statements(inner)


def _builds(code: ast.AST, builders: frozenset[int]) -> bool:
    return any(id(part) in builders for part in ast.walk(code))


def _builders(tree: ast.Module) -> set[int]:
    """Return the calls that build graphs, by themselves or in functions that they call."""
    calls_that_build: set[int] = set()
    calls: list[ast.Call] = []
    functions: dict[str, list[ast.AST]] = {}
    for part in ast.walk(tree):
        if isinstance(part, (ast.FunctionDef, ast.AsyncFunctionDef)):
            functions.setdefault(part.name, []).append(part)
        elif isinstance(part, ast.ClassDef):
            functions.setdefault(part.name, []).extend(
                each
                for each in part.body
                if isinstance(each, ast.FunctionDef) and each.name in ("__init__", "__post_init__")
            )
        elif isinstance(part, ast.Call):
            calls.append(part)
            if _is_builder(part):
                calls_that_build.add(id(part))
    inside = {
        name: {id(part) for code in codes for part in ast.walk(code) if isinstance(part, ast.Call)}
        for name, codes in functions.items()
    }
    building: set[str] = set()
    while True:
        new = {
            name
            for name, parts in inside.items()
            if name not in building and not calls_that_build.isdisjoint(parts)
        }
        if not new:
            return calls_that_build
        building |= new
        calls_that_build |= {id(call) for call in calls if last_name(call) in building}


def _is_builder(call: ast.Call) -> bool:
    name = last_name(call)
    if name in _SURE:
        return True
    if name not in _OF_OBJECTS or not isinstance(call.func, ast.Attribute):
        return False
    owner = call.func.value
    if isinstance(owner, ast.Call):
        return last_name(owner) in ("attribute", "get_attribute", "GetAttribute")
    return isinstance(owner, ast.Attribute) and owner.attr == "Controller"
