"""Compares a stage with the starter it was made from, as composed, and returns plain data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase

from msgspec import Struct
from msgspec.structs import replace
from pxr import Usd, UsdGeom

from lab3_usd.model.changes import Change, StarterSubject
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import UnresolvedAsset
from lab3_usd.model.transforms import PlaceTolerance
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.props import PropSpec
from lab3_usd.stage.compare.compared_prims import added_changes, prim_differences
from lab3_usd.stage.compare.pairs import (
    PRESENT,
    GonePrim,
    PairedPrim,
    PrimRecord,
    Scope,
    Signature,
    compare_prims,
    read_records,
    signature,
)
from lab3_usd.stage.compare.value_terms import (
    Terms,
    affects_physics,
    body_of,
    classifier,
    is_light_or_camera,
    is_on_robot,
    is_physical,
)
from lab3_usd.stage.read.assets import IS_PRESENT, find_unresolved
from lab3_usd.stage.read.opening import cached, quiet

_POSE = "xformOp"
_NewPrims = dict[Signature, list[Usd.Prim]]


class _Comparison(Struct, frozen=True):
    """A starter, the stage made from it, and what is compared of them."""

    starter: Usd.Stage
    stage: Usd.Stage
    terms: Terms
    scope: Scope
    share_layers: bool


@quiet()
def compare_starter(
    starter: Usd.Stage, stage: Usd.Stage, lab: Lab, checkpoint: str
) -> StarterSubject:
    """Compare everything that the lab does not add, both stages composed with their payloads.

    After the first checkpoint the places of rigid bodies are left out: a stage may have been
    saved after a run. Where the stage lacks an asset, what its own layers say is compared; the rest
    may be in the asset.
    """
    rules = lab.submission.starter
    terms = _terms(lab, starter, stage, bodies_rest=checkpoint == lab.first)
    scope = Scope(rules.ignored_prims, hidden=tuple(_hidden(starter, stage)))
    share_layers = not set(starter.GetUsedLayers()).isdisjoint(stage.GetUsedLayers())
    comparison = _Comparison(starter, stage, terms, scope, share_layers)
    key = ("changes", id(starter), id(stage), terms.bodies_rest)
    changes = cached(key, lambda: tuple(_changes(comparison)))
    point = lab.checkpoints[checkpoint]
    props = lab.props_at(point).values()
    added = [prop for prop in props if prop.since]
    kept = (  # without prims that the checkpoint takes away, or adds there or above
        change
        for change in changes
        if not point.is_removed(change.prim)
        and not any(prop.stands_at(path) for path in upwards(change.prim) for prop in added)
    )
    changed = [prop for prop in props if prop.until and not prop.since]
    if changed:
        kept = (each for change in kept if (each := _without_asked(change, changed)) is not None)
    return StarterSubject(rules, tuple(kept) if point.removed or added or changed else changes)


def _without_asked(change: Change, props: Iterable[PropSpec]) -> Change | None:
    """Return a change without the properties that some checkpoint changes; None if nothing else."""
    asked = {name for prop in props if prop.stands_at(change.prim) for name in prop.properties}
    if any(prop.stands_at(change.prim) and prop.place is not None for prop in props):
        asked |= {each.property for each in change.differences if each.property.startswith(_POSE)}
    kept = tuple(each for each in change.differences if each.property not in asked)
    return replace(change, differences=kept) if kept or change.absent else None


def _terms(lab: Lab, starter: Usd.Stage, stage: Usd.Stage, *, bodies_rest: bool) -> Terms:
    robots, tolerance = lab.scene.robots, lab.scene.tolerance
    rules = lab.submission.starter
    # A stage without a unit is reported elsewhere; here it only must not divide by it.
    length = tolerance.sensor_position / (UsdGeom.GetStageMetersPerUnit(stage) or 1.0)
    return Terms(
        rules=rules,
        classes=classifier(rules),
        place=PlaceTolerance(length, tolerance.sensor_angle, tolerance.scale),
        tolerances=tolerance,
        roots=tuple(robot.path for robot in robots),
        articulated=tuple(
            tuple(filter(None, (robot.path, robot.articulation.target))) for robot in robots
        ),
        bodies_rest=bodies_rest,
        unknown=tuple(asset.prim for asset in find_unresolved(starter)),
    )


def _hidden(starter: Usd.Stage, stage: Usd.Stage) -> Iterator[str]:
    """Yield the prims at which the stage lacks an asset that the starter has."""
    missing_before = {_identity(missing) for missing in find_unresolved(starter)}
    for missing in find_unresolved(stage):
        if _identity(missing) not in missing_before:
            yield missing.prim


def _identity(missing: UnresolvedAsset) -> tuple[str, str]:
    return missing.prim, missing.asset.rpartition("/")[2]


def _changes(comparison: _Comparison) -> Iterator[Change]:
    starter, stage, scope = comparison.starter, comparison.stage, comparison.scope
    gone: list[PrimRecord] = []
    # Data of the application is left out, unless it acts on the robot.
    new = [
        prim
        for prim in stage.GetPseudoRoot().GetChildren()
        if any(fnmatchcase(str(prim.GetPath()), pattern) for pattern in scope.roots)
    ]
    for prim in compare_prims(read_records(starter), stage.GetPseudoRoot(), scope):
        if isinstance(prim, PairedPrim):
            yield from _prim_changes(prim, comparison)
        elif isinstance(prim, GonePrim):
            gone.append(prim.was)
        else:
            new.append(prim.now)
    gone = [record for record in gone if not _is_library(record, comparison)]
    if gone:
        # An asset that is missing hides nothing of what stands elsewhere.
        elsewhere = replace(comparison, scope=replace(scope, hidden=()))
        new_prims = _new_prims(comparison)
        for record in gone:
            yield from _gone_changes(record, new_prims, elsewhere)
    yield from added_changes(new, starter, stage, comparison.terms)


def _prim_changes(
    pair: PairedPrim, comparison: _Comparison, *, moved: bool = False
) -> Iterator[Change]:
    """Yield what changed of one prim: at most one change."""
    prim, twin, terms = pair.was.prim, pair.now, comparison.terms
    if comparison.share_layers and not moved and prim.GetPrimStack() == twin.GetPrimStack():
        return  # both come from the same places of the same files
    changed = prim_differences(pair, terms, same_parent=not moved)
    if changed:
        body = body_of(prim, terms.rules)
        yield Change(str(twin.GetPath()), pair.was.kind, tuple(changed), body=body)


def _is_library(record: PrimRecord, comparison: _Comparison) -> bool:
    """Whether the prim only holds shapes that links refer to: they are compared at the links."""
    rules = comparison.terms.rules
    return record.name in rules.library and not body_of(record.prim, rules)


def _new_prims(comparison: _Comparison) -> _NewPrims:
    """Return the prims that the starter does not have, by type and name."""
    new_prims: _NewPrims = {}
    for prim in Usd.PrimRange(comparison.stage.GetPseudoRoot(), PRESENT):
        twin = comparison.starter.GetPrimAtPath(prim.GetPath())
        if not (twin and IS_PRESENT(twin)):
            new_prims.setdefault(signature(prim), []).append(prim)
    return new_prims


def _gone_changes(
    record: PrimRecord, new_prims: _NewPrims, comparison: _Comparison
) -> Iterator[Change]:
    """Yield one change for a prim that vanished, with all that stood below it.

    What was moved elsewhere is compared there; what is recognised by its type need not even
    keep its name.
    """
    twin = _moved_to(record, new_prims, comparison.terms)
    if twin is not None:
        yield from _prim_changes(PairedPrim(record, twin), comparison, moved=True)
        for prim in compare_prims(record, twin, comparison.scope):
            if isinstance(prim, PairedPrim):
                yield from _prim_changes(prim, comparison)
            elif isinstance(prim, GonePrim):
                yield from _gone_changes(prim.was, new_prims, comparison)
        return
    prim, rules = record.prim, comparison.terms.rules
    is_container = not is_physical(prim, rules) and not prim.IsA(UsdGeom.Gprim)
    if is_container and any(
        _moved_to(below, new_prims, comparison.terms) for below in _at_and_below(record)
    ):
        for child in record.children:
            yield from _gone_changes(child, new_prims, comparison)
    elif not _is_library(record, comparison):
        yield _absence(record, comparison)


def _moved_to(record: PrimRecord, new_prims: _NewPrims, terms: Terms) -> Usd.Prim | None:
    """Return the prim that this one became: of its type and name, else of its type alone."""
    is_robots = is_on_robot(record.path, terms)

    def is_beside(twin: Usd.Prim) -> bool:
        return is_on_robot(str(twin.GetPath()), terms) == is_robots

    for twin in new_prims.get((record.kind, record.name), []):
        if is_beside(twin):
            return twin
    if record.kind not in terms.rules.anywhere or is_robots:
        return None
    of_type = (twins for (kind, _), twins in new_prims.items() if kind == record.kind)
    return next((twin for twins in of_type for twin in twins if is_beside(twin)), None)


def _at_and_below(record: PrimRecord) -> Iterator[PrimRecord]:
    yield record
    for child in record.children:
        yield from _at_and_below(child)


def _absence(record: PrimRecord, comparison: _Comparison) -> Change:
    rules, below = comparison.terms.rules, [*_at_and_below(record)]
    targets = [str(path) for prim in below for paths in prim.targets.values() for path in paths]
    twin = comparison.stage.GetPrimAtPath(record.path)
    absent = "missing"
    if twin:
        absent = "deactivated" if not twin.IsActive() else "only an over without a def"
    return Change(
        record.path,
        record.kind,
        absent=absent,
        count=len(below),
        physics=affects_physics(record.prim, rules) and not is_light_or_camera(record.prim),
        related=tuple(dict.fromkeys(targets)),
        body=body_of(record.prim.GetParent(), rules),
    )
