"""Opens untrusted stages so that no file outside their own folder is ever opened."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Tf, Usd, UsdUtils

from lab3_usd.errors import StageError
from lab3_usd.stage.fence.layers import (
    BlockedAsset,
    Fence,
    close_openings,
    memory_errors,
    name_of,
    open_layer,
    shown_name,
)
from lab3_usd.stage.read.missing_assets import find_unresolved
from lab3_usd.stage.read.opening import check_file, opener, quiet, reading_cache, stage_errors


@contextmanager
def fenced(fence: Fence) -> Iterator[None]:
    """Let `open_stage` open stages within the fence only, each once, and keep what is read."""
    token, empty = opener.set(lambda path: _open_within(fence, path)), reading_cache.set({})
    try:
        yield
    finally:
        opener.reset(token)
        reading_cache.reset(empty)


def files_of(stage_path: Path) -> frozenset[str]:
    """Return every file that a trusted stage consists of: the assets of a supplied starter.

    Raises:
        StageError: the stage, or a file that it refers to, cannot be read.
    """
    with quiet(), stage_errors(f"{stage_path}, or a file that it uses", Tf.ErrorException):
        layers, assets, _ = UsdUtils.ComputeAllDependencies(str(stage_path))
    paths = [layer.realPath for layer in layers] + [str(asset) for asset in assets]
    return frozenset(os.path.realpath(path) for path in [*paths, str(stage_path)] if path)


def _open_within(fence: Fence, path: Path) -> Usd.Stage:
    real = os.path.realpath(path)
    if fence.closed and name_of(fence, real) in fence.closed:
        message = f"{path}: has been judged and is not opened again"
        raise StageError(message)
    if real not in fence.stages:
        fence.stages[real] = _open_first(fence, path, real)
    return fence.stages[real]


def _open_first(fence: Fence, path: Path, real: str) -> Usd.Stage:
    if real in fence.allowed:
        check_file(path)
        return Usd.Stage.Open(real, Usd.Stage.LoadAll)
    name = name_of(fence, real)
    if name is None:
        message = f"{path}: lies outside the submission and is not opened"
        raise StageError(message)
    fence.announce(name)
    if name in fence.broken:
        message = f"{path}: {fence.broken[name]}"
        raise StageError(message)
    check_file(path)
    twin = _twin(fence, real, name)
    if twin is not None:
        _share_blocked(fence, name_of(fence, twin), name)
        return fence.stages[twin]
    root = open_layer(fence, real, real)
    close_openings(fence, root, name)
    with memory_errors():
        stage = Usd.Stage.Open(root, Usd.Stage.LoadAll)
    _check_used(fence, stage, path)
    _check_graphs(fence, stage, name)
    return stage


def _twin(fence: Fence, real: str, name: str) -> str | None:
    """Return a stage of the same folder that is the same to the byte and open, else None.

    Checkpoints that change nothing are saved again under the next name: they are read once.
    """
    digest = fence.digests.get(name)
    if not digest:
        return None
    path = Path(real)
    first = fence.firsts.setdefault((str(path.parent), digest, path.suffix), real)
    return first if first in fence.stages else None


def _share_blocked(fence: Fence, twin: str | None, name: str) -> None:
    for (stage, asset), known in list(fence.found.items()):
        if stage == twin:
            fence.found[name, asset] = BlockedAsset(name, asset, known.reason, known.is_error)


def _check_used(fence: Fence, stage: Usd.Stage, path: Path) -> None:
    """Make sure that usd-core opened what was looked at, and nothing else."""
    for layer in stage.GetUsedLayers():
        if not layer.anonymous and layer.identifier not in fence.layers:
            read = shown_name(fence, os.path.realpath(layer.realPath))
            message = f"{path}: reads {read}, which was not looked at"
            raise StageError(message)


def _check_graphs(fence: Fence, stage: Usd.Stage, name: str) -> None:
    """Make blocked assets errors where a graph hangs on them."""
    if not any(stage_name == name for stage_name, _ in fence.found):
        return
    for missing in find_unresolved(stage):
        above = missing.prim
        while above and above not in fence.graphs:
            above = above.rpartition("/")[0]
        known = fence.found.get((name, missing.asset))
        if above and known is not None:
            reason = f"a graph hangs on it, and {known.reason}"
            fence.found[name, missing.asset] = BlockedAsset(
                name, known.asset, reason, is_error=True
            )
