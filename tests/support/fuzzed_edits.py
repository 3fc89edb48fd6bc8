"""Random edits of random text layers: the text says what the layer says, and no more changed."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

from fixing import own_texts
from pxr import Sdf
from random_layers import Layer, random_edits, random_layer

from lab3_usd.fix.text_editor import new_text
from lab3_usd.model.changes import Edit, MovePrim, RemovePrim
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.opening import open_stage, quiet

_NOTE = re.compile(r"note \d+")


@quiet()
def fault_of(seed: int, folder: Path) -> str | None:
    """Edit one random layer; return what went wrong, None where all is well.

    Raises:
        StageError: the layer is none.
    """
    layer = random_layer(seed)
    path = folder / f"layer{seed}.usda"
    path.write_bytes(layer.text.encode())
    lab = load_lab()
    session = EditSession(open_stage(path), lab, next(iter(lab.checkpoints.values())))
    edits = []
    try:
        for edit in random_edits(layer, seed):
            if session.stands(edit.prim):
                apply_edit(session, edit)
                edits.append(edit)
        for edited in session.edited.values():
            text = new_text(layer.text, edited)
            wanted = content(edited.layer)
            found = _fault(layer, text, wanted, edits)
            if found:
                return f"{found}: {edits}"
    finally:
        session.close()
        path.unlink()
    return None


def _fault(layer: Layer, text: str, wanted: dict[str, Any], edits: list[Edit]) -> str | None:
    try:
        written = Sdf.Layer.CreateAnonymous(".usda")
        is_read = written.ImportFromString(text)
    except Exception as error:  # noqa: BLE001 - usd-core's own kinds
        return f"is not read: {error}"
    if not is_read:
        return "is not read"
    actual = content(written)
    if actual != wanted:
        paths = sorted(p for p in {*actual, *wanted} if actual.get(p) != wanted.get(p))
        return f"says otherwise at {paths[:3]}"
    return _elsewhere(layer, text, edits) or _lost_comment(layer, text, edits)


def content(layer: Sdf.Layer) -> dict[str, dict[str, str]]:
    """Everything that a layer says, by path, in no order."""
    found: dict[str, dict[str, str]] = {}

    def add(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, (Sdf.PrimSpec, Sdf.PropertySpec)):
            found[str(path)] = {key: str(spec.GetInfo(key)) for key in spec.ListInfoKeys()}

    layer.Traverse(Sdf.Path.absoluteRootPath, add)
    return found


def _elsewhere(layer: Layer, text: str, edits: list[Edit]) -> str | None:
    """Name a prim whose own text changed though no edit names it."""
    if any(isinstance(edit, MovePrim) for edit in edits):
        return None
    named = {edit.prim for edit in edits}
    before, after = own_texts(layer.text), own_texts(text)
    for path in before.keys() & after.keys():
        if path not in named and before[path] != after[path]:
            return f"changed {path}"
    return None


def _lost_comment(layer: Layer, text: str, edits: list[Edit]) -> str | None:
    """Name a comment that went away with nothing that was removed."""
    if any(isinstance(edit, RemovePrim) for edit in edits):
        return None
    lost = Counter(_NOTE.findall(layer.text)) - Counter(_NOTE.findall(text))
    return f"lost {[*lost]}" if lost else None
