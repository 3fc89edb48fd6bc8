"""Values of ports as a picture shows them."""

from __future__ import annotations

from lab3_usd.report.drawing.text_width import clip_end, clip_path
from lab3_usd.spec.catalog import Value

MOST = 34  # characters of a value in a box; the pointer resting on it reads more
MOST_PRIMS = 12


def shown(value: Value) -> str:
    """Write a value as short as it stays readable."""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, tuple):
        return f"[{', '.join(shown(part) for part in value)}]"
    return str(value) if value != "" else '""'


def value_line(value: Value) -> tuple[str, ...]:
    """Return a value as the one line of a row."""
    return (clip_end(shown(value), MOST),)


def prim_lines(prims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the targets of a relationship, one line each."""
    lines = [clip_path(prim, MOST) for prim in prims[:MOST_PRIMS]]
    if len(prims) > MOST_PRIMS:
        lines.append(f"and {len(prims) - MOST_PRIMS} more")
    return tuple(lines) or ("no prim",)
