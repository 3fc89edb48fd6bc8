"""Kit's pure nodes: what each makes of its inputs, for rules that fold constants and for a dry run.

Their source is not public: the ports are those of NVIDIA's published documentation of the nodes
(graphs/isaac/kit_types.json), which says what each computes (docs.omniverse.nvidia.com,
ext_omnigraph/node-library/nodes/omni-graph-nodes, and GeneratedNodeDocumentation, whose pages are
named here). Values may be numbers, or vectors and arrays of them. Angles are in degrees.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import Any, Literal

# What reaches an input, by its name without `inputs:`; None where nothing does.
_Get = Callable[[str], Any]
_Operation = Callable[[Any, Any], Any]
Outputs = dict[str, Any]
# A node's outputs from what reaches its inputs, and the names of the inputs that it has.
PureNode = Callable[[_Get, Collection[str]], Outputs]
_TEXTS = {"ToString", "ToToken", "BuildString"}
PURE_NODES: dict[str, PureNode] = {}  # by the last part of the name of a type


class NoOutputError(Exception):
    """A node gives nothing for what reaches it."""

    def __init__(
        self, reason: str, kind: Literal["no-number-input", "no-vector-input"] = "no-number-input"
    ) -> None:
        """Name the reason, and the kind of fault that it is."""
        super().__init__(reason)
        self.reason = reason
        self.kind = kind


def makes_text(name: str) -> bool:
    """Whether a node makes a text of other values, whose digits only Kit knows."""
    return name in _TEXTS


def last_part(node_type: str) -> str:
    """Return the name of a type without the extension that it is of."""
    return node_type.rpartition(".")[2]


def absorbing(name: str, terms: Iterable[Any]) -> float | None:
    """Return what a node gives whatever else reaches it: a product 0 where one term is 0."""
    is_zero = any(type(term) in (int, float) and term == 0 for term in terms)
    return 0.0 if name == "Multiply" and is_zero else None


def are_numbers(values: Iterable[object]) -> bool:
    """Whether all of some values are numbers."""
    for value in values:  # noqa: SIM110 - at each step; a generator takes twice as long
        if not isinstance(value, (float, int)):  # as a rule it is a float
            return False
    return True


def _pure(*names: str) -> Callable[[PureNode], PureNode]:
    def register(function: PureNode) -> PureNode:
        PURE_NODES.update(dict.fromkeys(names, function))
        return function

    return register


def _parts(value: object) -> Iterator[object]:
    """Yield what a value consists of, itself where it is no vector or array."""
    if isinstance(value, tuple):
        for part in value:
            yield from _parts(part)
    else:
        yield value


def _numbers(*values: Any) -> None:
    """Demand numbers, or vectors and arrays of nothing else."""
    if not all(are_numbers(_parts(value)) for value in values):
        which = "it" if len(values) == 1 else "one of its inputs"
        raise NoOutputError(f"no number reaches {which}")


def _vectors(*values: Any) -> None:
    """Demand vectors of numbers."""
    for value in values:
        if not isinstance(value, tuple) or not are_numbers(value):
            raise NoOutputError("no vector reaches it", "no-vector-input")


def _items(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else ()


def _whole(value: Any) -> int:
    return int(value) if isinstance(value, (int, float)) and math.isfinite(value) else 0


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


def _each(value: Any, operation: Callable[[Any], Any]) -> Any:
    """Return a value with every number in it changed."""
    if isinstance(value, tuple):
        return tuple(_each(part, operation) for part in value)
    return operation(value)


def term_names(names: Collection[str]) -> list[str]:
    """Return `a`, `b` and the inputs that were added to them, which are `input2` and so on."""
    added = (name for name in names if name.startswith("input"))
    return ["a", "b", *sorted(added, key=lambda name: (len(name), name))]


# ---- arithmetic


def _of_terms(output: str, operation: _Operation) -> PureNode:
    def compute(get: _Get, names: Collection[str]) -> Outputs:
        terms = [get(name) for name in term_names(names)]
        if not all(are_numbers(_parts(term)) for term in terms):
            raise NoOutputError("no number reaches one of its inputs")
        result = terms[0]
        for term in terms[1:]:
            result = _combined(result, term, operation)
        return {output: result}

    return compute


# add-2.html, subtract-2.html, multiply-2.html: all inputs, from the first to the last.
_pure("Add")(_of_terms("sum", operator.add))
_pure("Subtract")(_of_terms("difference", operator.sub))
_pure("Multiply")(_of_terms("product", operator.mul))
_divided = _of_terms("result", operator.truediv)


@_pure("Divide")
def _divide(get: _Get, names: Collection[str]) -> Outputs:
    """divide-2.html: the first input divided by the second."""
    if 0 in _parts(get("b")):
        raise NoOutputError("it divides by 0")
    return _divided(get, names)


@_pure("Clamp")
def _clamp(get: _Get, _names: Collection[str]) -> Outputs:
    """clamp-1.html: the input cut to a range; no range is an error."""
    value, low, high = bounds = [get(name) for name in ("input", "lower", "upper")]
    _numbers(*bounds)
    if not isinstance(low, tuple) and not isinstance(high, tuple) and low > high:
        raise NoOutputError("its lower bound is above the upper one")
    return {"result": _combined(_combined(value, low, max), high, min)}


_COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    ">": operator.gt,
    "<": operator.lt,
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
}


@_pure("Compare")
def _compare(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnCompare.html: two values of one kind, element by element."""
    operation = _COMPARISONS.get(str(get("operation") or ""))
    if operation is None:
        raise NoOutputError("its operation is invalid")
    try:
        return {"result": _combined(get("a"), get("b"), operation)}
    except TypeError as error:
        raise NoOutputError("values of two kinds reach it") from error


def _switch(operation: Callable[[list[bool]], bool]) -> PureNode:
    return lambda get, names: {"result": operation([bool(get(n)) for n in term_names(names)])}


# OgnBooleanAnd.html and its like: switches in one.
_pure("BooleanAnd")(_switch(all))
_pure("BooleanOr")(_switch(any))
_pure("BooleanNand")(_switch(lambda terms: not all(terms)))
_pure("BooleanNor")(_switch(lambda terms: not any(terms)))
_pure("BooleanXor")(_switch(lambda terms: sum(terms) % 2 == 1))


@_pure("BooleanNot")
def _invert(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnBooleanNot.html: the switch the other way."""
    return {"valueOut": not get("valueIn")}


@_pure("SelectIf")
def _select(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnSelectIf.html: one of two values; the other one is not asked for."""
    return {"result": get("ifTrue" if get("condition") else "ifFalse")}


# ---- functions of one value or two

# By the name of a type: its input, its output, and what becomes of each number
# (OgnSin.html, OgnToDeg.html, OgnToInt.html and their like).
_FUNCTIONS: dict[str, tuple[str, str, Callable[[Any], Any]]] = {
    "Absolute": ("input", "absolute", abs),
    "Negate": ("input", "output", operator.neg),
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
# The same of two inputs (OgnATan2.html, OgnModulo.html, OgnExponent.html and their like).
_FUNCTIONS_OF_TWO: dict[str, tuple[str, str, str, _Operation]] = {
    "ATan2": ("a", "b", "result", lambda a, b: math.degrees(math.atan2(a, b))),
    "Modulo": ("a", "b", "result", math.fmod),
    "Exponent": ("base", "exponent", "result", math.pow),
    "Increment": ("value", "increment", "result", operator.add),
    "NthRoot": ("value", "nthRoot", "result", lambda a, b: math.pow(a, 1.0 / b)),
    "Round": ("input", "decimals", "output", lambda a, b: round(a, int(b))),
}
_NO_VALUE = "its function has no value there"


def _of_one(name: str, output: str, operation: Callable[[Any], Any]) -> PureNode:
    def compute(get: _Get, _names: Collection[str]) -> Outputs:
        value = get(name)
        _numbers(value)
        try:
            return {output: _each(value, operation)}
        except (ValueError, OverflowError, TypeError) as error:
            raise NoOutputError(_NO_VALUE) from error

    return compute


def _of_two(one: str, other: str, output: str, operation: _Operation) -> PureNode:
    def compute(get: _Get, _names: Collection[str]) -> Outputs:
        first, second = get(one), get(other)
        _numbers(first, second)
        try:
            result = _combined(first, second, operation)
        except (ValueError, ArithmeticError, TypeError) as error:
            raise NoOutputError(_NO_VALUE) from error
        is_whole = isinstance(first, int) and isinstance(second, int)
        return {output: _each(result, int) if is_whole else result}

    return compute


PURE_NODES.update({name: _of_one(*ports) for name, ports in _FUNCTIONS.items()})
PURE_NODES.update({name: _of_two(*ports) for name, ports in _FUNCTIONS_OF_TWO.items()})


@_pure("ConstantPi")
def _pi(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnConstantPi.html: pi times a factor."""
    factor = get("factor")
    return {"value": math.pi * factor if isinstance(factor, (int, float)) else 0.0}


@_pure("ConstantE")
def _euler(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnConstantE.html: Euler's number to the power of an exponent."""
    exponent = get("exponent")
    try:
        return {"value": math.exp(exponent if isinstance(exponent, (int, float)) else 0.0)}
    except OverflowError as error:
        raise NoOutputError(_NO_VALUE) from error


# ---- texts


@_pure("ToString", "ToToken")
def _text(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnToString.html, OgnToToken.html: any value as text."""
    return {"converted": str(get("value"))}


@_pure("BuildString")
def _joined_text(get: _Get, names: Collection[str]) -> Outputs:
    """OgnBuildString.html: texts, one after the other."""
    parts = ["a", "b", *sorted(set(names) - {"a", "b"})]
    return {"value": "".join(str(get(name) or "") for name in parts)}


# ---- vectors

_BROKEN = {"BreakVector2": "xy", "BreakVector3": "xyz", "BreakVector4": "xyzw"}
_MADE = {"MakeVector2": "xy", "MakeVector3": "xyz", "MakeVector4": "xyzw"}


def _break(components: str) -> PureNode:
    def compute(get: _Get, _names: Collection[str]) -> Outputs:
        value = get("tuple")
        if not isinstance(value, tuple) or len(value) != len(components):
            raise NoOutputError("no vector reaches it", "no-vector-input")
        return dict(zip(components, value, strict=True))

    return compute


def _make(components: str) -> PureNode:
    def compute(get: _Get, _names: Collection[str]) -> Outputs:
        parts = [get(name) for name in components]
        if not are_numbers(parts):
            raise NoOutputError("no number reaches one of its inputs")
        return {"tuple": tuple(parts)}

    return compute


# OgnBreakVector3.html, OgnMakeVector3.html and their like: a vector and its components.
PURE_NODES.update({name: _break(components) for name, components in _BROKEN.items()})
PURE_NODES.update({name: _make(components) for name, components in _MADE.items()})


@_pure("Magnitude")
def _magnitude(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnMagnitude.html: the length of a vector; of a number, that without its sign."""
    value = get("input")
    parts = value if isinstance(value, tuple) else (value,)
    if not are_numbers(parts):
        raise NoOutputError("no number reaches it")
    return {"magnitude": math.hypot(*parts)}


@_pure("Normalize")
def _normalize(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnNormalize.html: a vector of the same direction and the length 1; zeros stay."""
    value = get("vector")
    _vectors(value)
    length = math.hypot(*value)
    return {"result": tuple(part / length for part in value) if length else value}


@_pure("DotProduct")
def _dot_product(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnDotProduct.html: the sum of the products of components."""
    one, other = get("a"), get("b")
    _vectors(one, other)
    return {"product": math.fsum(a * b for a, b in zip(one, other, strict=False))}


@_pure("CrossProduct")
def _cross_product(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnCrossProduct.html: the vector upright on both."""
    one, other = (_items(get(name)) for name in "ab")
    if (len(one), len(other)) != (3, 3):
        raise NoOutputError("no vector reaches it", "no-vector-input")
    _vectors(one, other)
    pairs = ((1, 2), (2, 0), (0, 1))
    return {"product": tuple(one[i] * other[j] - one[j] * other[i] for i, j in pairs)}


# ---- arrays

_NO_ELEMENT = "the array that reaches it has no such element"


@_pure("ArrayIndex")
def _array_index(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnArrayIndex.html: an element, counted from the end where the index is negative."""
    array, index = get("array"), _whole(get("index"))
    if not isinstance(array, (tuple, str)) or not -len(array) <= index < len(array):
        raise NoOutputError(_NO_ELEMENT)
    return {"value": array[index]}


@_pure("ArrayGetSize")
def _array_size(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnArrayGetSize.html: how many elements there are."""
    array = get("array")
    return {"size": len(array) if isinstance(array, (tuple, str)) else 0}


@_pure("ArraySetIndex")
def _array_set_index(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnArraySetIndex.html: a copy with one element changed; it grows where that is asked for."""
    array, index = _items(get("array")), _whole(get("index"))
    if index >= len(array) and get("resizeToFit"):
        array = (*array, *[0] * (index + 1 - len(array)))
    if not -len(array) <= index < len(array):
        raise NoOutputError(_NO_ELEMENT)
    place = index % len(array)
    return {"array": (*array[:place], get("value"), *array[place + 1 :])}


@_pure("AppendArray")
def _append_array(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnAppendArray.html: one array behind the other."""
    return {"array": (*_items(get("input0")), *_items(get("input1")))}


@_pure("ArrayReverse")
def _array_reverse(get: _Get, _names: Collection[str]) -> Outputs:
    """OgnArrayReverse.html: the elements the other way round."""
    return {"array": _items(get("array"))[::-1]}
