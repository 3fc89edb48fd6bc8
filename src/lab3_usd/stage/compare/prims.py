"""What differs between one prim of a starter and the same prim of a stage."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.model.changes import Change, Difference
from lab3_usd.model.physics import BODY_ENABLED, KINEMATIC, SCENE
from lab3_usd.stage.compare.values import (
    Class,
    Terms,
    affects_physics,
    applied_schemas,
    authored_place_differences,
    display_value,
    is_authored,
    is_collision_shape,
    is_light_or_camera,
    is_physical,
    pattern,
    place_differences,
    same_value,
)
from lab3_usd.stage.read.properties import targets_of
from lab3_usd.stage.read.transforms import ORDER

_BINDING = "material:binding"
_PURPOSE = "physics"
_SWITCHES = (BODY_ENABLED, KINEMATIC)
_ENDS = ("physics:body0", "physics:body1")


def added_differences(prim: Usd.Prim, twin: Usd.Prim, terms: Terms) -> Iterator[Difference]:
    """Yield what one prim has of physics that the starter's does not."""
    path = str(prim.GetPath())
    if _is_unknown(path, terms):
        return
    is_robots = path == terms.root or path.startswith(f"{terms.root}/")
    idle = () if is_robots or not _stays(twin, terms) else (terms.rules.body, *_SWITCHES)
    before = applied_schemas(prim)
    for api in applied_schemas(twin):
        if api not in (*before, *idle) and api.startswith(terms.rules.acting):
            yield Difference("added", "", "", f"{api} was added", physics=False)
    is_judged = is_robots or is_physical(prim, terms.rules)
    for name in _new_properties(prim, twin):
        if name.startswith(_BINDING):
            yield from _bound(prim, twin, name, terms)
        elif is_judged and name not in idle and _counts(prim, twin, name, terms):
            yield from _property(twin, name, prim, terms)


def _new_properties(prim: Usd.Prim, twin: Usd.Prim) -> Iterator[str]:
    for name in twin.GetAuthoredPropertyNames():
        if not prim.HasProperty(name) or not prim.GetProperty(name).IsAuthored():
            yield name


def _stays(prim: Usd.Prim, terms: Terms) -> bool:
    """Whether the prim is no body, or one that nothing moves."""
    is_off = _value(prim, BODY_ENABLED) is False or _value(prim, KINEMATIC) is True
    return is_off or terms.rules.body not in applied_schemas(prim)


def _is_unknown(path: str, terms: Terms) -> bool:
    return any(f"{path}/".startswith(f"{top.rstrip('/')}/") for top in terms.unknown)


def _counts(prim: Usd.Prim, twin: Usd.Prim, name: str, terms: Terms) -> bool:
    """Whether this is physics, and does not belong to an articulation that came from elsewhere."""
    root_api = terms.rules.articulation[0]
    has_come = root_api in applied_schemas(twin) and root_api not in applied_schemas(prim)
    came_along = has_come and pattern(terms.rules.articulation_properties).match(name)
    return terms.classes(name) == "physics" and not came_along


def _property(twin: Usd.Prim, name: str, prim: Usd.Prim, terms: Terms) -> Iterator[Difference]:
    relationship = twin.GetRelationship(name)
    if relationship:
        targets = targets_of(relationship)
        if targets and not _is_only_scene(targets, twin.GetStage()):
            shown = ", ".join(map(str, targets))
            yield Difference("added", name, "", f"{name} {shown} was added", physics=False)
        return
    fallback = prim.GetAttribute(name)
    if fallback and fallback.Get() is not None:
        return  # what usd-core knows a default of is compared as a value
    value = twin.GetAttribute(name).Get()
    default = dict(terms.rules.neutral).get(name)
    if value is None or (default is not None and same_value(default, value, terms.number)):
        return
    yield Difference("added", name, "", f"{name} {display_value(value)} was added", physics=False)


def _is_only_scene(targets: Collection[Sdf.Path], stage: Usd.Stage) -> bool:
    """Whether a relationship names the one physics scene that the stage has."""
    scenes = [prim.GetPath() for prim in stage.Traverse() if _is_scene(prim)]
    return len(scenes) == 1 and list(targets) == scenes


def _is_scene(prim: Usd.Prim) -> bool:
    return bool(Usd.Prim.GetTypeName(prim) == SCENE)


def _bound(prim: Usd.Prim, twin: Usd.Prim, name: str, terms: Terms) -> Iterator[Difference]:
    """Yield a material that other shapes slide on than before, at the prim that binds it."""
    for shape in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()):
        if terms.rules.collision not in applied_schemas(shape):
            continue
        other = twin.GetStage().GetPrimAtPath(shape.GetPath())
        was, now = _material(shape, terms), _material(other, terms) if other else ""
        if was != now:
            message = f"{name} makes {shape.GetPath()} slide as {now or 'by default'}"
            yield Difference("added", name, was, message, physics=False)
            return


def _material(shape: Usd.Prim, terms: Terms) -> str:
    """Return the path of the material by which a shape slides; '' for none."""
    from pxr import UsdShade

    material, _ = UsdShade.MaterialBindingAPI(shape).ComputeBoundMaterial(_PURPOSE)
    found = material.GetPrim() if material else None
    return str(found.GetPath()) if found and is_physical(found, terms.rules) else ""


def added_changes(starter: Usd.Stage, stage: Usd.Stage, terms: Terms) -> Iterator[Change]:
    """Yield each prim that the starter does not have and that changes how its robot moves."""
    added = list(_added(starter, stage, terms))
    if not added:
        return  # as of most stages, for which nothing else need be worked out
    names = {(prim.GetTypeName(), prim.GetName()) for prim in _gone(starter, stage)}
    scenes = [sum(map(_is_scene, each.Traverse())) for each in (starter, stage)]
    for prim in added:
        kind = str(prim.GetTypeName())
        if (kind, prim.GetName()) in names or _is_unknown(str(prim.GetPath()), terms):
            continue  # it was moved here, or comes from an asset that the starter lacks
        if scenes[1] > scenes[0] or _acts(prim, kind, terms):
            message = f"{kind or 'prim'} was added"
            found = Difference("added", "", "", message, physics=False)
            yield Change(str(prim.GetPath()), kind, (found,))


def _added(starter: Usd.Stage, stage: Usd.Stage, terms: Terms) -> Iterator[Usd.Prim]:
    """Yield the prims at paths that the starter does not have, if they may act on its robot."""
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if starter.GetPrimAtPath(Usd.Prim.GetPath(prim)):
            continue
        if _is_scene(prim) or _acts(prim, str(Usd.Prim.GetTypeName(prim)), terms):
            yield prim


def _gone(starter: Usd.Stage, stage: Usd.Stage) -> Iterator[Usd.Prim]:
    for prim in Usd.PrimRange(starter.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        twin = stage.GetPrimAtPath(prim.GetPath())
        if not prim.IsPseudoRoot() and not (twin and twin.IsActive() and twin.IsDefined()):
            yield prim


def _acts(prim: Usd.Prim, kind: str, terms: Terms) -> bool:
    """Whether the prim filters collisions, joins the robot, or is a shape or body of it."""
    if kind == "PhysicsCollisionGroup":
        targets = _targets(prim, "physics:filteredGroups")
        return bool(targets) or _value(prim, "physics:invertFilteredGroups") is True
    if kind.endswith("Joint"):
        is_on = _value(prim, "physics:jointEnabled") is not False
        return is_on and any(
            _is_robots(target, terms) for name in _ENDS for target in _targets(prim, name)
        )
    if not _is_robots(str(Usd.Prim.GetPath(prim)), terms):
        return False
    is_acting = any(api.startswith(terms.rules.acting) for api in applied_schemas(prim))
    return is_acting and _value(prim, "physics:collisionEnabled") is not False


def _is_robots(path: str, terms: Terms) -> bool:
    return path.startswith(f"{terms.root}/")


def _value(prim: Usd.Prim, name: str) -> Any:
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None


def _targets(prim: Usd.Prim, name: str) -> list[str]:
    return [str(path) for path in targets_of(prim.GetRelationship(name))]


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
        {
            getauthoredattribute.GetName(): getauthoredattribute.Get()
            for getauthoredattribute in prim.GetAuthoredAttributes()
        },
        {
            getauthoredrelationship.GetName(): targets_of(getauthoredrelationship)
            for getauthoredrelationship in prim.GetAuthoredRelationships()
        },
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
            found.extend(_changed_property(prim, twin, name, kind, terms))
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
    found += [schema for schema in schemas if dropped is None or schema.was in dropped]
    poses = []
    for name in _unequal(was, twin, twin.GetAuthoredPropertyNames()):
        kind = terms.classes(name)
        if not is_authored(twin, name):
            continue
        if kind == "pose":
            poses.append(name)
        elif kind != "never":
            found.extend(_changed_property(prim, twin, name, kind, terms))
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
    before: Any,
    after: Any,
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


def _changed_property(
    prim: Usd.Prim, twin: Usd.Prim, name: str, kind: Class, terms: Terms
) -> Iterator[Difference]:
    attribute = prim.GetAttribute(name)
    if not attribute:
        yield from _changed_targets(prim, twin, name, kind)
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


def _changed_targets(
    prim: Usd.Prim, twin: Usd.Prim, name: str, kind: Class
) -> Iterator[Difference]:
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
