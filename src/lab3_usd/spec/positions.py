"""Finds the line and column in a file of a lab that a message about it names by its keys."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from lab3_usd.errors import SpecError
from lab3_usd.yaml_file import refuse_deep

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_LARGEST = 1_000_000  # bytes of a file in which places are looked up
_MISSING = " is missing"
_QUOTED = re.compile(r"'([^']+)'")
_PATH = re.compile(r"(/\w+)+")
_OWN_PATH = "path"
_NUMBERED = re.compile(r"(\w+) (\d+)")


def located(error: SpecError, folder: Path) -> SpecError:
    """Return an error that begins with a file of a folder and its keys, with the place added."""
    text = str(error)
    place = written_place(folder, text)
    return SpecError(f"{text}, at {place}" if place else text)


def written_place(folder: Path, message: str) -> str:
    """Return file, line and column of what a message names: 'scene.yaml: robot: links: ...'.

    It is '' where the message begins with no file of the folder.
    """
    file, *keys = message.split(": ")
    path = folder / file
    if not file or not path.is_file():
        return ""
    line, column = _position(path, keys)
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return f"{shown}:{line}:{column}"


def has_place(folder: Path, file: str, prim: str) -> bool:
    """Whether a file of a folder names a prim, as a key, as a path, or inside that of another."""
    path = folder / file
    return path.is_file() and _position(path, [prim]) != (1, 1)


def _position(path: Path, keys: Sequence[str]) -> tuple[int, int]:
    """Return the position of the last of the keys that the file has, each inside the one before."""
    try:
        if path.stat().st_size > _LARGEST:
            return 1, 1
        node = _composed(path.read_bytes())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        return (1, 1) if mark is None else (mark.line + 1, mark.column + 1)
    except (yaml.YAMLError, OSError, UnicodeDecodeError):
        return 1, 1
    mark = None
    for written in keys:
        # A topic is a key as it is written; of a path, each name is one, inside the one before.
        is_path = _PATH.fullmatch(written) is not None
        whole = _whole(node, written) if is_path else None
        names = written.split("/")[1:] if is_path else [written]
        each = [whole] if whole is not None else (_found(node, name) for name in names)
        for place in each:
            if place is not None:
                mark, node = place
    return (1, 1) if mark is None else (mark.line + 1, mark.column + 1)


@lru_cache(maxsize=8)
def _composed(text: bytes) -> Any:
    """Return the nodes of a file, of which several messages may speak."""
    refuse_deep(text)
    return yaml.compose(text, Loader=_Loader)


def _whole(node: Any, path: str) -> tuple[Any, Any] | None:
    """Return where a path is a key, or the `path` of something, and what is there."""
    for _, is_key, (mark, text, inner) in _texts(node):
        if is_key and text == path:
            return mark, inner
        if is_key and text == _OWN_PATH and isinstance(inner, yaml.MappingNode):
            own = _value(inner, _OWN_PATH)
            if isinstance(own, yaml.ScalarNode) and own.value == path:
                return own.start_mark, inner
    return None


def _found(node: Any, key: str) -> tuple[Any, Any] | None:
    """Return where a node has a key, and what is there; of a text, the mapping around it.

    The last key is the message itself: what it quotes is in the node, unless it is missing here.
    """
    quoted = _QUOTED.findall(key)
    for name in [key, key.rpartition(":")[2], *quoted]:
        for depth, is_key, (mark, text, value) in _texts(node):
            is_near = depth == 1 or not (is_key and key.endswith(_MISSING))
            if text == name and is_near:
                return mark, value
    match = _NUMBERED.match(key)
    if match is not None:
        entries = _value(node, f"{match[1]}s") if isinstance(node, yaml.MappingNode) else node
        number = int(match[2]) - 1
        if isinstance(entries, yaml.SequenceNode) and number < len(entries.value):
            entry = entries.value[number]
            return entry.start_mark, entry
    return None


def _value(node: Any, name: str) -> Any:
    return next((value for key, value in node.value if key.value == name), None)


def _texts(node: Any) -> Iterator[tuple[int, bool, tuple[Any, Any, Any]]]:
    """Yield the keys and texts in a node, the outer ones first: mark, text, and what is there.

    Around a text that is the mapping which holds it. What aliases repeat is entered once: aliases
    of aliases unfold without end.
    """
    level, depth, entered = [(node, node)], 0, set[int]()
    while level:
        depth, below = depth + 1, []
        for inner, around in level:
            if id(inner) in entered:
                continue
            entered.add(id(inner))
            if isinstance(inner, yaml.MappingNode):
                for key, value in inner.value:
                    is_text = isinstance(value, yaml.ScalarNode)
                    yield depth, True, (key.start_mark, key.value, inner if is_text else value)
                    below.append((value, inner))
            elif isinstance(inner, yaml.SequenceNode):
                below += ((entry, around) for entry in inner.value)
            elif isinstance(inner, yaml.ScalarNode):
                yield depth - 1, False, (inner.start_mark, inner.value, around)
        level = below
