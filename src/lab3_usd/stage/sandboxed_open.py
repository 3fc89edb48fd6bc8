"""Opens untrusted stages so that no file outside their own folder is ever opened."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace
from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from lab3_usd.errors import StageError
from lab3_usd.stage.read.assets import blocked_path, find_unresolved, real_path
from lab3_usd.stage.read.opening import ENDINGS, check_file, opening_by, quiet, stage_errors

_ADDRESS = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")  # one letter is a drive of Windows
_ABSOLUTE = re.compile(r"^([/\\]|[A-Za-z]:)")
_FORMAT_ARGUMENTS = ":SDF_FORMAT_ARGS:"
_CLIPS = "clips"
_ASSET = b"@"  # with which every asset in a text layer begins
_NO_MEMORY = "bad_alloc"
_ATTEMPTS = 8
_MOST_ASSETS = 500
_Check = Callable[[Path], "bytes | None"]
_Refusal = tuple[str, bool]  # why an asset is not opened, and whether that is an error


class BlockedAsset(Struct, frozen=True):
    """An asset that was not opened: the stage that asks for it, and why not.

    One with `is_error` is an error wherever it is; the others only where a graph hangs on them.
    """

    stage: str
    asset: str
    reason: str
    is_error: bool


@dataclass(slots=True)
class FileBounds:
    """The files that may be opened while one submission is judged, and those that were refused.

    `check` looks at the bytes of a layer before usd-core does: it raises StageError, which says
    why and leaves the name of the file to the bounds, or returns the text of a text layer. `broken`
    holds files that are not opened, and why; `announce` receives every stage before it is
    opened. `graphs` are paths at which a graph belongs, `digests` those of files, as far as they
    are known. Stages in `closed` are not opened again. Files go by their names in the submission.
    `alone` are the layers that lead to no other. `supplied` are folders in which the grader has the
    assets of servers: addresses may lead there. `starter` is the grader's, which stands in for a
    sublayer of its name that was not handed in; `lent` are those, by stage.
    """

    root: Path
    check: _Check
    allowed: frozenset[str] = frozenset()
    broken: Mapping[str, str] = field(default_factory=dict)
    announce: Callable[[str], None] = lambda _name: None
    supplied: tuple[str, ...] = ()
    starter: str = ""
    lent: dict[str, str] = field(default_factory=dict)
    graphs: Collection[str] = ()
    nesting: int = 200
    digests: Mapping[str, str] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    found: dict[tuple[str, str], BlockedAsset] = field(default_factory=dict)
    layers: dict[str, Sdf.Layer] = field(default_factory=dict)
    alone: set[str] = field(default_factory=set)
    stages: dict[str, Usd.Stage] = field(default_factory=dict)
    firsts: dict[tuple[str, ...], str] = field(default_factory=dict)


def name_of(bounds: FileBounds, real: str) -> str | None:
    """Return a path relative to the submission, None for what lies outside of it."""
    inside = os.path.relpath(real, bounds.root)
    return None if inside == ".." or inside.startswith(f"..{os.sep}") else inside


def shown_name(bounds: FileBounds, real: str) -> str:
    """Return the name of a file in messages, which never reveals the copy of a submission."""
    return name_of(bounds, real) or Path(real).name


def open_layer(bounds: FileBounds, identifier: str, file: str) -> Sdf.Layer:
    """Look at the bytes of a layer, let usd-core read it, and drop the clips that are in it.

    Raises:
        StageError: usd-core should not be given the file, or reads no layer from it.
        MemoryError: there is not enough for it.
    """
    name, is_trusted = shown_name(bounds, file), _is_trusted(bounds, file)
    try:
        text = None if is_trusted else bounds.check(Path(file))
    except StageError as error:
        raise StageError(f"{name}: {error}") from error
    with memory_errors():
        layer = Sdf.Layer.FindOrOpen(identifier)
    if layer is None:
        raise StageError(f"{name}: usd-core opens no stage from it; save it again from Isaac Sim")
    bounds.layers[layer.identifier] = layer
    if not is_trusted and (text is None or _CLIPS.encode() in text):
        _drop_clips(layer, bounds.nesting)
    if text is not None and _ASSET not in text:
        bounds.alone.add(layer.identifier)
    return layer


@contextmanager
def memory_errors() -> Iterator[None]:
    """Tell running out of memory from a damaged file; usd-core reports both alike."""
    try:
        yield
    except (Tf.ErrorException, RuntimeError) as error:
        if _NO_MEMORY in str(error):
            raise MemoryError from error
        raise


def _drop_clips(layer: Sdf.Layer, nesting: int) -> None:
    """Value clips name layers that are opened while values are read; the lab has none."""
    with_clips: list[Sdf.Path] = []

    def visit(path: Sdf.Path) -> None:
        if not path.IsPrimPath() and not path.IsPrimVariantSelectionPath():
            return
        if path.pathElementCount > nesting:
            raise StageError(f"prims lie more than {nesting} levels deep in one another")
        spec = layer.GetObjectAtPath(path)
        if spec is not None and spec.HasInfo(_CLIPS):  # a damaged file names what it lacks
            with_clips.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    for path in with_clips:
        layer.GetObjectAtPath(path).ClearInfo(_CLIPS)


def close_openings(bounds: FileBounds, root: Sdf.Layer, name: str) -> None:
    """Redirect everything that leads out, in this layer and in all it leads to, to nowhere."""
    waiting, seen = [root], {root.identifier}
    while waiting:
        layer = waiting.pop()
        if layer.identifier in bounds.alone:
            continue
        is_trusted = _is_trusted(bounds, real_path(layer.realPath))
        assets = [asset for asset in layer.GetCompositionAssetDependencies() if asset]
        if len(assets) > _MOST_ASSETS and not is_trusted:
            raise StageError(
                f"{shown_name(bounds, root.realPath)}: refers to {len(assets)} files; not opened"
            )
        for asset in assets:
            if is_trusted:  # what is missing in the starter stays missing
                identifier, file = _located(layer, asset)
                may_open = _is_trusted(bounds, file) and Path(file).is_file()
                opened = open_layer(bounds, identifier, file) if may_open else None
            else:
                opened = _open_inside(bounds, layer, asset)
            # A sublayer that is not there may be the starter that everybody was given.
            is_named = bounds.starter and Path(asset).name == Path(bounds.starter).name
            if (
                isinstance(opened, tuple)
                and is_named
                and not os.path.lexists(_located(layer, asset)[1])
                and asset in layer.subLayerPaths
            ):
                layer.UpdateCompositionAssetDependency(asset, bounds.starter)
                bounds.lent[name] = asset
                opened = open_layer(bounds, bounds.starter, bounds.starter)
            if isinstance(opened, tuple):
                bounds.found.setdefault((name, asset), BlockedAsset(name, asset, *opened))
                _redirect(layer, asset)
            elif opened is not None and opened.identifier not in seen:
                seen.add(opened.identifier)
                waiting.append(opened)


def _located(layer: Sdf.Layer, asset: str) -> tuple[str, str]:
    """Return the identifier of an asset of a layer, and the file itself."""
    identifier = layer.ComputeAbsolutePath(asset)
    is_searched = _ADDRESS.match(asset) is not None
    path = str(Ar.GetResolver().Resolve(identifier)) if is_searched else ""
    return identifier, real_path(path or identifier)


def _is_trusted(bounds: FileBounds, file: str) -> bool:
    """Whether a file is of the starter, or an asset that the grader has supplied."""
    return file in bounds.allowed or _is_supplied(bounds, file)


def _is_supplied(bounds: FileBounds, file: str) -> bool:
    return file.startswith(tuple(f"{folder}{os.sep}" for folder in bounds.supplied))


def _open_inside(bounds: FileBounds, layer: Sdf.Layer, asset: str) -> Sdf.Layer | _Refusal:
    if asset.startswith("`"):
        return "it is an expression, not a path", True
    if _FORMAT_ARGUMENTS in asset:
        return "it carries arguments for a file format", True
    identifier, file = _located(layer, asset)
    if _ADDRESS.match(asset):
        is_there = _is_supplied(bounds, file) and Path(file).is_file()
        refusal = "it is not on this computer", False
        return open_layer(bounds, identifier, file) if is_there else refusal
    if file not in bounds.allowed:
        if _ABSOLUTE.match(asset):
            return "it is an absolute path", False
        if name_of(bounds, file) is None:
            return "it leads out of the submission", True
    return _open_file(bounds, identifier, file)


def _open_file(bounds: FileBounds, identifier: str, file: str) -> Sdf.Layer | _Refusal:
    if not Path(identifier).is_absolute() or not os.path.lexists(file):
        return "it is not there", False
    if identifier in bounds.layers:
        return bounds.layers[identifier]
    if not file.lower().endswith(ENDINGS):
        return "it is no USD file", True
    try:
        return open_layer(bounds, identifier, file)
    except StageError as error:
        return str(error).rpartition(": ")[2], True
    except (Tf.ErrorException, RuntimeError, UnicodeError):
        return "it is damaged", True


def _redirect(layer: Sdf.Layer, asset: str) -> None:
    """Rewrite an asset in memory; usd-core changes one kind of arc at a time, so ask again."""
    for _ in range(_ATTEMPTS):
        layer.UpdateCompositionAssetDependency(asset, blocked_path(asset))
        if asset not in layer.GetCompositionAssetDependencies():
            return
    raise StageError(f"the reference to {asset} cannot be taken out")


def opening_within(bounds: FileBounds) -> AbstractContextManager[None]:
    """Let `open_stage` open stages within the bounds only, each once, and keep what is read."""
    return opening_by(lambda path: _open_within(bounds, path), {})


def _open_within(bounds: FileBounds, path: Path) -> Usd.Stage:
    real = os.path.realpath(path)
    if bounds.closed and name_of(bounds, real) in bounds.closed:
        raise StageError(f"{path}: has been judged and is not opened again")
    if real not in bounds.stages:
        bounds.stages[real] = _open_first(bounds, path, real)
    return bounds.stages[real]


def _open_first(bounds: FileBounds, path: Path, real: str) -> Usd.Stage:
    if real in bounds.allowed:
        check_file(path)
        return Usd.Stage.Open(real, Usd.Stage.LoadAll)
    name = name_of(bounds, real)
    if name is None:
        raise StageError(f"{path}: lies outside the submission and is not opened")
    bounds.announce(name)
    if name in bounds.broken:
        raise StageError(f"{path}: {bounds.broken[name]}")
    check_file(path)
    twin = _twin(bounds, real, name)
    if twin is not None:
        twin_name = name_of(bounds, twin)
        for (stage_name, asset), blocked in list(bounds.found.items()):
            if stage_name == twin_name:
                bounds.found[name, asset] = replace(blocked, stage=name)
        return bounds.stages[twin]
    root = open_layer(bounds, real, real)
    close_openings(bounds, root, name)
    with memory_errors():
        stage = Usd.Stage.Open(root, Usd.Stage.LoadAll)
    for layer in stage.GetUsedLayers():  # usd-core opened what was looked at, and nothing else
        if not layer.anonymous and layer.identifier not in bounds.layers:
            read = shown_name(bounds, os.path.realpath(layer.realPath))
            raise StageError(f"{path}: reads {read}, which was not looked at")
    _check_graphs(bounds, stage, name)
    return stage


def _twin(bounds: FileBounds, real: str, name: str) -> str | None:
    """Return a stage of the same folder that is the same to the byte and open, else None.

    Checkpoints that change nothing are saved again under the next name: they are read once.
    """
    digest = bounds.digests.get(name)
    if not digest:
        return None
    path = Path(real)
    first = bounds.firsts.setdefault((str(path.parent), digest, path.suffix), real)
    return first if first in bounds.stages else None


def _check_graphs(bounds: FileBounds, stage: Usd.Stage, name: str) -> None:
    """Make blocked assets errors where a graph hangs on them."""
    if not any(stage_name == name for stage_name, _ in bounds.found):
        return
    for missing in find_unresolved(stage):
        above = missing.prim
        while above and above not in bounds.graphs:
            above = above.rpartition("/")[0]
        blocked = bounds.found.get((name, missing.asset))
        if above and blocked is not None:
            reason = f"a graph hangs on it, and {blocked.reason}"
            bounds.found[name, missing.asset] = replace(blocked, reason=reason, is_error=True)


def files_of(stage_path: Path) -> frozenset[str]:
    """Return every file that a trusted stage consists of: the assets of a supplied starter.

    Raises:
        StageError: the stage, or a file that it refers to, cannot be read.
    """
    with quiet(), stage_errors(f"{stage_path}, or a file that it uses", Tf.ErrorException):
        layers, assets, _ = UsdUtils.ComputeAllDependencies(str(stage_path))
    paths = [layer.realPath for layer in layers] + [str(asset) for asset in assets]
    return frozenset(os.path.realpath(path) for path in [*paths, str(stage_path)] if path)
