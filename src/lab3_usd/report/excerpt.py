"""The lines of a layer around a fault, where the layer is a text file that can be read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.check.finding import Finding

# A stage written on one line is data, not something to show.
LINE_LIMIT = 100_000


class Excerpt(Struct, frozen=True):
    """Lines of a layer as they are, without line ends; `first` is the number of the first."""

    first: int
    lines: tuple[str, ...]


def read_excerpts(findings: Iterable[Finding], around: int = 1) -> dict[tuple[str, int], Excerpt]:
    """Return the excerpt for each (layer, line) that the findings name, as far as it can be read.

    `around` is the number of lines before and after. Each layer is read once.
    """
    wanted: dict[str, set[int]] = {}
    for finding in findings:
        if finding.layer and finding.line:
            wanted.setdefault(finding.layer, set()).add(finding.line)
    found: dict[tuple[str, int], Excerpt] = {}
    for layer, numbers in wanted.items():
        span = {near for number in numbers for near in range(number - around, number + around + 1)}
        lines = _read_lines(layer, span)
        for number in sorted(numbers & lines.keys()):
            found[layer, number] = _excerpt(lines, number, around)
    return found


def _read_lines(layer: str, numbers: set[int]) -> dict[int, str]:
    try:
        path = Path(layer)
        if not path.is_file():
            return {}
        with path.open(encoding="utf-8", errors="replace", newline="\n") as file:
            last = max(numbers)
            lines = {}
            for number, line in enumerate(file, start=1):
                if number in numbers:
                    lines[number] = line.rstrip("\r\n")[:LINE_LIMIT]
                if number >= last:
                    break
            return lines
    except (OSError, ValueError):
        return {}


def _excerpt(lines: Mapping[int, str], number: int, around: int) -> Excerpt:
    shown = [near for near in range(number - around, number + around + 1) if near in lines]
    return Excerpt(shown[0], tuple(lines[near] for near in shown))
