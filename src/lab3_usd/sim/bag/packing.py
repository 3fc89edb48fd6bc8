"""Unpacks what is compressed in a recording, up to a bound."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, BinaryIO, cast

from lab3_usd.errors import RecordingError

PACKED = ".zstd"
LARGEST_CHUNK = 256_000_000  # bytes
LARGEST_MESSAGE = 64_000_000
LARGEST_FILE = 20_000_000_000  # of one that has to be unpacked
_PART = 1 << 20


def plain_file(path: Path, stack: ExitStack) -> Path:
    """Return the file itself, unpacked into a folder for the time being where it is packed."""
    if path.suffix != PACKED:
        return path
    from backports import zstd  # noqa: PLC0415 - of the extra

    folder = Path(stack.enter_context(TemporaryDirectory(prefix="lab3-bag-")))
    target = folder / path.stem
    try:
        with zstd.open(path, "rb") as packed, target.open("wb") as plain:
            _copy(cast("IO[bytes]", packed), plain)
    except (zstd.ZstdError, EOFError, OSError) as error:
        message = f"{path.name} cannot be unpacked"
        raise RecordingError(message) from error
    return target


def _copy(packed: IO[bytes], plain: BinaryIO) -> None:
    size = 0
    while part := packed.read(_PART):
        size += len(part)
        if size > LARGEST_FILE:
            message = f"unpacks to more than {LARGEST_FILE // 10**9} GB"
            raise RecordingError(message)
        plain.write(part)


def unpacked(data: bytes) -> bytes:
    """Return a message that is compressed by itself.

    Raises:
        RecordingError: it is damaged, or unpacks to too much.
    """
    return _zstd(data, LARGEST_MESSAGE)


def _zstd(data: bytes, most: int) -> bytes:
    from backports import zstd  # noqa: PLC0415 - of the extra

    try:
        plain: bytes = zstd.ZstdDecompressor().decompress(data, max_length=most + 1)
    except zstd.ZstdError as error:
        message = "a compressed part is damaged"
        raise RecordingError(message) from error
    return _bounded(plain, most)


def _lz4(data: bytes, most: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - of the extra

    return _bounded(LZ4FrameDecompressor().decompress(data, max_length=most + 1), most)


def _bounded(plain: bytes, most: int) -> bytes:
    if len(plain) > min(most, LARGEST_CHUNK):
        message = "a compressed part is larger than it says, or than is read"
        raise RecordingError(message)
    return plain


def bound_decompression() -> None:
    """Let the reader of MCAP unpack no more than a chunk says, and no more than is read."""
    from rosbags.rosbag2 import storage_mcap  # noqa: PLC0415 - of the extra

    storage_mcap.DECOMPRESSORS["zstd"] = lambda data, size: _zstd(data, min(size, LARGEST_CHUNK))
    storage_mcap.DECOMPRESSORS["lz4"] = lambda data, size: _lz4(data, min(size, LARGEST_CHUNK))
