"""Reads messages as `ros2 topic echo` prints them, whole, truncated or cut by hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

from lab3_usd.lab.plain_yaml import load_plain
from lab3_usd.model.folder.lab_files import Message, Scalar

_SCALARS = (str, int, float, bool, type(None))
# What rclcpp and ros2cli print between messages: log lines, and the notice of a lost message.
_NOISE = re.compile(r"^(\[(INFO|WARN|ERROR|DEBUG)\]|WARNING:|A message was lost|\ttotal count)")
_ELEMENT = re.compile(r"^ *- (-?[\d.]\S*|\.nan|'\.\.\.')\s*$")
_FIELD = re.compile(r"(?P<indent> *)(?:- )?(?P<name>[A-Za-z_]\w*):(?: +(?P<value>.*))?$")
_SEPARATOR = re.compile(r"^-{3,}[ \t]*$", re.MULTILINE)
_MOST_MESSAGES = 20
_LONGEST_MESSAGE = 20_000  # characters, arrays left out; YAML is slow to read


def parse_messages(text: str) -> list[Message]:
    """Return the messages of an output, fields by dotted path; empty when none was printed.

    Of very many, those in the middle are left out. Arrays of numbers are left out. A message that
    is no longer YAML, because somebody shortened it, is read line by line as far as its lines say
    `name: value`.
    """
    lines = [line for line in text.splitlines() if not (_NOISE.match(line) or _ELEMENT.match(line))]
    documents = [each for each in _SEPARATOR.split("\n".join(lines)) if each.strip()]
    if len(documents) > _MOST_MESSAGES:
        documents = documents[: _MOST_MESSAGES // 2] + documents[-_MOST_MESSAGES // 2 :]
    return [message for document in documents if (message := _parse(document))]


def _parse(document: str) -> Message:
    try:
        data = load_plain(document) if len(document) <= _LONGEST_MESSAGE else None
        if isinstance(data, dict):
            return dict(_flat(data, "", set()))
    except (yaml.YAMLError, RecursionError, ValueError):
        pass
    return dict(_by_line(document))


def _flat(value: Any, path: str, seen: set[int]) -> Iterator[tuple[str, Scalar]]:  # noqa: ANN401
    """Yield the scalars below a value; a part that YAML repeats by an alias is entered once."""
    if isinstance(value, _SCALARS):
        yield path, value
        return
    if id(value) in seen or not isinstance(value, (dict, list)):
        return
    seen.add(id(value))
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for name, inner in inside:
        # Arrays of numbers are left out, arrays of messages are not.
        if isinstance(value, dict) or isinstance(inner, dict):
            yield from _flat(inner, f"{path}.{name}" if path else str(name), seen)


def _by_line(document: str) -> Iterator[tuple[str, Scalar]]:
    outer: list[tuple[int, str]] = []
    for line in document[:_LONGEST_MESSAGE].splitlines():
        field = _FIELD.match(line.rstrip())
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
        value = load_plain(text)
    except (yaml.YAMLError, RecursionError, ValueError):
        return text
    return value if isinstance(value, _SCALARS) else text
