"""Physics that a stage has beyond its starter, where it changes how the robot moves."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.model.changes import Change, Difference
from lab3_usd.model.physics import BODY_ENABLED, KINEMATIC, SCENE
from lab3_usd.stage.compare.terms import Terms, applied_schemas, is_physical, pattern
from lab3_usd.stage.compare.values import display_value, same_value
from lab3_usd.stage.read.properties import targets_of

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
    from pxr import UsdShade  # noqa: PLC0415 - only where a binding was added

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
            _is_robots(each, terms) for name in _ENDS for each in _targets(prim, name)
        )
    if not _is_robots(str(Usd.Prim.GetPath(prim)), terms):
        return False
    is_acting = any(api.startswith(terms.rules.acting) for api in applied_schemas(prim))
    return is_acting and _value(prim, "physics:collisionEnabled") is not False


def _is_robots(path: str, terms: Terms) -> bool:
    return path.startswith(f"{terms.root}/")


def _value(prim: Usd.Prim, name: str) -> Any:  # noqa: ANN401 - what USD holds
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None


def _targets(prim: Usd.Prim, name: str) -> list[str]:
    return [str(path) for path in targets_of(prim.GetRelationship(name))]
