"""Opens the files of a recording.

Which there are, how they are packed, and what reading them may cost.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import lru_cache
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import IO, Any, NamedTuple, TypeVar, cast

from msgspec import Struct

from lab3_usd.errors import RecordingError

PACKED = ".zstd"
LARGEST_CHUNK = 256_000_000  # bytes
LARGEST_PROFILE = 20_000  # characters of the QoS of a topic
_PART = 1 << 20


class Bounds(Struct, frozen=True):
    """The most that a recording may hold; sizes are bytes after unpacking."""

    messages: int = 20_000_000
    listed: int = 100_000_000  # transforms and goals in the messages
    file: int = 20_000_000_000
    parts: int = 1_000_000_000_000
    message: int = 64_000_000
    topics: int = 2000
    records: int = 100_000  # in the index of an MCAP file: chunks, topics, statistics
    kept: int = 60_000  # messages that are judged one by one


def plain_file(path: Path, stack: ExitStack, most: int) -> Path:
    """Return the file itself, unpacked into a folder for the time being where it is packed."""
    if path.suffix != PACKED:
        return path
    from backports import zstd

    folder = Path(stack.enter_context(TemporaryDirectory(prefix="lab3-bag-")))
    target = folder / path.stem
    try:
        with zstd.open(path, "rb") as packed, target.open("wb") as plain:
            size = 0
            while part := cast("IO[bytes]", packed).read(_PART):
                size += len(part)
                if size > most:
                    raise RecordingError(_too_large(most))
                plain.write(part)
    except (zstd.ZstdError, EOFError, OSError) as error:
        raise RecordingError(f"{path.name} cannot be unpacked") from error
    return target


def _too_large(most: int) -> str:
    return f"unpacks to more than {most // 10**6} MB"


class Unpacker:
    """Unpacks the parts of one recording, up to so many bytes in all and in a message."""

    def __init__(self, bounds: Bounds) -> None:
        self.most = self.left = bounds.parts
        self.largest = bounds.message

    def plain(self, data: bytes) -> bytes:
        """Return what is not packed: an index may name one part again and again."""
        return self._counted(data, len(data))

    def zstd(self, data: bytes, size: int) -> bytes:
        """Return what unpacks to no more than `size` bytes."""
        from backports import zstd

        try:
            plain: bytes = zstd.ZstdDecompressor().decompress(data, max_length=size + 1)
        except zstd.ZstdError as error:
            raise RecordingError("a compressed part is damaged") from error
        return self._counted(plain, size)

    def lz4(self, data: bytes, size: int) -> bytes:
        """Return what unpacks to no more than `size` bytes."""
        from lz4.frame import LZ4FrameDecompressor

        return self._counted(LZ4FrameDecompressor().decompress(data, max_length=size + 1), size)

    def _counted(self, plain: bytes, size: int) -> bytes:
        if len(plain) > size:
            raise RecordingError("a compressed part is larger than it says, or than is read")
        self.left -= len(plain)
        if self.left < 0:
            raise RecordingError(_too_large(self.most))
        return plain


@contextmanager
def bound_readers(unpacker: Unpacker, files: int, most: int) -> Iterator[None]:
    """Limit decompression and the number of QoS profiles: `most` topics in each file.

    The library has no bounds of its own; what is replaced here is what it looks up by name.
    """
    from rosbags.rosbag2 import storage_mcap, storage_sqlite3

    libraries: tuple[Any, Any] = (storage_mcap, storage_sqlite3)
    unbound, parse = storage_mcap.DECOMPRESSORS, libraries[0].parse_qos
    storage_mcap.DECOMPRESSORS = unbound | {
        "": lambda data, _size: unpacker.plain(data),
        "zstd": lambda data, size: unpacker.zstd(data, min(size, LARGEST_CHUNK)),
        "lz4": lambda data, size: unpacker.lz4(data, min(size, LARGEST_CHUNK)),
    }
    for library in libraries:
        library.parse_qos = _bound_parser(files, most)
    try:
        yield
    finally:
        storage_mcap.DECOMPRESSORS = unbound
        for library in libraries:
            library.parse_qos = parse


def _bound_parser(files: int, most: int) -> Callable[[str], Any]:
    """Return what parses each text once, and no more than so many texts in each file."""
    times = 0

    def parsed(text: str) -> Any:
        nonlocal times
        times += 1
        if times > most * files:
            raise RecordingError(too_many(most))
        return _profiles(text if len(text) <= LARGEST_PROFILE else "")

    return parsed


@lru_cache(maxsize=256)
def _profiles(text: str) -> Any:
    """Return the profiles of a text; the recordings of a class offer the same."""
    from rosbags.rosbag2.metadata import parse_qos

    return parse_qos(text)


def too_many(most: int) -> str:
    """Say that there are more topics than are read."""
    return f"has more than {most} topics"


_ODD = set("%?#")
# A view, virtual table or generated column may take for ever to be read.
_COMPUTED = """SELECT 1 FROM sqlite_master AS each WHERE type NOT IN ('table', 'index')
OR sql LIKE 'create virtual%' OR sql LIKE '%generated%' OR sql LIKE '% as (%' LIMIT 1"""
_FOOTER = 37  # bytes: a record of 29 bytes, and what the file ends in
_SUMMARY = slice(9, 17)  # in it, where the index begins
_HEAD = 9  # bytes of a record: what it is, and its length


def screen(path: Path, bounds: Bounds) -> None:
    """Refuse a file that the library should not be given.

    Raises:
        RecordingError: it is damaged, or holds too much.
        OSError: it cannot be read.
    """
    if path.suffix == ".mcap":
        _check_index(path, bounds.records)
        return
    if _ODD & set(str(path)):  # which the library hands to SQLite as part of an address
        raise RecordingError(f"{path.name} has %, ? or # in its name or folder; rename it")
    _check_database(path, bounds.topics)


def _check_index(path: Path, most: int) -> None:
    """Count the records of the index, which the library all keeps."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - _FOOTER))
        at = int.from_bytes(file.read(_FOOTER)[_SUMMARY], "little")
        for _ in range(most):
            if not 0 < at <= size - _FOOTER - _HEAD:
                return
            file.seek(at)
            at += _HEAD + int.from_bytes(file.read(_HEAD)[1:], "little")
    raise RecordingError(f"{path.name} has an index of more than {most} records")


def _check_database(path: Path, most: int) -> None:
    """Refuse a database that is cut off, or has too many topics, before each is read.

    Raises:
        RecordingError: it has too many, or is no database.
    """
    with path.open("rb") as file:
        start = file.read(32)
    size, pages = int.from_bytes(start[16:18], "big"), int.from_bytes(start[28:32], "big")
    if path.stat().st_size < pages * (65536 if size == 1 else size):
        raise RecordingError(f"{path.name} is cut off")
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as base:
            if base.execute(_COMPUTED).fetchone() is not None:
                raise RecordingError(f"{path.name} contains views or computed columns; not opened")
            (count,) = base.execute("SELECT count(*) FROM topics").fetchone()
    except sqlite3.Error as error:
        raise RecordingError(f"{path.name} is damaged or not a recording: {error}") from error
    if count > most:
        raise RecordingError(too_many(most))


ENDINGS = (".mcap", ".db3")
METADATA = "metadata.yaml"
NOT_SENT = "lab3_not_sent"  # in the metadata: topics whose messages a dry run does not make
LARGEST_METADATA = 4_000_000
T = TypeVar("T")


class Raw(NamedTuple):
    """A message as it was recorded: when it arrived (nanoseconds), its topic, type and bytes."""

    arrival: int
    topic: str
    type: str
    data: bytes


class Offered(NamedTuple):
    """What one publisher offered."""

    durability: str
    reliability: str

    @property
    def text(self) -> str:
        """As people say it."""
        return f"{self.reliability.replace('_', ' ')}, {self.durability.replace('_', ' ')}"


class Layout(Struct, frozen=True):
    """The files of a recording in order, and whether each message is compressed by itself.

    `not_sent` are the topics whose messages a dry run, which was recorded, does not make.
    """

    paths: tuple[Path, ...]
    by_message: bool = False
    not_sent: frozenset[str] = frozenset()


# A column of SQLite holds what was written into it, of whatever type it is declared.
_OTHER_COLUMNS = "is damaged: the columns of its tables hold values of other types"


class Bag(Struct, frozen=True):
    """An open recording."""

    readers: tuple[Any, ...]
    by_message: bool
    unpacker: Unpacker
    most: int  # messages

    @property
    def topics(self) -> dict[tuple[str, str], tuple[Offered, ...]]:
        """What was offered, by topic and type."""
        profiles: dict[tuple[str, str], tuple[Offered, ...]] = {}
        for reader in self.readers:
            for connection in reader.connections:
                offered = tuple(
                    Offered(qos.durability.name.lower(), qos.reliability.name.lower())
                    for qos in connection.ext.offered_qos_profiles
                )
                key = (connection.topic, connection.msgtype)
                profiles[key] = max(profiles.get(key, ()), offered, key=len)
        return profiles

    def messages(self) -> Iterator[Raw]:
        """Yield the messages, file after file.

        Raises:
            RecordingError: the recording is damaged, or too large.
        """
        count, unpacker = 0, self.unpacker
        for reader in self.readers:
            for connection, arrival, data in _guarded(iter(reader.messages())):
                count += 1
                if count > self.most:
                    raise RecordingError(f"has more than {self.most} messages")
                if not (isinstance(arrival, int) and isinstance(data, bytes)):
                    raise RecordingError(_OTHER_COLUMNS)
                plain = unpacker.zstd(data, unpacker.largest) if self.by_message else data
                yield Raw(arrival, connection.topic, connection.msgtype, plain)


@contextmanager
def opened(layout: Layout, bounds: Bounds) -> Iterator[Bag]:
    """Open a recording.

    Raises:
        RecordingError: it is none, damaged, or too large.
    """
    unpacker, files = Unpacker(bounds), len(layout.paths)
    with ExitStack() as stack:
        stack.enter_context(bound_readers(unpacker, files, bounds.topics))
        plain = [plain_file(path, stack, bounds.file) for path in layout.paths]
        readers = [_reader(path, bounds) for path in plain]
        for reader in readers:
            stack.callback(reader.close)
            for connection in reader.connections:
                if not (isinstance(connection.topic, str) and isinstance(connection.msgtype, str)):
                    raise RecordingError(_OTHER_COLUMNS)
        if sum(len(reader.connections) for reader in readers) > bounds.topics * files:
            raise RecordingError(too_many(bounds.topics))
        yield Bag(tuple(readers), layout.by_message, unpacker, bounds.messages)


def layout_at(path: Path) -> Layout:
    """Return the files of a recording: a folder of `ros2 bag record`, or one of its files.

    Raises:
        RecordingError: it is none.
    """
    if path.is_file():
        return Layout((path,))
    if not path.is_dir():
        raise RecordingError("there is no such recording")
    return layout_of([file for file in path.iterdir() if file.is_file()])


def layout_of(files: Sequence[Path]) -> Layout:
    """Return which of some files are a recording, in order: what its metadata say, or all.

    Raises:
        RecordingError: it is none, or a file is missing.
    """
    by_name = {file.name: file for file in files}
    metadata = _metadata(by_name[METADATA]) if METADATA in by_name else {}
    names = metadata.get("relative_file_paths")
    if isinstance(names, list) and names:
        wanted = [PurePath(str(name)).name for name in names]
        missing = next((name for name in wanted if name not in by_name), None)
        if missing is not None:
            raise RecordingError(f"{missing} is missing")
    else:
        wanted = sorted(name for name in by_name if is_file_of_bag(name))
    if not wanted:
        raise RecordingError("contains neither an .mcap nor a .db3 file")
    by_message = str(metadata.get("compression_mode", "")).lower() == "message"
    custom = metadata.get("custom_data")
    not_sent = str(custom.get(NOT_SENT, "")).split() if isinstance(custom, dict) else ()
    return Layout(tuple(by_name[name] for name in wanted), by_message, frozenset(not_sent))


def is_file_of_bag(name: str) -> bool:
    """Whether a file has the name of one that messages are recorded in."""
    return name.removesuffix(PACKED).endswith(ENDINGS)


def _metadata(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if path.stat().st_size > LARGEST_METADATA:
        raise RecordingError(too_many(Bounds().topics))
    try:
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise RecordingError("metadata.yaml cannot be read") from error
    information = (
        document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    )
    return information if isinstance(information, dict) else {}


def _reader(path: Path, bounds: Bounds) -> Any:
    from rosbags.rosbag2 import Reader

    if path.suffix not in ENDINGS:
        raise RecordingError(f"{path.name} is neither .mcap nor .db3")
    screen(path, bounds)

    def start() -> Iterator[Any]:
        reader = Reader(path)
        reader.open()
        yield reader

    return next(_guarded(start()))


def _guarded(items: Iterator[T]) -> Iterator[T]:
    """Yield from a library; an exception about a damaged file becomes one line.

    Raises:
        RecordingError: the library cannot go on.
    """
    while True:
        try:
            item = next(items)
        except StopIteration:
            return
        except RecordingError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise RecordingError(f"is damaged or not a recording: {reason}") from error
        yield item
