"""Loads the node types of Isaac Sim: compiled where they can be, else out of `graphs/isaac/`."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lab3_usd.data import data_folder
from lab3_usd.spec.isaac import IsaacTypes
from lab3_usd.spec.load.compiled import compiled_or_loaded_types


@lru_cache(maxsize=1)
def load_isaac_types() -> IsaacTypes:
    """Load every public node type of Isaac Sim, which the lab's catalog is a part of.

    Raises:
        SpecError: a file is missing or wrong.
    """
    return compiled_or_loaded_types(data_folder("graphs") / "isaac", _assemble_types)


def _assemble_types(folder: Path) -> IsaacTypes:
    from lab3_usd.spec.load.isaac import assemble_types  # noqa: PLC0415 - not if compiled

    return assemble_types(folder)
