"""Reads messages as `ros2 topic echo` prints them, whole, truncated or cut by hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

from lab3_usd.check.subjects_lab import Message, Scalar

_SAFE: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DEEPEST = 20  # no message of the lab is nested half as deep
_SCALARS = (str, int, float, bool, type(None))
# What rclcpp and ros2cli print between messages: log lines, and the notice of a lost message.
_NOISE = re.compile(r"^(\[(INFO|WARN|ERROR|DEBUG)\]|WARNING:|A message was lost|\ttotal count)")
_FIELD = re.compile(r"^(?P<indent> *)(?:- )?(?P<name>[A-Za-z_]\w*):(?: +(?P<value>.*?))?\s*$")


def parse_messages(text: str) -> list[Message]:
    """Return the messages of an output, fields by dotted path; empty when none was printed.

    Arrays of numbers are left out. A message that is no longer YAML, because somebody shortened
    it, is read line by line as far as its lines say `name: value`.
    """
    lines = [line for line in text.splitlines() if not _NOISE.match(line)]
    documents = re.split(r"(?m)^-{3,}\s*$", "\n".join(lines))
    return [message for document in documents if (message := _parse(document))]


def _parse(document: str) -> Message:
    try:
        data = yaml.load(document, Loader=_SAFE)  # noqa: S506 - a safe loader
        if isinstance(data, dict):
            return dict(_flat(data, "", 0))
    except (yaml.YAMLError, RecursionError, ValueError):
        pass
    return dict(_by_line(document))


def _flat(value: Any, path: str, depth: int) -> Iterator[tuple[str, Scalar]]:  # noqa: ANN401
    if depth > _DEEPEST:
        return
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{path}.{name}" if path else str(name), depth + 1)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            if isinstance(inner, dict):
                yield from _flat(inner, f"{path}.{index}", depth + 1)
    elif isinstance(value, _SCALARS):
        yield path, value


def _by_line(document: str) -> Iterator[tuple[str, Scalar]]:
    outer: list[tuple[int, str]] = []
    for line in document.splitlines():
        field = _FIELD.match(line)
        if field is None:
            continue
        indent = len(field["indent"])
        while outer and outer[-1][0] >= indent:
            outer.pop()
        if field["value"]:
            yield ".".join([*(name for _, name in outer), field["name"]]), _scalar(field["value"])
        else:
            outer.append((indent, field["name"]))


def _scalar(text: str) -> Scalar:
    try:
        value = yaml.load(text, Loader=_SAFE)  # noqa: S506 - a safe loader
    except (yaml.YAMLError, RecursionError, ValueError):
        return text
    return value if isinstance(value, _SCALARS) else text
