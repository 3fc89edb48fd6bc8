"""The TF frame names that Isaac Sim gives to prims, and how it keeps them apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.check.model import StageModel

NAME_OVERRIDE = "isaac:nameOverride"


def frame_name(path: str, stage: StageModel) -> str:
    """Return the frame of a prim: its name override, else the prim's own name."""
    prim = stage.prim(path)
    override = None if prim is None else prim.attributes.get(NAME_OVERRIDE)
    return override if isinstance(override, str) and override else _leaf(path)


def _leaf(path: str) -> str:
    return path.rpartition("/")[2]


def unique_names(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim of one list, no name twice.

    The prim with the longest path keeps a name that several want; the others go by the prim's
    name, and where that is taken too by an ancestor's name before it.
    """
    wanted = [frame_name(path, stage) for path in paths]
    owner: dict[str, int] = {}
    for index, name in enumerate(wanted):
        if name not in owner or len(paths[index]) > len(paths[owner[name]]):
            owner[name] = index
    names = [name if owner[name] == index else "" for index, name in enumerate(wanted)]
    for index, path in enumerate(paths):
        if not names[index]:
            names[index] = next(name for name in _others(path, stage) if name not in names)
    return names


def _others(path: str, stage: StageModel) -> Iterator[str]:
    """Yield what the prim may be called instead, best first; the last always serves."""
    leaf = _leaf(path)
    yield leaf
    parts = path.strip("/").split("/")[:-1]
    for depth in range(1, len(parts) + 1):
        yield f"{frame_name('/' + '/'.join(parts[:depth]), stage)}_{leaf}"
    number = 0
    while True:
        number += 1
        yield f"{'_'.join(parts)}_{leaf}_{number}"
