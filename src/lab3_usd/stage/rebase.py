"""Copies a layer so that what it refers to is still found from another folder."""

from __future__ import annotations

import os
import re
from pathlib import Path

from pxr import Sdf, UsdUtils

_URI = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")


def copy_for(source: Sdf.Layer, folder: Path) -> Sdf.Layer:
    """Return an anonymous copy of `source` whose relative asset paths start from `folder`.

    Addresses (`https:`, `omniverse:`) and absolute paths stay as they are. Nothing is flattened:
    the layers referred to are not touched.
    """
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.TransferContent(source)
    # usd-core drops `..` from paths as written, without following links; so does this.
    start = Path(os.path.abspath(folder))  # noqa: PTH100 - Path.resolve() follows links
    if Path(source.realPath).parent != start or source.GetFileFormat().IsPackage():
        UsdUtils.ModifyAssetPaths(copy, lambda path: _moved(path, source, start))
    return copy


def _moved(path: str, source: Sdf.Layer, folder: Path) -> str:
    if not path or _URI.match(path) or path.startswith("/") or not source.realPath:
        return path
    found = Sdf.ComputeAssetPathRelativeToLayer(source, path)
    if not found.startswith("/"):
        return path  # a search path that only the application's own resolver knows
    relative = os.path.relpath(found, folder)
    return relative if relative.startswith("..") else f"./{relative}"
