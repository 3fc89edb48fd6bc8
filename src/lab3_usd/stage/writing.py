"""Output files: written whole under a temporary name, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pxr import Sdf, Tf

from lab3_usd.errors import StageError


def export_layer(layer: Sdf.Layer, target: Path, form: str) -> Path:
    """Write `layer` beside `target` as `form` (`usda` or `usdc`) and return the temporary file.

    Raises:
        StageError: the folder cannot be written to, or the disk is full.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=".usd", dir=target.parent)
        os.close(handle)
    except OSError as error:
        message = f"{target}: cannot be written ({error.strerror})"
        raise StageError(message) from error
    temporary = Path(name)
    try:
        written = layer.Export(name, "", {"format": form})
    except Tf.ErrorException:
        written = False
    if not written:
        temporary.unlink(missing_ok=True)
        message = f"{target}: cannot be written; is the disk full?"
        raise StageError(message)
    temporary.chmod(0o644)
    return temporary


def put_in_place(files: Mapping[Path, Path]) -> None:
    """Rename each temporary file to its target.

    Raises:
        StageError: a target cannot be replaced; new files that came before it are gone again.
    """
    made: list[Path] = []
    for target, temporary in files.items():
        new = not target.exists()
        try:
            temporary.replace(target)
        except OSError as error:
            for path in made:
                path.unlink(missing_ok=True)
            message = f"{target}: cannot be written ({error.strerror})"
            raise StageError(message) from error
        if new:
            made.append(target)
