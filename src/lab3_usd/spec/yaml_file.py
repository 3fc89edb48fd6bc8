"""Reading a YAML file of `graphs/` safely, and asking it for what must be there."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from lab3_usd.errors import SpecError

# The C loader reads the catalog about seven times as fast as the plain one.
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TEXT = "tag:yaml.org,2002:str"
_MEGABYTE = 1_000_000
_NESTING = 50  # levels; what the lab's own files need is below ten
_SHOWN = reprlib.Repr()
_SHOWN.maxlevel, _SHOWN.maxstring, _SHOWN.maxother, _SHOWN.maxlong = 2, 100, 100, 60


class _UniqueKeys(_Safe):  # type: ignore[misc]  # the base is chosen at run time
    """A safe loader that refuses keys that are not text, or given twice and so overwritten."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:  # noqa: ANN401, FBT001, FBT002 - PyYAML's signature
        if not isinstance(node, yaml.MappingNode):  # a tag says that it is one
            raise yaml.MarkedYAMLError(problem="is no mapping", problem_mark=node.start_mark)
        seen: set[str] = set()
        for key, _ in node.value:
            problem = ""
            if key.tag != _TEXT or not isinstance(key, yaml.ScalarNode):
                problem = f"the key {_SHOWN.repr(_plain(key))} is not text; put it in quotes"
            elif key.value in seen:
                problem = f"'{key.value}' is given twice"
            if problem:
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


def _plain(node: Any) -> object:  # noqa: ANN401 - PyYAML's types
    return node.value if isinstance(node, yaml.ScalarNode) else "[...]"


def _whole(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Have a value that looks like a number or a date but is none refused like other mistakes."""

    def constructed(loader: Any, node: Any) -> Any:  # noqa: ANN401 - PyYAML's types
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
    return _read(path, lambda: _bounded(path))


def _bounded(path: Path) -> bytes:
    if path.exists() and not path.is_file():
        message = f"{path.name}: is no file"
        raise SpecError(message)
    with path.open("rb") as file:
        text = file.read(_MEGABYTE + 1)
    if len(text) > _MEGABYTE:
        message = f"{path.name}: is larger than {_MEGABYTE} bytes"
        raise SpecError(message)
    refuse_deep(text)
    return text


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


def _read(path: Path, content: Callable[[], bytes]) -> dict[str, Any]:
    try:
        data = yaml.load(content(), Loader=_UniqueKeys)  # noqa: S506 - a safe loader
    except OSError as error:
        message = f"{path.name}: cannot be read ({error.strerror}); expected at {path}"
        raise SpecError(message) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        message = f"{path.name}: {_describe(error)}"
        raise SpecError(message) from error
    if not isinstance(data, dict):
        message = f"{path.name}: is not a mapping of names to values"
        raise SpecError(message)
    return data


def _describe(error: Exception) -> str:
    """Say in one line where the YAML is wrong."""
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or "is not YAML text"
    return f"line {mark.line + 1}: {problem}" if mark is not None else str(problem)
