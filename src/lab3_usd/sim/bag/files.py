"""Opens the files of a recording: which there are, how they are packed, and their messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePath
from typing import Any, NamedTuple, TypeVar

from msgspec import Struct

from lab3_usd.errors import RecordingError
from lab3_usd.sim.bag import limits
from lab3_usd.sim.bag.limits import PACKED, Bounds, Unpacker, bound_readers, plain_file, too_many
from lab3_usd.sim.bag.screening import screen

ENDINGS = (".mcap", ".db3")
METADATA = "metadata.yaml"
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
    unpacker: Unpacker
    most: int  # messages

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
                if count > self.most:
                    message = f"has more than {self.most} messages"
                    raise RecordingError(message)
                plain = self.unpacker.message(data) if self.by_message else data
                yield Raw(arrival, connection.topic, connection.msgtype, plain)


def _offered(qos: Any) -> Offered:  # noqa: ANN401 - the library's record
    return Offered(qos.durability.name.lower(), qos.reliability.name.lower())


@contextmanager
def opened(layout: Layout, bounds: Bounds) -> Iterator[Bag]:
    """Open a recording.

    Raises:
        RecordingError: it is none, damaged, or too large.
    """
    unpacker, most = Unpacker(bounds.parts), limits.MOST_TOPICS * len(layout.paths)
    with ExitStack() as stack:
        stack.enter_context(bound_readers(unpacker, most))
        plain = [plain_file(each, stack, bounds.file) for each in layout.paths]
        readers = [_reader(each) for each in plain]
        for reader in readers:
            stack.callback(reader.close)
        if sum(len(each.connections) for each in readers) > most:
            raise RecordingError(too_many())
        yield Bag(tuple(readers), layout.by_message, unpacker, bounds.messages)


def layout_at(path: Path) -> Layout:
    """Return the files of a recording: a folder of `ros2 bag record`, or one of its files.

    Raises:
        RecordingError: it is none.
    """
    if path.is_file():
        return Layout((path,))
    if not path.is_dir():
        message = "there is no such recording"
        raise RecordingError(message)
    return layout_of([each for each in path.iterdir() if each.is_file()])


def layout_of(files: Sequence[Path]) -> Layout:
    """Return which of some files are a recording, in order: what its metadata say, or all.

    Raises:
        RecordingError: it is none, or a file is missing.
    """
    there = {each.name: each for each in files}
    said = _metadata(there[METADATA]) if METADATA in there else {}
    names = said.get("relative_file_paths")
    if isinstance(names, list) and names:
        wanted = [PurePath(str(each)).name for each in names]
        missing = next((each for each in wanted if each not in there), None)
        if missing is not None:
            message = f"{missing} is missing"
            raise RecordingError(message)
    else:
        wanted = sorted(each for each in there if is_file_of_bag(each))
    if not wanted:
        message = "holds no .mcap and no .db3 file"
        raise RecordingError(message)
    by_message = str(said.get("compression_mode", "")).lower() == "message"
    return Layout(tuple(there[each] for each in wanted), by_message)


def is_file_of_bag(name: str) -> bool:
    """Whether a file has the name of one that messages are recorded in."""
    return name.removesuffix(PACKED).endswith(ENDINGS)


def _metadata(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML  # noqa: PLC0415 - of the extra
    from ruamel.yaml.error import YAMLError  # noqa: PLC0415

    if path.stat().st_size > LARGEST_METADATA:
        raise RecordingError(too_many())
    try:
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        message = "metadata.yaml cannot be read"
        raise RecordingError(message) from error
    said = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    return said if isinstance(said, dict) else {}


def _reader(path: Path) -> Any:  # noqa: ANN401 - the library's reader
    from rosbags.rosbag2 import Reader  # noqa: PLC0415 - of the extra

    if path.suffix not in ENDINGS:
        message = f"{path.name} is neither .mcap nor .db3"
        raise RecordingError(message)
    screen(path)

    def start() -> Iterator[Any]:
        reader = Reader(path)
        reader.open()
        yield reader

    return next(_guarded(start()))


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
