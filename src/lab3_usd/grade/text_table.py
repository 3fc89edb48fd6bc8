"""Reads and writes tables of text; where cells are filled in, every other byte stays."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.files import undecodable

_LARGEST = 64 << 20  # bytes
_SIGNATURES = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # what begins .xlsx and old .xls files
_QUOTED = re.compile(r'"[^"]*(?:""[^"]*)*"')


class Cell(Struct, frozen=True):
    """A cell: what it holds, and from where to where it stands in the text."""

    value: str
    start: int
    end: int


class TextTable(Struct, frozen=True):
    """The rows of a table, the first of which holds the headings, and the text they are in."""

    text: str
    rows: tuple[tuple[Cell, ...], ...]
    delimiter: str
    encoding: str
    signature: bytes

    @property
    def headings(self) -> tuple[str, ...]:
        """What the first row holds, without white space around it."""
        return tuple(cell.value.strip() for cell in self.rows[0])

    @property
    def lines(self) -> tuple[int, ...]:
        """The numbers of the rows below the headings that hold anything."""
        return tuple(
            number
            for number, cells in enumerate(self.rows)
            if number and any(cell.value.strip() for cell in cells)
        )

    def value(self, row: int, column: int) -> str:
        """Return what a cell holds, '' where the row has none."""
        cells = self.rows[row]
        return cells[column].value if column < len(cells) else ""


def read_text_table(path: Path) -> TextTable:
    """Read a table with commas, semicolons or tabs, in UTF-8 or UTF-16.

    Raises:
        UsageError: the file cannot be read, or holds no such table.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise UsageError(f"{path}: is larger than {_LARGEST >> 20} MB")
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from error
    if data.startswith(_WORKBOOKS):
        raise UsageError(f"{path}: is a workbook; export it as comma-separated values (CSV)")
    signature, encoding = next(
        (pair for pair in _SIGNATURES if data.startswith(pair[0])), (b"", "utf-8")
    )
    try:
        text = data[len(signature) :].decode(encoding)
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: is not a text table: it {undecodable(error)}") from error
    first = re.split(r"[\r\n]", text, maxsplit=1)[0]
    delimiter = max(",;\t", key=_QUOTED.sub("", first).count)
    return TextTable(text, _rows(text, delimiter, path), delimiter, encoding, signature)


def _rows(text: str, delimiter: str, path: Path) -> tuple[tuple[Cell, ...], ...]:
    """Return the cells of each line as the csv module of Python reads them, and their places."""
    plain = re.compile(rf"[^{re.escape(delimiter)}\r\n]*")
    rows: list[tuple[Cell, ...]] = []
    cells: list[Cell] = []
    start = 0
    while start < len(text) or cells:
        quoted = _QUOTED.match(text, start)
        if quoted is None and text.startswith('"', start):
            line = text.count("\n", 0, start) + 1
            raise UsageError(f"{path}: is not a text table: line {line} opens a quote and no end")
        inside = quoted[0][1:-1].replace('""', '"') if quoted else ""
        rest = plain.match(text, quoted.end() if quoted else start)
        assert rest is not None  # noqa: S101 - the pattern matches nothing too
        cells.append(Cell(inside + rest[0], start, rest.end()))
        start = rest.end()
        if text.startswith(delimiter, start):
            start += 1
            continue
        rows.append(tuple(cells))
        cells = []
        start += 2 if text.startswith("\r\n", start) else 1
    return tuple(rows)


def csv_line(cells: Iterable[str]) -> str:
    """Return a line of a table with commas, which ends in CR LF."""
    line = io.StringIO(newline="")
    csv.writer(line).writerow(cells)
    return line.getvalue()


def filled_bytes(table: TextTable, values: Mapping[tuple[int, int], str]) -> bytes:
    """Return the bytes of the table with cells filled in, by row and column.

    A value is quoted where it must be, and where the cell or its heading is.
    """
    pieces, copied = [], 0
    for (row, column), value in sorted(values.items()):
        cells = table.rows[row]
        before = ""
        if column < len(cells):
            start, end = cells[column].start, cells[column].end
        else:  # a row that ends early
            start = end = cells[-1].end
            before = table.delimiter * (column - len(cells) + 1)
        quoted = any(
            table.text.startswith('"', place) for place in (table.rows[0][column].start, start)
        )
        if quoted or any(letter in value for letter in ('"', "\r", "\n", table.delimiter)):
            shown = '"' + value.replace('"', '""') + '"'
        else:
            shown = value
        pieces += [table.text[copied:start], before, shown]
        copied = end
    text = "".join([*pieces, table.text[copied:]])
    return table.signature + text.encode(table.encoding, "replace")
