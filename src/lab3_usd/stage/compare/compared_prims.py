"""The relevant differences between a prim of a starter and the same prim of a stage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pxr import Usd

from lab3_usd.model.changes import Change, Difference
from lab3_usd.model.physics import BODY_ENABLED, KINEMATIC, SCENE, still_by
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.traction import BINDING
from lab3_usd.stage.compare.pairs import (
    PRESENT,
    PairedPrim,
    PrimRecord,
    RawDifference,
    raw_differences,
    signature,
    value_of,
)
from lab3_usd.stage.compare.value_terms import (
    Class,
    Terms,
    affects_physics,
    applied_schemas,
    authored_place_differences,
    display_value,
    is_authored,
    is_collision_shape,
    is_light_or_camera,
    is_on_robot,
    is_physical,
    pattern,
    place_differences,
    same_usd_value,
)
from lab3_usd.stage.read.prim_transforms import ORDER
from lab3_usd.stage.read.properties import targets_of

_PURPOSE = "physics"
_SWITCHES = (BODY_ENABLED, KINEMATIC)
_ENDS = ("physics:body0", "physics:body1")
_SCHEMAS = "apiSchemas"


def prim_differences(pair: PairedPrim, terms: Terms, *, same_parent: bool) -> list[Difference]:
    """Return all differences between the prim of the stage and the starter's.

    With `same_parent` False the two stand at different paths, and are compared in the world. Where
    an asset of the prim is missing, what the layers at hand say is compared: values, schemas and
    targets that no layer states may be in the asset.
    """
    was, now = pair.was, pair.now
    raw = [*raw_differences(was, now)]
    if pair.is_hidden and raw:
        raw = _stated(raw, now)
    changed: list[Difference] = []
    poses: list[str] = []
    for difference in raw:
        if difference.kind == "type":
            if difference.was:
                kinds = (difference.was, difference.now or "no type")
                physics = affects_physics(was.prim, terms.rules)
                changed.append(Difference("type", "", *kinds, physics=physics))
        elif difference.kind == "schema":
            changed.extend(_removed_schema(difference, was.prim, now, terms))
        elif not difference.is_new or difference.name == ORDER or _has_default(difference):
            # Switching a collision off writes what the starter left at its default; so does the
            # first move.
            kind = terms.classes(difference.name)
            if kind == "pose":
                poses.append(difference.name)
            elif kind != "never":
                changed.extend(_changed_property(difference, kind, was.prim, now, terms))
    if was.path not in terms.roots and (poses or not same_parent):  # its own place has its own rule
        if pair.is_hidden:
            changed.extend(authored_place_differences(was.prim, now, poses, terms))
        else:
            changed.extend(place_differences(was.prim, now, terms, same_parent=same_parent))
    if raw and not is_unknown(was.path, terms):
        changed.extend(_added_differences(raw, was, now, terms))
    return changed


def _stated(raw: list[RawDifference], now: Usd.Prim) -> list[RawDifference]:
    """Return the differences that a layer at hand makes."""
    dropped = _dropped_schemas(now)

    def is_stated(difference: RawDifference) -> bool:
        if difference.kind == "type":
            return bool(difference.now)
        if difference.kind == "schema":
            return difference.was is None or dropped is None or difference.name in dropped
        return difference.is_new or is_authored(now, difference.name)

    return [difference for difference in raw if is_stated(difference)]


def _dropped_schemas(prim: Usd.Prim) -> set[str] | None:
    """Return the schemas that layers delete; None where one lists all that there are."""
    dropped: set[str] = set()
    for spec in prim.GetPrimStack():
        edits = spec.GetInfo(_SCHEMAS)
        if edits.isExplicit and spec.HasInfo(_SCHEMAS):
            return None
        dropped.update(edits.deletedItems)
    return dropped


def _has_default(difference: RawDifference) -> bool:
    """Whether usd-core knows what the starter leaves unwritten."""
    return difference.kind == "value" and difference.was is not None


def _removed_schema(
    difference: RawDifference, prim: Usd.Prim, twin: Usd.Prim, terms: Terms
) -> Iterator[Difference]:
    name = difference.name
    if difference.was is None or terms.classes(name) == "never":
        return
    if not _is_elsewhere(name, prim, twin, terms):
        physics = name.startswith(terms.rules.physics_names)
        yield Difference("schema", "", name, "removed", physics=physics)


def _is_elsewhere(api: str, prim: Usd.Prim, twin: Usd.Prim, terms: Terms) -> bool:
    """Whether the schema went with the articulation root to the other prim that may carry it."""
    path, (root_api, *_) = str(prim.GetPath()), terms.rules.articulation
    both = next((paths for paths in terms.articulated if path in paths), ())
    if api not in terms.rules.articulation or not both:
        return False
    stage = twin.GetStage()
    carriers = [stage.GetPrimAtPath(carrier) for carrier in both if carrier != path]
    return any(carrier and root_api in applied_schemas(carrier) for carrier in carriers)


def _changed_property(
    difference: RawDifference, kind: Class, prim: Usd.Prim, twin: Usd.Prim, terms: Terms
) -> Iterator[Difference]:
    name, was, now = difference.name, difference.was, difference.now
    if difference.kind == "targets":
        yield from _changed_targets(difference, kind, prim, twin)
        return
    if now is None and twin.GetAttribute(name).HasAuthoredValueOpinion():
        # A block leaves what the schema says.
        now = twin.GetPrimDefinition().GetAttributeFallbackValue(name)
    if was is None or was == now:
        return
    if same_usd_value(was, now, terms.margin(name)) or _is_excused(prim, twin, name, kind, terms):
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
    difference: RawDifference, kind: Class, prim: Usd.Prim, twin: Usd.Prim
) -> Iterator[Difference]:
    name, was, now = difference.name, difference.was, difference.now
    relationship = prim.GetRelationship(name)
    if not relationship or not relationship.HasAuthoredTargets():
        return
    if kind == "look" and not is_light_or_camera(prim):
        return
    # A target that moved goes by its name.
    stage, named = twin.GetStage(), {path.name: path for path in now}
    expected = [path if stage.GetPrimAtPath(path) else named.get(path.name, path) for path in was]
    if sorted(map(str, expected)) != sorted(map(str, now)):
        physics = kind == "physics"
        before, after = (", ".join(map(str, paths)) or "no prim" for paths in (was, now))
        yield Difference("physics" if physics else "look", name, before, after, physics=physics)


def _added_differences(
    raw: list[RawDifference], was: PrimRecord, twin: Usd.Prim, terms: Terms
) -> Iterator[Difference]:
    """Yield what one prim has of physics that the starter's does not."""
    prim = was.prim
    is_robots = is_on_robot(was.path, terms)
    # Nothing moves what is no body, or is held still.
    is_still = still_by({name: value_of(twin, name) for name in _SWITCHES}) != ""
    is_still = is_still or terms.rules.body not in applied_schemas(twin)
    idle = () if is_robots or not is_still else (terms.rules.body, *_SWITCHES)
    is_judged = is_robots or is_physical(prim, terms.rules)
    for difference in raw:
        name = difference.name
        if difference.kind == "schema":
            is_added = difference.was is None and name not in idle
            if is_added and name.startswith(terms.rules.acting):
                yield Difference("added", "", "", f"{name} was added", physics=False)
        elif not difference.is_new:
            continue
        elif name.startswith(BINDING):
            yield from _bound(prim, twin, name, terms)
        elif is_judged and name not in idle and _counts(prim, twin, name, terms):
            yield from _added_property(difference, twin, terms)


def is_unknown(path: str, terms: Terms) -> bool:
    """Whether the starter lacks an asset here: what a stage has there may be the asset's."""
    return any(is_at_or_below(path, top) for top in terms.unknown)


def _counts(prim: Usd.Prim, twin: Usd.Prim, name: str, terms: Terms) -> bool:
    """Whether this is physics, and does not belong to an articulation that came from elsewhere."""
    root_api = terms.rules.articulation[0]
    has_come = root_api in applied_schemas(twin) and root_api not in applied_schemas(prim)
    came_along = has_come and pattern(terms.rules.articulation_properties).match(name)
    return terms.classes(name) == "physics" and not came_along


def _added_property(
    difference: RawDifference, twin: Usd.Prim, terms: Terms
) -> Iterator[Difference]:
    name, value = difference.name, difference.now
    if difference.kind == "targets":
        prims = twin.GetStage().Traverse() if value else ()
        scenes = [prim.GetPath() for prim in prims if _is_scene(prim)]
        if value and not ([*value] == scenes and len(scenes) == 1):  # the one that the stage has
            shown = ", ".join(map(str, value))
            yield Difference("added", name, "", f"{name} {shown} was added", physics=False)
        return
    if value is None or _has_default(difference):
        return  # what usd-core knows a default of is compared as a value
    default = dict(terms.rules.neutral).get(name)
    if default is None or not same_usd_value(default, value, terms.margin(name)):
        message = f"{name} {display_value(value)} was added"
        yield Difference("added", name, "", message, physics=False)


def _is_scene(prim: Usd.Prim) -> bool:
    return bool(Usd.Prim.GetTypeName(prim) == SCENE)


def _bound(prim: Usd.Prim, twin: Usd.Prim, name: str, terms: Terms) -> Iterator[Difference]:
    """Yield a material that other shapes slide on than before, at the prim that binds it."""
    for shape in Usd.PrimRange(prim, PRESENT):
        if terms.rules.collision not in applied_schemas(shape):
            continue
        same_shape = twin.GetStage().GetPrimAtPath(shape.GetPath())
        was, now = _material(shape, terms), _material(same_shape, terms) if same_shape else ""
        if was != now:
            message = f"{name} makes {shape.GetPath()} slide as {now or 'by default'}"
            yield Difference("added", name, was, message, physics=False)
            return


def _material(shape: Usd.Prim, terms: Terms) -> str:
    """Return the path of the material by which a shape slides; '' for none."""
    from pxr import UsdShade

    material, _ = UsdShade.MaterialBindingAPI(shape).ComputeBoundMaterial(_PURPOSE)
    prim = material.GetPrim() if material else None
    return str(prim.GetPath()) if prim and is_physical(prim, terms.rules) else ""


def added_changes(
    new: Iterable[Usd.Prim], starter: Usd.Stage, stage: Usd.Stage, terms: Terms
) -> Iterator[Change]:
    """Yield each new prim, and each below one, that changes how the starter's robot moves."""
    added = [
        prim
        for top in new
        for prim in Usd.PrimRange(top, PRESENT)
        if not starter.GetPrimAtPath(prim.GetPath())
        and (_is_scene(prim) or _acts(prim, str(prim.GetTypeName()), terms))
    ]
    if not added:
        return  # as of most stages, for which nothing else need be worked out
    gone = set(map(signature, _gone(starter, stage)))
    scenes = [sum(map(_is_scene, either.Traverse())) for either in (starter, stage)]
    for prim in added:
        path, kind = str(prim.GetPath()), str(prim.GetTypeName())
        if signature(prim) in gone or is_unknown(path, terms):
            continue  # it was moved here, or comes from an asset that the starter lacks
        if scenes[1] > scenes[0] or _acts(prim, kind, terms):
            message = f"{kind or 'prim'} was added"
            yield Change(path, kind, (Difference("added", "", "", message, physics=False),))


def _gone(starter: Usd.Stage, stage: Usd.Stage) -> Iterator[Usd.Prim]:
    for prim in Usd.PrimRange(starter.GetPseudoRoot(), PRESENT):
        twin = stage.GetPrimAtPath(prim.GetPath())
        if not prim.IsPseudoRoot() and not (twin and twin.IsActive() and twin.IsDefined()):
            yield prim


def _acts(prim: Usd.Prim, kind: str, terms: Terms) -> bool:
    """Whether the prim filters collisions, joins the robot, or is a shape or body of it."""
    if kind == "PhysicsCollisionGroup":
        targets = _targets(prim, "physics:filteredGroups")
        return bool(targets) or value_of(prim, "physics:invertFilteredGroups") is True
    if kind.endswith("Joint"):
        is_on = value_of(prim, "physics:jointEnabled") is not False
        return is_on and any(
            _is_robots(target, terms) for name in _ENDS for target in _targets(prim, name)
        )
    if not _is_robots(str(Usd.Prim.GetPath(prim)), terms):
        return False
    is_acting = any(api.startswith(terms.rules.acting) for api in applied_schemas(prim))
    return is_acting and value_of(prim, "physics:collisionEnabled") is not False


def _is_robots(path: str, terms: Terms) -> bool:
    return any(path.startswith(f"{root}/") for root in terms.roots)


def _targets(prim: Usd.Prim, name: str) -> list[str]:
    return [str(path) for path in targets_of(prim.GetRelationship(name))]
