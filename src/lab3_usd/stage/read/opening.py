"""Opens stage files; any damage is reported as one clear line."""

from __future__ import annotations

import codecs
import os
import re
import stat
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypeVar

from pxr import Sdf, Tf, Usd

from lab3_usd.data import program
from lab3_usd.errors import StageError
from lab3_usd.files import is_script_file
from lab3_usd.stage.read.crate import CRATE, DAMAGED, PACKAGE, SPECS, check_binary, entry_counts
from lab3_usd.stage.read.properties import hold_start_values

_T = TypeVar("_T")
# What usd-core says of text: `/work/x.usda:201:4: Expected } at 'x' in </A>`; of some faults it
# names the rule of its grammar instead, in C++.
_PARSE_ERROR = r":(\d+):(\d+): ([^\n]+?)(?: matching | at '|'?(?:\n|$))"
_ARGUMENTS = ":SDF_FORMAT_ARGS:"
_DAMAGE = (Tf.ErrorException, UnicodeDecodeError)
ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
_ENDINGS_BY_START = {b"#usda": (".usda", ".usd"), b"PXR-U": (".usd", ".usdc")}
_ARCHIVES = (".zip", ".tar", ".tgz", ".gz", ".xz", ".bz2", ".7z", ".rar")
_MOST_OPEN = 2
TEXT = b"#usda"
_BINARY = (CRATE, PACKAGE, codecs.BOM_UTF8)
# How text of more than one byte a letter begins, as PowerShell and Notepad save it; the longest
# marks first.
_WIDE = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
    ("#usd".encode("utf-16-le"), "UTF-16"),
    ("#usd".encode("utf-16-be"), "UTF-16"),
    ("#u".encode("utf-32-le"), "UTF-32"),
)
_ASSETS = re.compile(rb"@([^@\n]+)@")
_MOST_SEARCHED = 20_000  # specs, a tenth of a second
_LARGEST_SEARCHED = 20_000_000  # bytes of a package
# What a file of 0 bytes is, as far as anybody can tell.
PLACEHOLDER = "a placeholder of OneDrive or iCloud, or a failed save"


def _open(path: Path) -> Usd.Stage:
    check_file(path)
    check_layers_below(path)
    return Usd.Stage.Open(str(path), Usd.Stage.LoadAll)


# How a stage is opened, its file checked before. A grader replaces it while strangers' files are
# read (see `sandboxed_open`).
opener: ContextVar[Callable[[Path], Usd.Stage]] = ContextVar("opener", default=_open)
# What was read of stages that stay open; None if they are not kept open.
reading_cache: ContextVar[dict[Hashable, Any] | None] = ContextVar("reading_cache", default=None)


def cached(key: Hashable, make: Callable[[], _T]) -> _T:
    """Return what `make` returns, from last time where stages stay open; `key` names it."""
    cache = reading_cache.get()
    if cache is None:
        return make()
    if key not in cache:
        cache[key] = make()
    answer: _T = cache[key]
    return answer


@contextmanager
def kept_open() -> Iterator[None]:
    """Keep the last opened stages open, and cache what is read of them."""
    if reading_cache.get() is not None:
        yield  # they are kept already
        return
    stages: dict[str, Usd.Stage] = {}
    open_first, readings = opener.get(), dict[Hashable, Any]()

    def open_once(path: Path) -> Usd.Stage:
        name = os.path.realpath(path)
        stages[name] = stages.pop(name, None) or open_first(path)
        if len(stages) > _MOST_OPEN:
            del stages[next(iter(stages))]
            readings.clear()  # which names stages by where they are in memory
        return stages[name]

    with opening_by(open_once, readings):
        yield


@contextmanager
def opening_by(
    open_path: Callable[[Path], Usd.Stage], readings: dict[Hashable, Any]
) -> Iterator[None]:
    """Let `open_stage` open stages in this way, and keep what is read of them."""
    token, before = opener.set(open_path), reading_cache.set(readings)
    try:
        yield
    finally:
        opener.reset(token)
        reading_cache.reset(before)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep usd-core's own warnings off the terminal; what they say is asked of the stage later.

    usd-core writes them to file descriptor 2 from C++, past `sys.stderr`.
    """
    saved, devnull = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(devnull, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(devnull)


class stage_errors:  # noqa: N801 - used as a function is; made of one it takes five times as long
    """Raise StageError, with a line for people, where usd-core raises one of these.

    Where none are named, they are those by which it tells damage of a file that it has opened.
    """

    __slots__ = ("_kinds", "_path")

    def __init__(self, path: Path | str, *kinds: type[Exception]) -> None:
        """Name the file at `path` in what is raised."""
        self._path = path
        self._kinds = kinds or _DAMAGE

    def __enter__(self) -> None:
        """Begin to read."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Raise what is wrong with the file."""
        if isinstance(error, self._kinds):
            raise _stage_error(self._path, error) from error


def _stage_error(path: Path | str, error: Exception) -> StageError:
    """Return the message of an exception of usd-core in plain words."""
    try:
        text = str(error)
    except UnicodeError:
        text = ""
    place = re.search(_PARSE_ERROR, text)
    if place is not None:
        line, column, what = int(place[1]), int(place[2]), place[3]
        reason = f"is damaged or cut short, at {line}:{column}: {what}"
        return StageError(f"{path}: {reason}", line, column)
    if "UTF-8 BOM" in text:
        reason = "cannot be read: it starts with a byte order mark; save it as UTF-8 without one"
    else:
        reason = "cannot be read: it is damaged or not USD"
    return StageError(f"{path}: {reason}")


@quiet()
def open_stage(path: Path) -> Usd.Stage:
    """Open the composed stage with all payloads loaded.

    Raises:
        StageError: one line that says why the file cannot be opened, and what to do.
    """
    with stage_errors(path, Tf.ErrorException, RuntimeError, UnicodeError):
        stage = opener.get()(path)
        if stage is None:
            raise StageError(
                f"{path}: usd-core opens no stage from it; save it again from Isaac Sim"
            )
        return held(stage)


def held(stage: Usd.Stage) -> Usd.Stage:
    """Return a stage whose attributes are held at their values at the start time."""

    def hold() -> Usd.Stage:
        hold_start_values(stage)
        return stage  # which is kept with the answer, so that no other is where it is in memory

    return cached(("held", id(stage)), hold)


def reopened(stage: Usd.Stage) -> Usd.Stage:
    """Return another stage of the same layers, which can be read without changing the first."""
    session = Sdf.Layer.CreateAnonymous(".usda")
    session.TransferContent(stage.GetSessionLayer())
    context = stage.GetPathResolverContext()
    return Usd.Stage.Open(stage.GetRootLayer(), session, context, Usd.Stage.LoadAll)


def check_file(path: Path) -> None:
    """Refuse, in plain words, a file that usd-core cannot open.

    Raises:
        StageError: usd-core cannot open the file.
    """
    shown = os.fsencode(path).decode("utf-8", "replace")
    if shown != str(path):
        raise StageError(f"{shown}: the name of the file or of a folder is not UTF-8; rename it")
    if _ARGUMENTS in shown:
        raise StageError(f"{shown}: USD reads '{_ARGUMENTS}' in a name as options; rename the file")
    try:
        _check_kind(path)
        with path.open("rb") as file:
            start = file.read(8)
            if path.suffix.lower() not in ENDINGS:
                raise _other_ending(path, start)
            encoding = next((name for mark, name in _WIDE if start.startswith(mark)), "")
            if encoding:
                raise StageError(f"{path}: is text in {encoding}", repair="save it again as UTF-8")
            if start.startswith(TEXT):
                _check_text(path, start + file.read())
            elif start and not start.startswith(_BINARY):
                raise StageError(f"{path}: is not USD: it does not begin with '#usda'")
            else:
                try:
                    check_binary(file, start)
                except StageError as error:
                    raise StageError(f"{path}: {error}") from error
    except PermissionError as error:
        repair = "change the permissions, or check it as somebody who may read it"
        raise StageError(f"{path}: cannot be read ({error.strerror})", repair=repair) from error
    except OSError as error:
        raise StageError(f"{path}: cannot be read ({error.strerror})") from error
    if not start:
        repair = "open it once, so that it is downloaded, or save the stage again"
        raise StageError(f"{path}: is empty: {PLACEHOLDER}", repair=repair)


def _check_kind(path: Path) -> None:
    """Refuse what is no file.

    Raises:
        OSError: it, or a folder in its place, may not be opened.
        StageError: there is nothing, or something else.
    """
    try:
        kind = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:
        from lab3_usd.files import absence

        raise StageError(absence(path)) from error
    if stat.S_ISDIR(kind):
        os.scandir(path).close()
        raise StageError(f"{path}: is a folder", repair="name one stage in it")
    if not stat.S_ISREG(kind):
        raise StageError(f"{path}: is not a file", repair="name a stage")


def check_layers_below(path: Path) -> None:
    """Refuse a stage that leads to a binary layer which would exhaust usd-core.

    Texts are searched for what they lead to. Of binary layers it takes usd-core, which looks at
    every spec: those with many are not searched.

    Raises:
        StageError: a layer is damaged; the line names it.
    """
    seen, waiting = {path}, [path]
    while waiting:
        layer = waiting.pop()
        try:
            assets = _assets_of(layer)
        except StageError as error:
            whose = f"{path}:" if layer == path else f"{path}: leads to {layer}, which"
            raise StageError(f"{whose} {error}") from error
        for asset in assets:
            below = Path(os.path.normpath(layer.parent / asset))
            if below in seen or not asset or below.suffix.lower() not in ENDINGS:
                continue
            seen.add(below)
            waiting.append(below)
            try:
                with below.open("rb") as file:
                    check_binary(file, file.read(len(CRATE)))
            except StageError as error:
                raise StageError(f"{path}: leads to {below}, which {error}") from error
            except (OSError, ValueError):  # it is a missing asset, if anything asks for it
                waiting.pop()


def _assets_of(layer: Path) -> Iterable[str]:
    """Return what a layer leads to; a package leads to nothing but its own layers.

    Raises:
        StageError: a binary layer names a child that is not a prim, at which usd-core would end.
    """
    with layer.open("rb") as file:
        start = file.read(len(CRATE))
        if start.startswith(TEXT):
            names = _ASSETS.findall(start + file.read())
            return [name.decode("utf-8", "replace") for name in names]
        if start.startswith(PACKAGE):
            for name in _layers_in(layer):
                _whole_layer(f"{layer}[{name}]")
            return ()
        if start != CRATE or entry_counts(file).get(SPECS, 0) > _MOST_SEARCHED:
            return ()
    opened = _whole_layer(str(layer))
    return () if opened is None else list(opened.GetCompositionAssetDependencies())


def _layers_in(package: Path) -> list[str]:
    """Return the layers of a package, none of a large one."""
    files: Any = None
    if package.stat().st_size <= _LARGEST_SEARCHED:
        files = Sdf.ZipFile.Open(str(package))
    names = files.GetFileNames() if files else ()
    return [name for name in names if Path(name).suffix.lower() in ENDINGS]


def _whole_layer(name: str) -> Any:
    """Open a layer, None where that fails, and look whether each child is a prim."""
    opened: Any = Sdf.Layer.FindOrOpen(name)
    paths: list[Sdf.Path] = []
    if opened is not None:
        opened.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    named = (path for path in paths if not path.IsTargetPath())  # a target is no object of its own
    if not all(map(opened.GetObjectAtPath, named)):
        raise StageError(DAMAGED)
    return opened


def _other_ending(path: Path, start: bytes) -> StageError:
    """Return what to say of a file whose ending is none of USD, by how its content starts."""
    text = f"{path}: '{path.suffix}' is not a USD ending ({', '.join(ENDINGS)})"
    inner = Path(path.stem)  # robot.usda.txt
    endings = _ENDINGS_BY_START.get(start[:5], ())
    if not endings and is_script_file(path):
        return StageError(
            f"{path}: is a script and no stage; {program()} lint judges the graphs that scripts "
            "build"
        )
    if not endings and path.suffix.lower() in _ARCHIVES:
        repair = "unpack it, and name a stage in it or the folder"
        return StageError(f"{path}: is an archive, and no package of USD (.usdz)", repair=repair)
    if not endings:
        return StageError(f"{text}, and the content is not USD", repair="name a stage")
    stem = inner.stem if inner.suffix.lower() in ENDINGS else inner.name
    name = inner.name if inner.suffix.lower() in endings else f"{stem}{endings[0]}"
    if path.with_name(name).exists():  # the copy that a repair left, beside the repaired file
        free = f"{Path(name).stem}_before{Path(name).suffix}"
        return StageError(text, repair=f"copy the file to {free}; {name} is there, and another one")
    return StageError(text, repair=f"rename the file to {name}")


def _check_text(path: Path, data: bytes) -> None:
    """Refuse text that the parser would cut short or choke on."""
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        raise StageError(f"{path}: line {line} holds a NUL byte; the file is damaged", line)
    if data.isascii():  # as most text is, which needs no second copy
        return
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise StageError(
            f"{path}: line {line} is not UTF-8 text; the file is damaged", line
        ) from error
