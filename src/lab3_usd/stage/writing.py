"""Output files: written whole under a temporary name, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pxr import Sdf

from lab3_usd.errors import StageError


def export_layer(layer: Sdf.Layer, target: Path, form: str) -> Path:
    """Write `layer` beside `target` as `form` (`usda` or `usdc`) and return the temporary file.

    Raises:
        StageError: the folder cannot be written to.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=".usd", dir=target.parent)
        os.close(handle)
    except OSError as error:
        message = f"{target}: cannot be written ({error.strerror})"
        raise StageError(message) from error
    temporary = Path(name)
    if not layer.Export(name, "", {"format": form}):
        temporary.unlink(missing_ok=True)
        message = f"{target}: usd-core could not write the file"
        raise StageError(message)
    temporary.chmod(0o644)
    return temporary


def put_in_place(files: Mapping[Path, Path]) -> None:
    """Rename each temporary file to its target.

    Raises:
        StageError: a target cannot be replaced.
    """
    for target, temporary in files.items():
        try:
            temporary.replace(target)
        except OSError as error:
            message = f"{target}: cannot be written ({error.strerror})"
            raise StageError(message) from error
