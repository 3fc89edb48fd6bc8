"""The layers of a stage under repair: which are edited, and their content before.

Prims are rendered as usd-core writes them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from pxr import Sdf, Tf, Usd

from lab3_usd.errors import StageError
from lab3_usd.files import FileState, read_state
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.prims import is_at_or_below, upwards
from lab3_usd.spec.lab import STARTER, Checkpoint, Lab, articulated_at_roots
from lab3_usd.stage.read.opening import check_file, open_stage
from lab3_usd.stage.write.builder import checkpoint_layer, described_layer
from lab3_usd.stage.write.graphs import take_out
from lab3_usd.stage.write.starter import robots_articulated_at_root

NEEDS_STARTER = "needs the starter: name it with --starter"
# The fields of a prim that edits change, beside its specifier.
_FIELDS = ("typeName", "active", "apiSchemas")
_OFFSETS = "subLayerOffsets"  # which usd-core cannot hand to Python


def open_for_edits(
    path: Path, instead: str = "or write --layer FILE beside it"
) -> tuple[Usd.Stage, FileState]:
    """Open a stage whose root layer is going to be edited; `instead` is what to do with a package.

    Raises:
        StageError: it cannot be opened, or is a package.
    """
    if path.suffix.lower() == ".usdz":
        raise StageError(f"{path}: is a package, which is not edited; unpack it, {instead}")
    check_file(path)  # a pipe would be waited for
    try:
        state = read_state(path)
    except OSError as error:
        raise StageError(f"{path}: cannot be read ({error.strerror})") from error
    return open_stage(path), state


def layer_from(text: str) -> Sdf.Layer | None:
    """Return the layer that a text holds, None where usd-core cannot read it."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    try:
        return layer if layer.ImportFromString(text) else None
    except Tf.ErrorException:
        return None


def same_content(before: Sdf.Layer, after: Sdf.Layer) -> bool:
    """Whether two layers hold the same, in whatever order."""
    mine, theirs = (layer.ExportToString() for layer in (before, after))
    if mine == theirs:
        return True
    # Two prims that have exchanged a value have the same lines.
    is_alike = sorted(mine.split("\n")) == sorted(theirs.split("\n"))
    return is_alike and _fields(before) == _fields(after)


def same_prim(before: Sdf.Layer, after: Sdf.Layer, path: str) -> bool:
    """Whether two layers say the same of a prim and its properties, whatever is below it."""
    mine, theirs = (layer.GetPrimAtPath(path) for layer in (before, after))
    if mine is None or theirs is None:
        return False
    said, expected = (
        {spec.path: _info(spec) for spec in (prim, *prim.properties)} for prim in (mine, theirs)
    )
    return said == expected


def _fields(layer: Sdf.Layer) -> dict[Sdf.Path, dict[str, str]]:
    """Return what a layer says of each prim and property."""
    fields: dict[Sdf.Path, dict[str, str]] = {}

    def keep(path: Sdf.Path) -> None:
        if not path.IsTargetPath():  # which is in a list, and not always a spec of its own
            fields[path] = _info(layer.GetObjectAtPath(path))

    layer.Traverse(Sdf.Path.absoluteRootPath, keep)
    return fields


def _info(spec: Any) -> dict[str, str]:
    """Return the fields of a prim or property as text: no NaN equals another."""
    names = spec.ListInfoKeys() if spec else ()
    return {name: str(spec.GetInfo(name)) for name in names if name != _OFFSETS}


def is_text(layer: Sdf.Layer) -> bool:
    """Whether the file of a layer is text."""
    with Path(layer.realPath).open("rb") as file:
        return file.read(5) == b"#usda"


def crate_bytes(layer: Sdf.Layer) -> bytes:
    """Return a layer in the binary form."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "layer.usdc"
        layer.Export(str(path), args={"format": "usdc"})
        return path.read_bytes()


def anchored(data: bytes, home: Path, copy: Path) -> None:
    """Write a layer that stands at `home` to another place, from where it finds the same assets."""
    from pxr import UsdUtils

    copy.write_bytes(data)
    layer, folder = Sdf.Layer.OpenAsAnonymous(str(copy)), home.resolve().parent

    def absolute(asset: str) -> str:
        return str(folder / asset) if (folder / asset).exists() else asset

    UsdUtils.ModifyAssetPaths(layer, absolute)
    layer.Export(str(copy))


def render_prim(layer: Sdf.Layer, path: str) -> str:
    """Return a layer that holds one prim with its properties and without its children.

    Of the layer itself, `/`, the metadata is rendered, without its sublayers.
    """
    rendered = Sdf.Layer.CreateAnonymous(".usda")
    if path == "/":
        for name in layer.pseudoRoot.ListInfoKeys():
            if name not in {"subLayers", _OFFSETS}:
                rendered.pseudoRoot.SetInfo(name, layer.pseudoRoot.GetInfo(name))
    else:
        _copy_alone(layer, rendered, path)
    return str(rendered.ExportToString())


def _copy_alone(layer: Sdf.Layer, target: Sdf.Layer, path: str) -> None:
    """Make a prim without those below it what it is in another layer."""
    source, prim = layer.GetPrimAtPath(path), Sdf.CreatePrimInLayer(target, path)
    prim.specifier = source.specifier
    for name in _FIELDS:
        if source.HasInfo(name):
            prim.SetInfo(name, source.GetInfo(name))
        else:
            prim.ClearInfo(name)
    for spec in [*prim.properties]:
        prim.RemoveProperty(spec)
    for spec in source.properties:
        Sdf.CopySpec(layer, spec.path, target, spec.path)


def render_tree(layer: Sdf.Layer, path: str) -> str:
    """Return a layer that holds one prim with everything below it."""
    rendered = Sdf.Layer.CreateAnonymous(".usda")
    parent = path.rpartition("/")[0]
    if parent:
        Sdf.CreatePrimInLayer(rendered, parent)
    Sdf.CopySpec(layer, path, rendered, path)
    return str(rendered.ExportToString())


def has_prim(layer: Sdf.Layer, path: str) -> bool:
    """Whether a layer has a spec of a prim."""
    return path == "/" or layer.GetPrimAtPath(path) is not None


def child_names(layer: Sdf.Layer, path: str) -> list[str]:
    """Name the prims below a prim, or below the layer itself."""
    spec = layer.pseudoRoot if path == "/" else layer.GetPrimAtPath(path)
    return [child.name for child in spec.nameChildren]


class EditedLayer(Struct, eq=False):
    """A layer with its content before the first edit, and the prims that were edited.

    `renames` are the properties that were renamed, as prim, old and new name; `moves` the prims
    that were moved afterwards. Both are in order. `added` are the highest prims that the layer had
    not: they are known where `before` holds only what was edited.
    """

    layer: Sdf.Layer
    before: Sdf.Layer
    touched: dict[str, None] = field(default_factory=dict)
    added: list[str] = field(default_factory=list)
    renames: list[tuple[str, str, str]] = field(default_factory=list)
    moves: list[tuple[str, str]] = field(default_factory=list)

    def keep_prim(self, path: str) -> None:
        """Keep what the layer says of one prim before it is edited."""
        if path in self.touched or any(is_at_or_below(path, top) for top in self.added):
            return
        missing = [above for above in upwards(path) if not has_prim(self.layer, above)]
        self.added += missing[-1:]
        there = missing[-1].rpartition("/")[0] if missing else path
        if there and not has_prim(self.before, there):
            Sdf.CreatePrimInLayer(self.before, there)
        if not missing:
            _copy_alone(self.layer, self.before, path)

    def put_back(self) -> None:
        """Make each prim what it was before it was edited."""
        with Sdf.ChangeBlock():
            for path in self.touched:
                if not any(is_at_or_below(path, top) for top in self.added):
                    _copy_alone(self.before, self.layer, path)
            for path in self.added:
                spec = self.layer.GetPrimAtPath(path)
                if spec is not None:
                    take_out(spec)


class Reference(Struct, eq=False):
    """A checkpoint as its lab builds it from the starter, made when it is first asked for.

    Without a starter, given or described by the lab, it is what the lab says by itself.
    """

    lab: Lab
    checkpoint: Checkpoint
    starter: str | None = None
    _made: list[Usd.Stage] = field(default_factory=list)

    @property
    def has_starter(self) -> bool:
        """Whether there is a starter, given or described by the lab."""
        return self.starter is not None or (self.lab.folder / STARTER).is_file()

    def beside(self, stage: Usd.Stage) -> Usd.Stage:
        """Return the checkpoint composed, with the robots of a stage articulated as they are."""
        if not self._made:
            if self.has_starter:
                layer = checkpoint_layer(self.lab, self.starter, self.checkpoint)
            else:
                at_root = robots_articulated_at_root(self.lab, stage)
                lab = articulated_at_roots(self.lab, at_root)
                layer = described_layer(lab, self.checkpoint)
            self._made.append(Usd.Stage.Open(layer))
        return self._made[0]


class EditSession(Struct, eq=False):
    """An open stage under repair; with `root_only` no layer but the root is edited.

    With `by_prim`, of each layer only the prims that are edited are kept and put back: the edits
    change a prim and its properties, and add none that has more than that. `right` is what parts
    of the stage are restored to, None where nothing says it.
    """

    stage: Usd.Stage
    platform: Platform
    right: Reference | None = None
    root_only: bool = False
    by_prim: bool = False
    edited: dict[str, EditedLayer] = field(default_factory=dict)

    @property
    def has_starter(self) -> bool:
        """Whether there is a starter, given or described by a lab."""
        return self.right is not None and self.right.has_starter

    def reference(self) -> Sdf.Layer:
        """Return what parts of the stage are restored to.

        Raises:
            StageError: nothing says it.
        """
        return self.reference_stage().GetRootLayer()

    def reference_stage(self) -> Usd.Stage:
        """Return that composed.

        Raises:
            StageError: nothing says it.
        """
        if self.right is None:
            raise StageError(NEEDS_STARTER)
        return self.right.beside(self.stage)

    def layers(self) -> list[Sdf.Layer]:
        """Return the layers that may be edited, the strongest first."""
        root = self.stage.GetRootLayer()
        if self.root_only:
            return [root]
        stack = self.stage.GetLayerStack(includeSessionLayers=False)
        # In these folders layers are the user's own; a link may lead elsewhere.
        named, real = Path(root.realPath).parent.resolve(), Path(root.realPath).resolve().parent
        return [
            layer
            for layer in stack
            if layer == root
            or (layer.realPath and {named, real} & {*Path(layer.realPath).resolve().parents})
        ]

    def touch(self, layer: Sdf.Layer, path: str) -> None:
        """Remember that a prim is about to be edited in a layer."""
        edited = self.begin(layer)
        if self.by_prim:
            edited.keep_prim(path)
        edited.touched[path] = None

    def begin(self, layer: Sdf.Layer) -> EditedLayer:
        """Keep the content of a layer before its first edit."""
        if layer.identifier not in self.edited:
            before = Sdf.Layer.CreateAnonymous(".usda")
            if not self.by_prim:
                before.TransferContent(layer)
            self.edited[layer.identifier] = EditedLayer(layer, before)
        return self.edited[layer.identifier]

    def stands(self, path: str) -> bool:
        """Whether a layer other than the session layer has a spec of a prim."""
        return bool(self.opinions(path))

    def opinions(self, path: str) -> list[Sdf.PrimSpec]:
        """Return the specs of a prim, the strongest first, without those of the session layer."""
        prim, above = self.stage.GetPrimAtPath(path), self.stage.GetSessionLayer()
        return [spec for spec in prim.GetPrimStack() if spec.layer != above] if prim else []

    def prim_layer(self, path: str) -> Sdf.Layer:
        """Return the layer whose opinion on a prim is the strongest, else the root layer."""
        return self._strongest(self.opinions(path), path)

    def property_layer(self, path: str, name: str) -> Sdf.Layer:
        """Return the layer whose opinion on a property is the strongest, else that of its prim."""
        above = self.stage.GetSessionLayer()
        specs = [spec for spec in self._property_stack(path, name) if spec.layer != above]
        if not specs:
            return self.prim_layer(path)
        return self._strongest(specs, f"{path}.{name}")

    def source(self, path: str, name: str) -> str:
        """Return the prim at which a property is authored, which may be one that is referred to."""
        allowed = self.layers()
        specs = (spec for spec in self._property_stack(path, name) if spec.layer in allowed)
        return next((str(spec.path.GetPrimPath()) for spec in specs), path)

    def _property_stack(self, path: str, name: str) -> list[Any]:
        prim = self.stage.GetPrimAtPath(path)
        authored = prim.GetProperty(name) if prim else None
        return authored.GetPropertyStack(Usd.TimeCode.Default()) if authored else []

    def _strongest(self, specs: list[Any], path: str) -> Sdf.Layer:
        allowed = self.layers()
        if specs and specs[0].layer in allowed and str(specs[0].path) == path:
            return specs[0].layer
        return self.stage.GetRootLayer()

    def prim_spec(self, layer: Sdf.Layer, path: str) -> Sdf.PrimSpec:
        """Return the spec of a prim in a layer, an over where there was none."""
        self.touch(layer, path)
        return Sdf.CreatePrimInLayer(layer, path)

    def specs(self, path: str) -> Iterator[Sdf.PrimSpec]:
        """Yield the specs of a prim in the layers that may be edited, the strongest first."""
        for layer in self.layers():
            spec = layer.GetPrimAtPath(path)
            if spec is not None:
                yield spec

    def close(self) -> None:
        """Restore the content of every layer."""
        for edited in self.edited.values():
            if self.by_prim:
                edited.put_back()
            else:
                edited.layer.TransferContent(edited.before)
