"""Reads a stranger's YAML into plain data: text, truth values, and numbers one can compute with."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import yaml

_LONGEST_NUMBER = 400
_TAG = "tag:yaml.org,2002:"
_Construct = Callable[[Any, Any], Any]


# libyaml, fast as it is, ends the process where a file is nested too deep.
class PlainLoader(yaml.SafeLoader):
    """A safe loader that leaves as text what is no finite number, and dates and the like."""

    def compose_scalar_node(self, anchor: Any) -> yaml.ScalarNode:  # noqa: ANN401
        """Return a scalar whose text can be written again: halves of letters are replaced."""
        node = super().compose_scalar_node(anchor)
        node.value = node.value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
        return node


def load_plain(text: str | bytes) -> Any:  # noqa: ANN401 - whatever the file holds
    """Return what a YAML text holds.

    Raises:
        yaml.YAMLError: it is not YAML, or of types that are not plain.
        RecursionError: it is nested too deep.
        ValueError: it holds what is no character.
    """
    return yaml.load(text, Loader=PlainLoader)  # noqa: S506 - a safe loader


def _or_text(construct: _Construct) -> _Construct:
    """Make a constructor return the text where there is no value that can be computed with."""

    def constructor(loader: Any, node: Any) -> Any:  # noqa: ANN401
        text = loader.construct_scalar(node)
        # Python refuses to read, and takes long to compute, what is far too long for a number.
        if len(text) <= _LONGEST_NUMBER:
            with suppress(ValueError, OverflowError, LookupError):
                value = construct(loader, node)
                if math.isfinite(value):
                    return value
        return text

    return constructor


def _register() -> None:
    safe: Any = yaml.SafeLoader
    for name in ("int", "float", "bool"):
        construct = safe.yaml_constructors[_TAG + name]
        PlainLoader.add_constructor(_TAG + name, _or_text(construct))
    for name in ("timestamp", "binary"):
        PlainLoader.add_constructor(_TAG + name, safe.construct_yaml_str)
    PlainLoader.add_constructor(_TAG + "set", safe.construct_yaml_map)  # which keeps the order


_register()
