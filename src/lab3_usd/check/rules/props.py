"""The rules about things of a scene: their number, schemas and values, and what is taken away."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.robot.sensors import INVISIBLE, hidden_by
from lab3_usd.isaac.values import Value
from lab3_usd.model.changes import ApplySchema, Connect, Edit, RemovePrim, Restore
from lab3_usd.model.finding import Problem, Severity, display, format_paths
from lab3_usd.model.physics import GRAVITY_DIRECTION, number, numbers, vector
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import StageModel, same_value
from lab3_usd.model.transforms import (
    AXES,
    SAVED_PLACE,
    Rotation,
    angle_between,
    decompose,
    rotate_by_quaternion,
    rotate_vector,
    rotation_difference,
    rotation_from_euler,
)
from lab3_usd.spec.lab import Checkpoint, Lab, Removal
from lab3_usd.spec.props import PlaceSpec, PropSpec, is_named


def _things(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for name, prop in lab.props_at(checkpoint).items():
        title = f"{name} is at {prop.path}"
        if prop.count is not None:
            title = f"{prop.count} of {name} are at {prop.path}"
        yield Demand(_demand(name), title, prop.path, prop.handout)
        for part, wanted in _parts(prop):
            yield Demand(_demand(name, part), f"{name}: {part} {wanted}", prop.path, prop.handout)


def _demand(name: str, part: str = "") -> str:
    return "/".join(filter(None, ("Scene/prop", name, part)))


def _parts(prop: PropSpec) -> Iterator[tuple[str, str]]:
    """Yield what is asked of each of the things, and its value in words."""
    yield from [(_ASSET, prop.asset)] if prop.asset else ()
    yield from ((api, "is applied") for api in prop.apis)
    yield from ((name, format_paths(paths)) for name, paths in prop.targets.items())
    yield from ((name, display(value)) for name, value in prop.plain_values.items())
    yield from ((_variants(name), wanted) for name, wanted in prop.variants.items())
    yield from [(_PLACE, _place_text(prop.place))] if prop.place is not None else ()


@rule("S36", "prop", scope="stage", demands=_things, needs="props")
def prop(subject: StageSubject) -> Iterator[Problem]:
    """A thing of the scene is missing, or is not as the handout asks.

    Why: sensors see, measure and bump into the things of the scene as the handout describes them.

    Fix: create the thing at the path named here, or set what is named on the prim that is named.

    Example: three racks where the handout asks for four, or one without its material.
    """
    props = subject.lab.props_at(subject.checkpoint)
    prims_of = {name: [*_found(spec, subject)] for name, spec in props.items()}
    told, surplus = dict[tuple[str, str], list[str]](), set[str]()
    for name, spec in props.items():
        beyond = 0 if spec.count is None else len(prims_of[name]) - spec.count
        if beyond > 0:  # those count as too many that are least like what is asked for
            worst = sorted(
                prims_of[name], key=lambda prim: -len([*_wrong_parts("", spec, prim, subject)])
            )
            surplus |= {prim.path for prim in worst[:beyond]}
        if beyond or (spec.count is None and not prims_of[name]):
            told.setdefault((spec.path, spec.type), []).append(name)
    for names in told.values():
        yield _wrong_count(names, prims_of[names[0]], props, subject)
    for name, spec in props.items():
        kept = [prim for prim in prims_of[name] if prim.path not in surplus]
        yield from _not_found(name, spec, kept, subject)
        for prim in kept:
            yield from _wrong_parts(name, spec, prim, subject)


def _found(spec: PropSpec, subject: StageSubject) -> Iterator[Prim]:
    for path in subject.stage.prims:
        if spec.stands_at(path):
            prim = subject.stage.prim(path)
            if prim is not None and spec.type in ("", prim.type):
                yield prim


def _wrong_count(
    names: list[str], prims: list[Prim], props: Mapping[str, PropSpec], subject: StageSubject
) -> Problem:
    """Say once of a path and a type that too few or too many are there.

    Where what should hold them is missing, that is told alone.
    """
    spec = props[names[0]]
    count = 1 if spec.count is None else spec.count
    kind = f" of type {spec.type}" if spec.type else ""
    start = spec.path.partition("*")[0]
    return Problem(
        spec.path,
        f"{len(prims)} of {names[0]} are there, expected {count}: prims at {spec.path}{kind}",
        expected=str(count),
        actual=str(len(prims)),
        handout=spec.handout,
        hint=_way_to_count(spec, count - len(prims)),
        related=tuple(prim.path for prim in prims),
        unmet=tuple(map(_demand, names)),
        absent=not prims,
        assumes=tuple((path, None) for path in upwards(start.rstrip("/"))),
        rests_on=None if len(prims) > count else subject.stage.unknown(start),
    )


def _way_to_count(spec: PropSpec, lacking: int) -> str:
    """Say how many to add, or to delete."""
    if lacking < 0:
        return f"delete {-lacking} of the prims at {spec.path}"
    kind = f" of type {spec.type}" if spec.type else ""
    what = f"{lacking} more prims" if lacking > 1 else "a prim"
    refer = f", with {spec.asset} as its reference" if spec.asset else ""
    return f"add {what}{kind} at {spec.path}{refer}"


def _not_found(
    name: str, spec: PropSpec, standing: list[Prim], subject: StageSubject
) -> Iterator[Problem]:
    """Yield each file that cannot be found, with the things that refer to it."""
    users: dict[str, list[str]] = {}
    named = (prim for prim in standing if not spec.asset or spec.refers(prim.assets))
    paths = {prim.path for prim in named} if spec.resolved else set()
    for missing in subject.stage.unresolved:
        if missing.prim in paths:
            users.setdefault(missing.asset, []).append(missing.prim)
    for asset, prims in users.items():
        names = ", ".join(path.rpartition("/")[2] for path in prims)
        yield Problem(
            prims[0],
            f"{asset}, to which {names} {'refer' if prims[1:] else 'refers'}, cannot be found",
            handout=spec.handout,
            hint=f"hand in {asset} beside the stage, or name it as the handout does",
            related=tuple(prims[1:]),
            unmet=(_demand(name),),
            covers=tuple((path, _ASSET) for path in prims),
        )


def _wrong_parts(name: str, spec: PropSpec, prim: Prim, subject: StageSubject) -> Iterator[Problem]:
    if spec.asset and not spec.refers(prim.assets):
        yield Problem(
            prim.path,
            f"{prim.name} refers to {', '.join(prim.assets) or 'nothing'}, expected {spec.asset}",
            expected=spec.asset,
            actual=", ".join(prim.assets) or "nothing",
            handout=spec.handout,
            hint=f"let {prim.path} refer to {spec.asset}",
            unmet=(_demand(name, _ASSET),),
            covers=((prim.path, _ASSET),),
        )
    faults = [*_faults(spec, prim, subject.stage)]
    brought = {fault.part: [*_brought_by(fault, faults)] for fault in faults}
    told_elsewhere = [other for members in brought.values() for other in members]
    for fault in (each for each in faults if each not in told_elsewhere):
        together = (fault, *brought[fault.part])
        lost = "".join(f", and {other.part} with it" for other in together[1:])
        is_error = fault.severity != "warning"
        yield Problem(
            prim.path,
            fault.message
            or f"{fault.part} of {prim.name} is {fault.actual}{lost}, expected {fault.wanted}",
            None if fault.part.startswith((_PLACE, _variants(""))) else fault.part,
            fault.wanted,
            fault.actual,
            spec.handout,
            severity=fault.severity,
            hint=", and ".join(each.hint or each.way_at(prim.path) for each in together),
            fix=tuple(edit for each in together for edit in each.fix),
            unmet=tuple(_demand(name, each.part) for each in together) if is_error else (),
            assumes=(("/", "metersPerUnit"),) if fault.part == _PLACE else (),
            rests_on=subject.stage.unknown(prim.path),
        )


def _brought_by(fault: _Fault, faults: list[_Fault]) -> Iterator[_Fault]:
    """Yield the values that are not set because a schema with the same instance is missing."""
    instance = fault.part.partition(":")[2]
    if fault.is_schema and instance:
        for other in faults:
            is_unset = not other.is_schema and other.actual == display(None)
            if is_unset and other.part.endswith(f":{instance}"):
                yield other


_ASSET, _BINDING, _LABELS, _PLACE = "asset", "material:binding", "semantics:labels:", "place"
_BINDING_API, _VISIBILITY, _HIDDEN = "MaterialBindingAPI", "visibility", "invisible"


class _Fault(Struct, frozen=True):
    """What a thing has otherwise: the part, what it should be and is, and the repair."""

    part: str
    wanted: str
    actual: str
    fix: tuple[Edit, ...] = ()
    message: str = ""
    hint: str | None = None
    severity: Severity | None = None

    @property
    def is_schema(self) -> bool:
        """Whether a schema is missing."""
        return any(isinstance(edit, ApplySchema) for edit in self.fix)

    def way_at(self, path: str) -> str:
        """Say what to do at a prim."""
        if self.is_schema:
            return f"apply {self.part} to {path}"
        return f"set {self.part} of {path} to {self.wanted}"


def _faults(spec: PropSpec, prim: Prim, stage: StageModel) -> Iterator[_Fault]:
    for api in spec.apis:
        if api not in prim.apis:
            yield _Fault(api, "applied", "missing", (ApplySchema(prim.path, api),))
    for name, paths in spec.relationships.items():
        yield from _wrong_targets(name, paths, prim, stage)
        if name.startswith(_BINDING) and _BINDING_API not in spec.apis:
            yield from _bare_bindings(name, prim, stage)
    for name, paths in spec.connections.items():
        actual = prim.relationships.get(name, ())
        if set(actual) != set(paths):
            wanted, shown = format_paths(paths), format_paths(actual) if actual else "nothing"
            message = f"{name} of {prim.name} is connected to {shown}, expected {wanted}"
            is_output = name.startswith("outputs:")  # of a material, which are all tokens
            fix = (Connect(prim.path, name, "token", paths),) if is_output else ()
            hint = f"connect {name} of {prim.path} to {wanted}"
            yield _Fault(name, wanted, shown, fix, message, hint)
    for name, value in spec.plain_values.items():
        if name == _VISIBILITY:
            yield from _wrong_visibility(value, prim, stage)
        else:
            yield from _wrong_value(name, value, spec.types.get(name, ""), prim, stage)
    for name, wanted in spec.variants.items():
        selected = stage.details.variant(prim.path, name)
        if selected != wanted:
            message = f"the {name} of {prim.name} is {display(selected or None)}"
            message += f", expected the variant {display(wanted)}"
            hint = f"select the variant {wanted} of {name} at {prim.path}"
            yield _Fault(_variants(name), wanted, selected, (), message, hint)
    if spec.place is not None:
        yield from _wrong_place(spec.place, prim, stage)


def _wrong_targets(
    name: str, paths: tuple[str, ...], prim: Prim, stage: StageModel
) -> Iterator[_Fault]:
    """Yield a relationship that leads elsewhere; a material counts that USD takes for the prim."""
    above = _binding(name, prim, stage) if name.startswith(_BINDING) else prim
    actual = () if above is None else above.relationships.get(name, ())
    if name.startswith(_BINDING):
        material = stage.details.material(prim.path, name)
        actual = (material,) if material else actual
    if set(actual) != set(paths):
        fix = (Restore(prim.path, name),)
        yield _Fault(name, format_paths(paths), format_paths(actual), fix)


def _binding(name: str, prim: Prim, stage: StageModel) -> Prim | None:
    """Return the nearest prim, itself or above, at which a relationship leads somewhere."""
    prims = (stage.prim(path) for path in upwards(prim.path))
    return next((each for each in prims if each and each.relationships.get(name)), None)


def _bare_bindings(name: str, prim: Prim, stage: StageModel) -> Iterator[_Fault]:
    """Yield a binding without its schema.

    USD takes it and warns of it, unless the variable USD_SHADE_MATERIAL_BINDING_API_CHECK is
    `strict`; usdchecker calls it an error (pxr/usd/usdShade/materialBindingAPI.cpp).
    """
    site = _binding(name, prim, stage)
    if site is not None and _BINDING_API not in site.apis:
        message = f"{site.name} binds a material without {_BINDING_API}, which usdchecker refuses"
        fix = (ApplySchema(site.path, _BINDING_API),)
        hint = f"apply {_BINDING_API} to {site.path}"
        yield _Fault(name, "applied", "missing", fix, message, hint, "warning")


def _wrong_visibility(wanted: Value, prim: Prim, stage: StageModel) -> Iterator[_Fault]:
    """Yield a thing that is hidden, itself or with what is above it, or one that is not."""
    hiding = hidden_by(prim, stage, INVISIBLE)
    if (hiding is not None) == (wanted == _HIDDEN):
        return
    if hiding is None or hiding is prim:
        actual = display("inherited" if hiding is None else _HIDDEN)
        yield _Fault(_VISIBILITY, display(wanted), actual, (Restore(prim.path, _VISIBILITY),))
    else:
        message = f"{prim.name} is hidden by {hiding.path}, whose visibility is {_HIDDEN}"
        hint = f"set the visibility of {hiding.path} to inherited"
        yield _Fault(_VISIBILITY, display(wanted), _HIDDEN, message=message, hint=hint)


def _wrong_value(
    name: str, wanted: Value, kind: str, prim: Prim, stage: StageModel
) -> Iterator[_Fault]:
    value = prim.attributes.get(name)
    types = stage.details.other_type(prim.path, name, kind) if value is not None else None
    if types is not None:
        written, read = types
        message = f"{name} of {prim.name} is written as {written}, and is read as {read}"
        yield _Fault(name, read, written, (Restore(prim.path, name),), message)
        return
    value = stage.details.fallback(prim.path, name) if value is None else value
    if name == f"{_OP}{_ORIENT}" and isinstance(value, tuple):  # read with the real part last
        value = (*value[-1:], *value[:-1])
    is_set = name.startswith(_LABELS)
    pair = (_in_order(value), _in_order(wanted)) if is_set else (value, wanted)
    is_file = isinstance(wanted, str) and stage.details.is_file(prim.path, name)
    is_named_so = is_file and is_named(str(wanted), str(value))
    is_written = is_named_so or same_value(*pair, near_zero=1e-6)
    order = prim.attributes.get(_ORDER) or ()
    is_idle = name.startswith(_OP) and not (isinstance(order, tuple) and name in order)
    if (is_written and not is_idle) or _comes_to(name, wanted, prim, stage):
        return
    hint = None
    if is_written:
        message = f"{name} of {prim.name} has no effect: {_ORDER} does not name it"
        hint = f"add {name} to {_ORDER} of {prim.path}"
    else:
        message = f"{name} of {prim.name} is {display(value)}, expected {display(wanted)}"
        message += _in_units(name, stage)
    restored = (Restore(prim.path, _ORDER if is_written else name),)
    yield _Fault(name, display(wanted), display(value), restored, message, hint)


def _comes_to(name: str, wanted: Value, prim: Prim, stage: StageModel) -> bool:
    """Whether a thing is placed, or gravity pulls, as other values than those asked for say it."""
    asked = vector(wanted)
    if name == GRAVITY_DIRECTION:  # which is normalized (UsdPhysics schema)
        pull = vector(prim.attributes.get(name))
        return any(pull) and any(asked) and angle_between(pull, asked) <= SAVED_PLACE.angle
    local = stage.details.local(prim.path) if name.startswith(_OP) else None
    if local is None:
        return False
    pose = decompose(local)
    match name.removeprefix(_OP):
        case "translate":
            return same_value(pose.translation, asked, near_zero=1e-6)
        case "scale":
            return same_value(pose.scale, asked, near_zero=1e-6)
    turned = _rotation(name.removeprefix(_OP), wanted)
    return turned is not None and rotation_difference(pose.rotation, turned) <= SAVED_PLACE.angle


def _rotation(operation: str, value: Value) -> Rotation | None:
    """Return the rotation that an operation with a value is, as UsdGeomXformOp applies it.

    The real part of a quaternion comes first. None: it is no rotation.
    """
    if operation == _ORIENT:
        w, x, y, z = numbers(value) if len(numbers(value)) == 4 else (1.0, 0.0, 0.0, 0.0)  # noqa: PLR2004
        across, up, ahead = (rotate_by_quaternion(axis, (x, y, z, w)) for axis in AXES)
        return (across, up, ahead)
    axes = operation.removeprefix("rotate")
    if axes == operation or not axes or set(axes) - set(_TURNS):
        return None
    angles = dict(zip(_TURNS, vector(value), strict=True))
    if axes in angles:
        angles[axes] = number(value) or 0.0
    turned = AXES
    for axis in axes:
        x, y, z = (angles[each] if each == axis else 0.0 for each in _TURNS)
        single = rotation_from_euler((x, y, z))
        across, up, ahead = (rotate_vector(direction, single) for direction in turned)
        turned = (across, up, ahead)
    return turned


_ORIENT, _TURNS = "orient", "XYZ"
_OP, _ORDER = "xformOp:", "xformOpOrder"
_LENGTHS = re.compile(
    r"xformOp:translate|(inputs:)?(radius|width|height|length)|size|clippingRange|focusDistance"
    r"|physics:(gravityMagnitude|centerOfMass|localPos[01])"
)
_UNITS = {0.01: "centimetres", 0.001: "millimetres", 0.0254: "inches"}


def _in_units(name: str, stage: StageModel) -> str:
    """Return the unit of a value of USD where it is a length and the stage is not in metres."""
    metres = stage.meters_per_unit
    if metres == 1 or _LENGTHS.match(name) is None:
        return ""
    return f" {_UNITS.get(metres, f'units of {metres:g} m')}"


def _variants(name: str) -> str:
    """Return how the part of a thing is called that a set of variants is."""
    return f"variants: {name}"


def _in_order(labels: Value | None) -> Value | None:
    return tuple(sorted(labels, key=str)) if isinstance(labels, tuple) else labels


def _wrong_place(place: PlaceSpec, prim: Prim, stage: StageModel) -> Iterator[_Fault]:
    """Yield a thing that stands elsewhere in the world, along the axes that are asked for."""
    origin = stage.details.origin(prim.path)
    if origin is None or all(
        abs(origin[axis] - wanted) <= place.within for axis, wanted in place.axes.items()
    ):
        return
    asked = _place_text(place)
    shown = ", ".join(f"{_AXES[axis]} {round(origin[axis], 4) + 0.0:g}" for axis in place.axes)
    message = f"{prim.name} stands at {shown} in the world, expected {asked}"
    yield _Fault(_PLACE, asked, f"{shown} m", (), message, f"move {prim.path} there")


_AXES = "xyz"


def _place_text(place: PlaceSpec) -> str:
    numbers = ", ".join(f"{_AXES[axis]} {value:g}" for axis, value in place.axes.items())
    return f"{numbers} m, give or take {place.within:g}"


REMOVED = "Scene/removed"  # before the path of what is to be gone


def _absences(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for gone in checkpoint.removals:
        name, title = f"{REMOVED}{gone.path}", f"{gone.path} is removed"
        yield Demand(name, title, gone.path, _section(gone, lab), part="world")


def _section(gone: Removal, lab: Lab) -> str:
    return gone.handout or lab.handout.behind("S35", lab.scene.stage.handout)


@rule("S35", "not-removed", scope="stage", demands=_absences, needs="removals")
def not_removed(subject: StageSubject) -> Iterator[Problem]:
    """A prim that a checkpoint removes is still there.

    Why: the handout asks to delete it. What stays there goes on to publish, to move or to be seen.

    Fix: delete the prim in the Stage panel.

    Example: `{next_graph}`, which a later part replaces.
    """
    for gone in subject.checkpoint.removals:
        path, prim = gone.path, subject.stage.prim(gone.path)
        if prim is not None:
            yield Problem(
                path,
                f"{path} is there, expected to be removed",
                expected="removed",
                actual=prim.type or "a prim",
                handout=_section(gone, subject.lab),
                fix=(RemovePrim(path),),
                unmet=(f"{REMOVED}{path}",),
            )
