"""Kit's nodes that make one value of one: functions, conversions, vectors and arrays.

What each computes is said by NVIDIA's published documentation of Kit's node library: the pages
named here are those of its GeneratedNodeDocumentation (docs.omniverse.nvidia.com/kit/docs).
Values may be numbers, or vectors and arrays of them. Angles are in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from lab3_usd.sim.execution.node_instance import NodeInstance, are_numbers, computes
from lab3_usd.sim.execution.world import World


def combined(first: Any, second: Any, operation: Callable[[Any, Any], Any]) -> Any:
    """Return two values combined element by element; a number goes with each of a vector."""
    if isinstance(first, tuple) and isinstance(second, tuple):
        pairs = zip(first, second, strict=False)
        return tuple(combined(a, b, operation) for a, b in pairs)
    if isinstance(first, tuple):
        return tuple(combined(a, second, operation) for a in first)
    if isinstance(second, tuple):
        return tuple(combined(first, b, operation) for b in second)
    return operation(first, second)


def each(value: Any, operation: Callable[[Any], Any]) -> Any:
    """Return a value with every number in it changed."""
    if isinstance(value, tuple):
        return tuple(each(part, operation) for part in value)
    return operation(value)


# By the name of a type: its input, its output, and what becomes of each number.
_FUNCTIONS: dict[str, tuple[str, str, Callable[[Any], Any]]] = {
    "Absolute": ("input", "absolute", abs),
    "Negate": ("input", "output", lambda x: -x),
    "Floor": ("a", "result", lambda x: float(math.floor(x))),
    "Ceil": ("a", "result", lambda x: float(math.ceil(x))),
    "Sin": ("value", "value", lambda x: math.sin(math.radians(x))),
    "Cos": ("value", "value", lambda x: math.cos(math.radians(x))),
    "Tan": ("value", "value", lambda x: math.tan(math.radians(x))),
    "Asin": ("value", "value", lambda x: math.degrees(math.asin(x))),
    "Acos": ("value", "value", lambda x: math.degrees(math.acos(x))),
    "Atan": ("value", "value", lambda x: math.degrees(math.atan(x))),
    "ToDeg": ("radians", "degrees", math.degrees),
    "ToRad": ("degrees", "radians", math.radians),
    "ToDouble": ("value", "converted", float),
    "ToFloat": ("value", "converted", float),
    "ToHalf": ("value", "converted", float),
    "ToInt": ("value", "converted", int),
    "ToInt64": ("value", "converted", int),
    "ToUint": ("value", "converted", int),
    "ToUint64": ("value", "converted", int),
    "ToUchar": ("value", "converted", int),
    "ToBool": ("value", "converted", bool),
}


def _is_number(value: object) -> bool:
    """Whether a value is a number, or a vector or array of nothing else."""
    return all(map(_is_number, value)) if isinstance(value, tuple) else are_numbers((value,))


@computes(*_FUNCTIONS)
def function(node: NodeInstance, world: World) -> bool:
    """OgnSin.html, OgnToDeg.html, OgnToInt.html and their like: a function of one value."""
    name, output, operation = _FUNCTIONS[node.type.type.rpartition(".")[2]]
    value = node.get(name, world)
    if not _is_number(value):
        return node.fails("no number reaches it", "no-number-input")
    try:
        node.outputs[output] = each(value, operation)
    except (ValueError, OverflowError, TypeError):
        return node.fails("its function has no value there", "no-number-input")
    return True


# The same of two inputs.
_FUNCTIONS_OF_TWO: dict[str, tuple[str, str, str, Callable[[Any, Any], Any]]] = {
    "ATan2": ("a", "b", "result", lambda a, b: math.degrees(math.atan2(a, b))),
    "Modulo": ("a", "b", "result", math.fmod),
    "Exponent": ("base", "exponent", "result", math.pow),
    "Increment": ("value", "increment", "result", lambda a, b: a + b),
    "NthRoot": ("value", "nthRoot", "result", lambda a, b: math.pow(a, 1.0 / b)),
    "Round": ("input", "decimals", "output", lambda a, b: round(a, int(b))),
}


@computes(*_FUNCTIONS_OF_TWO)
def function_of_two(node: NodeInstance, world: World) -> bool:
    """OgnATan2.html, OgnModulo.html, OgnExponent.html and their like: a function of two values."""
    one, other, output, operation = _FUNCTIONS_OF_TWO[node.type.type.rpartition(".")[2]]
    first, second = node.get(one, world), node.get(other, world)
    if not _is_number(first) or not _is_number(second):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    try:
        result = combined(first, second, operation)
    except (ValueError, ArithmeticError, TypeError):
        return node.fails("its function has no value there", "no-number-input")
    is_whole = isinstance(first, int) and isinstance(second, int)
    node.outputs[output] = each(result, int) if is_whole else result
    return True


@computes("ToString", "ToToken")
def to_text(node: NodeInstance, world: World) -> bool:
    """OgnToString.html, OgnToToken.html: any value as text."""
    node.outputs["converted"] = str(node.get("value", world))
    return True


@computes("BuildString")
def joined_text(node: NodeInstance, world: World) -> bool:
    """OgnBuildString.html: texts, one after the other."""
    names = ["a", "b", *sorted(name for name in node.values if name not in ("a", "b"))]
    node.outputs["value"] = "".join(node.text(name, world) for name in names)
    return True


@computes("ConstantPi")
def pi(node: NodeInstance, world: World) -> bool:
    """OgnConstantPi.html: pi times a factor."""
    node.outputs["value"] = math.pi * node.number("factor", world)
    return True


@computes("ConstantE")
def euler(node: NodeInstance, world: World) -> bool:
    """OgnConstantE.html: Euler's number to the power of an exponent."""
    try:
        node.outputs["value"] = math.exp(node.number("exponent", world))
    except OverflowError:
        return node.fails("its function has no value there", "no-number-input")
    return True


_PARTS = {"BreakVector2": "xy", "BreakVector3": "xyz", "BreakVector4": "xyzw"}
_WHOLES = {"MakeVector2": "xy", "MakeVector3": "xyz", "MakeVector4": "xyzw"}


@computes(*_PARTS)
def break_vector(node: NodeInstance, world: World) -> bool:
    """OgnBreakVector3.html and its like: one output for each component."""
    names, value = _PARTS[node.type.type.rpartition(".")[2]], node.get("tuple", world)
    if not isinstance(value, tuple) or len(value) != len(names):
        return node.fails("no vector reaches it", "no-vector-input")
    node.outputs.update(zip(names, value, strict=True))
    return True


@computes(*_WHOLES)
def make_vector(node: NodeInstance, world: World) -> bool:
    """OgnMakeVector3.html and its like: numbers as a vector."""
    parts = [node.get(name, world) for name in _WHOLES[node.type.type.rpartition(".")[2]]]
    if any(not isinstance(part, (int, float)) for part in parts):
        return node.fails("no number reaches one of its inputs", "no-number-input")
    node.outputs["tuple"] = tuple(parts)
    return True


@computes("Magnitude")
def magnitude(node: NodeInstance, world: World) -> bool:
    """OgnMagnitude.html: the length of a vector; of a number, that without its sign."""
    value = node.get("input", world)
    parts = value if isinstance(value, tuple) else (value,)
    if not are_numbers(parts):
        return node.fails("no number reaches it", "no-number-input")
    node.outputs["magnitude"] = math.hypot(*parts)
    return True


@computes("Normalize")
def normalize(node: NodeInstance, world: World) -> bool:
    """OgnNormalize.html: a vector of the same direction and the length 1; zeros stay."""
    value = node.get("vector", world)
    if not isinstance(value, tuple) or not are_numbers(value):
        return node.fails("no vector reaches it", "no-vector-input")
    length = math.hypot(*value)
    node.outputs["result"] = tuple(part / length for part in value) if length else value
    return True


@computes("DotProduct")
def dot_product(node: NodeInstance, world: World) -> bool:
    """OgnDotProduct.html: the sum of the products of components."""
    one, other = node.get("a", world), node.get("b", world)
    if not isinstance(one, tuple) or not isinstance(other, tuple):
        return node.fails("no vector reaches it", "no-vector-input")
    if not are_numbers((*one, *other)):
        return node.fails("no vector reaches it", "no-vector-input")
    node.outputs["product"] = math.fsum(a * b for a, b in zip(one, other, strict=False))
    return True


@computes("CrossProduct")
def cross_product(node: NodeInstance, world: World) -> bool:
    """OgnCrossProduct.html: the vector upright on both."""
    one, other = (node.items(name, world) for name in "ab")
    if (len(one), len(other)) != (3, 3) or not are_numbers((*one, *other)):
        return node.fails("no vector reaches it", "no-vector-input")
    pairs = ((1, 2), (2, 0), (0, 1))
    node.outputs["product"] = tuple(one[i] * other[j] - one[j] * other[i] for i, j in pairs)
    return True


@computes("ArrayIndex")
def array_index(node: NodeInstance, world: World) -> bool:
    """OgnArrayIndex.html: an element, counted from the end where the index is negative."""
    array, index = node.get("array", world), node.whole("index", world)
    if not isinstance(array, (tuple, str)) or not -len(array) <= index < len(array):
        return node.fails("the array that reaches it has no such element", "no-number-input")
    node.outputs["value"] = array[index]
    return True


@computes("ArrayGetSize")
def array_size(node: NodeInstance, world: World) -> bool:
    """OgnArrayGetSize.html: how many elements there are."""
    array = node.get("array", world)
    node.outputs["size"] = len(array) if isinstance(array, (tuple, str)) else 0
    return True


@computes("ArraySetIndex")
def array_set_index(node: NodeInstance, world: World) -> bool:
    """OgnArraySetIndex.html: a copy with one element changed; it grows where that is asked for."""
    array, index = node.items("array", world), node.whole("index", world)
    if index >= len(array) and node.flag("resizeToFit", world):
        array = (*array, *[0] * (index + 1 - len(array)))
    if not -len(array) <= index < len(array):
        return node.fails("the array that reaches it has no such element", "no-number-input")
    place = index % len(array)
    node.outputs["array"] = (*array[:place], node.get("value", world), *array[place + 1 :])
    return True


@computes("AppendArray")
def append_array(node: NodeInstance, world: World) -> bool:
    """OgnAppendArray.html: one array behind the other."""
    node.outputs["array"] = (*node.items("input0", world), *node.items("input1", world))
    return True


@computes("ArrayReverse")
def array_reverse(node: NodeInstance, world: World) -> bool:
    """OgnArrayReverse.html: the elements the other way round."""
    node.outputs["array"] = node.items("array", world)[::-1]
    return True
