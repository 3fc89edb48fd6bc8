"""Judges the recordings in a submission: a bounded part of each, and only listed files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from lab3_usd.errors import RecordingError
from lab3_usd.model.folder.lab_files import RecordingShown
from lab3_usd.model.folder.submission import Entry
from lab3_usd.spec.file_names import named_checkpoint
from lab3_usd.spec.lab import Lab

MOST = 12  # recordings
MOST_BYTES = 512_000_000  # of all of them
MESSAGES = 200_000  # of one
LISTED = 600_000  # transforms and goals in them
LARGEST_FILE = 512_000_000  # bytes that one may unpack to
UNPACKED = 1_000_000_000  # bytes that the parts of one may unpack to
_ENDINGS = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
_METADATA = "metadata.yaml"


def opens_all(_name: str) -> str:
    """Have nothing against opening a recording."""
    return ""


def read_recordings(
    root: Path, entries: Sequence[Entry], until: tuple[Lab, str], may_open: Callable[[str], str]
) -> tuple[RecordingShown, ...]:
    """Judge each recording by what was recorded, at the checkpoint in its name, or the last.

    `may_open` is told of each before it is opened, and says why it is not to be.
    """
    return tuple(_shown(root, entries, until, may_open))


def _shown(
    root: Path, entries: Sequence[Entry], until: tuple[Lab, str], may_open: Callable[[str], str]
) -> Iterator[RecordingShown]:
    room = MOST_BYTES
    for number, files in enumerate(_recordings(entries)):
        name = files[0].path
        refused = next((each.why_not for each in files if each.why_not), "")
        if refused:
            yield RecordingShown(name, unread=refused)
        elif find_spec("rosbags") is None:
            yield RecordingShown(name, unread="needs the extra lab3-usd[sim]", for_lack=True)
        else:
            room -= sum((root / each.path).stat().st_size for each in files)
            if room < 0 or number >= MOST:
                most = f"{MOST} recordings of {MOST_BYTES // 10**6} MB in all are read"
                yield RecordingShown(name, unread=f"no more than {most}")
                return
            refused = may_open(name)
            yield RecordingShown(name, unread=refused) if refused else _judged(root, files, until)


def _recordings(entries: Sequence[Entry]) -> Iterator[list[Entry]]:
    """Yield the files of each recording: a folder with metadata is one, else each file is one."""
    folders: dict[str, list[Entry]] = {}
    for each in entries:
        if each.name == _METADATA or each.name.endswith(_ENDINGS):
            folders.setdefault(each.folder, []).append(each)
    for inside in folders.values():
        files = [each for each in inside if each.name != _METADATA]
        if files and len(files) < len(inside):
            yield [*files, *(each for each in inside if each.name == _METADATA)]
        else:
            yield from ([each] for each in files)


def _judged(root: Path, files: Sequence[Entry], until: tuple[Lab, str]) -> RecordingShown:
    from lab3_usd.sim.bag.files import layout_of  # noqa: PLC0415 - of the extra
    from lab3_usd.sim.bag.judging import judge_what_came  # noqa: PLC0415
    from lab3_usd.sim.bag.limits import Bounds  # noqa: PLC0415

    lab, last = until
    name = files[0].path
    parts = reversed(PurePosixPath(name).parts)
    known = (named_checkpoint(each, lab.files) for each in parts)
    bounds = Bounds(MESSAGES, LISTED, LARGEST_FILE, UNPACKED)
    try:
        layout = layout_of([root / each.path for each in files])
        found = judge_what_came(layout, bounds, lab, next(filter(None, known), last))
    except (RecordingError, OSError) as error:
        return RecordingShown(name, unread=str(error).replace(f"{root}/", ""))
    frames = {name for each in found.frames for name in (each.parent, each.child)}
    topics = frozenset(each.name for each in found.topics)
    return RecordingShown(name, topics, frozenset(frames), found.checks)
