"""Makes records of the data in a YAML file; a slip is one line that names the key."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec.structs import FieldInfo, fields

from lab3_usd.errors import SpecError

_T = TypeVar("_T")
_SHOWN = reprlib.Repr()
_SHOWN.maxlevel, _SHOWN.maxstring, _SHOWN.maxother, _SHOWN.maxlong = 2, 100, 100, 60
_NAMES = {str: "text", int: "a whole number", float: "a number", bool: "true or false"}
_LISTS = (list, tuple)
_ENTRY = "entry "  # what stands for a name in a list


def record(data: Any, kind: type[_T], where: str) -> _T:  # noqa: ANN401 - whatever YAML holds
    """Return `data` as a value of `kind`, a type that msgspec knows.

    Raises:
        SpecError: it is none; the line opens with `where` and names the key.
    """
    try:
        return msgspec.convert(data, kind, dec_hook=_parse)
    except msgspec.ValidationError as error:
        names, fault = _fault(data, kind)
        is_value = fault.startswith("is ")
        named = [n for n, name in enumerate(names) if not name.startswith(_ENTRY)]
        if named and is_value:
            names[named[-1]] = f"'{names[named[-1]]}'"
        message = ": ".join((where, *names)) + (" " if is_value else ": ") + fault
        raise SpecError(message) from error


def _parse(kind: Any, data: Any) -> Any:  # noqa: ANN401
    """Make a value of a type that msgspec does not know out of how it is written."""
    if not isinstance(data, str):
        raise TypeError(data)
    return kind.parse(data)


def records(
    data: Mapping[str, Mapping[str, Any]], kind: type[_T], where: str, key: str = "name"
) -> dict[str, _T]:
    """Return the entries of `data` as records that hold their own names at `key`.

    Raises:
        SpecError: one is none, or says `key` itself.
    """
    for name, entry in data.items():
        if key in entry:
            message = f"{where}: {name}: {key!r} is not known; '{name}' is what it is called"
            raise SpecError(message)
    return {
        name: record({key: name, **entry}, kind, f"{where}: {name}") for name, entry in data.items()
    }


def _fault(data: Any, kind: Any) -> tuple[list[str], str]:  # noqa: ANN401
    """Return the keys that lead to the first slip, and what is wrong there."""
    kind = _meant(data, kind)
    if _is_record(kind) and isinstance(data, dict):
        known = {field.encode_name: field for field in _fields(kind)}
        for key in data if kind.__struct_config__.forbid_unknown_fields else ():
            if key not in known:
                return [], f"{key!r} is not known; known are {', '.join(known)}"
        for name, field in known.items():
            if field.required and name not in data:
                return [], f"'{name}' is missing"
    for name, value, inner in _inside(data, kind):
        if not _fits(value, inner):
            names, fault = _fault(value, inner)
            return [name, *names], fault
    quotes = "; put it in quotes" if kind is str and isinstance(data, (bool, int, float)) else ""
    return [], f"is {_SHOWN.repr(data)}, expected {_called(kind)}{quotes}"


@cache
def _fields(kind: Any) -> tuple[FieldInfo, ...]:  # noqa: ANN401
    """Return the fields of a record; msgspec evaluates all annotations for it."""
    return fields(kind)


def _meant(data: Any, kind: Any) -> Any:  # noqa: ANN401
    """Of several types return the one that was likely meant."""
    if get_origin(kind) not in {Union, UnionType}:
        return kind
    kinds = [each for each in get_args(kind) if each is not type(None)]
    alike = [each for each in kinds if isinstance(data, dict) == _is_mapping(each)]
    return (alike or kinds)[0]


def _is_record(kind: Any) -> bool:  # noqa: ANN401
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _is_mapping(kind: Any) -> bool:  # noqa: ANN401
    origin = get_origin(kind)
    return _is_record(kind) or (isinstance(origin, type) and issubclass(origin, Mapping))


def _inside(data: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:  # noqa: ANN401
    """Yield the name, the value and the type of everything in `data`."""
    if isinstance(data, dict) and _is_record(kind):
        yield from (
            (each.encode_name, data[each.encode_name], each.type)
            for each in _fields(kind)
            if each.encode_name in data
        )
    elif isinstance(data, dict) and _is_mapping(kind):
        yield from ((str(key), value, get_args(kind)[1]) for key, value in data.items())
    elif isinstance(data, list) and get_origin(kind) in _LISTS:
        inner = get_args(kind)
        if inner[-1] is ... or len(inner) in {1, len(data)}:
            for number, value in enumerate(data):
                fixed = inner[number] if inner[-1] is not ... and len(inner) > 1 else inner[0]
                yield f"{_ENTRY}{number + 1}", value, fixed


def _fits(value: Any, kind: Any) -> bool:  # noqa: ANN401
    try:
        msgspec.convert(value, kind, dec_hook=_parse)
    except msgspec.ValidationError:
        return False
    return True


def _called(kind: Any) -> str:  # noqa: ANN401
    inner = get_args(kind)
    if get_origin(kind) is Annotated:
        return f"{_called(inner[0])} from {inner[1].ge:.7g} to {inner[1].le:.7g}"
    if get_origin(kind) is Literal:
        return f"one of {', '.join(filter(None, inner))}"
    if get_origin(kind) in _LISTS:
        return f"a list of {len(inner)}" if len(inner) > 1 and inner[-1] is not ... else "a list"
    if hasattr(kind, "written"):
        return str(kind.written)
    return "a mapping" if _is_mapping(kind) else _NAMES.get(kind, str(kind))
