"""Writes plain data as YAML that people read: short parts in one line, comments above keys."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from struct import pack, unpack
from typing import Any

_WIDTH = 110
_FLAT = 2  # levels of nesting in one line
_SINGLE = 6e-8  # how far single precision is from a number, as a share of it
_LARGEST = 3e38  # of single precision
_PLAIN = re.compile(r"[A-Za-z_/][\w/.-]*(?: (?:-> )?[\w/.-]+)*")
_WORDS = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}  # what YAML takes otherwise


def document(head: str, data: Mapping[str, Any], notes: Mapping[str, str] | None = None) -> str:
    """Return a file: a comment, then each key of `data`; `notes` are comments above keys.

    A key inside another one is written `outer.inner` there.
    """
    lines = [*_comment(head, ""), *_block(data, "", "", notes or {})]
    return "\n".join(lines).strip("\n") + "\n"


def _comment(text: str, indent: str) -> Iterator[str]:
    for line in text.splitlines():
        yield f"{indent}# {line}".rstrip()


def _block(data: Mapping[str, Any], indent: str, above: str, notes: Mapping[str, str]) -> list[str]:
    lines: list[str] = []
    for key, value in data.items():
        place = f"{above}{key}"
        lines += [""] if place in notes and not above else []
        lines += _comment(notes.get(place, ""), indent)
        opening = f"{indent}{scalar(key)}:"
        is_noted = any(note.startswith(f"{place}.") for note in notes)
        is_filled = isinstance(value, (Mapping, list, tuple)) and bool(value)
        is_short = _depth(value) <= _FLAT and len(opening) + 1 + len(flow(value)) <= _WIDTH
        if not is_noted and (is_short or not is_filled):
            lines.append(f"{opening} {flow(value)}")
        elif isinstance(value, Mapping):
            lines += [opening, *_block(value, f"{indent}  ", f"{place}.", notes)]
        else:
            lines += [opening, *(f"{indent}  - {flow(item)}" for item in value)]
    return lines


def _depth(value: Any) -> int:
    if isinstance(value, Mapping):
        return 1 + max((_depth(item) for item in value.values()), default=0)
    if isinstance(value, (list, tuple)):
        return 1 + max((_depth(item) for item in value), default=0)
    return 0


def flow(value: Any) -> str:
    """Return a value as one line of YAML."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{scalar(key)}: {flow(item)}' for key, item in value.items())}}}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(flow, value))}]"
    return scalar(value)


def as_typed(value: Any) -> Any:
    """Return numbers as a person types them: 1.3 for 1.29999995 of single precision."""
    if isinstance(value, (list, tuple)):
        return tuple(as_typed(number) for number in value)
    if not isinstance(value, float) or not math.isfinite(value):
        return value
    is_single = unpack("f", pack("f", value))[0] == value if abs(value) < _LARGEST else False
    for digits in range(6, 10 if is_single else 7):
        short = float(f"{value:.{digits}g}")
        if abs(short - value) <= _SINGLE * abs(value):
            return short + 0.0
    return float(f"{value:.12g}") + 0.0  # without the noise of arithmetic in double precision


def scalar(value: object) -> str:
    """Return a single value as YAML reads it again."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)
        if text.lstrip("-") in {"inf", "nan"}:
            return text.replace("inf", ".inf").replace("nan", ".nan")
        # Without a point YAML takes `1e-05` for text.
        mantissa, exponent, power = text.partition("e")
        return f"{mantissa}.0e{power}" if exponent and "." not in mantissa else text
    if isinstance(value, int):
        return str(value)
    text = str(value)
    is_plain = _PLAIN.fullmatch(text) is not None and text.lower() not in _WORDS
    return text if is_plain else json.dumps(text, ensure_ascii=False)
