"""Occupancy map files as map_server reads them: a PGM image and the YAML beside it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import Lab3Error

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
_WHITE = 255
_OCCUPIED_THRESHOLD = 0.65
_TWO_BYTES = 65535
_MOST_CELLS = 10**8
_MOST_DIGITS = 9
GAP = rb"(?:\s|#[^\n]*\n)+"
# One white space ends the header: in a binary file the next byte is a cell.
_HEADER = re.compile(
    rb"(?P<kind>P[25])"
    + GAP
    + rb"(?P<width>\d{1,9})"
    + GAP
    + rb"(?P<height>\d{1,9})"
    + GAP
    + rb"(?P<white>\d{1,9})(?:[ \t]*#[^\n]*)?\s"
)


class MapError(Lab3Error):
    """A map file cannot be read, or two maps cannot be compared."""


class MapFile(Struct, frozen=True):
    """What a map's YAML says; `image` as written there, lengths in metres, the turn in radians."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: int
    occupied_thresh: float
    free_thresh: float
    mode: str = "trinary"


class Grid(Struct, frozen=True):
    """A map image: one byte for each cell, row 0 at the top."""

    width: int
    height: int
    cells: bytes

    def at(self, column: int, row: int) -> int:
        """Return the grey value of a cell."""
        return self.cells[row * self.width + column]

    def occupied(self) -> Iterator[tuple[int, int]]:
        """Yield (column, row) of the cells that map_server calls occupied, black being 1."""
        for index, value in enumerate(self.cells):
            if (_WHITE - value) / _WHITE > _OCCUPIED_THRESHOLD:
                yield index % self.width, index // self.width


def map_yaml(file: MapFile) -> str:
    """Write a map's YAML in the order and form of the handout (4.2)."""
    origin = ", ".join(f"{value:.10g}" for value in file.origin)
    return (
        f"image: {file.image}\n"
        f"mode: {file.mode}\n"
        f"resolution: {file.resolution:.10g}\n"
        f"origin: [{origin}]\n"
        f"negate: {file.negate}\n"
        f"occupied_thresh: {file.occupied_thresh:.10g}\n"
        f"free_thresh: {file.free_thresh:.10g}\n"
    )


def pgm(grid: Grid) -> bytes:
    """Write a grid as a binary PGM."""
    return b"P5\n%d %d\n%d\n" % (grid.width, grid.height, _WHITE) + grid.cells


def read_pgm(path: Path) -> Grid:
    """Read a PGM image, binary (P5) or text (P2), with comments; grey values become 0 to 255.

    Raises:
        MapError: the file cannot be read, is no PGM, or holds other cells than it announces.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        message = f"{path} cannot be read ({error.strerror})"
        raise MapError(message) from error
    header = _HEADER.match(data)
    if header is None:
        message = f"{path} is no PGM image, which begins with P5 or P2, width, height and white"
        raise MapError(message)
    width, height, white = (int(header[name]) for name in ("width", "height", "white"))
    if not (0 < width * height <= _MOST_CELLS and 0 < white <= _TWO_BYTES):
        message = f"{path}: no map has {width} x {height} cells and {white} shades of grey"
        raise MapError(message)
    body = data[header.end() :]
    values = _binary(body, white) if header["kind"] == b"P5" else _decimal(body, path)
    if len(values) < width * height:
        message = f"{path}: {width} x {height} cells announced, only {len(values)} found"
        raise MapError(message)
    cells = values[: width * height]
    if max(cells) > white:
        message = f"{path}: a cell is {max(cells)}, but white is {white}"
        raise MapError(message)
    return Grid(width, height, bytes(value * _WHITE // white for value in cells))


def _binary(body: bytes, white: int) -> Sequence[int]:
    if white <= _WHITE:
        return body
    return [body[at] * 256 + body[at + 1] for at in range(0, len(body) - 1, 2)]


def _decimal(body: bytes, path: Path) -> Sequence[int]:
    words = re.sub(rb"#[^\n]*", b"", body).split()
    if all(word.isdigit() and len(word) <= _MOST_DIGITS for word in words):
        return [int(word) for word in words]
    message = f"{path}: a text PGM (P2) holds only whole numbers"
    raise MapError(message)


def agreement(student: Grid, ours: Grid) -> float:
    """Return the share of the student's occupied cells that lie within one cell of one of ours.

    A cell's neighbours include the diagonal ones. A map without walls agrees with nothing: 0.

    Raises:
        MapError: the maps have different sizes.
    """
    if (student.width, student.height) != (ours.width, ours.height):
        message = (
            f"a map of {student.width} x {student.height} cells cannot be compared "
            f"with one of {ours.width} x {ours.height}"
        )
        raise MapError(message)
    near = {
        (column + right, row + down)
        for column, row in ours.occupied()
        for right in (-1, 0, 1)
        for down in (-1, 0, 1)
    }
    judged = [cell in near for cell in student.occupied()]
    return sum(judged) / len(judged) if judged else 0.0
