"""Loads the lab: everything that `graphs/` says, checked once, then plain frozen data."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lab3_usd.data import data_folder
from lab3_usd.spec.compiled import compiled_or_loaded
from lab3_usd.spec.spec import Lab


def load_lab(folder: Path | None = None) -> Lab:
    """Load the lab described by the YAML files of `folder`, by default the bundled one.

    Raises:
        SpecError: a file is missing or wrong; the line names file, graph, role and port.
    """
    return _bundled(data_folder("graphs")) if folder is None else _load(folder)


@lru_cache(maxsize=1)
def _bundled(folder: Path) -> Lab:
    return compiled_or_loaded(folder, _load)


@lru_cache(maxsize=4)
def _load(folder: Path) -> Lab:
    from lab3_usd.spec.assemble import assemble  # noqa: PLC0415 - nor YAML's parser without need

    return assemble(folder)
