"""What differs between one prim of a starter and the same prim of a stage made from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.model.changes import Difference
from lab3_usd.stage.compare.added import added_differences
from lab3_usd.stage.compare.placement import (
    authored_place_differences,
    is_authored,
    place_differences,
)
from lab3_usd.stage.compare.terms import (
    Class,
    Terms,
    affects_physics,
    applied_schemas,
    is_collision_shape,
    is_light_or_camera,
    pattern,
)
from lab3_usd.stage.compare.values import display_value, same_value
from lab3_usd.stage.read.properties import targets_of
from lab3_usd.stage.read.transforms import ORDER

_SCHEMAS = "apiSchemas"


class StarterPrim(Struct, frozen=True, eq=False):
    """What one prim of a starter is and holds: attributes in the order of `names`.

    One starter is compared with the stages of a whole class, so it is asked once.
    """

    prim: Usd.Prim
    path: str
    kind: str
    form: Any
    names: list[str]
    values: Mapping[str, Any]
    targets: Mapping[str, list[Sdf.Path]]


def read_starter_prim(prim: Usd.Prim) -> StarterPrim:
    """Read a prim of a starter."""
    return StarterPrim(
        prim,
        str(prim.GetPath()),
        prim.GetTypeName(),
        prim.GetPrimTypeInfo(),
        prim.GetAuthoredPropertyNames(),
        {each.GetName(): each.Get() for each in prim.GetAuthoredAttributes()},
        {each.GetName(): targets_of(each) for each in prim.GetAuthoredRelationships()},
    )


def differences(
    was: StarterPrim, twin: Usd.Prim, terms: Terms, *, same_parent: bool = True
) -> list[Difference]:
    """Return everything in which `twin` is not as the starter's prim, additions left aside.

    With `same_parent` False the two stand at different paths, and are compared in the world.
    """
    prim, form = was.prim, Usd.Prim.GetPrimTypeInfo(twin)
    found: list[Difference] = []
    if form != was.form:  # which tells type and schemas
        found = [*_type(was.kind, twin, prim, terms), *_schemas(was.form, form, prim, twin, terms)]
    is_posed, names = not same_parent, Usd.Prim.GetAuthoredPropertyNames(twin)
    for name in _unequal(was, twin, names):
        kind = terms.classes(name)
        if kind == "pose":
            is_posed = True
        elif kind != "never":
            found.extend(_property(prim, twin, name, kind, terms))
    if is_posed and was.path != terms.root:  # whose own place has a rule of its own
        found.extend(place_differences(prim, twin, terms, same_parent=same_parent))
    if form != was.form or names != was.names:
        found.extend(added_differences(prim, twin, terms))
    return found


def authored_differences(was: StarterPrim, twin: Usd.Prim, terms: Terms) -> list[Difference]:
    """Return what the layers at hand say of `twin` otherwise than the starter.

    An asset of `twin` is missing: values, schemas and targets that no layer states may be in it.
    """
    prim, form = was.prim, twin.GetPrimTypeInfo()
    found = [*_type(was.kind, twin, prim, terms)] if twin.GetTypeName() else []
    dropped = _dropped_schemas(twin)
    schemas = _schemas(was.form, form, prim, twin, terms)
    found += [each for each in schemas if dropped is None or each.was in dropped]
    poses = []
    for name in _unequal(was, twin, twin.GetAuthoredPropertyNames()):
        kind = terms.classes(name)
        if not is_authored(twin, name):
            continue
        if kind == "pose":
            poses.append(name)
        elif kind != "never":
            found.extend(_property(prim, twin, name, kind, terms))
    if poses and was.path != terms.root:
        found.extend(authored_place_differences(prim, twin, poses, terms))
    found.extend(added_differences(prim, twin, terms))
    return found


def _dropped_schemas(prim: Usd.Prim) -> set[str] | None:
    """Return the schemas that layers delete; None where one lists all that there are."""
    dropped: set[str] = set()
    for spec in prim.GetPrimStack():
        edits = spec.GetInfo(_SCHEMAS)
        if edits.isExplicit and spec.HasInfo(_SCHEMAS):
            return None
        dropped.update(edits.deletedItems)
    return dropped


def _unequal(was: StarterPrim, twin: Usd.Prim, others: list[str]) -> Iterator[str]:
    """Yield the properties that are not the same to the bit; most are, so this must be quick.

    `others` are the names of those of `twin`.
    """
    attributes = Usd.Prim.GetAuthoredAttributes(twin)
    if was.names == others and len(was.values) == len(attributes):
        values = [*map(Usd.Attribute.Get, attributes)]
        if values != [*was.values.values()]:
            pairs = zip(was.values.items(), values, strict=True)
            yield from (name for (name, value), other in pairs if value != other)
        for name, paths in was.targets.items():
            other = Usd.Prim.GetRelationship(twin, name)
            if not other or paths != targets_of(other):
                yield name
        return
    for name in was.names:
        other = Usd.Prim.GetAttribute(twin, name)
        if name not in was.values or not other or was.values[name] != other.Get():
            yield name
    # Switching a collision off writes what the starter left at its default; so does the first move.
    added = (name for name in others if name not in was.names)
    yield from (name for name in added if name == ORDER or _has_default(was.prim, name))


def _has_default(prim: Usd.Prim, name: str) -> bool:
    attribute = prim.GetAttribute(name)
    return bool(attribute) and attribute.Get() is not None


def _type(was: str, twin: Usd.Prim, prim: Usd.Prim, terms: Terms) -> Iterator[Difference]:
    now = twin.GetTypeName()
    if was != now and was:
        physics = affects_physics(prim, terms.rules)
        yield Difference("type", "", str(was), str(now) or "no type", physics=physics)


def _schemas(
    before: Any,  # noqa: ANN401 - pxr has no types
    after: Any,  # noqa: ANN401
    prim: Usd.Prim,
    twin: Usd.Prim,
    terms: Terms,
) -> Iterator[Difference]:
    was, now = before.GetAppliedAPISchemas(), after.GetAppliedAPISchemas()
    for name in was:
        if name in now or terms.classes(name) == "never" or _is_elsewhere(name, prim, twin, terms):
            continue
        physics = name.startswith(terms.rules.physics_names)
        yield Difference("schema", "", str(name), "removed", physics=physics)


def _is_elsewhere(api: str, prim: Usd.Prim, twin: Usd.Prim, terms: Terms) -> bool:
    """Whether the schema went with the articulation root to the other prim that may carry it."""
    path, (root_api, *_) = str(prim.GetPath()), terms.rules.articulation
    if api not in terms.rules.articulation or path not in terms.articulated:
        return False
    others = [twin.GetStage().GetPrimAtPath(each) for each in terms.articulated if each != path]
    return any(other and root_api in applied_schemas(other) for other in others)


def _property(
    prim: Usd.Prim, twin: Usd.Prim, name: str, kind: Class, terms: Terms
) -> Iterator[Difference]:
    attribute = prim.GetAttribute(name)
    if not attribute:
        yield from _targets(prim, twin, name, kind)
        return
    other = twin.GetAttribute(name)
    was, now = attribute.Get(), other.Get() if other else None
    if now is None and other.HasAuthoredValueOpinion():  # a block leaves what the schema says
        now = twin.GetPrimDefinition().GetAttributeFallbackValue(name)
    if was is None or was == now:
        return
    tolerance = terms.mass if name in terms.rules.masses else terms.number
    if same_value(was, now, tolerance) or _is_excused(prim, twin, name, kind, terms):
        return
    physics = kind == "physics" or (kind == "shape" and is_collision_shape(prim, terms.rules))
    shown = display_value(now) if now is not None else "not set"
    yield Difference(
        "physics" if physics else "look", name, display_value(was), shown, physics=physics
    )


def _is_excused(prim: Usd.Prim, twin: Usd.Prim, name: str, kind: Class, terms: Terms) -> bool:
    """Whether a difference counts for nothing: looks of a shape, or an articulation elsewhere."""
    if kind == "look":
        return not is_light_or_camera(prim)
    is_of_articulation = pattern(terms.rules.articulation_properties).match(name)
    root_api = terms.rules.articulation[0]
    return is_of_articulation is not None and _is_elsewhere(root_api, prim, twin, terms)


def _targets(prim: Usd.Prim, twin: Usd.Prim, name: str, kind: Class) -> Iterator[Difference]:
    relationship = prim.GetRelationship(name)
    if not relationship or not relationship.HasAuthoredTargets():
        return
    other = twin.GetRelationship(name)
    was, now = targets_of(relationship), targets_of(other)
    if was == now or (kind == "look" and not is_light_or_camera(prim)):
        return
    if sorted(_found(was, now, twin.GetStage())) != sorted(map(str, now)):
        physics = kind == "physics"
        before, after = (", ".join(map(str, paths)) or "no prim" for paths in (was, now))
        yield Difference("physics" if physics else "look", name, before, after, physics)


def _found(was: list[Sdf.Path], now: list[Sdf.Path], stage: Usd.Stage) -> list[str]:
    """Return the old targets as the stage names them: what moved elsewhere goes by its name."""
    moved = {path.name: str(path) for path in now}
    return [
        moved.get(path.name, str(path)) if not stage.GetPrimAtPath(path) else str(path)
        for path in was
    ]
