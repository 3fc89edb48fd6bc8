"""Opens the files of a recording: which there are, how they are packed, and their messages."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path, PurePath
from typing import Any, NamedTuple, TypeVar

from msgspec import Struct

from lab3_usd.errors import RecordingError
from lab3_usd.sim.bag.packing import PACKED, bound_decompression, plain_file, unpacked

ENDINGS = (".mcap", ".db3")
MOST_TOPICS = 2000
MOST_MESSAGES = 20_000_000
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
    """The files of a recording in order, and whether each message is compressed by itself."""

    paths: tuple[Path, ...]
    by_message: bool = False


class Bag(Struct, frozen=True):
    """An open recording."""

    readers: tuple[Any, ...]
    by_message: bool

    @property
    def topics(self) -> dict[tuple[str, str], tuple[Offered, ...]]:
        """What was offered, by topic and type."""
        found: dict[tuple[str, str], tuple[Offered, ...]] = {}
        for reader in self.readers:
            for each in reader.connections:
                offered = tuple(map(_offered, each.ext.offered_qos_profiles))
                key = (each.topic, each.msgtype)
                found[key] = max(found.get(key, ()), offered, key=len)
        return found

    def messages(self) -> Iterator[Raw]:
        """Yield the messages, file after file.

        Raises:
            RecordingError: the recording is damaged, or too large.
        """
        count = 0
        for reader in self.readers:
            for connection, arrival, data in _guarded(iter(reader.messages())):
                count += 1
                if count > MOST_MESSAGES:
                    message = f"has more than {MOST_MESSAGES} messages"
                    raise RecordingError(message)
                plain = unpacked(data) if self.by_message else data
                yield Raw(arrival, connection.topic, connection.msgtype, plain)


def _offered(qos: Any) -> Offered:  # noqa: ANN401 - the library's record
    return Offered(qos.durability.name.lower(), qos.reliability.name.lower())


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a recording: a folder of `ros2 bag record`, or one of its files.

    Raises:
        RecordingError: it is none, damaged, or too large.
    """
    layout = _layout(path)
    bound_decompression()
    with ExitStack() as stack:
        plain = [plain_file(each, stack) for each in layout.paths]
        readers = [_reader(each) for each in plain]
        for reader in readers:
            stack.callback(reader.close)
        if sum(len(each.connections) for each in readers) > MOST_TOPICS * len(readers):
            raise RecordingError(_too_many())
        yield Bag(tuple(readers), layout.by_message)


def _layout(path: Path) -> Layout:
    if path.is_file():
        return Layout((path,))
    if not path.is_dir():
        message = "there is no such recording"
        raise RecordingError(message)
    metadata = path / "metadata.yaml"
    said = _metadata(metadata) if metadata.is_file() else {}
    names = said.get("relative_file_paths")
    if isinstance(names, list) and names:
        paths = tuple(path / PurePath(str(each)).name for each in names)
        missing = next((each.name for each in paths if not each.is_file()), None)
        if missing is not None:
            message = f"{missing} is missing"
            raise RecordingError(message)
    else:
        paths = tuple(sorted(each for each in path.iterdir() if _is_file_of_bag(each)))
    if not paths:
        message = "holds no .mcap and no .db3 file"
        raise RecordingError(message)
    return Layout(paths, str(said.get("compression_mode", "")).lower() == "message")


def _is_file_of_bag(path: Path) -> bool:
    return path.is_file() and path.name.removesuffix(PACKED).endswith(ENDINGS)


def _metadata(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML  # noqa: PLC0415 - of the extra
    from ruamel.yaml.error import YAMLError  # noqa: PLC0415

    if path.stat().st_size > LARGEST_METADATA:
        raise RecordingError(_too_many())
    try:
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        message = "metadata.yaml cannot be read"
        raise RecordingError(message) from error
    said = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    return said if isinstance(said, dict) else {}


def _too_many() -> str:
    return f"has more than {MOST_TOPICS} topics"


def _reader(path: Path) -> Any:  # noqa: ANN401 - the library's reader
    from rosbags.rosbag2 import Reader  # noqa: PLC0415 - of the extra

    if path.suffix not in ENDINGS:
        message = f"{path.name} is neither .mcap nor .db3"
        raise RecordingError(message)
    if path.suffix == ".db3":
        _check_database(path)

    def start() -> Iterator[Any]:
        reader = Reader(path)
        reader.open()
        yield reader

    return next(_guarded(start()))


def _check_database(path: Path) -> None:
    """Refuse a database that is cut off, or has too many topics, before each is read.

    Raises:
        RecordingError: it has too many, or is no database.
    """
    with path.open("rb") as file:
        start = file.read(32)
    size, pages = int.from_bytes(start[16:18], "big"), int.from_bytes(start[28:32], "big")
    if path.stat().st_size < pages * (65536 if size == 1 else size):
        message = f"{path.name} is cut off"
        raise RecordingError(message)
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as base:
            (count,) = base.execute("SELECT count(*) FROM topics").fetchone()
    except sqlite3.Error as error:
        message = f"{path.name} is damaged or no recording: {error}"
        raise RecordingError(message) from error
    if count > MOST_TOPICS:
        raise RecordingError(_too_many())


def _guarded(items: Iterator[T]) -> Iterator[T]:
    """Yield what a library yields; whatever it raises on a damaged file is one line.

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
            message = f"is damaged or no recording: {reason}"
            raise RecordingError(message) from error
        yield item
