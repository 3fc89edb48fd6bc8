"""Prims of a starter that are not where they were: found elsewhere, or gone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec import Struct
from pxr import Usd, UsdGeom

from lab3_usd.model.changes import Change
from lab3_usd.stage.compare.prims import (
    StarterPrim,
    authored_differences,
    differences,
    read_starter_prim,
)
from lab3_usd.stage.compare.terms import (
    Terms,
    affects_physics,
    body_of,
    is_light_or_camera,
    is_physical,
)
from lab3_usd.stage.read.missing_assets import IS_PRESENT
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
