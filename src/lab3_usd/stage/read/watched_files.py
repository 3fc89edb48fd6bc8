"""The files of a watched stage, and rereading them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pxr import Sdf, Tf, Usd

from lab3_usd.errors import StageError
from lab3_usd.stage.read.crate import CRATE, check_binary
from lab3_usd.stage.read.opening import ENDINGS, check_file, check_layers_below, open_stage, opener

_NOT_TEXT = (CRATE, b"PK")  # a binary layer, an archive


@contextmanager
def text_in_memory() -> Iterator[None]:
    """Open stages so that their text layers may be written while they are read.

    usd-core maps the text files that it reads, and a file that is cut short while it is mapped
    ends the process (SIGBUS). Here it is given the text instead of the file.
    """
    token = opener.set(_open_in_memory)
    try:
        yield
    finally:
        opener.reset(token)


def _open_in_memory(path: Path) -> Usd.Stage:
    check_file(path)
    check_layers_below(path)
    layers: dict[str, Sdf.Layer] = {}
    _read_texts(str(path), layers)
    return Usd.Stage.Open(layers.get(str(path), str(path)), Usd.Stage.LoadAll)


def _read_texts(file: str, layers: dict[str, Sdf.Layer]) -> None:
    """Read a text file, and those that its layer leads to, for as long as `layers` is held."""
    layer = Sdf.Layer.Find(file) or _read_text(Path(file))
    if layer is None or file in layers:
        return
    layers[file] = layer
    for asset in layer.GetCompositionAssetDependencies():
        _read_texts(layer.ComputeAbsolutePath(asset), layers)


def _read_text(path: Path) -> Sdf.Layer | None:
    """Return the layer of a text file; None where there is none.

    Raises:
        StageError: the file is empty, as one is that is about to be written.
    """
    if path.suffix.lower() not in ENDINGS:
        return None
    try:
        data = path.read_bytes()
    except (OSError, ValueError):
        return None
    if data.startswith(_NOT_TEXT):
        return None
    if not data:
        raise StageError(f"{path}: is empty; save it again")
    file_format = Sdf.FileFormat.FindByExtension(path.suffix.lower()[1:])
    layer = Sdf.Layer.New(file_format, str(path))
    layer.ImportFromString(data.decode())
    return layer


def may_be_whole(path: Path) -> bool:
    """Whether a file may be read: of a binary layer, every section must have been written.

    usd-core does not survive every binary layer that is cut short.
    """
    try:
        with path.open("rb") as file:
            start = file.read(len(CRATE))
            check_binary(file, start)
            return bool(start)
    except (OSError, StageError):
        return False


def used_files(path: Path) -> frozenset[str]:
    """Return the stage file and the files of all layers that it uses, links followed."""
    files = {str(path.resolve())}
    try:
        stage = open_stage(path)
    except StageError:
        return frozenset(files)
    return frozenset(files | {layer.realPath for layer in stage.GetUsedLayers() if layer.realPath})


def forget_files(paths: Iterable[str]) -> None:
    """Read layers of these files anew where something still holds them."""
    for path in paths:
        layer = Sdf.Layer.Find(path)
        if layer is not None:
            with suppress(
                Tf.ErrorException
            ):  # it is damaged, which is reported when it is opened again
                layer.Reload(force=True)
