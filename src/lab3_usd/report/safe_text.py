"""Text from a stage made safe to report, lines of a layer around a fault, terminal colours."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from unicodedata import combining, east_asian_width

import msgspec
from msgspec import Struct
from msgspec.structs import asdict, replace

from lab3_usd.model.finding import Finding

LONGEST = 1000  # characters
# A cell that opens with one of these is a formula to a spreadsheet.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n")
CELL_LIMIT = 32_000  # spreadsheets hold 32767 characters a cell


def visible(text: str) -> str:
    r"""Return `text` with everything that does not print written as an escape (`\x1b`, `\u202e`).

    Covers the control characters that terminals obey, line ends, marks that turn the direction
    of writing, lone surrogates and every character that XML 1.0 forbids. The result is one line.
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode("ascii")
        for letter in text
    )


def safe_cell(text: str) -> str:
    """Return the text as a spreadsheet cell; an apostrophe before it disables a formula."""
    guarded = f"'{text}" if text.startswith(FORMULA_STARTS) else text
    return visible(guarded)[:CELL_LIMIT]


def truncated(text: str) -> str:
    """Return the text; one longer than `LONGEST` is truncated and ends with its length."""
    if len(text) <= LONGEST:
        return text
    return f"{text[:LONGEST]}... ({len(text)} characters)"


def printable(text: str) -> str:
    """Return the text truncated, with escapes for characters that do not print."""
    return visible(truncated(text))


def folded(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Return text in lines of at most `width` columns, none broken inside a word, path or URL.

    `first` and `rest` indent the first line and the others.
    """
    from textwrap import wrap

    return wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def dot_string(text: str) -> str:
    """Return any text as a string of Graphviz, in which nothing is an escape."""
    return '"' + printable(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


# Files are opened again by their paths, and no report shows the rest of these.
_KEPT = frozenset({"path", "layer", "requirements", "hidden", "dry_runs"})


def truncated_values(document: Any) -> Any:
    """Return plain data, or a report, with every text in it truncated that is shown."""
    if isinstance(document, str):
        return truncated(document)
    if isinstance(document, dict):
        return {truncated(key): truncated_values(value) for key, value in document.items()}
    if isinstance(document, (list, tuple)):
        return type(document)(map(truncated_values, document))
    if isinstance(document, Struct):
        fields = asdict(document)
        shown = {name: truncated_values(fields[name]) for name in fields if name not in _KEPT}
        return replace(document, **shown)
    return document


def json_text(document: object, indent: int) -> str:
    """Return a document as JSON in ASCII, each step indented by so many spaces; a line end last.

    So any console can print it, and a path that is no valid Unicode comes back as it was given.
    It is laid out as `json.dumps` does, in an eighth of its time.
    """
    text = json.dumps(document)
    try:
        return msgspec.json.format(text, indent=indent) + "\n"
    except msgspec.DecodeError:  # NaN, infinity, half a letter of UTF-16
        return json.dumps(document, indent=indent) + "\n"


# Select Graphic Rendition parameters of ECMA-48; the sixteen basic colours follow the user's theme.
STYLES = {
    "plain": "",
    "heading": "1",
    "dim": "2",
    "error": "1;31",
    "warning": "33",
    "note": "36",
    "pass": "32",
    "fail": "31",
    "not judged": "33",
    "unreadable": "1;31",
    "met": "32",
    "not met": "31",
    "not shown": "33",
    "person": "36",
}


def paint(text: str, style: str, *, color: bool) -> str:
    """Return `text` in a style, or as it is where there are no colours."""
    codes = STYLES[style]
    if not color or not codes or not text:
        return text
    return f"\x1b[{codes}m{text}\x1b[0m"


# A stage written on one line is data, not something to show.
LINE_LIMIT = 100_000
TAB = "    "
MORE = "..."
LEAD = 20  # columns kept before the caret when a long line is cut


Excerpt = Mapping[int, str]  # lines of a layer as they are, without line ends, by their numbers


def read_excerpts(findings: Iterable[Finding]) -> dict[tuple[str, int], Excerpt]:
    """Return the excerpt for each (layer, line) that the findings name, as far as it can be read.

    It is the line and its neighbours. Each layer is read once.
    """
    wanted: dict[str, set[int]] = {}
    for finding in findings:
        if finding.layer and finding.line:
            wanted.setdefault(finding.layer, set()).add(finding.line)
    excerpts: dict[tuple[str, int], Excerpt] = {}
    for layer, numbers in wanted.items():
        lines = _read_lines(layer, {near for number in numbers for near in _around(number)})
        ends = max(lines, default=0) + 1
        if ends in numbers and lines:  # where text was cut short: behind its last line
            lines[ends] = ""
        for number in numbers & lines.keys():
            shown = {near: lines[near] for near in _around(number) if near in lines}
            excerpts[layer, number] = shown
    return excerpts


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


def _around(number: int) -> range:
    return range(number - 1, number + 2)


def excerpt_lines(excerpt: Excerpt, line: int, column: int | None, width: int) -> list[str]:
    """Return the lines of the frame, none wider than `width` columns.

    `column` counts characters from 1; without it the line alone is marked.
    """
    gutter = len(str(max(excerpt)))
    indents = [len(raw) - len(raw.lstrip(" \t")) for raw in excerpt.values() if raw.strip()]
    margin = min(indents, default=0)
    room = max(width - gutter - 5, LEAD + len(MORE) * 2)
    frame = []
    for number, raw in excerpt.items():
        mark = ">" if number == line else " "
        shown, caret = _fitted(raw[margin:], (column or 1) - 1 - margin, room)
        frame.append(f"{mark} {number:>{gutter}} | {shown}".rstrip())
        if number == line and column is not None:
            frame.append(f"  {'':>{gutter}} | {' ' * caret}^")
    return frame


def _fitted(raw: str, position: int, room: int) -> tuple[str, int]:
    """Return the line as shown in `room` columns, and the column of the character `position`."""
    position = min(max(position, 0), len(raw))
    caret = _columns(_printed(raw[:position]))
    shown = _printed(raw)
    if _columns(shown) <= room:
        return shown, caret
    if caret + len(MORE) < room:
        return _cut(shown, room - len(MORE)) + MORE, caret
    start = max(position - LEAD, 0)
    head = MORE + _printed(raw[start:position])
    if _columns(head) >= room - len(MORE):
        head = MORE
    rest = head + _printed(raw[position : position + room])
    tail = MORE if _columns(rest) > room else ""
    return _cut(rest, room - len(tail)) + tail, _columns(head)


def _printed(raw: str) -> str:
    return visible(raw.replace("\t", TAB))


def _cut(shown: str, room: int) -> str:
    while _columns(shown) > room:
        shown = shown[: room - _columns(shown)]
    return shown


def _columns(shown: str) -> int:
    if shown.isascii():
        return len(shown)
    return sum(
        0 if combining(letter) else 2 if east_asian_width(letter) in "WF" else 1 for letter in shown
    )
