"""Compares a stage with the starter it was made from, as composed, and returns plain data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from weakref import WeakKeyDictionary

from msgspec import Struct
from msgspec.structs import replace
from pxr import Sdf, Usd, UsdGeom

from lab3_usd.model.changes import Change, StarterSubject
from lab3_usd.model.stage import UnresolvedAsset
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import StarterRules
from lab3_usd.stage.compare.prims import (
    StarterPrim,
    added_changes,
    authored_differences,
    differences,
    read_starter_prim,
)
from lab3_usd.stage.compare.values import (
    Terms,
    affects_physics,
    body_of,
    classifier,
    is_light_or_camera,
    is_physical,
)
from lab3_usd.stage.read.assets import IS_PRESENT, find_unresolved
from lab3_usd.stage.read.opening import cached, open_stage, quiet
from lab3_usd.stage.read.properties import targets_of

_Added = dict[tuple[str, str], list[Usd.Prim]]


class Pair(Struct, frozen=True):
    """A starter and the stage made from it; below the `hidden` prims the stage lacks an asset."""

    starter: Usd.Stage
    stage: Usd.Stage
    terms: Terms
    hidden: tuple[str, ...]
    share_layers: bool

    def changes(
        self, was: StarterPrim, twin: Usd.Prim, *, moved: bool = False, is_whole: bool = True
    ) -> Iterator[Change]:
        """Yield what changed of one prim, which stands at `twin` now: at most one change.

        With `is_whole` False an asset of `twin` is missing, which may hold what `twin` lacks.
        """
        if self.share_layers and not moved and was.prim.GetPrimStack() == twin.GetPrimStack():
            return  # both come from the same places of the same files
        if is_whole:
            found = differences(was, twin, self.terms, same_parent=not moved)
        else:
            found = authored_differences(was, twin, self.terms)
        if found:
            body = body_of(was.prim, self.terms.rules)
            yield Change(str(twin.GetPath()), str(was.kind), tuple(found), body=body)


def is_there(prim: Usd.Prim, *, may_be_undefined: bool = False) -> bool:
    """Whether the prim is part of the scene; what defines it may be in a missing asset."""
    if not may_be_undefined:
        return bool(prim and IS_PRESENT(prim))
    return bool(prim and prim.IsActive() and not prim.IsAbstract())


def missing_prim_changes(gone: Iterable[Usd.Prim], pair: Pair) -> Iterator[Change]:
    """Yield one change for each prim that vanished, with all that stood below it.

    What was moved elsewhere is compared there; what is recognised by its type need not even
    keep its name.
    """
    added: _Added = {}
    for prim in gone:
        if _is_library(prim, pair):
            continue
        if not added:
            added = _added(pair)
        yield from _seek(prim, added, pair)


def _is_library(prim: Usd.Prim, pair: Pair) -> bool:
    """Whether the prim only holds shapes that links refer to: they are compared at the links."""
    return prim.GetName() in pair.terms.rules.library and not body_of(prim, pair.terms.rules)


def _added(pair: Pair) -> _Added:
    """Return the prims that the starter does not have, by type and name."""
    found: _Added = {}
    for prim in Usd.PrimRange(pair.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsPseudoRoot() and not is_there(pair.starter.GetPrimAtPath(prim.GetPath())):
            found.setdefault((str(prim.GetTypeName()), prim.GetName()), []).append(prim)
    return found


def _seek(prim: Usd.Prim, added: _Added, pair: Pair) -> Iterator[Change]:
    twin = _elsewhere(prim, added, pair)
    if twin is not None:
        yield from pair.changes(read_starter_prim(prim), twin, moved=True)
        for child in _children(prim):
            at = twin.GetStage().GetPrimAtPath(twin.GetPath().AppendChild(child.GetName()))
            yield from _below(child, at, added, pair)
        return
    is_container = not is_physical(prim, pair.terms.rules) and not prim.IsA(UsdGeom.Gprim)
    if is_container and any(_elsewhere(each, added, pair) for each in _below_of(prim)):
        for child in _children(prim):
            yield from _seek(child, added, pair)
        return
    if prim.GetName() not in pair.terms.rules.library or body_of(prim, pair.terms.rules):
        yield _gone(prim, pair)


def _below(prim: Usd.Prim, twin: Usd.Prim, added: _Added, pair: Pair) -> Iterator[Change]:
    """Compare a subtree that moved as a whole."""
    if not is_there(twin):
        yield from _seek(prim, added, pair)
        return
    yield from pair.changes(read_starter_prim(prim), twin)
    for child in _children(prim):
        at = twin.GetStage().GetPrimAtPath(twin.GetPath().AppendChild(child.GetName()))
        yield from _below(child, at, added, pair)


def _children(prim: Usd.Prim) -> list[Usd.Prim]:
    return list(prim.GetFilteredChildren(Usd.TraverseInstanceProxies()))


def _below_of(prim: Usd.Prim) -> list[Usd.Prim]:
    return list(Usd.PrimRange(prim, Usd.TraverseInstanceProxies()))


def _elsewhere(prim: Usd.Prim, added: _Added, pair: Pair) -> Usd.Prim | None:
    """Return the prim that this one became: of its type and name, else of its type alone."""
    kind = str(prim.GetTypeName())
    is_robots = _is_robots(prim, pair)
    for twin in added.get((kind, prim.GetName()), []):
        if _is_robots(twin, pair) == is_robots:
            return twin
    if kind not in pair.terms.rules.anywhere or is_robots:
        return None
    of_type = [twins for (type_name, _), twins in added.items() if type_name == kind]
    return next((twin for twins in of_type for twin in twins if not _is_robots(twin, pair)), None)


def _is_robots(prim: Usd.Prim, pair: Pair) -> bool:
    return f"{prim.GetPath()}/".startswith(f"{pair.terms.root}/")


def _gone(prim: Usd.Prim, pair: Pair) -> Change:
    path = str(prim.GetPath())
    below = _below_of(prim)
    related = [
        str(target)
        for each in below
        for relationship in each.GetAuthoredRelationships()
        for target in targets_of(relationship)
    ]
    rules = pair.terms.rules
    return Change(
        path,
        str(prim.GetTypeName()),
        absent=_why(pair.stage.GetPrimAtPath(prim.GetPath())),
        count=len(below),
        physics=affects_physics(prim, rules) and not is_light_or_camera(prim),
        related=tuple(dict.fromkeys(related)),
        body=body_of(prim.GetParent(), rules),
    )


def _why(twin: Usd.Prim) -> str:
    if not twin:
        return "missing"
    return "deactivated" if not twin.IsActive() else "only an over without a def"


_Listed = tuple[tuple[Sdf.Path, StarterPrim], ...]
_STARTERS: WeakKeyDictionary[Usd.Stage, _Listed] = WeakKeyDictionary()


@quiet()
def compare_starter(
    starter: Path | Usd.Stage, stage: Path | Usd.Stage, lab: Lab, checkpoint: str
) -> StarterSubject:
    """Compare everything that the lab does not add, both stages composed with their payloads.

    After the first checkpoint the places of rigid bodies are left aside: a stage may have been
    saved after a run. Where the stage lacks an asset, what its own layers say is compared; the rest
    may be in the asset.

    Raises:
        StageError: one of the files cannot be opened.
    """
    rules = lab.submission.starter
    before = open_stage(starter) if isinstance(starter, Path) else starter
    after = open_stage(stage) if isinstance(stage, Path) else stage
    terms = _terms(rules, lab, after, bodies_rest=checkpoint == next(iter(lab.checkpoints)))
    terms = replace(terms, unknown=tuple(asset.prim for asset in find_unresolved(before)))
    pair = Pair(before, after, terms, tuple(_hidden(before, after)), _share_layers(before, after))
    key = ("changes", id(before), id(after), terms.bodies_rest)
    return StarterSubject(rules, cached(key, lambda: tuple(_changes(pair))))


def _terms(rules: StarterRules, lab: Lab, stage: Usd.Stage, *, bodies_rest: bool) -> Terms:
    robot, tolerance = lab.scene.robot, lab.scene.tolerance
    # A stage whose unit is nothing is told so elsewhere; here it only must not divide by it.
    length = tolerance.sensor_position / (UsdGeom.GetStageMetersPerUnit(stage) or 1.0)
    return Terms(
        rules=rules,
        classes=classifier(rules),
        number=tolerance.number,
        mass=tolerance.mass,
        limits=(length, tolerance.sensor_angle, tolerance.scale),
        root=robot.path,
        articulated=tuple(filter(None, (robot.path, robot.articulation.target))),
        bodies_rest=bodies_rest,
    )


def _share_layers(starter: Usd.Stage, stage: Usd.Stage) -> bool:
    return not set(starter.GetUsedLayers()).isdisjoint(stage.GetUsedLayers())


def _hidden(starter: Usd.Stage, stage: Usd.Stage) -> Iterator[str]:
    """Yield the prims at which the stage lacks an asset that the starter has."""
    known = {_signature(missing) for missing in find_unresolved(starter)}
    for missing in find_unresolved(stage):
        if _signature(missing) not in known:
            yield missing.prim


def _signature(missing: UnresolvedAsset) -> tuple[str, str]:
    return missing.prim, missing.asset.rpartition("/")[2]


def _changes(pair: Pair) -> Iterator[Change]:
    gone: list[Usd.Prim] = []
    skipped = None
    for path, was in _listed(pair.starter):
        if skipped is not None and path.HasPrefix(skipped):
            continue
        skipped = None
        if _is_ignored(path, pair):
            skipped = path
            continue
        twin = pair.stage.GetPrimAtPath(path)
        is_hidden = _is_hidden(was.path, pair.hidden)
        if is_there(twin, may_be_undefined=is_hidden):
            yield from pair.changes(was, twin, is_whole=not is_hidden)
            continue
        skipped = path
        if twin or not is_hidden:  # else the missing asset may hold it
            gone.append(was.prim)
    yield from missing_prim_changes(gone, pair)
    yield from added_changes(pair.starter, pair.stage, pair.terms)


def _listed(starter: Usd.Stage) -> _Listed:
    """Return the prims of a starter, read once for as long as it is open."""
    if starter not in _STARTERS:
        _STARTERS[starter] = _list(starter)
    return _STARTERS[starter]


def _list(starter: Usd.Stage) -> _Listed:
    prims = Usd.PrimRange(starter.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return tuple(
        (prim.GetPath(), read_starter_prim(prim)) for prim in prims if not prim.IsPseudoRoot()
    )


def _is_ignored(path: Sdf.Path, pair: Pair) -> bool:
    ignored = pair.terms.rules.ignored_prims
    is_root = path.pathElementCount == 1
    return is_root and any(fnmatchcase(str(path), pattern) for pattern in ignored)


def _is_hidden(path: str, hidden: tuple[str, ...]) -> bool:
    """Whether a missing asset could hold the prim, or what it lacks."""
    return any(path == top or path.startswith(f"{top.rstrip('/')}/") for top in hidden)
