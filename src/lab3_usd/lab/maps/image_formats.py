"""Images that map_server loads although they are no PGM: it goes by what a file holds."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

_PNG = b"\x89PNG\r\n\x1a\n"
_GAP = rb"(?:\s|#[^\n]*\n)+"
_NUMBER = rb"(\d{1,9})"
_BITMAP = re.compile(rb"P[14]" + _GAP + _NUMBER + _GAP + _NUMBER + rb"\s")
_COLOUR = re.compile(rb"P[36]" + _GAP + _NUMBER + _GAP + _NUMBER + _GAP + _NUMBER + rb"\s")
_TWO_BYTES = 255  # what is lighter than that takes two


class OtherImage(Struct, frozen=True):
    """An image by its format, the endings that say so, and its size in cells."""

    name: str
    endings: tuple[str, ...]
    width: int
    height: int


def other_image(data: bytes) -> OtherImage | None:
    """Return what a file holds where it is a whole PNG, PPM or PBM image."""
    if data.startswith(_PNG):
        return _png(data)
    for header, name, ending in ((_COLOUR, "PPM", ".ppm"), (_BITMAP, "PBM", ".pbm")):
        found = header.match(data)
        if found:
            width, height, *white = (int(group) for group in found.groups())
            image = OtherImage(name, (ending, ".pnm"), width, height)
            return image if _is_whole(data[:2], data[found.end() :], image, *white) else None
    return None


def _is_whole(kind: bytes, body: bytes, image: OtherImage, white: int = 1) -> bool:
    """Whether as many values stand after a header as it announces."""
    cells = image.width * image.height
    if cells == 0:
        return False
    if kind == b"P1":  # digits, which need no blanks between them
        return sum(map(body.count, (b"0", b"1"))) >= cells
    if kind == b"P3":
        return len(body.split()) >= 3 * cells
    if kind == b"P4":
        return len(body) >= (image.width + 7) // 8 * image.height
    return len(body) >= 3 * cells * (2 if white > _TWO_BYTES else 1)


def _png(data: bytes) -> OtherImage | None:
    """Read the size of a PNG out of its first chunk; None unless its last one is there."""
    chunks = dict(_chunks(data))
    header = chunks.get(b"IHDR")
    if header is None or b"IDAT" not in chunks or b"IEND" not in chunks:
        return None
    width, height = (int.from_bytes(data[header + at : header + at + 4], "big") for at in (0, 4))
    return OtherImage("PNG", (".png",), width, height)


def _chunks(data: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield the name of each chunk that is whole, and where what it holds begins."""
    at = len(_PNG)
    while (end := at + 12 + int.from_bytes(data[at : at + 4], "big")) <= len(data):
        yield data[at + 4 : at + 8], at + 8
        at = end
