"""Judges the recordings in a submission, within bounds of number and size."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from lab3_usd.errors import RecordingError
from lab3_usd.model.folder import FolderFile, RecordingShown
from lab3_usd.sim.bag.recording_files import Bounds, layout_of
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import named_checkpoint

MOST = 12  # recordings
MOST_BYTES = 512_000_000  # of all of them
OF_EACH = Bounds(messages=200_000, listed=600_000, file=512_000_000, parts=1_000_000_000)
_METADATA = "metadata.yaml"


def read_recordings(
    root: Path,
    entries: Sequence[FolderFile],
    until: tuple[Lab, str],
    may_open: Callable[[str], str],
    bounds: Bounds = OF_EACH,
) -> Iterator[RecordingShown]:
    """Judge each recording by what was recorded, at the checkpoint in its name, or the last.

    `may_open` receives each before it is opened, and returns a reason not to open it. `bounds` are
    those of each.
    """
    room = MOST_BYTES
    for number, files in enumerate(_recordings(entries)):
        name = files[0].path
        refused = next((file.why_not for file in files if file.why_not), "")
        if refused:
            yield RecordingShown(name, unread=refused)
        elif find_spec("rosbags") is None:
            yield RecordingShown(name, unread="needs the extra lab3-usd[sim]", for_lack=True)
        else:
            room -= sum((root / entry.path).stat().st_size for entry in files)
            if room < 0 or number >= MOST:
                most = f"{MOST} recordings of {MOST_BYTES // 10**6} MB in all are read"
                yield RecordingShown(name, unread=f"no more than {most}")
                return
            refused = may_open(name)
            if refused:
                yield RecordingShown(name, unread=refused)
            else:
                yield _recording(root, files, until, bounds)


def _recordings(entries: Sequence[FolderFile]) -> Iterator[list[FolderFile]]:
    """Yield the files of each recording: a folder with metadata is one, else each file is one."""
    folders: dict[str, list[FolderFile]] = {}
    for entry in entries:
        if entry.name == _METADATA or entry.is_recording:
            folders.setdefault(entry.folder, []).append(entry)
    for inside in folders.values():
        files = [entry for entry in inside if entry.name != _METADATA]
        if files and len(files) < len(inside):
            yield [*files, *(entry for entry in inside if entry.name == _METADATA)]
        else:
            yield from ([file] for file in files)


def _recording(
    root: Path, files: Sequence[FolderFile], until: tuple[Lab, str], bounds: Bounds
) -> RecordingShown:
    from lab3_usd.sim.bag.judge import judge_what_came  # needs the extra

    lab, last = until
    name = files[0].path
    parts = reversed(PurePosixPath(name).parts)
    numbers = (named_checkpoint(part, lab.files) for part in parts)
    try:
        layout = layout_of([root / file.path for file in files])
        judged = judge_what_came(layout, bounds, lab, next(filter(None, numbers), last))
    except (RecordingError, OSError) as error:
        return RecordingShown(name, unread=str(error).replace(f"{root}{os.sep}", ""))
    frames = {name for frame in judged.frames for name in (frame.parent, frame.child)}
    topics = frozenset(topic.name for topic in judged.topics)
    return RecordingShown(name, topics, frozenset(frames), judged.checks)
