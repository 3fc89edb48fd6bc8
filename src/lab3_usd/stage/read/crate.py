"""Looks at the tables of binary layers, alone or in a package, before usd-core reads them.

usd-core makes room for as many entries as a table says that it has: a damaged count in a file of
20 kB takes all memory of a computer. So what each table says must fit into its file. The layout is
that of OpenUSD's pxr/usd/sdf/crateFile.cpp, and of its zipFile.cpp for packages.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

from msgspec import Struct

from lab3_usd.errors import StageError

CRATE = b"PXR-USDC"
PACKAGE = b"PK\x03\x04"
DAMAGED = "cannot be read: it is damaged or cut short; save it again"
_BOOTSTRAP = struct.Struct("<8s8sq")  # a name, the version, where the table of contents begins
_NUMBER = struct.Struct("<Q")
_SHORT_NUMBER = struct.Struct("<L")
_SECTION = struct.Struct("<16sqq")  # a name, where it begins, its size
_PACKED_FILE = struct.Struct("<4s4xH8xLLHH")  # method, both sizes, lengths of name and extra field
_MOST_SECTIONS = 64
_OLDEST = (0, 4)  # version that usd-core reads; it says so of others
_STORED = 0  # how a file in a package is packed: not at all
_MOST_LARGER = 255  # times, by LZ4
_GOES_ON = 15  # in LZ4: the length has more bytes
_MOST_NUMBERS = 4 * _MOST_LARGER  # in a byte: a number takes two bits before that
SPECS = b"SPECS"
_FIELDS, _PATHS = b"FIELDS", b"PATHS"
# Numbers with which each section begins before the sizes of its parts; the first is how many
# entries it has.
_COUNTS = {_FIELDS: 1, b"FIELDSETS": 1, _PATHS: 2, SPECS: 1}
_TOKENS, _STRINGS = b"TOKENS", b"STRINGS"
_KNOWN = {_TOKENS, _STRINGS, *_COUNTS}


class _Part(Struct, frozen=True):
    """A part of a file: where it begins, and how many bytes it has."""

    file: BinaryIO
    begin: int
    size: int

    def inner(self, begin: int, size: int) -> _Part:
        """Return what lies in it.

        Raises:
            StageError: it does not.
        """
        if begin < 0 or size < 0 or begin + size > self.size:
            raise StageError(DAMAGED)
        return _Part(self.file, self.begin + begin, size)

    def read(self, form: struct.Struct, begin: int) -> Any:
        """Return what stands there in it."""
        self.file.seek(self.inner(begin, form.size).begin)
        return form.unpack(self.file.read(form.size))

    def bytes(self) -> bytes:
        """Return all of it."""
        self.file.seek(self.begin)
        return self.file.read(self.size)

    def number(self, begin: int) -> int:
        """Return a number of 8 bytes."""
        number: int = self.read(_NUMBER, begin)[0]
        return number


def check_binary(file: BinaryIO, start: bytes) -> None:
    """Refuse a binary layer or a package whose tables do not fit into it; it begins with `start`.

    Raises:
        StageError: it is damaged; the line does not name it.
    """
    if not start.startswith((CRATE, PACKAGE)):
        return
    whole = _Part(file, 0, file.seek(0, os.SEEK_END))
    for layer in [whole] if start.startswith(CRATE) else _packed_layers(whole):
        _entry_counts(layer)


def entry_counts(file: BinaryIO) -> dict[bytes, int]:
    """Return how many entries each table of a binary layer says that it has.

    Raises:
        StageError: it is damaged; the line does not name it.
    """
    return _entry_counts(_Part(file, 0, file.seek(0, os.SEEK_END)))


def _entry_counts(layer: _Part) -> dict[bytes, int]:
    counts = {}
    try:
        _, version, contents = layer.read(_BOOTSTRAP, 0)
        is_known = (version[0], version[1]) >= _OLDEST
        count = layer.number(contents)
        if contents < _BOOTSTRAP.size or count > _MOST_SECTIONS:
            raise StageError(DAMAGED)
        for index in range(count):
            place = contents + _NUMBER.size + index * _SECTION.size
            padded, begin, size = layer.read(_SECTION, place)
            name, section = padded.rstrip(b"\0"), layer.inner(begin, size)
            if name in _KNOWN and is_known:
                counts[name] = section.number(0)
                _check_section(section, name)
            if name == _FIELDS and is_known:
                _check_lists(layer, section, (version[0], version[1]))
            elif name == _PATHS and is_known:
                _check_tree(section)
    except struct.error as error:  # the file was cut meanwhile
        raise StageError(DAMAGED) from error
    return counts


def _check_section(section: _Part, name: bytes) -> None:
    """Refuse a table whose entries cannot all lie in it.

    Raises:
        StageError: they cannot.
    """
    count, room = section.number(0), section.size - _NUMBER.size
    if name == _STRINGS:
        most = room // 4
    elif name == _TOKENS:
        plain, packed = section.number(8), section.number(16)
        section.inner(24, packed)
        if plain > _MOST_LARGER * packed:
            raise StageError(DAMAGED)
        most = plain  # each ends in a zero
    else:
        begin = _NUMBER.size * _COUNTS[name]
        count = max(section.number(place) for place in range(0, begin, _NUMBER.size))
        most = _MOST_NUMBERS * section.inner(begin + _NUMBER.size, section.number(begin)).size
    if count > most:
        raise StageError(DAMAGED)


# A value of a field, in 8 bytes: bits that say how it is kept, its type, where it lies.
_IS_LIST, _IS_INLINE, _PLACE = 1 << 63, 1 << 62, (1 << 48) - 1
_NUMBERED_LISTS = {40: 4, 41: 4, 48: 8, 49: 16, 50: 4}  # type of a vector, bytes of an entry
_DIFFERENCES = (0, 1, 2, 4)  # bytes of a difference between integers
_MOST_PATHS = 1 << 14  # in a table that is looked at; to unpack more would take long
_MOST_PACKED = 1 << 15  # bytes; a table of more is not unpacked here, which would take long
_SHAPED, _LONG = (0, 5), (0, 7)  # versions: until here a list has a rank, from here 8 bytes of size


def _check_lists(layer: _Part, fields: _Part, version: tuple[int, int]) -> None:
    """Refuse a layer with a value that says it is a longer list than the layer has room for.

    Raises:
        StageError: it says so, or the table of the fields cannot be unpacked.
    """
    count = fields.number(0)
    at = 2 * _NUMBER.size + fields.number(_NUMBER.size)  # behind the names
    packed = fields.inner(at + _NUMBER.size, fields.number(at))
    if packed.size > _MOST_PACKED or not count:
        return
    values = _unpacked(packed.bytes(), count * _NUMBER.size)
    if len(values) != count * _NUMBER.size:
        raise StageError(DAMAGED)
    for (value,) in _NUMBER.iter_unpack(values):
        kind, place = value >> 48 & 0xFF, value & _PLACE
        if value & _IS_INLINE or not place:
            continue
        if value & _IS_LIST:
            start = place + 4 if version < _SHAPED else place
            is_long = version >= _LONG
            size = layer.number(start) if is_long else layer.read(_SHORT_NUMBER, start)[0]
            least = 1 / _MOST_NUMBERS  # bytes that an entry takes
        elif kind in _NUMBERED_LISTS:
            size, least = layer.number(place), _NUMBERED_LISTS[kind]
        else:
            continue
        if size * least > layer.size - place:
            raise StageError(DAMAGED)


def _check_tree(paths: _Part) -> None:
    """Refuse a table of paths that is no tree: usd-core follows it without end, or out of it.

    A path has a jump: 0 for a sibling behind it, -1 for a child, the way to a sibling behind its
    children, and -2 for a leaf at the end.

    Raises:
        StageError: a path is reached twice, or lies behind the last one.
    """
    room, count, at = paths.number(0), paths.number(_NUMBER.size), 2 * _NUMBER.size
    if count > _MOST_PATHS:
        return
    tables = []
    for _ in range(3):  # the place of each path, its name, its jump
        packed = paths.inner(at + _NUMBER.size, paths.number(at))
        tables.append(_integers(packed.bytes(), count))
        at += _NUMBER.size + packed.size
    places, _, jumps = tables
    reached = bytearray(count)
    waiting = [0] if count else []
    while waiting:
        path = waiting.pop()
        while True:
            if path >= count or reached[path]:
                raise StageError(DAMAGED)
            reached[path] = 1
            jump = jumps[path]
            if jump > 0:
                waiting.append(path + jump)
            if jump < -1:
                break
            path += 1
    if len(set(places)) < count or min(places, default=0) < 0 or max(places, default=0) >= room:
        raise StageError(DAMAGED)


def _integers(packed: bytes, count: int) -> list[int]:
    """Unpack integers: each is the one before it and a difference.

    Four differences have a byte that says of each whether it is the usual one, or takes 1, 2 or 4
    bytes (OpenUSD's pxr/usd/sdf/integerCoding.cpp).

    Raises:
        StageError: they are not so many.
    """
    codes = 4 + (2 * count + 7) // 8
    plain = _unpacked(packed, codes + 4 * count)
    numbers, at, number = [], codes, 0
    usual = int.from_bytes(plain[:4], "little", signed=True)
    if len(plain) < codes:
        raise StageError(DAMAGED)
    for index in range(count):
        size = _DIFFERENCES[plain[4 + index // 4] >> 2 * (index % 4) & 3]
        number += int.from_bytes(plain[at : at + size], "little", signed=True) if size else usual
        at += size
        numbers.append(number)
    if at != len(plain):
        raise StageError(DAMAGED)
    return numbers


def _unpacked(packed: bytes, most: int) -> bytes:
    """Unpack one block of LZ4, which stands behind a zero, to at most so many bytes.

    Several blocks, which only a table of gigabytes has, are not unpacked. Of the format: a byte has
    two lengths, of what follows as it is and of what stood before; 15 goes on in the next bytes.

    Raises:
        StageError: it is no such block, or has more.
    """
    plain, at = bytearray(), 1
    try:
        if packed[0]:
            return b""
        while at < len(packed):
            lengths, at = packed[at], at + 1
            literal, at = _length(packed, at, lengths >> 4)
            plain += packed[at : at + literal]
            at += literal
            if at >= len(packed):
                break
            back = packed[at] | packed[at + 1] << 8
            again, at = _length(packed, at + 2, lengths & _GOES_ON)
            begin, again = len(plain) - back, again + 4
            if not 0 <= begin < len(plain) or len(plain) + again > most:
                raise StageError(DAMAGED)
            repeated = plain[begin : begin + again]
            plain += (repeated * (again // len(repeated) + 1))[:again]
    except IndexError as error:
        raise StageError(DAMAGED) from error
    if len(plain) > most:
        raise StageError(DAMAGED)
    return bytes(plain)


def _length(packed: bytes, at: int, length: int) -> tuple[int, int]:
    """Return a length of LZ4, and where the bytes that it takes end."""
    if length == _GOES_ON:
        while True:
            length, at = length + packed[at], at + 1
            if packed[at - 1] != _MOST_LARGER:
                break
    return length, at


def _packed_layers(package: _Part) -> Iterator[_Part]:
    """Yield the binary layers of a package, whose files stand in it one after the other.

    Raises:
        StageError: a file does not lie in the package.
    """
    at = 0
    while at + _PACKED_FILE.size <= package.size:
        start, method, packed, plain, name, extra = package.read(_PACKED_FILE, at)
        if start != PACKAGE:
            return
        file = package.inner(at + _PACKED_FILE.size + name + extra, packed)
        if method == _STORED and plain == packed:
            package.file.seek(file.begin)
            if package.file.read(len(CRATE)) == CRATE:
                yield file
        at += _PACKED_FILE.size + name + extra + packed
