"""The text of scripts and notebooks: found by a search, decoded as Python does, never imported."""

from __future__ import annotations

import ast
import io
import json
import re
import tokenize
import warnings
from bisect import bisect_right
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import StageError
from lab3_usd.files import undecodable

MOST_BYTES = 10_000_000
_BUILDS = re.compile(rb"\bedit\b|create_graph|create_node|CREATE_NODES|\.create_node")
_MAGIC = re.compile(r"\s*[%!?]")


def may_build(path: Path, module: str) -> bool:
    """Whether a file may build graphs: it names the module, and what makes graphs.

    Raises:
        StageError: it cannot be read.
    """
    return may_change(path, module) and _BUILDS.search(_bytes(path)) is not None


def may_change(path: Path, module: str) -> bool:
    """Whether a file may change graphs that are there already: it names the module.

    Raises:
        StageError: it cannot be read.
    """
    return module.encode() in _bytes(path)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise StageError(f"{path}: cannot be read ({why})") from error


class Source(Struct, frozen=True, eq=False):
    """The code of a script, and where its lines stand in the file.

    `lines` are those of the code, from the first; of a notebook `file_lines` are the numbers that
    they have in the file, and `cells` the numbers of their cells, from 1.
    """

    path: str
    code: str
    lines: tuple[str, ...]
    file_lines: tuple[int, ...] = ()
    cells: tuple[int, ...] = ()

    def line(self, number: int) -> int:
        """Return the line of the file in which a line of the code stands."""
        return self.file_lines[number - 1] if 0 < number <= len(self.file_lines) else number

    def column(self, line: int, offset: int) -> int:
        """Return the column, from 1 in characters, of an offset in bytes within a line."""
        if not 0 < line <= len(self.lines):
            return 1
        return len(self.lines[line - 1].encode()[:offset].decode(errors="replace")) + 1

    def cell(self, line: int) -> str:
        """Return which cell a line of the code stands in, '' for a script."""
        if not 0 < line <= len(self.cells):
            return ""
        number = self.cells[line - 1]
        first = self.cells.index(number)
        return f"cell {number}, line {line - first}"


def read_source(path: Path) -> Source:
    """Return the code of a script or of the code cells of a notebook.

    Raises:
        StageError: it cannot be read, is too large, or is no text.
    """
    data = _bytes(path)
    if len(data) > MOST_BYTES:
        size = len(data) // 1_000_000
        raise StageError(
            f"{path}: not read: it has {size} MB, and a script may have {MOST_BYTES // 1_000_000}",
            repair="split it, or leave it out with exclude in the configuration",
        )
    if path.suffix == ".ipynb":
        return _notebook(path, data)
    code = _decoded(path, data)
    return Source(str(path), code, tuple(code.split("\n")))


def _decoded(path: Path, data: bytes) -> str:
    try:
        encoding, _ = tokenize.detect_encoding(io.BytesIO(data).readline)
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        repair = "save it as UTF-8, or name its encoding in the first line"
        raise StageError(f"{path}: {undecodable(error)}", repair=repair) from error
    except (SyntaxError, LookupError, UnicodeError) as error:
        raise StageError(f"{path}: its text cannot be decoded ({error})") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _notebook(path: Path, data: bytes) -> Source:
    try:
        text = data.decode("utf-8-sig")
        document = json.loads(text)
        cells = [(kind["cell_type"], kind["source"]) for kind in document["cells"]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise StageError(f"{path}: is not a notebook that can be read ({error})") from error
    lines: list[str] = []
    numbers: list[int] = []
    places: list[int] = []
    starts = [0, *(match.end() for match in re.finditer("\n", text))]
    at = 0
    for number, (kind, source) in enumerate(cells, 1):
        code = source if isinstance(source, str) else "".join(map(str, source))
        position = text.find('"source"', at)
        at = position if position >= 0 else at
        if kind != "code":
            at += len('"source"')
            continue
        is_other = code.lstrip().startswith("%%")
        for line in code.split("\n"):
            at, place = _place(text, line, at)
            lines.append("" if is_other or _MAGIC.match(line) else line)
            numbers.append(number)
            places.append(bisect_right(starts, place))
    code = "\n".join(  # without the lines that show help
        "" if line.rstrip().endswith("?") and "#" not in line else line for line in lines
    )
    return Source(str(path), code, tuple(lines), tuple(places), tuple(numbers))


def _place(text: str, line: str, at: int) -> tuple[int, int]:
    """Return where the search goes on behind a line of a notebook, and where the line stands."""
    for written in (json.dumps(line, ensure_ascii=False)[1:-1], json.dumps(line)[1:-1]):
        position = text.find(written, at) if written else -1
        if position >= 0:
            return position + len(written), position
    return at, at


def parse(source: Source) -> ast.Module:
    """Return the tree of the code.

    Raises:
        StageError: it is no Python; the line is that of the file.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(source.code)
    except SyntaxError as error:
        number = error.lineno or 1
        cell = source.cell(number)
        where = f" ({cell})" if cell else ""
        raise StageError(
            f"{source.path}: {error.msg} in line {source.line(number)}{where}",
            source.line(number),
            error.offset,
            repair=f"correct line {source.line(number)}",
        ) from error
    except ValueError as error:
        raise StageError(f"{source.path}: is no Python ({error})") from error
    except (RecursionError, MemoryError) as error:
        raise StageError(f"{source.path}: is nested too deeply to be read") from error
