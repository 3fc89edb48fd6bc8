"""Finds the starter of a submission, and tells whether it was overwritten."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import StageError
from lab3_usd.judge.starter import Starter, open_starter
from lab3_usd.model.stage import StageModel
from lab3_usd.model.submission import Listing, StarterFile
from lab3_usd.spec.lab import Lab


class Starters(Struct, frozen=True):
    """The starter to compare stages with, None for none, and the one in the submission."""

    compared: Starter | None = None
    submitted: StarterFile | None = None


def find_starters(
    folder: Path, listing: Listing, supplied: Path | Starter | None, lab: Lab
) -> Starters:
    """Open the supplied starter, else the submission's own; only the first is trusted.

    Raises:
        StageError: the supplied starter cannot be opened.
    """
    trusted = open_starter(supplied, lab) if isinstance(supplied, Path) else supplied
    if listing.starter is None:
        return Starters(trusted)
    submitted = StarterFile(listing.starter)
    try:
        own = open_starter(folder / listing.starter, lab, trusted=False)
        holds = tuple(_holds(own, trusted, lab))
    except StageError as error:
        fault = str(error).removeprefix(f"{folder / listing.starter}: ")
        return Starters(trusted, replace(submitted, fault=fault))
    compared = trusted if trusted is not None else None if holds else own
    return Starters(compared, replace(submitted, holds=holds))


def _holds(own: Starter, trusted: Starter | None, lab: Lab) -> Iterator[str]:
    """Yield what a starter holds that only the lab adds, or has otherwise than the supplied one."""
    from lab3_usd.stage.compare.starter import compare_starter  # noqa: PLC0415 - pxr, only when needed
    from lab3_usd.stage.read.reader import read_model  # noqa: PLC0415

    model = read_model(own.stage, lab, str(own.path))
    added = list(_added(model, lab))
    yield from added
    if trusted is not None and not added:
        first = next(iter(lab.checkpoints))
        changes = compare_starter(trusted.stage, own.stage, lab, first).changes
        yield from (f"a change of {change.prim}" for change in changes)


def _added(model: StageModel, lab: Lab) -> Iterator[str]:
    yield from (graph.path for graph in model.graphs)
    for sensor in lab.sensors.values():
        if model.prim(sensor["path"]) is not None:
            yield sensor["path"]
