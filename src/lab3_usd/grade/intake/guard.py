"""Checks the bytes of a stage before usd-core opens it: what would exhaust it is refused."""

from __future__ import annotations

import io
import re
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

from lab3_usd.errors import StageError
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.stage.read.crate import CRATE, PACKAGE, check_binary, entry_counts

_TEXT = b"#usda"
_NOT_BRACKETS = bytes(set(range(256)) - set(b"()[]{}"))
_TOKENS = re.compile(
    rb'"""(?:[^\\]|\\.)*?"""|'
    rb"'''(?:[^\\]|\\.)*?'''|"
    rb'"(?:[^"\\\n]|\\.)*"|'
    rb"'(?:[^'\\\n]|\\.)*'|"
    rb"@@@.*?@@@|@[^@\n]*@|#[^\n]*|[()\[\]{}]",
    re.DOTALL,
)
_OPENING, _CLOSING = (b"(", b"[", b"{"), (b")", b"]", b"}")
_PRIM = re.compile(rb"^[ \t]*(?:def|over|class)\b", re.MULTILINE)
_COUNTED = {b"PATHS": "prims and properties", b"SPECS": "prims and properties", b"TOKENS": "names"}
_PER_PRIM = 50  # entries of a crate file that one prim may have


def check_layer(path: Path, limits: Limits) -> bytes | None:
    """Return the text of a text layer, None for the binary kinds.

    Raises:
        StageError: the file is not a plain one, or holds what usd-core should not be given. Which
            file it is, the caller adds: the path here is that of a copy.
    """
    status = path.lstat()
    if not stat.S_ISREG(status.st_mode):
        _refuse("is a link, pipe or device; not opened")
    if status.st_size > limits.file_size:
        _refuse(f"is larger than {limits.file_size >> 20} MB; not opened")
    data = path.read_bytes()
    if data.startswith(_TEXT):
        _check_text(data, limits)
        return data
    if data.startswith(CRATE):
        _check_crate(data, limits)
    elif data.startswith(PACKAGE):
        _check_package(path, limits)
    return None


def can_be_read(path: Path, limits: Limits) -> bool:
    """Whether a stage is whole as far as its bytes tell: not empty, damaged or cut short."""
    try:
        text = check_layer(path, limits)
        if text is not None:
            tokens = _TOKENS.findall(text)
            opened, closed = (sum(map(tokens.count, each)) for each in (_OPENING, _CLOSING))
            return opened == closed
        with path.open("rb") as file:
            return file.read(len(CRATE)).startswith((CRATE, PACKAGE))
    except (StageError, OSError):
        return False


def _refuse(reason: str) -> NoReturn:
    raise StageError(reason)


def _check_text(data: bytes, limits: Limits) -> None:
    if data.count(b"\n") > limits.prims and len(_PRIM.findall(data)) > limits.prims:
        _refuse(f"holds more than {limits.prims} prims; not opened")
    if _may_be_deep(data, limits.nesting) and any(
        depth > limits.nesting for depth in _depths(data)
    ):
        _refuse(f"is nested more than {limits.nesting} levels deep; not opened")


def _may_be_deep(data: bytes, limit: int) -> bool:
    """Whether the brackets alone, those in strings and comments included, nest that deep."""
    brackets = data.translate(None, _NOT_BRACKETS)
    for _ in range(limit):
        shorter = brackets.replace(b"()", b"").replace(b"[]", b"").replace(b"{}", b"")
        if len(shorter) == len(brackets):
            break
        brackets = shorter
    return len(brackets) > limit


def _depths(data: bytes) -> Iterator[int]:
    """Yield how deep brackets lie in one another after each of them."""
    depth = 0
    for token in _TOKENS.finditer(data):
        if token[0] in _OPENING:
            depth += 1
        elif token[0] in _CLOSING:
            depth -= 1
        yield depth


def _check_crate(data: bytes, limits: Limits) -> None:
    """Refuse a binary layer that is damaged, or whose tables are absurdly large."""
    counts = entry_counts(io.BytesIO(data))
    for name, what in _COUNTED.items():
        if counts.get(name, 0) > limits.prims * _PER_PRIM:
            _refuse(f"holds {counts[name]} {what}; not opened")


def _check_package(path: Path, limits: Limits) -> None:
    """A USD package is a zip file of plain, unpacked files; each layer in it is looked at."""
    with path.open("rb") as file:
        check_binary(file, PACKAGE)
    try:
        with zipfile.ZipFile(path) as package:
            entries = package.infolist()
            if len(entries) > limits.files:
                _refuse(f"holds more than {limits.files} files; not opened")
            for entry in entries:
                _check_packed(package, entry, limits)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError):
        _refuse("cannot be read: the package is damaged; save it again")


def _check_packed(package: zipfile.ZipFile, entry: zipfile.ZipInfo, limits: Limits) -> None:
    name = entry.filename
    if name.startswith("/") or "\\" in name or ".." in name.split("/"):
        _refuse("holds a name that leads out of the package; not opened")
    if entry.compress_type != zipfile.ZIP_STORED or entry.flag_bits & 1:
        _refuse("is not packed as a USD package; not opened")
    if name.lower().endswith(".usdz"):
        _refuse("contains a package in a package; not opened")
    if name.lower().endswith((".usd", ".usda", ".usdc")):
        data = package.read(entry)
        if data.startswith(_TEXT):
            _check_text(data, limits)
        elif data.startswith(CRATE):
            _check_crate(data, limits)
