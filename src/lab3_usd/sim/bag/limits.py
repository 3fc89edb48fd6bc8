"""Limits of what reading a recording may cost: bytes unpacked, topics parsed, messages read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, BinaryIO, cast

from msgspec import Struct

from lab3_usd.errors import RecordingError

PACKED = ".zstd"
LARGEST_CHUNK = 256_000_000  # bytes
LARGEST_MESSAGE = 64_000_000
LARGEST_PROFILE = 20_000  # characters of the QoS of a topic
MOST_TOPICS = 2000
_PART = 1 << 20


class Bounds(Struct, frozen=True):
    """The most messages of a recording, transforms and goals in them, and bytes to unpack."""

    messages: int = 20_000_000
    listed: int = 100_000_000
    file: int = 20_000_000_000
    parts: int = 1_000_000_000_000


def plain_file(path: Path, stack: ExitStack, most: int) -> Path:
    """Return the file itself, unpacked into a folder for the time being where it is packed."""
    if path.suffix != PACKED:
        return path
    from backports import zstd  # noqa: PLC0415 - of the extra

    folder = Path(stack.enter_context(TemporaryDirectory(prefix="lab3-bag-")))
    target = folder / path.stem
    try:
        with zstd.open(path, "rb") as packed, target.open("wb") as plain:
            _copy(cast("IO[bytes]", packed), plain, most)
    except (zstd.ZstdError, EOFError, OSError) as error:
        message = f"{path.name} cannot be unpacked"
        raise RecordingError(message) from error
    return target


def _copy(packed: IO[bytes], plain: BinaryIO, most: int) -> None:
    size = 0
    while part := packed.read(_PART):
        size += len(part)
        if size > most:
            raise RecordingError(_too_large(most))
        plain.write(part)


def _too_large(most: int) -> str:
    return f"unpacks to more than {most // 10**6} MB"


class Unpacker:
    """Unpacks the parts of one recording, up to so many bytes in all."""

    def __init__(self, most: int) -> None:
        self.most = self.left = most

    def message(self, data: bytes) -> bytes:
        """Return a message that is compressed by itself.

        Raises:
            RecordingError: it is damaged, or unpacks to too much.
        """
        return self.zstd(data, LARGEST_MESSAGE)

    def plain(self, data: bytes) -> bytes:
        """Return what is not packed: an index may name one part again and again."""
        return self._counted(data, len(data))

    def zstd(self, data: bytes, size: int) -> bytes:
        """Return what unpacks to no more than `size` bytes."""
        from backports import zstd  # noqa: PLC0415 - of the extra

        try:
            plain: bytes = zstd.ZstdDecompressor().decompress(data, max_length=size + 1)
        except zstd.ZstdError as error:
            message = "a compressed part is damaged"
            raise RecordingError(message) from error
        return self._counted(plain, size)

    def lz4(self, data: bytes, size: int) -> bytes:
        """Return what unpacks to no more than `size` bytes."""
        from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - of the extra

        return self._counted(LZ4FrameDecompressor().decompress(data, max_length=size + 1), size)

    def _counted(self, plain: bytes, size: int) -> bytes:
        if len(plain) > size:
            message = "a compressed part is larger than it says, or than is read"
            raise RecordingError(message)
        self.left -= len(plain)
        if self.left < 0:
            raise RecordingError(_too_large(self.most))
        return plain


@contextmanager
def bound_readers(unpacker: Unpacker, topics: int) -> Iterator[None]:
    """Let the readers unpack no more than chunks say, and parse the QoS of so many topics.

    The library has no bounds of its own; what is replaced here is what it looks up by name.
    """
    from rosbags.rosbag2 import storage_mcap, storage_sqlite3  # noqa: PLC0415 - of the extra

    libraries: tuple[Any, Any] = (storage_mcap, storage_sqlite3)
    unbound, parse = storage_mcap.DECOMPRESSORS, libraries[0].parse_qos
    storage_mcap.DECOMPRESSORS = unbound | {
        "": lambda data, _size: unpacker.plain(data),
        "zstd": lambda data, size: unpacker.zstd(data, min(size, LARGEST_CHUNK)),
        "lz4": lambda data, size: unpacker.lz4(data, min(size, LARGEST_CHUNK)),
    }
    for each in libraries:
        each.parse_qos = _bound_parser(parse, topics)
    try:
        yield
    finally:
        storage_mcap.DECOMPRESSORS = unbound
        for each in libraries:
            each.parse_qos = parse


def _bound_parser(parse: Callable[[str], Any], most: int) -> Callable[[str], Any]:
    """Return what parses each text once, and no more than so many times."""
    known: dict[str, Any] = {}
    times = 0

    def parsed(text: str) -> Any:  # noqa: ANN401 - the library's records
        nonlocal times
        times += 1
        if times > most:
            raise RecordingError(too_many())
        if text not in known:
            known[text] = parse(text if len(text) <= LARGEST_PROFILE else "")
        return known[text]

    return parsed


def too_many() -> str:
    """Say that there are more topics than are read."""
    return f"has more than {MOST_TOPICS} topics"
