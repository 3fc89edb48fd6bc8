"""Compares a stage with the starter it was made from, as composed, and returns plain data."""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from weakref import WeakKeyDictionary

from msgspec.structs import replace
from pxr import Sdf, Usd, UsdGeom

from lab3_usd.model.changes import Change, StarterSubject
from lab3_usd.model.stage import UnresolvedAsset
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import StarterRules
from lab3_usd.stage.compare.added import added_changes
from lab3_usd.stage.compare.missing_prims import Pair, is_there, missing_prim_changes
from lab3_usd.stage.compare.prims import StarterPrim, read_starter_prim
from lab3_usd.stage.compare.terms import Terms, classifier
from lab3_usd.stage.read.missing_assets import find_unresolved
from lab3_usd.stage.read.opening import cached, open_stage, quiet

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
    terms = replace(terms, unknown=tuple(each.prim for each in find_unresolved(before)))
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
