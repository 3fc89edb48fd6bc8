"""Walks through two composed stages: pairs their prims, and yields raw differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, Literal, TypeAlias
from weakref import WeakKeyDictionary

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.model.prims import is_at_or_below
from lab3_usd.stage.read.properties import targets_of

_ROOT = "/"
PRESENT = Usd.TraverseInstanceProxies()
Signature = tuple[str, str]


class PrimRecord(Struct, frozen=True, eq=False, dict=True):
    """A prim of the first stage: its type, schemas and attributes in the order of `names`.

    One starter is compared with the stages of a whole class, so it is read once, and what is below
    a prim when that is first asked for.
    """

    prim: Usd.Prim
    path: str
    name: str
    kind: str
    form: Any
    names: list[str]
    values: Mapping[str, Any]
    targets: Mapping[str, list[Sdf.Path]]

    @cached_property
    def children(self) -> tuple[PrimRecord, ...]:
        """The prims below this one."""
        return tuple(map(read_record, self.prim.GetFilteredChildren(PRESENT)))


class Scope(Struct, frozen=True):
    """Which prims are left out: those of some types, and root prims whose paths fit a pattern.

    Below the `hidden` prims the second stage lacks an asset, which may hold what is not there.
    """

    roots: tuple[str, ...] = ()
    types: frozenset[str] = frozenset()
    hidden: tuple[str, ...] = ()


class PairedPrim(Struct, frozen=True, eq=False):
    """A prim that both stages have; with `is_hidden`, an asset of the second is missing here."""

    was: PrimRecord
    now: Usd.Prim
    is_hidden: bool = False


class GonePrim(Struct, frozen=True, eq=False):
    """A prim that the second stage lacks, with all that is below it."""

    was: PrimRecord


class NewPrim(Struct, frozen=True, eq=False):
    """A prim that only the second stage has, with all that is below it."""

    now: Usd.Prim


ComparedPrim: TypeAlias = PairedPrim | GonePrim | NewPrim


class RawDifference(Struct, frozen=True, eq=False):
    """One bitwise difference between two prims.

    `name` is that of a schema or a property; `was` and `now` are what USD returns, None for
    nothing. With `is_new`, only the second stage writes the property, maybe as the first has it by
    default.
    """

    kind: Literal["type", "schema", "value", "targets"]
    name: str
    was: Any
    now: Any
    is_new: bool = False


_RECORDS: WeakKeyDictionary[Usd.Stage, PrimRecord] = WeakKeyDictionary()


def read_records(stage: Usd.Stage) -> PrimRecord:
    """Return the root of a stage, of which every prim is read once for as long as it is open."""
    if stage not in _RECORDS:
        _RECORDS[stage] = read_record(stage.GetPseudoRoot())
    return _RECORDS[stage]


def read_record(prim: Usd.Prim) -> PrimRecord:
    """Return what a prim is and holds."""
    attributes = Usd.Prim.GetAuthoredAttributes(prim)
    relationships = Usd.Prim.GetAuthoredRelationships(prim)
    return PrimRecord(
        prim,
        str(Usd.Prim.GetPath(prim)),
        Usd.Prim.GetName(prim),
        Usd.Prim.GetTypeName(prim),
        Usd.Prim.GetPrimTypeInfo(prim),
        Usd.Prim.GetAuthoredPropertyNames(prim),
        {Usd.Attribute.GetName(each): Usd.Attribute.Get(each) for each in attributes},
        {Usd.Relationship.GetName(each): targets_of(each) for each in relationships},
    )


def compare_prims(
    was: PrimRecord,
    now: Usd.Prim,
    scope: Scope,
    is_alike: Callable[[PairedPrim], bool] = lambda _: False,
) -> Iterator[ComparedPrim]:
    """Yield every prim below `was` and `now`: in pairs by their names, or as gone or new.

    Below a pair, what is gone or new comes first, then the pairs, each with all below it. A prim
    that is gone or new stands for all below it, and so does a pair that `is_alike`.
    """
    twins = children_in_scope(now, scope)
    is_filtered = was.path == _ROOT or bool(scope.types)
    pairs = []
    for record in was.children:
        if is_filtered and not _is_in_scope(record.prim, record.kind, scope):
            continue
        twin = twins.pop(record.name, None)
        is_hidden = bool(scope.hidden) and any(
            is_at_or_below(record.path, top) for top in scope.hidden
        )
        if twin is None and is_hidden:
            over = Usd.Prim.GetStage(now).GetPrimAtPath(record.path)
            if not over:
                continue  # the missing asset may hold it
            if over.IsActive() and not over.IsAbstract():
                twin = over  # what defines it may be in the missing asset
        if twin is None:
            yield GonePrim(record)
        else:
            pairs.append(PairedPrim(record, twin, is_hidden))
    for twin in twins.values():
        yield NewPrim(twin)
    for pair in pairs:
        yield pair
        if not is_alike(pair):
            yield from compare_prims(pair.was, pair.now, scope, is_alike)


def children_in_scope(prim: Usd.Prim, scope: Scope) -> dict[str, Usd.Prim]:
    """Return the children of a prim that are compared, by name."""
    is_filtered = bool(scope.types) or Usd.Prim.IsPseudoRoot(prim)
    return {
        Usd.Prim.GetName(child): child
        for child in Usd.Prim.GetFilteredChildren(prim, PRESENT)
        if not is_filtered or _is_in_scope(child, Usd.Prim.GetTypeName(child), scope)
    }


def _is_in_scope(prim: Usd.Prim, kind: str, scope: Scope) -> bool:
    if kind in scope.types:
        return False
    path = Usd.Prim.GetPath(prim)
    is_root = path.pathElementCount == 1
    return not (is_root and any(fnmatchcase(str(path), pattern) for pattern in scope.roots))


def is_aside(prim: Usd.Prim, scope: Scope) -> bool:
    """Whether a prim, or one above it, is not compared."""
    above = prim
    while not above.IsPseudoRoot():
        if not _is_in_scope(above, str(above.GetTypeName()), scope):
            return True
        above = above.GetParent()
    return False


def signature(prim: Usd.Prim) -> Signature:
    """Return the type and the name of a prim: one that is gone has moved where they are new."""
    return str(Usd.Prim.GetTypeName(prim)), str(Usd.Prim.GetName(prim))


def raw_differences(was: PrimRecord, now: Usd.Prim) -> Iterator[RawDifference]:
    """Yield everything that `now` is or holds, and `was` not, or the other way round.

    Most prims have no difference, so this must be quick.
    """
    form = Usd.Prim.GetPrimTypeInfo(now)
    if form != was.form:  # which tells type and schemas
        yield from _form_differences(was, now, form)
    names, attributes = Usd.Prim.GetAuthoredPropertyNames(now), Usd.Prim.GetAuthoredAttributes(now)
    if was.names == names and len(was.values) == len(attributes):
        values = [*map(Usd.Attribute.Get, attributes)]
        if values != [*was.values.values()]:
            for (name, old), new in zip(was.values.items(), values, strict=True):
                if old != new:
                    yield RawDifference("value", name, old, new)
        for name, old in was.targets.items():
            targets = targets_of(Usd.Prim.GetRelationship(now, name))
            if old != targets:
                yield RawDifference("targets", name, old, targets)
    else:
        yield from _property_differences(was, now, names)


def _form_differences(was: PrimRecord, now: Usd.Prim, form: Any) -> Iterator[RawDifference]:
    kind = str(Usd.Prim.GetTypeName(now))
    if was.kind != kind:
        yield RawDifference("type", "", was.kind, kind)
    before, after = was.form.GetAppliedAPISchemas(), form.GetAppliedAPISchemas()
    for name in before:
        if name not in after:
            yield RawDifference("schema", str(name), str(name), None)
    for name in after:
        if name not in before:
            yield RawDifference("schema", str(name), None, str(name))


def _property_differences(
    was: PrimRecord, now: Usd.Prim, names: list[str]
) -> Iterator[RawDifference]:
    """Yield what differs of properties where the second prim does not write the same ones."""
    for name in was.names:
        if name in was.values:
            difference = RawDifference("value", name, was.values[name], value_of(now, name))
        else:
            targets = targets_of(now.GetRelationship(name))
            difference = RawDifference("targets", name, was.targets[name], targets)
        if difference.was != difference.now:
            yield difference
    for name in names:
        if name not in was.names:
            yield _new_property(was.prim, now, name)


def _new_property(was: Usd.Prim, now: Usd.Prim, name: str) -> RawDifference:
    relationship = now.GetRelationship(name)
    if relationship:
        targets = targets_of(was.GetRelationship(name))
        return RawDifference("targets", name, targets, targets_of(relationship), is_new=True)
    return RawDifference("value", name, value_of(was, name), value_of(now, name), is_new=True)


def value_of(prim: Usd.Prim, name: str) -> Any:
    """Return the value of an attribute, None where it has none."""
    attribute = Usd.Prim.GetAttribute(prim, name)
    return attribute.Get() if attribute else None
