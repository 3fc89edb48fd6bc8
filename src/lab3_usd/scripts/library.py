"""What functions of Python and of common libraries give for known values."""

from __future__ import annotations

import ast
import builtins
import json
import math
import posixpath
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from msgspec.structs import replace

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.operations import as_unknown, listed
from lab3_usd.scripts.run import Arguments
from lab3_usd.scripts.values import (
    MOST_ITEMS,
    MOST_LETTERS,
    At,
    Instance,
    Items,
    Table,
    Text,
    UnknownValueError,
    Value,
    as_text,
    concatenated,
    key_of,
    lifted,
    place,
    plain,
    reason,
    truth,
    unknown,
)

BUILTINS = frozenset(name for name in dir(builtins) if not name.startswith("_"))
_TEXT_METHODS = (
    "join", "replace", "strip", "lstrip", "rstrip", "lower", "upper", "title", "capitalize",
    "split", "rsplit", "removeprefix", "removesuffix", "startswith", "endswith", "partition",
    "rpartition", "find", "rfind", "count", "zfill", "splitlines", "isdigit", "isalpha",
    "isupper", "islower", "casefold", "swapcase",
)  # fmt: skip
_NUMBERS: Mapping[str, Callable[..., Any]] = {
    "radians": math.radians, "deg2rad": math.radians, "degrees": math.degrees,
    "rad2deg": math.degrees, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "asin": math.asin, "acos": math.acos, "atan": math.atan, "atan2": math.atan2,
    "sqrt": math.sqrt, "floor": math.floor, "ceil": math.ceil, "fabs": math.fabs,
    "hypot": math.hypot,
}  # fmt: skip
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "int": int, "float": float, "bool": bool, "len": len, "abs": abs, "min": min, "max": max,
    "sum": sum, "round": round, "all": all, "any": any, "sorted": sorted,
}  # fmt: skip
_SAME = (
    "array", "asarray", "deepcopy", "copy", "float32", "float64", "int32", "int64", "uint32",
    "uint64", "tensor",
)  # fmt: skip
_VECTORS = ("Vec2", "Vec3", "Vec4", "Quat")
_OF_PARTS = ("strip", "rstrip", "lstrip", "encode", "as_posix", "resolve", "GetString", "__str__")


def call_builtin(name: str, given: Arguments, node: ast.AST) -> Value:
    """Return what a function of Python itself gives."""
    values, at = given.given, place(node)
    if given.is_open:
        return unknown(node)
    result = _list_function(name, values, given.named, at)
    if result is not None:
        return result
    if name == "str":
        return as_text(values[0], at) if len(values) == 1 else unknown(node)
    if name in ("dict", "OrderedDict"):
        return _dict(values, given.named, at, node)
    if name == "bool" and values and truth(values[0]) is not None:
        return truth(values[0])
    items = listed(values[0]) if name == "len" and values else None
    if items is not None and items.rest is None:
        return len(items.items)
    if name in _FUNCTIONS:
        return _computed(_FUNCTIONS[name], given, node)
    if name == "getattr" and len(values) > 1:
        own, attribute = values[:2]
        if isinstance(own, Instance) and isinstance(attribute, Text):
            default = values[2] if len(values) > 2 else unknown(node)  # noqa: PLR2004
            return own.attributes.get(attribute.text, default)
    return None if name == "print" else unknown(node)


def _computed(function: Callable[..., Any], given: Arguments, node: ast.AST) -> Value:
    """Return what a function of Python gives, where all that it is given is known."""
    with suppress(UnknownValueError, ValueError, TypeError, OverflowError):
        values = [plain(value) for value in given.given]
        named = {name: plain(value) for name, value in given.named.items()}
        return lifted(function(*values, **named), place(node))
    return unknown(node)


def _list_function(
    name: str, values: list[Value], named: Mapping[str, Value], at: At
) -> Value | None:
    """Return what a function that makes a list gives, None for another function."""
    lists = [listed(value) for value in values]
    first = lists[0] if lists else Items([], at)
    if name in ("list", "tuple", "set", "frozenset", "reversed") and len(values) < 2:  # noqa: PLR2004
        if first is None:
            return Items([], at, "list", reason(values[0], at[0]))
        items = list(reversed(first.items)) if name == "reversed" else list(first.items)
        return Items(items, at, "tuple" if name == "tuple" else "list", first.rest)
    if name == "range" and values and all(isinstance(value, int) for value in values):
        with suppress(ValueError, TypeError, OverflowError):
            numbers = range(*values)
            if len(numbers) <= MOST_ITEMS:
                return Items(list(numbers), at)
        return Unknown("range()", at[0])
    if name == "enumerate" and values and first is not None:
        start = named.get("start", values[1] if len(values) > 1 else 0)
        if isinstance(start, int):
            pairs = [
                Items([number, item], at, "tuple") for number, item in enumerate(first.items, start)
            ]
            return Items(pairs, at, "list", first.rest)
    if name == "zip" and values and all(each is not None for each in lists):
        rows = zip(*(each.items for each in lists if each is not None), strict=False)
        rest = next((each.rest for each in lists if each is not None and each.rest), None)
        return Items([Items(list(row), at, "tuple") for row in rows], at, "list", rest)
    return None


def _dict(values: list[Value], named: Mapping[str, Value], at: At, node: ast.AST) -> Value:
    table = Table(at)
    for value in values:
        if isinstance(value, Table):
            table.update(value)
        elif isinstance(value, Items):
            for pair in value.items:
                if isinstance(pair, Items) and len(pair.items) == 2:  # noqa: PLR2004
                    table.set(*pair.items)
                else:
                    table.rest = unknown(node)
        else:
            table.rest = as_unknown(value, node)
    for word, value in named.items():
        table.set(lifted(word, at), value)
    return table


def call_method(own: Value, name: str, given: Arguments, node: ast.AST) -> Value:
    """Return what a method of a text, a list or a dictionary gives, and change it."""
    if isinstance(own, Text):
        return _call_text(own, name, given, node)
    if isinstance(own, Items):
        return _call_list(own, name, given.given, node)
    return _call_table(own, name, given, node)


def _call_text(own: Text, name: str, given: Arguments, node: ast.AST) -> Value:
    at = place(node)
    if name in ("AppendChild", "AppendPath", "AppendElementString") and given.given:
        slash = as_text(lifted("/", at), at)
        return concatenated([own, slash, as_text(given.given[0], at)], at)
    if name == "join" and given.given and isinstance(given.given[0], Items):
        return _joined(own, given.given[0], at, node)
    if name in _OF_PARTS and not given.given and own.unknown:
        return own
    if name == "format" and not given.is_open:
        return _formatted(own, given, at, node)
    if name in ("split", "rsplit") and own.unknown and len(given.given) == 1:
        return _split(own, given.given[0], at, node)
    if name not in _TEXT_METHODS or given.is_open:
        return unknown(node)
    with suppress(UnknownValueError, ValueError, TypeError, IndexError, KeyError, AttributeError):
        values = [plain(value) for value in given.given]
        if name in ("replace", "zfill"):
            longest = max(
                (len(value) if isinstance(value, str) else int(value) for value in values),
                default=0,
            )
            if len(own.text) * max(longest, 1) > MOST_LETTERS:
                return unknown(node)
        return lifted(getattr(plain(own), name)(*values), at)
    return unknown(node)


def _split(own: Text, mark: Value, at: At, node: ast.AST) -> Value:
    """Return the parts of a text that is known in part: the last ones are what they seem."""
    if not isinstance(mark, Text) or mark.unknown or not mark.text:
        return unknown(node)
    parts = own.text.split(mark.text)
    return Items([Text(part, at, own.unknown if "{" in part else None) for part in parts], at)


def _formatted(own: Text, given: Arguments, at: At, node: ast.AST) -> Value:
    if (
        own.unknown
        or len(own.text) > MOST_LETTERS // 10
        or ":" in own.text.replace("inputs:", "").replace("outputs:", "")
    ):
        return unknown(node)
    values = [as_text(value, at) for value in given.given]
    named = {name: as_text(value, at) for name, value in given.named.items()}
    if sum(len(text.text) for text in (*values, *named.values())) * 50 > MOST_LETTERS:
        return unknown(node)
    with suppress(ValueError, TypeError, IndexError, KeyError, AttributeError):
        text = own.text.format(*[v.text for v in values], **{n: v.text for n, v in named.items()})
        rest = next((v.unknown for v in (*values, *named.values()) if v.unknown), None)
        return Text(text, at, rest)
    return unknown(node)


def _joined(own: Text, items: Items, at: At, node: ast.AST) -> Value:
    if items.rest is not None:
        return unknown(node)
    parts: list[Text] = []
    for item in items.items:
        parts += [own] if parts else []
        parts.append(as_text(item, at))
    return concatenated(parts, at)


def _call_list(own: Items, name: str, values: list[Value], node: ast.AST) -> Value:
    if name in ("append", "add") and values:
        own.extend([values[0]])
    elif name == "extend" and values:
        more = listed(values[0])
        if more is None:
            own.rest = own.rest or as_unknown(values[0], node)
        else:
            own.extend(list(more.items), more.rest)
    elif name == "insert" and len(values) > 1:
        at = values[0] if isinstance(values[0], int) else len(own.items)
        own.items.insert(at, values[1])
    elif name == "copy":
        return Items(list(own.items), own.at, own.kind, own.rest)
    elif name == "tolist":
        return own
    elif name == "pop" and own.items and own.rest is None:
        at = values[0] if values and isinstance(values[0], int) else -1
        return own.items.pop(at) if -len(own.items) <= at < len(own.items) else unknown(node)
    elif name in ("remove", "clear", "sort", "pop", "discard"):
        own.rest = own.rest or unknown(node)
    else:
        return unknown(node)
    return None


def _call_table(own: Table, name: str, given: Arguments, node: ast.AST) -> Value:
    at, values = place(node), given.given
    if name == "items":
        pairs = [Items([own.keys[key], value], at, "tuple") for key, value in own.values.items()]
        return Items(pairs, at, "list", own.rest)
    if name == "values":
        return Items(list(own.values.values()), at, "list", own.rest)
    if name == "keys":
        return Items(list(own.keys.values()), at, "list", own.rest)
    if name in ("get", "setdefault", "pop") and values:
        key = key_of(values[0])
        default = values[1] if len(values) > 1 else given.named.get("default")
        if key is not None and key in own.values:
            return own.values.pop(key) if name == "pop" else own.values[key]
        if key is None or own.rest is not None:
            return unknown(node)
        if name == "setdefault":
            own.set(values[0], default)
        return default
    if name == "update":
        own.update(_dict(values, given.named, at, node))
        return None
    return own.copy() if name == "copy" else unknown(node)


def call_library(name: str, given: Arguments, node: ast.AST) -> Value:
    """Return what a function of a library gives, by its last name."""
    values = given.given
    last = name.rpartition(".")[2]
    if last == "Path" and len(values) == 1 and isinstance(values[0], (Text, Unknown)):
        text = as_text(values[0], place(node))
        is_path = ".Sdf." in f".{name}"
        return replace(text, is_path=is_path)
    if last in _SAME and values and isinstance(values[0], (Items, int, float, Table)):
        return values[0]
    if last in _NUMBERS and name.partition(".")[0] in ("math", "numpy", "np"):
        return _computed(_NUMBERS[last], given, node)
    if last.startswith(_VECTORS):
        parts = [part for v in values for part in (v.items if isinstance(v, Items) else [v])]
        if all(isinstance(part, (int, float)) for part in parts):
            return Items(parts, place(node), "tuple")
    if name == "json.dumps":
        return _computed(json.dumps, Arguments(values[:1]), node)
    if name.endswith("path.join"):
        return _computed(posixpath.join, given, node)
    return unknown(node)
