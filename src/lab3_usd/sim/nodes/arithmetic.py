"""Kit's pure nodes: arithmetic, comparisons, switches and variables.

Their source is not public: the ports are those of NVIDIA's published documentation of the nodes
(graphs/isaac/kit_types.json), which says what each computes (docs.omniverse.nvidia.com,
ext_omnigraph/node-library/nodes/omni-graph-nodes, and GeneratedNodeDocumentation).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from typing import Any

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.sim.execution.node_instance import NodeInstance, are_numbers, computes
from lab3_usd.sim.execution.world import World
from lab3_usd.sim.nodes.numbers import combined

_Number = int | float
_Operation = Callable[[_Number, _Number], _Number]


def _parts(value: object) -> Iterator[object]:
    """Yield what a value consists of, itself where it is no vector or array."""
    if isinstance(value, tuple):
        for part in value:
            yield from _parts(part)
    else:
        yield value


def _is_of_numbers(value: object) -> bool:
    return are_numbers(_parts(value))


def _terms(node: NodeInstance, world: World) -> list[Any]:
    """Return the values of `a`, `b` and the inputs that were added to them, those that are there.

    The ones that were added are `input2` and so on.
    """
    added = [name.removeprefix(INPUT) for name in node.node.inputs]
    added = sorted((name for name in added if name.startswith("input")), key=lambda n: (len(n), n))
    return [node.get(name, world) for name in ("a", "b", *added)]


def _calculate(node: NodeInstance, world: World, output: str, operation: _Operation) -> bool:
    terms = _terms(node, world)
    if not all(map(_is_of_numbers, terms)):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    result = terms[0]
    for term in terms[1:]:
        result = combined(result, term, operation)
    node.outputs[output] = result
    return True


@computes("Add")
def add(node: NodeInstance, world: World) -> bool:
    """add-2.html: the sum of all inputs."""
    return _calculate(node, world, "sum", lambda a, b: a + b)


@computes("Subtract")
def subtract(node: NodeInstance, world: World) -> bool:
    """subtract-2.html: the inputs that follow are taken from the first."""
    return _calculate(node, world, "difference", lambda a, b: a - b)


@computes("Multiply")
def multiply(node: NodeInstance, world: World) -> bool:
    """multiply-2.html: the product of all inputs."""
    return _calculate(node, world, "product", lambda a, b: a * b)


@computes("Divide")
def divide(node: NodeInstance, world: World) -> bool:
    """divide-2.html: the first input divided by the second."""
    second = node.get("b", world)
    if 0 in _parts(second):
        return node.fails("it divides by 0", "no-number-input")
    return _calculate(node, world, "result", lambda a, b: a / b)


@computes("Clamp")
def clamp(node: NodeInstance, world: World) -> bool:
    """clamp-1.html: the input cut to a range; no range is an error."""
    bounds: list[Any] = [node.get(name, world) for name in ("input", "lower", "upper")]
    value, low, high = bounds
    if not all(map(_is_of_numbers, bounds)):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    if not isinstance(low, tuple) and not isinstance(high, tuple) and low > high:
        return node.fails("its lower bound is above the upper one", "no-number-input")
    node.outputs["result"] = combined(combined(value, low, max), high, min)
    return True


_COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    ">": operator.gt,
    "<": operator.lt,
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
}


@computes("Compare")
def compare(node: NodeInstance, world: World) -> bool:
    """OgnCompare.html: two values of one kind, element by element."""
    first, second = node.get("a", world), node.get("b", world)
    operation = _COMPARISONS.get(node.text("operation", world))
    if operation is None:
        return node.fails("its operation is invalid", "no-number-input")
    try:
        node.outputs["result"] = combined(first, second, operation)
    except TypeError:
        return node.fails("values of two kinds reach it", "no-number-input")
    return True


_SWITCHES: dict[str, Callable[[list[bool]], bool]] = {
    "BooleanAnd": all,
    "BooleanOr": any,
    "BooleanNand": lambda terms: not all(terms),
    "BooleanNor": lambda terms: not any(terms),
    "BooleanXor": lambda terms: sum(terms) % 2 == 1,
}


@computes(*_SWITCHES)
def switch(node: NodeInstance, world: World) -> bool:
    """OgnBooleanAnd.html and its like: switches in one."""
    operation = _SWITCHES[node.type.type.rpartition(".")[2]]
    node.outputs["result"] = operation([bool(term) for term in _terms(node, world)])
    return True


@computes("BooleanNot")
def invert(node: NodeInstance, world: World) -> bool:
    """OgnBooleanNot.html: the switch the other way."""
    node.outputs["valueOut"] = not node.get("valueIn", world)
    return True


@computes("SelectIf")
def select(node: NodeInstance, world: World) -> bool:
    """OgnSelectIf.html: one of two values."""
    name = "ifTrue" if node.flag("condition", world) else "ifFalse"
    node.outputs["result"] = node.get(name, world)
    return True


@computes("ReadVariable")
def read_variable(node: NodeInstance, world: World) -> bool:
    """omni-graph-core/readvariable-2.html: what a variable of the graph holds."""
    name, path = node.text("variableName", world), node.path.rpartition("/")[0]
    targets = node.targets("graph")
    path = targets[0] if targets else path
    graph = next((graph for graph in world.scene.graphs if graph.path == path), None)
    if graph is None or name not in graph.variables:
        return node.fails(f"the graph has no variable '{name}'", "no-number-input")
    node.outputs["value"] = graph.variables[name]
    return True
