"""The TF frame names that Isaac Sim gives to prims, and how it keeps them apart."""

from __future__ import annotations

from collections.abc import Sequence

from lab3_usd.model.stage import StageModel

NAME_OVERRIDE = "isaac:nameOverride"


def frame_name(path: str, stage: StageModel) -> str:
    """Return the frame of a prim: its name override, else the prim's own name."""
    prim = stage.prim(path)
    override = None if prim is None else prim.attributes.get(NAME_OVERRIDE)
    return override if isinstance(override, str) and override else _leaf(path)


def _leaf(path: str) -> str:
    return path.rpartition("/")[2]


def unique_names(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim of one list, as Isaac Compute Transform Tree does.

    The prim with the longest path keeps a name that several want. The others go by the prim's
    name; where that is taken too, an ancestor's name comes before it, but never that of a prim at
    the root, as the first path of the list has one.
    """
    wanted = [frame_name(path, stage) for path in paths]
    owner: dict[str, int] = {}
    for index, name in enumerate(wanted):
        if name not in owner or len(paths[index]) > len(paths[owner[name]]):
            owner[name] = index
    names = [name if owner[name] == index else "" for index, name in enumerate(wanted)]
    start = max(paths[0].find("/", 1), 0) if paths else 0
    for index, path in enumerate(paths):
        if not names[index]:
            leaf = _leaf(path)
            names[index] = _qualified(path, start, names, stage) if leaf in names else leaf
    return names


def _qualified(path: str, start: int, taken: Sequence[str], stage: StageModel) -> str:
    """Return the first name with an ancestor's before it that is free, else the rest of the path.

    The rest is no unique name for a prim right below one at the root. Isaac Sim counts `start` in
    characters, whatever prim it falls into.
    """
    leaf = _leaf(path)
    end = path.find("/", start + 1)
    while end >= 0:
        above = frame_name(path[:end], stage)
        if above != leaf and f"{above}_{leaf}" not in taken:
            return f"{above}_{leaf}"
        end = path.find("/", end + 1)
    return path[start:].removeprefix("/").replace("/", "_") or leaf


def names_in_turn(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim: who comes first keeps it, the next goes by its path."""
    names: dict[str, str] = {}
    for path in paths:
        if path not in names:
            name = frame_name(path, stage)
            taken = name in names.values()
            names[path] = path.strip("/").replace("/", "_") if taken else name
    return [names[path] for path in paths]
