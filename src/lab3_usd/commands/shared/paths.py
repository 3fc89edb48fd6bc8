"""The paths of a call: what it reads and what it writes, and that no output is one of its inputs.

A command declares each path that it takes by a type of this module. Before it runs,
`refuse_inputs_as_outputs` compares every output with every input; a command that makes files in a
folder calls `refuse_inputs` with these.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import Any

import click

from lab3_usd.data import lab_folder
from lab3_usd.errors import UsageError, unwritten


class Input(click.Path):
    """A file or folder that a call reads."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or fail with one line."""
        try:
            return super().convert(value, param, ctx)
        except ValueError as error:  # a null byte
            self.fail(f"{value!r} is not a path: {error}", param, ctx)

    def places(self, value: str | Path) -> Iterator[Path]:
        """Yield what is read where this is given."""
        yield Path(value)


class AssetFolder(Input):
    """A folder behind an address: `URL=FOLDER`."""

    def places(self, value: str | Path) -> Iterator[Path]:
        """Yield the folder."""
        yield Path(str(value).partition("=")[2])


_OF_RECORDINGS = (".mcap", ".db3", ".zstd")
_IMAGE = re.compile(rb"(?m)^\s*image:\s*[\"']?([^\"'\r\n#]+)")


class RecordingInput(Input):
    """A recording, a folder or one of its files, which is read with the others."""

    def places(self, value: str | Path) -> Iterator[Path]:
        """Yield the recording; of a file also those that lie beside it."""
        path = Path(value)
        yield path
        if path.is_file():
            yield path.with_name("metadata.yaml")
            yield from (file for end in _OF_RECORDINGS for file in path.parent.glob(f"*{end}*"))


class MapInput(Input):
    """A map, its YAML or its folder."""

    def places(self, value: str | Path) -> Iterator[Path]:
        """Yield the map; of a YAML also the image that it names."""
        path = Path(value)
        yield path
        with suppress(OSError):
            for name in _IMAGE.findall(path.read_bytes()) if path.is_file() else ():
                yield path.parent / os.fsdecode(name.strip())


class OutputFile(click.Path):
    """A file that a call writes; the folder that it lies in must be there."""

    advice = "name another file"

    def may_replace(self, path: Path) -> bool:
        """Whether a file in a folder that is read may be replaced: it is an older output."""
        del path
        return False


class OutputAlone(OutputFile):
    """The one file that a call is for; the folder that it lies in is made."""


class OutputRepair(OutputFile):
    """A stage that is written after repairs, which may also replace the one that was read."""

    advice = "use --in-place"


class OutputReport(OutputFile):
    """A report or page, whose ending is never that of a stage."""


class OutputBaseline(OutputReport):
    """A baseline, which is written again and again, often beside the stages."""

    def may_replace(self, path: Path) -> bool:
        """Whether the file is a baseline."""
        from lab3_usd.commands.shared.baseline import read_baseline

        try:
            read_baseline(path)
        except UsageError:
            return False
        return True


class OutputFolder(click.Path):
    """A folder that a call makes, or makes files in."""


class ChangedFolder(click.Path):
    """A folder that a call reads and writes to, as a gradebook that is counted again."""


def refuse_inputs_as_outputs(context: click.Context) -> None:
    """Refuse a call that would write over, or into, what it reads.

    Raises:
        UsageError: an output is an input, by whatever name; it exists in a folder that is read; it
            has no folder to lie in, has the ending of a stage and is none, or is also another
            output.
    """
    given = [(option, context.params.get(str(option.name))) for option in context.command.params]
    outputs = [
        (option, Path(value))
        for option, value in given
        if value is not None and isinstance(option.type, (OutputFile, OutputFolder))
    ]
    if not outputs:
        return
    read = tuple(_inputs(context))
    for option, path in outputs:
        _refuse_loop(path)
        if isinstance(option.type, OutputReport):
            refuse_stage_ending(path)
        if isinstance(option.type, OutputFile):
            if not isinstance(option.type, OutputAlone):
                refuse_missing_folder(path)
            _refuse(path, read, option.type)
        elif not path.is_dir():
            _refuse(path, read, None)
    for (option, path), (later, other) in combinations(outputs, 2):
        if _key(path) == _key(other):
            names = f"{option.opts[0]} and {later.opts[0]}"
            raise UsageError(f"{path}: is named by {names}; name another file for one of them")


def refuse_inputs(paths: Iterable[Path]) -> None:
    """Refuse to write files, which a command makes in a folder, over what the call reads.

    Raises:
        UsageError: a file is an input.
    """
    existing = [path for path in paths if os.path.lexists(path)]
    context = click.get_current_context(silent=True)
    if existing and context is not None:
        read = tuple(_inputs(context))
        for path in existing:
            _refuse_loop(path)
            _refuse(path, read, OutputFile())


def refuse_missing_folder(path: Path) -> None:
    """Refuse a file to be written in a folder that does not exist.

    Raises:
        UsageError: it does not, or is no folder.
    """
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}; make it first")


def refuse_stage_ending(path: Path) -> None:
    """Refuse to write a report to what may be a stage.

    Raises:
        UsageError: it has the ending of a stage.
    """
    from lab3_usd.pipeline.results import STAGE_ENDINGS

    if path.suffix.lower() in STAGE_ENDINGS:
        raise UsageError(f"{path}: has the ending of a stage; name another file")


def _refuse_loop(path: Path) -> None:
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise unwritten(path, error) from error


def _inputs(context: click.Context) -> Iterator[Path]:
    """Yield every file and folder that a call reads: those given, configured, and of the lab."""
    own = context.params
    given: list[Path] = []
    for option in context.command.params:
        value = own.get(str(option.name))
        if isinstance(option.type, Input) and value is not None:
            values = value if isinstance(value, tuple) else (value,)
            given += (place for item in values for place in option.type.places(item))
    yield from given
    with suppress(FileNotFoundError):
        yield lab_folder()
    if not own.get("isolated"):
        named = own.get("config_file")
        yield from _configured(given, named, judges="config_file" in own)


def _configured(given: Sequence[Path], named: str | None, *, judges: bool) -> Iterator[Path]:
    """Yield the configuration that is named or found for what is given, and what that names."""
    from lab3_usd.config.lookup import find_file, read_table

    files = {Path(named)} if named is not None else {find_file(path) for path in given}
    for file in files:
        if file is None:
            continue
        yield file
        try:
            table = read_table(file)
        except UsageError:  # which the command itself reports
            continue
        values: list[Any] = [table.get("lab")]
        values += table["assets"].values() if isinstance(table.get("assets"), dict) else ()
        if judges:
            values += [table.get("starter"), table.get("maps")]
            values += table["rules"] if isinstance(table.get("rules"), list) else ()
        places = (file.parent / value for value in values if isinstance(value, str))
        yield from (place for place in places if place.exists())


def _refuse(path: Path, read: Iterable[Path], kind: OutputFile | None) -> None:
    """Refuse to write over an input, or over a file in a folder that is one."""
    advice = OutputFile.advice if kind is None else kind.advice
    for place in read:
        if _key(path) == _key(place) or _are_same(path, place):
            is_same = os.fspath(path) == os.fspath(place)
            what = "is read by this command" if is_same else f"is {place}, which this command reads"
            raise UsageError(f"{path}: {what}; {advice}")
        if kind is None or not (path.exists() and place.is_dir()):
            continue
        above = {str(folder).casefold() for folder in Path(os.path.realpath(path)).parents}
        is_inside = _key(place) in above or _is_linked_from(path, place)
        if is_inside and not kind.may_replace(path):
            raise UsageError(
                f"{path}: exists in {place}, which this command reads; name another file"
            )


def _key(path: Path) -> str:
    """Return where a path leads, by one spelling: some systems count capitals as small letters."""
    return os.path.realpath(path).casefold()


def _are_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:
        return False


def _is_linked_from(path: Path, folder: Path) -> bool:
    """Whether a link in a folder, symbolic or hard, leads to a file, or to a folder above it."""
    above = {str(path.resolve()), *map(str, path.resolve().parents)}
    is_hard = path.stat().st_nlink > 1
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink():
                if os.path.realpath(entry.path) in above:
                    return True
            elif entry.is_dir():
                if _is_linked_from(path, Path(entry.path)):
                    return True
            elif is_hard and _are_same(path, Path(entry.path)):
                return True
    return False
