"""Compares the prims of two stages that are no graphs, and returns every difference."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.isaac.values import SAVED
from lab3_usd.model.changes import ChangeKind, Part, StageChange
from lab3_usd.model.transforms import SAVED_PLACE
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import SceneSpec
from lab3_usd.stage.compare.pairs import (
    GonePrim,
    PairedPrim,
    PrimRecord,
    RawDifference,
    Scope,
    Signature,
    children_in_scope,
    compare_prims,
    is_aside,
    raw_differences,
    read_record,
    read_records,
    signature,
)
from lab3_usd.stage.compare.value_terms import (
    POSE,
    display_value,
    how_apart,
    matrix_of,
    pattern,
    same_usd_value,
    shown_place,
)
from lab3_usd.stage.read.opening import quiet

# What sensors are set by, which a starter has none of.
_SENSORS = ("isaac:*", "omni:*")


class _Terms(Struct, frozen=True):
    """The terms of a comparison of two stages; `path` returns the new path of a target."""

    scope: Scope
    scene: SceneSpec
    path: Callable[[str], str]
    never: Callable[[str], Any]

    def part(self, path: str) -> Part:
        """Return what a prim at this path belongs to."""
        return "scene" if self.scene.robot_of(path) is None else "robot"


_METADATA = ("defaultPrim", "timeCodesPerSecond", "framesPerSecond", "startTimeCode", "endTimeCode")


def metadata_changes(before: Usd.Stage, after: Usd.Stage) -> Iterator[StageChange]:
    """Yield what differs of the stages themselves: prim and times by default, order of layers."""
    for name in _METADATA:
        was, now = before.GetMetadata(name), after.GetMetadata(name)
        if was != now:
            yield StageChange("scene", "changed", "/", name, display_value(was), display_value(now))
    orders = [[*stage.GetRootLayer().subLayerPaths] for stage in (before, after)]
    if orders[0] != orders[1] and sorted(orders[0]) == sorted(orders[1]):
        yield StageChange("scene", "changed", "/", "subLayers", *map(", ".join, orders))


@quiet()
def scene_changes(
    before: Usd.Stage, after: Usd.Stage, lab: Lab, path: Callable[[str], str]
) -> Iterator[StageChange]:
    """Yield how the prims of `after` differ from those of `before`, graphs left aside.

    An added or removed prim represents everything below it. A prim that was removed and added
    elsewhere with the same type and name was moved. `path` returns the present path of a target.
    """
    rules, form = lab.submission.starter, lab.platform.graph
    never = pattern(name for name in rules.never if name not in _SENSORS).match
    scope = Scope(rules.ignored_prims, frozenset((form.type, form.node_type)))
    terms = _Terms(scope, lab.scene, path, never)
    gone: list[PrimRecord] = []
    new: dict[Signature, list[Usd.Prim]] = {}
    equal: dict[tuple[Sdf.Path, Sdf.Path], bool] = {}  # the prototypes of instances

    def is_alike(pair: PairedPrim) -> bool:
        """Whether the prims are instances, at one place, of prototypes that hold the same."""
        was, now = pair.was.prim, pair.now
        is_instance = Usd.Prim.IsInstance(was) and Usd.Prim.IsInstance(now)
        if not is_instance or was.GetPath() != now.GetPath():
            return False
        prototypes = (was.GetPrototype().GetPath(), now.GetPrototype().GetPath())
        if prototypes not in equal:
            below = compare_prims(pair.was, now, scope, is_alike)
            equal[prototypes] = not any(
                not isinstance(prim, PairedPrim) or any(raw_differences(prim.was, prim.now))
                for prim in below
            )
        return equal[prototypes]

    def changes_below(was: PrimRecord, now: Usd.Prim) -> Iterator[StageChange]:
        for prim in compare_prims(was, now, scope, is_alike):
            if isinstance(prim, PairedPrim):
                yield from _prim_changes(prim.was, prim.now, terms)
            elif isinstance(prim, GonePrim):
                gone.append(prim.was)
            else:
                new.setdefault(signature(prim.now), []).append(prim.now)

    yield from changes_below(read_records(before), after.GetPseudoRoot())
    for record in gone:  # which grows by what is gone below a prim that moved
        twins = new.get((record.kind, record.name))
        if not twins:
            yield _removed(record, after, terms)
            continue
        twin = twins.pop(0)
        now = str(twin.GetPath())
        yield StageChange(terms.part(now), "changed", now, "path", record.path, now)
        yield from _prim_changes(record, twin, terms)
        yield from changes_below(record, twin)
    for twins in new.values():
        for twin in twins:
            now = str(twin.GetPath())
            yield StageChange(terms.part(now), "added", now, now=_counted(twin, terms))
    yield from _over_changes(before, after, terms)


def _over_changes(before: Usd.Stage, after: Usd.Stage, terms: _Terms) -> Iterator[StageChange]:
    """Yield how overs differ that define nothing: they edit what an asset holds that is not found.

    One that stands in one stage alone stands for those below it.
    """
    ours, theirs = (
        {str(over.GetPath()): over for over in _overs(stage, terms)} for stage in (before, after)
    )
    for path in sorted({*ours, *theirs}):
        was, now, part = ours.get(path), theirs.get(path), terms.part(path)
        above = path.rpartition("/")[0]
        if was is not None and now is not None:
            if was.IsActive() != now.IsActive():
                active = (str(over.IsActive()).lower() for over in (was, now))
                yield StageChange(part, "changed", path, "active", *active)
            yield from _prim_changes(read_record(was), now, terms)
        elif was is not None and not after.GetPrimAtPath(path) and _stands(above, after):
            yield StageChange(part, "removed", path, was=_over_text(was))
        elif now is not None and not before.GetPrimAtPath(path) and _stands(above, before):
            yield StageChange(part, "added", path, now=_over_text(now))


def _overs(stage: Usd.Stage, terms: _Terms) -> Iterator[Usd.Prim]:
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate):
        is_over = not Usd.Prim.IsDefined(prim) and not Usd.Prim.IsAbstract(prim)
        if is_over and not is_aside(prim, terms.scope):
            yield prim


def _stands(path: str, stage: Usd.Stage) -> bool:
    return path == "" or bool(stage.GetPrimAtPath(path))


def _over_text(over: Usd.Prim) -> str:
    names = over.GetAuthoredPropertyNames()
    state = "" if over.IsActive() else ", inactive"
    return f"an over{state}" + (f" of {', '.join(names)}" if names else "")


def _removed(record: PrimRecord, after: Usd.Stage, terms: _Terms) -> StageChange:
    twin = after.GetPrimAtPath(record.path)
    now = "" if not twin else "an over without a def" if twin.IsActive() else "deactivated"
    was = _counted(record.prim, terms)
    return StageChange(terms.part(record.path), "removed", record.path, was=was, now=now)


def _counted(prim: Usd.Prim, terms: _Terms) -> str:
    below = _count_below(prim, terms)
    kind = str(prim.GetTypeName()) or "prim"
    return f"{kind}, with {below} prim{'s' if below > 1 else ''} below it" if below else kind


def _count_below(prim: Usd.Prim, terms: _Terms) -> int:
    children = children_in_scope(prim, terms.scope).values()
    return len(children) + sum(_count_below(child, terms) for child in children)


def _prim_changes(was: PrimRecord, now: Usd.Prim, terms: _Terms) -> Iterator[StageChange]:
    differences = [*raw_differences(was, now)]
    if not differences:  # as most prims have none
        return
    path = str(now.GetPath())
    part = terms.part(path)
    is_posed = False
    for difference in differences:
        name, before, after = difference.name, difference.was, difference.now
        if difference.kind == "type":
            kinds = (before or "no type", after or "no type")
            yield StageChange(part, "changed", path, "type", *kinds)
        elif difference.kind == "schema":
            edit: ChangeKind = "removed" if after is None else "added"
            yield StageChange(part, edit, path, "schema", before or "", after or "")
        elif before == after:
            pass  # what one stage writes, the other has by default
        elif name.startswith(POSE):
            is_posed = True
        elif not terms.never(name):
            is_value = difference.kind == "value"
            texts = _values(difference) if is_value else _targets(difference, terms)
            if texts:
                yield StageChange(part, "changed", path, name, *texts)
    if is_posed:
        matrices = [matrix_of(prim, local=True) for prim in (was.prim, now)]
        what = how_apart(matrices[0], matrices[1], SAVED_PLACE)
        if what is not None:
            places = [shown_place(what, matrix) for matrix in matrices]
            yield StageChange(part, "changed", path, "place", *places)


def _targets(difference: RawDifference, terms: _Terms) -> list[str]:
    """Return the targets before and after, named as they are now; nothing where they are equal."""
    was = sorted(terms.path(str(path)) for path in difference.was)
    now = sorted(map(str, difference.now))
    return [] if was == now else [", ".join(paths) or "no prim" for paths in (was, now)]


def _values(difference: RawDifference) -> list[str]:
    """Return the values before and after; nothing where they are the same."""
    was, now = difference.was, difference.now
    if was is not None and same_usd_value(was, now, SAVED):
        return []
    return ["not set" if value is None else display_value(value) for value in (was, now)]
