"""Loads the lab: everything that `graphs/` says, checked once, then plain frozen data."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lab3_usd.data import data_folder, own_lab
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.compiled import compiled_or_loaded


def load_lab(folder: Path | None = None) -> Lab:
    """Load the lab described by the YAML files of `folder`.

    By default it is the folder that the environment variable `LAB3_LAB` names, else the bundled
    one.

    Raises:
        SpecError: a file is missing or wrong; the line names file, graph, role and port.
    """
    folder = folder or own_lab()
    return _bundled(data_folder("graphs")) if folder is None else _load(folder)


@lru_cache(maxsize=1)
def _bundled(folder: Path) -> Lab:
    return compiled_or_loaded(folder, _load)


@lru_cache(maxsize=4)
def _load(folder: Path) -> Lab:
    from lab3_usd.spec.contradictions.references import (
        refuse_faulty,
    )
    from lab3_usd.spec.load.lab import assemble

    lab = assemble(folder)
    refuse_faulty(lab)
    return lab
