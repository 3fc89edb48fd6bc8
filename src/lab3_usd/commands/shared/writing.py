"""How commands that edit a stage write it: shown, as a diff, in place, elsewhere."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import click
from msgspec import Struct

from lab3_usd import hooks
from lab3_usd.commands.shared.options import Option, all_of, recorded
from lab3_usd.commands.shared.paths import OutputRepair
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.files import (
    FileState,
    is_script_file,
    keep_original,
    lines_of,
    refuse_existing,
    refuse_shared,
    replace_files,
    write_whole,
)
from lab3_usd.fix.patch import patch
from lab3_usd.report.safe_text import visible

_TEXT = b"#usda"


class WritingOptions(Struct, frozen=True):
    """Where an edited stage goes: nowhere but a diff, another file, or in place of the old one."""

    diff: bool = False
    output: Path | None = None
    in_place: bool = False
    no_orig: bool = False


def writing_options(what: str) -> Option:
    """Return the options that say where an edited stage goes; `what` is what it is then."""
    return all_of(
        click.option("--diff", is_flag=True, help="Print the changes, and write nothing."),
        click.option(
            "--output",
            "-o",
            type=OutputRepair(path_type=Path),
            help=f"Write the {what} stage here.",
        ),
        click.option(
            "--in-place", is_flag=True, help="Replace the file; keep the old one as NAME.orig."
        ),
        click.option("--no-orig", is_flag=True, help="With --in-place: keep no NAME.orig."),
        recorded("writing", WritingOptions),
    )


def check_ways(stages: Sequence[Path], writing: WritingOptions, **further: Path | None) -> None:
    """Refuse ways of writing that exclude each other; a command may have further ones.

    Raises:
        UsageError: they do, or the output has another ending than the stage.
    """
    output = writing.output
    ways = {"--diff": writing.diff, "--output": output, "--in-place": writing.in_place}
    ways |= {f"--{name}": value for name, value in further.items()}
    if len([value for value in ways.values() if value]) > 1:
        *earlier, last = ways
        raise UsageError(f"{', '.join(earlier)} and {last} exclude each other")
    if output is None:
        return
    if len(stages) > 1:
        raise UsageError("--output goes with one stage; use --in-place")
    if output.suffix.lower() != stages[0].suffix.lower():
        raise UsageError(f"{output}: must end in {stages[0].suffix}, as the stage does")


def print_diff(files: Mapping[Path, bytes], states: Mapping[Path, FileState]) -> int:
    """Print what would change, and return the exit status: 1 if something would."""
    for line in _diffs(files, states):
        click.echo(line, nl=False)
    return 1 if files else 0


def write_edited(
    stage: Path,
    files: Mapping[Path, bytes],
    states: Mapping[Path, FileState],
    writing: WritingOptions,
    *,
    force: bool,
    check: Callable[[bytes, Path], None] = lambda _data, _path: None,
    first_alone: bool = False,
) -> Iterator[str]:
    """Write an edited stage where it was asked for, and yield a line about each file.

    All files are checked before the first is written. With `first_alone`, NAME.orig is written only
    if there is none: it keeps the stage as it was before the first of several commands.

    Raises:
        UsageError: a file exists, is shared, was changed meanwhile, or cannot be written.
    """
    output = writing.output
    if output is not None:
        refuse_existing(output, force=force)
        data = next(iter(files.values()), None) or stage.read_bytes()
        check(data, output)
        write_whole(output, data, force=force)
        yield f"written: {shown(output)}"
        return
    for path, data in files.items():
        if not force:
            refuse_shared(path)
        check(data, path)
    originals: dict[Path, Path] = {}
    try:
        for path in () if writing.no_orig else files:
            if not (first_alone and path.with_name(f"{path.name}.orig").exists()):
                originals[path] = keep_original(path, states[path].content)
        replace_files(files, states)
    except Lab3Error:
        for original in originals.values():
            original.unlink(missing_ok=True)
        raise
    for path in files:
        kept = f", the old one is {shown(originals[path])}" if path in originals else ""
        yield f"written: {shown(path)}{kept}"


def _diffs(files: Mapping[Path, bytes], states: Mapping[Path, FileState]) -> Iterator[str]:
    """Yield a unified diff of each text file, and the differences of the others as stages."""
    for path, data in files.items():
        old = states[path].content
        if not (data.startswith(_TEXT) or is_script_file(path)):
            yield from (f"{line}\n" for line in hooks.changes_to(path, data))
            continue
        before, after = (lines_of(content.decode()) for content in (old, data))
        names = _name_in_patch("a", path), _name_in_patch("b", path)
        for line in patch(before, after, *names):
            yield line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n"


def _name_in_patch(side: str, path: Path) -> str:
    """Return the name of a file as git writes it: quoted, or with a tab behind one with a space."""
    name = f"{side}/{Path(os.path.relpath(path)).as_posix()}"
    if name.isprintable() and not {'"', "\\"} & {*name}:
        return f"{name}\t" if " " in name else name
    letters = (
        f"\\{byte:03o}" if byte < ord(" ") or byte > ord("~") or byte in b'"\\' else chr(byte)
        for byte in os.fsencode(name)
    )
    return f'"{"".join(letters)}"'


def shown(path: Path) -> str:
    """Return a path as a terminal shows it."""
    return visible(os.path.relpath(path) if path.is_absolute() else str(path))
