"""Kit's pure nodes: arithmetic, conversions, vectors, variables and branches.

Their source is not public: the ports are those of NVIDIA's scripts and saved stages
(graphs/isaac/kit_types.yaml) and of the node library in Omniverse's documentation, which says what
each computes (docs.omniverse.nvidia.com, ext_omnigraph/node-library/nodes/omni-graph-nodes).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.sim.execution.node_instance import NodeInstance, are_numbers, computes
from lab3_usd.sim.execution.world import World

_Number = int | float
_Operation = Callable[[_Number, _Number], _Number]


def _combined(first: Any, second: Any, operation: _Operation) -> Any:
    """Return two values combined element by element; a number goes with each of a vector."""
    if isinstance(first, tuple) and isinstance(second, tuple):
        pairs = zip(first, second, strict=False)
        return tuple(_combined(a, b, operation) for a, b in pairs)
    if isinstance(first, tuple):
        return tuple(_combined(a, second, operation) for a in first)
    if isinstance(second, tuple):
        return tuple(_combined(first, b, operation) for b in second)
    return operation(first, second)


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
        result = _combined(result, term, operation)
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


@computes("Negate")
def negate(node: NodeInstance, world: World) -> bool:
    """negate-1.html: the input times -1."""
    value = node.get("input", world)
    if not _is_of_numbers(value):
        return node.fails("no number reaches it", "no-number-input")
    node.outputs["output"] = _combined(value, -1, lambda a, b: a * b)
    return True


@computes("Clamp")
def clamp(node: NodeInstance, world: World) -> bool:
    """clamp-1.html: the input cut to a range; no range is an error."""
    bounds: list[Any] = [node.get(name, world) for name in ("input", "lower", "upper")]
    value, low, high = bounds
    if not all(map(_is_of_numbers, bounds)):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    if not isinstance(low, tuple) and not isinstance(high, tuple) and low > high:
        return node.fails("its lower bound is above the upper one", "no-number-input")
    node.outputs["result"] = _combined(_combined(value, low, max), high, min)
    return True


@computes("ToDouble", "ToFloat")
def to_number(node: NodeInstance, world: World) -> bool:
    """todouble-1.html, tofloat-1.html: numbers and switches as numbers with a fraction."""
    value = node.get("value", world)
    if not _is_of_numbers(value):
        return node.fails("no number reaches it", "no-number-input")
    node.outputs["converted"] = _combined(value, 1.0, lambda a, b: float(a) * b)
    return True


@computes("ToString")
def to_string(node: NodeInstance, world: World) -> bool:
    """tostring-1.html: any value as text."""
    node.outputs["converted"] = str(node.get("value", world))
    return True


@computes("MakeVector3")
def make_vector(node: NodeInstance, world: World) -> bool:
    """makevector3-1.html: three numbers as a vector."""
    parts = [node.get(name, world) for name in "xyz"]
    if any(not isinstance(part, (int, float)) for part in parts):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    node.outputs["tuple"] = tuple(parts)
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


@computes("PrintText")
def print_text(node: NodeInstance, world: World) -> bool:
    """omni-graph-ui-nodes/printtext-1.html: nothing comes of it but a line in the log."""
    del world
    node.enabled.append("execOut")
    return True


@computes("Branch")
def branch(node: NodeInstance, world: World) -> bool:
    """omni-graph-action/branch-1.html: a signal goes on at one of two outputs."""
    node.enabled.append("execTrue" if node.flag("condition", world) else "execFalse")
    return True
