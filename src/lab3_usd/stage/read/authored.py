"""What a stage writes at single prims: every attribute with its type, whether rules ask or not."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pxr import Usd

from lab3_usd.spec.catalog import Value
from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
from lab3_usd.stage.read.plain_values import plain_value
from lab3_usd.stage.read.ports import declared_properties
from lab3_usd.stage.read.prims import DAMAGE

Authored = dict[str, tuple[str, Value]]  # type and value by name


@quiet()
def authored_attributes(path: Path, prims: Iterable[str]) -> dict[str, Authored]:
    """Return the types and values of the attributes that a stage writes at prims, by prim.

    Raises:
        StageError: the stage cannot be read.
    """
    with stage_errors(str(path), *DAMAGE):
        stage = open_stage(path)
        found: dict[str, Authored] = {}
        for prim_path in prims:
            prim = stage.GetPrimAtPath(prim_path)
            said = found.setdefault(prim_path, {})
            for name, each in declared_properties(prim).items():
                value = plain_value(each.Get()) if isinstance(each, Usd.Attribute) else None
                if value is not None:
                    said[name] = (str(each.GetTypeName()), value)
    return found
