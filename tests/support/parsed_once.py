"""YAML is parsed once a text: labs and submissions are copied, changed at one place, and read."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any
from unittest.mock import patch

import yaml

LOAD = yaml.load


@contextmanager
def yaml_parsed_once() -> Iterator[None]:
    """Let whoever reads a text that was read before have a copy of what it said."""
    with patch.object(yaml, "load", _load):
        yield


def _load(stream: Any, Loader: Any) -> Any:  # noqa: N803 - PyYAML's name
    is_text = isinstance(stream, (bytes, str))
    return pickle.loads(_copied(stream, Loader)) if is_text else LOAD(stream, Loader)  # noqa: S301


@lru_cache(maxsize=256)
def _copied(text: bytes | str, loader: Any) -> bytes:
    return pickle.dumps(LOAD(text, loader))
