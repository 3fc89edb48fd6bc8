"""Reads a YAML file of `graphs/` safely, and makes records of it."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec
import yaml
from msgspec.structs import FieldInfo, fields

from lab3_usd.errors import SpecError

# The C loader reads the platform about seven times as fast as the plain one.
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_BRACED = re.compile(rb"[\w/]\{\w+\}")  # a placeholder, which is no mapping
_TEXT = "tag:yaml.org,2002:str"
_MEGABYTE = 1_000_000
_NESTING = 50  # levels; what the lab's own files need is below ten
_SHOWN = reprlib.Repr()
_SHOWN.maxlevel, _SHOWN.maxstring, _SHOWN.maxother, _SHOWN.maxlong = 2, 100, 100, 60


class _UniqueKeys(_Safe):  # type: ignore[misc]  # the base is chosen at run time
    """A safe loader that refuses keys that are not text, or given twice and so overwritten."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:  # noqa: FBT001, FBT002 - PyYAML's signature
        if not isinstance(node, yaml.MappingNode):  # a tag says that it is one
            raise yaml.MarkedYAMLError(problem="is not a mapping", problem_mark=node.start_mark)
        seen: set[str] = set()
        for key, _ in node.value:
            problem = ""
            if key.tag != _TEXT or not isinstance(key, yaml.ScalarNode):
                shown = _SHOWN.repr(key.value if isinstance(key, yaml.ScalarNode) else "[...]")
                problem = f"the key {shown} is not text; put it in quotes"
            elif key.value in seen:
                problem = f"'{key.value}' is given twice"
            if problem:
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


def _whole(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Have a value that looks like a number or a date but is none refused like other mistakes."""

    def constructed(loader: Any, node: Any) -> Any:
        try:
            return construct(loader, node)
        except (ValueError, LookupError, AttributeError) as error:
            problem = f"{_SHOWN.repr(node.value)} cannot be read"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from error

    return constructed


for _kind in ("bool", "int", "float", "timestamp"):
    _tag = f"tag:yaml.org,2002:{_kind}"
    _UniqueKeys.add_constructor(_tag, _whole(_UniqueKeys.yaml_constructors[_tag]))


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping that a YAML file of the lab holds.

    Raises:
        SpecError: the file is missing, is not YAML, holds a wrong key, or is no mapping.
    """
    return _read(path, path.read_bytes)


def read_foreign_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping that a YAML file of unknown origin holds.

    Raises:
        SpecError: as `read_yaml`, or the file is larger than a megabyte, or nested too deeply.
    """

    def bounded() -> bytes:
        if path.exists() and not path.is_file():
            raise SpecError(f"{path.name}: is not a file")
        with path.open("rb") as file:
            text = file.read(_MEGABYTE + 1)
        if len(text) > _MEGABYTE:
            raise SpecError(f"{path.name}: is larger than {_MEGABYTE} bytes")
        return text

    return _read(path, bounded, refuse_deep)


def refuse_deep(text: bytes) -> None:
    """Refuse YAML that is nested deeply: loaders descend without limit, until they crash.

    Raises:
        yaml.YAMLError: it is, or is no YAML.
    """
    depth = 0
    event: Any
    for event in yaml.parse(text, Loader=_Safe):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _NESTING:
            problem = f"is nested more than {_NESTING} levels deep"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def _read(
    path: Path, content: Callable[[], bytes], check: Callable[[bytes], None] = lambda _: None
) -> dict[str, Any]:
    text = b""
    try:
        text = content()
        check(text)
        data = yaml.load(text, Loader=_UniqueKeys)  # noqa: S506 - a safe loader
    except OSError as error:
        raise SpecError(
            f"{path.name}: cannot be read ({error.strerror}); expected at {path}"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or "is not YAML text"
        line = f"line {mark.line + 1}: " if mark is not None else ""
        rest = b"" if mark is None else b"".join(text.splitlines()[mark.line :])[mark.column :]
        if mark is not None and not rest.strip():
            problem = f"the file ends too early: close what is open, or add a value ({problem})"
        elif mark is not None and _BRACED.search(text.splitlines()[mark.line]):
            problem += "; a text with braces needs quotation marks"
        raise SpecError(f"{path.name}: {line}{problem}") from error
    if not isinstance(data, dict):
        raise SpecError(f"{path.name}: is not a mapping of names to values")
    return data


def line_of(path: Path, keys: Iterable[str | int]) -> int:
    """Return the line of a key, or of an entry of a list, in a YAML file that can be read.

    `keys` lead there; of one that the text itself does not have, the last one before it counts.
    """
    node: Any = yaml.compose(path.read_bytes(), Loader=_Safe)
    line = node.start_mark.line
    for key in keys:
        if isinstance(node, yaml.SequenceNode) and isinstance(key, int):
            entries = [(entry, entry) for entry in node.value[key : key + 1]]
        elif isinstance(node, yaml.MappingNode):
            entries = [(name, value) for name, value in node.value if name.value == key]
        else:
            break
        if not entries:
            break
        name, node = entries[0]
        line = name.start_mark.line
    return int(line) + 1


_T = TypeVar("_T")
_NAMES = {str: "text", int: "a whole number", float: "a number", bool: "true or false"}
_LISTS = (list, tuple)
_ENTRY = "entry "  # what stands for a name in a list


def as_record(data: Any, kind: type[_T], where: str) -> _T:
    """Return `data` as a value of `kind`, a type that msgspec knows.

    A record may have `FORMER` names of its keys, with those that they have now, and keys that are
    `GONE`, with what to write instead.

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
        raise SpecError(": ".join((where, *names)) + (" " if is_value else ": ") + fault) from error


def read_record(path: Path, kind: type[_T]) -> _T:
    """Return what a file says as a value of `kind`; a large one is JSON, which is read sooner.

    Raises:
        SpecError: the file is missing or wrong; the line opens with its folder and its name.
    """
    where = f"{path.parent.name}/{path.name}"
    if path.suffix != ".json":
        return as_record(read_yaml(path), kind, where)
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise SpecError(f"{where}: cannot be read ({error})") from error
    return as_record(data, kind, where)


def _parse(kind: Any, data: Any) -> Any:
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
            raise SpecError(f"{where}: {name}: {key!r} is not known; '{name}' is what it is called")
    return {
        name: as_record({key: name, **entry}, kind, f"{where}: {name}")
        for name, entry in data.items()
    }


def _fault(data: Any, kind: Any) -> tuple[list[str], str]:
    """Return the keys that lead to the first slip, and what is wrong there."""
    kind = _meant(data, kind)
    if _is_record(kind) and isinstance(data, dict):
        by_key = {field.encode_name: field for field in _fields(kind)}
        unknown = [key for key in data if key not in by_key]
        if unknown and kind.__struct_config__.forbid_unknown_fields:
            return [], _unknown_key(unknown[0], kind, by_key)
        for name, field in by_key.items():
            if field.required and name not in data:
                return [], f"'{name}' is missing"
    for name, value, inner in _inside(data, kind):
        if _refusal(value, inner):
            names, fault = _fault(value, inner)
            return [name, *names], fault
    if _is_record(kind) and isinstance(data, dict):
        return [], _refusal(data, kind)
    quotes = "; put it in quotes" if kind is str and isinstance(data, (bool, int, float)) else ""
    return [], f"is {_SHOWN.repr(data)}, expected {_called(kind)}{quotes}"


def _refusal(data: Any, kind: Any) -> str:
    """Return why data is not of a type, in the words of msgspec; '' where it is."""
    try:
        msgspec.convert(data, kind, dec_hook=_parse)
    except msgspec.ValidationError as error:
        return str(error).partition(" - at `")[0]
    return ""


def _unknown_key(key: Any, kind: Any, keys: Iterable[str]) -> str:
    former, gone = getattr(kind, "FORMER", {}), getattr(kind, "GONE", {})
    if key in former:
        return f"{key!r} is called {former[key]!r} now"
    if key in gone:
        return f"{key!r} is gone: {gone[key]}"
    return f"{key!r} is not known; known are {', '.join(keys)}"


@cache
def _fields(kind: Any) -> tuple[FieldInfo, ...]:
    """Return the fields of a record; msgspec evaluates all annotations for it."""
    return fields(kind)


def _meant(data: Any, kind: Any) -> Any:
    """Of several types return the one that was likely meant."""
    if get_origin(kind) not in {Union, UnionType}:
        return kind
    kinds = [option for option in get_args(kind) if option is not type(None)]
    alike = [option for option in kinds if isinstance(data, dict) == _is_mapping(option)]
    return (alike or kinds)[0]


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _is_mapping(kind: Any) -> bool:
    origin = get_origin(kind)
    return _is_record(kind) or (isinstance(origin, type) and issubclass(origin, Mapping))


def _inside(data: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the name, the value and the type of everything in `data`."""
    if isinstance(data, dict) and _is_record(kind):
        yield from (
            (field.encode_name, data[field.encode_name], field.type)
            for field in _fields(kind)
            if field.encode_name in data
        )
    elif isinstance(data, dict) and _is_mapping(kind):
        yield from ((str(key), value, get_args(kind)[1]) for key, value in data.items())
    elif isinstance(data, list) and get_origin(kind) in _LISTS:
        inner = get_args(kind)
        if inner[-1] is ... or len(inner) in {1, len(data)}:
            for number, value in enumerate(data):
                fixed = inner[number] if inner[-1] is not ... and len(inner) > 1 else inner[0]
                yield f"{_ENTRY}{number + 1}", value, fixed


def _called(kind: Any) -> str:
    inner = get_args(kind)
    if get_origin(kind) is Annotated:
        low, high = inner[1].ge, inner[1].le
        lowest = f"above {inner[1].gt:.7g} and up" if low is None else f"from {low:.7g}"
        return f"{_called(inner[0])} {lowest} to {high:.7g}"
    if get_origin(kind) is Literal:
        return f"one of {', '.join(filter(None, inner))}"
    if get_origin(kind) in _LISTS:
        return f"a list of {len(inner)}" if len(inner) > 1 and inner[-1] is not ... else "a list"
    if hasattr(kind, "written"):
        return str(kind.written)
    return "a mapping" if _is_mapping(kind) else _NAMES.get(kind, str(kind))
