"""Reads untrusted YAML into plain data: text, booleans and finite numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import yaml

_LONGEST_NUMBER = 400
_LONGEST_TEXT = 200_000  # characters; maps and parameters have some thousands
_MOST_BRACKETS = 60
_NOT_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_TAG = "tag:yaml.org,2002:"
_Construct = Callable[[Any, Any], Any]


# libyaml, fast as it is, ends the process where a file is nested too deep.
class PlainLoader(yaml.SafeLoader):
    """A safe loader that keeps dates, and numbers that are not finite, as text.

    It refuses what it would take minutes to read.
    """

    def __init__(self, stream: str | bytes) -> None:
        """Begin to read a text, unless it is far too long or too deep."""
        data = stream.encode(errors="replace") if isinstance(stream, str) else stream
        if len(data) > _LONGEST_TEXT or bracket_depth(data) > _MOST_BRACKETS:
            raise yaml.YAMLError(f"is longer than {_LONGEST_TEXT} characters, or nested too deep")
        super().__init__(stream)

    def compose_scalar_node(self, anchor: Any) -> yaml.ScalarNode:
        """Return a scalar whose text can be written again: halves of letters are replaced."""
        node = super().compose_scalar_node(anchor)
        node.value = node.value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
        return node


def bracket_depth(data: bytes) -> int:
    """Return how deep the brackets of a text nest, whatever else stands between them."""
    depth = deepest = 0
    for letter in data.translate(None, _NOT_BRACKETS):
        depth += 1 if letter in b"[{" else -1
        deepest = max(deepest, depth)
    return deepest


def load_plain(text: str | bytes) -> Any:
    """Return what a YAML text holds.

    Raises:
        yaml.YAMLError: it is not YAML, of types that are not plain, or far too long.
        RecursionError: it is nested too deep.
        ValueError: it holds what is no character.
    """
    return yaml.load(text, Loader=PlainLoader)  # noqa: S506 - a safe loader


NOT_YAML = (yaml.YAMLError, RecursionError, ValueError)  # what `load_plain` raises


def not_yaml(error: Exception) -> str:
    """Say that a text is not YAML, and in which line where that is known."""
    mark = getattr(error, "problem_mark", None)
    return "is not YAML" + (f", see line {mark.line + 1}" if mark is not None else "")


def _or_text(construct: _Construct) -> _Construct:
    """Make a constructor return the text where there is no value that can be computed with."""

    def constructor(loader: Any, node: Any) -> Any:
        text = loader.construct_scalar(node)
        # Python refuses to read, and takes long to compute, what is far too long for a number.
        if len(text) <= _LONGEST_NUMBER:
            with suppress(ValueError, OverflowError, LookupError):
                value = construct(loader, node)
                if math.isfinite(value):
                    return value
        return text

    return constructor


_SAFE: Any = yaml.SafeLoader
for _name in ("int", "float", "bool"):
    PlainLoader.add_constructor(_TAG + _name, _or_text(_SAFE.yaml_constructors[_TAG + _name]))
for _name in ("timestamp", "binary"):
    PlainLoader.add_constructor(_TAG + _name, _SAFE.construct_yaml_str)
PlainLoader.add_constructor(_TAG + "set", _SAFE.construct_yaml_map)  # which keeps the order
