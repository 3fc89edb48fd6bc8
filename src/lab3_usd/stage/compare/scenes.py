"""Compares the prims of two stages that are no graphs, and returns every difference."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
from typing import Any

from msgspec import Struct
from pxr import Usd

from lab3_usd.model.changes import Part, StageChange
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.compare.values import (
    applied_schemas,
    display_value,
    matrix_of,
    pattern,
    same_place,
    same_value,
    shown_place,
)
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.properties import targets_of

_PRECISION = 1e-6  # of a number that a file holds in single precision
_PLACE = (1e-5, 0.01, 1e-5)  # a length in stage units, degrees, and a scale
# What sensors are set by, which a starter has none of.
_SENSORS = ("isaac:*", "omni:*")
_POSE = "xformOp"


class _Scenes(Struct, frozen=True):
    """The two stages, and what is left aside in both."""

    before: Usd.Stage
    after: Usd.Stage
    lab: Lab
    path: Callable[[str], str]
    never: Callable[[str], Any]

    def part(self, path: str) -> Part:
        """Return what a prim at this path belongs to."""
        root = self.lab.scene.robot.path
        return "robot" if is_at_or_below(path, root) else "scene"

    def is_left_aside(self, prim: Usd.Prim) -> bool:
        """Whether a prim is a graph, a node or the application's own."""
        form, kind = self.lab.catalog.graph, prim.GetTypeName()
        ignored = self.lab.submission.starter.ignored_prims
        is_root = prim.GetPath().pathElementCount == 1
        return kind in {form.type, form.node_type} or (
            is_root and any(fnmatchcase(str(prim.GetPath()), each) for each in ignored)
        )


@quiet()
def scene_changes(
    before: Usd.Stage, after: Usd.Stage, lab: Lab, path: Callable[[str], str]
) -> Iterator[StageChange]:
    """Yield how the prims of `after` differ from those of `before`, graphs left aside.

    A prim that came or went stands for all below it. `path` says where a target is now.
    """
    rules = lab.submission.starter
    never = pattern(name for name in rules.never if name not in _SENSORS).match
    scenes = _Scenes(before, after, lab, path, never)
    gone: list[Usd.Prim] = []
    new: list[Usd.Prim] = []
    yield from _below(before.GetPseudoRoot(), after.GetPseudoRoot(), scenes, (gone, new))
    for prim in gone:
        twin = next((each for each in new if _signature(each) == _signature(prim)), None)
        if twin is None:
            yield _removed(prim, scenes)
            continue
        new.remove(twin)
        was, now = str(prim.GetPath()), str(twin.GetPath())
        yield StageChange(scenes.part(now), "changed", now, "path", was, now)
        yield from _tree(prim, twin, scenes, (gone, new))
    for prim in new:
        path_now = str(prim.GetPath())
        yield StageChange(scenes.part(path_now), "added", path_now, now=_counted(prim, scenes))


def _signature(prim: Usd.Prim) -> tuple[str, str]:
    return str(prim.GetTypeName()), str(prim.GetName())


def _removed(prim: Usd.Prim, scenes: _Scenes) -> StageChange:
    path = str(prim.GetPath())
    twin = scenes.after.GetPrimAtPath(path)
    now = "" if not twin else "an over without a def" if twin.IsActive() else "deactivated"
    return StageChange(scenes.part(path), "removed", path, was=_counted(prim, scenes), now=now)


def _counted(prim: Usd.Prim, scenes: _Scenes) -> str:
    below = sum(1 for _ in _all_below(prim, scenes))
    kind = str(prim.GetTypeName()) or "prim"
    return f"{kind}, with {below} prims below it" if below else kind


def _all_below(prim: Usd.Prim, scenes: _Scenes) -> Iterator[Usd.Prim]:
    for child in _children(prim, scenes).values():
        yield child
        yield from _all_below(child, scenes)


_Lists = tuple[list[Usd.Prim], list[Usd.Prim]]


def _tree(was: Usd.Prim, now: Usd.Prim, scenes: _Scenes, lists: _Lists) -> Iterator[StageChange]:
    yield from _prim(was, now, scenes)
    yield from _below(was, now, scenes, lists)


def _below(was: Usd.Prim, now: Usd.Prim, scenes: _Scenes, lists: _Lists) -> Iterator[StageChange]:
    ours, theirs = (_children(each, scenes) for each in (was, now))
    lists[0].extend(prim for name, prim in ours.items() if name not in theirs)
    lists[1].extend(prim for name, prim in theirs.items() if name not in ours)
    for name, prim in ours.items():
        if name in theirs:
            yield from _tree(prim, theirs[name], scenes, lists)


def _children(prim: Usd.Prim, scenes: _Scenes) -> dict[str, Usd.Prim]:
    children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
    return {child.GetName(): child for child in children if not scenes.is_left_aside(child)}


def _prim(was: Usd.Prim, now: Usd.Prim, scenes: _Scenes) -> Iterator[StageChange]:
    path = str(now.GetPath())
    part = scenes.part(path)
    kinds = [str(each.GetTypeName()) for each in (was, now)]
    if kinds[0] != kinds[1]:
        yield StageChange(part, "changed", path, "type", *(kind or "no type" for kind in kinds))
    yield from _schemas(was, now, part)
    is_posed = False
    for name in _unequal(was, now):
        if name.startswith(_POSE):
            is_posed = True
        elif not scenes.never(name):
            yield from _property(was, now, name, scenes)
    if is_posed:
        yield from _place(was, now, part)


def _schemas(was: Usd.Prim, now: Usd.Prim, part: Part) -> Iterator[StageChange]:
    path = str(now.GetPath())
    before, after = applied_schemas(was), applied_schemas(now)
    for name in before:
        if name not in after:
            yield StageChange(part, "removed", path, "schema", was=name)
    for name in after:
        if name not in before:
            yield StageChange(part, "added", path, "schema", now=name)


def _unequal(was: Usd.Prim, now: Usd.Prim) -> list[str]:
    """Return the properties with an opinion in one of the two that are not the same to the bit."""
    names = sorted({*was.GetAuthoredPropertyNames(), *now.GetAuthoredPropertyNames()})
    return [name for name in names if _content(was, name) != _content(now, name)]


def _content(prim: Usd.Prim, name: str) -> Any:
    relationship = prim.GetRelationship(name)
    if relationship:
        return targets_of(relationship)
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None


def _property(was: Usd.Prim, now: Usd.Prim, name: str, scenes: _Scenes) -> Iterator[StageChange]:
    path = str(now.GetPath())
    part = scenes.part(path)
    if was.GetRelationship(name) or now.GetRelationship(name):
        targets = [
            sorted(scenes.path(str(each)) for each in _content(was, name) or ()),
            sorted(str(each) for each in _content(now, name) or ()),
        ]
        if targets[0] != targets[1]:
            shown = [", ".join(target) or "no prim" for target in targets]
            yield StageChange(part, "changed", path, name, *shown)
        return
    before, after = _content(was, name), _content(now, name)
    if before is not None and same_value(before, after, _PRECISION):
        return
    told = ["not set" if each is None else display_value(each) for each in (before, after)]
    yield StageChange(part, "changed", path, name, *told)


def _place(was: Usd.Prim, now: Usd.Prim, part: Part) -> Iterator[StageChange]:
    matrices = [matrix_of(each, local=True) for each in (was, now)]
    what = same_place(matrices[0], matrices[1], _PLACE)
    if what:
        told = [shown_place(what, matrix) for matrix in matrices]
        yield StageChange(part, "changed", str(now.GetPath()), "place", *told)
