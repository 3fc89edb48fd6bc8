"""The rule about things of a scene: their number, schemas, materials, labels and values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.isaac.values import Value
from lab3_usd.model.changes import ApplySchema, Edit, Restore
from lab3_usd.model.finding import Problem, display, format_paths
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import StageModel, same_value
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import PropSpec


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


@rule("S36", "prop", scope="stage", demands=_things, needs="props")
def prop(subject: StageSubject) -> Iterator[Problem]:
    """A thing of the scene is missing, or is not as the handout asks.

    Why: what the handout places in the scene is seen, measured or bumped into as it says.

    Fix: create the thing at the path named here, or set the value, the schema or the material that
    is named.

    Example: three racks where the handout asks for four, or one without its material.
    """
    props = subject.lab.props_at(subject.checkpoint)
    found = {name: [*_found(spec, subject)] for name, spec in props.items()}
    told, surplus = dict[tuple[str, str], list[str]](), set[str]()
    for name, spec in props.items():
        beyond = 0 if spec.count is None else len(found[name]) - spec.count
        if beyond > 0:  # those count as too many that are least like what is asked for
            worst = sorted(
                found[name], key=lambda prim: -len([*_wrong_parts("", spec, prim, subject)])
            )
            surplus |= {prim.path for prim in worst[:beyond]}
        if beyond or (spec.count is None and not found[name]):
            told.setdefault((spec.path, spec.type), []).append(name)
    for names in told.values():
        yield _wrong_count(names, found[names[0]], props, subject)
    for name, spec in props.items():
        kept = [prim for prim in found[name] if prim.path not in surplus]
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
    names: list[str], found: list[Prim], props: Mapping[str, PropSpec], subject: StageSubject
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
        f"{len(found)} of {names[0]} are there, expected {count}: prims at {spec.path}{kind}",
        expected=str(count),
        actual=str(len(found)),
        handout=spec.handout,
        related=tuple(prim.path for prim in found),
        unmet=tuple(map(_demand, names)),
        absent=not found,
        assumes=tuple((path, None) for path in upwards(start.rstrip("/"))),
        rests_on=None if len(found) > count else subject.stage.unknown(start),
    )


def _not_found(
    name: str, spec: PropSpec, found: list[Prim], subject: StageSubject
) -> Iterator[Problem]:
    """Yield each file that cannot be found, with the things that refer to it."""
    users: dict[str, list[str]] = {}
    named = (prim for prim in found if not spec.asset or spec.refers(prim.assets))
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
        )


def _wrong_parts(name: str, spec: PropSpec, prim: Prim, subject: StageSubject) -> Iterator[Problem]:
    if spec.asset and not spec.refers(prim.assets):
        actual = ", ".join(prim.assets) or "nothing"
        message = f"{prim.name} refers to {actual}, expected {spec.asset}"
        unmet = (_demand(name, _ASSET),)
        yield Problem(prim.path, message, None, spec.asset, actual, spec.handout, unmet=unmet)
    for part, wanted, actual, fix in _differences(spec, prim, subject.stage):
        yield Problem(
            prim.path,
            f"{part} of {prim.name} is {actual}, expected {wanted}",
            part,
            wanted,
            actual,
            spec.handout,
            fix=(fix,),
            unmet=(_demand(name, part),),
            rests_on=subject.stage.unknown(prim.path),
        )


_ASSET, _BINDING, _LABELS = "asset", "material:binding", "semantics:labels:"


def _in_order(labels: Value | None) -> Value | None:
    return tuple(sorted(labels, key=str)) if isinstance(labels, tuple) else labels


def _bound(prim: Prim, name: str, stage: StageModel) -> tuple[str, ...]:
    """Return the targets of a relationship; a material is also that of the nearest prim above."""
    paths = upwards(prim.path) if name.startswith(_BINDING) else (prim.path,)
    found = (stage.prim(path) for path in paths)
    targets = (each.relationships.get(name, ()) for each in found if each is not None)
    return next(filter(None, targets), ())


def _differences(
    spec: PropSpec, prim: Prim, stage: StageModel
) -> Iterator[tuple[str, str, str, Edit]]:
    """Yield what a thing has otherwise: the part, what it should be and is, and the repair."""
    for api in spec.apis:
        if api not in prim.apis:
            yield api, "applied", "missing", ApplySchema(prim.path, api)
    for name, paths in spec.targets.items():
        actual = _bound(prim, name, stage)
        if set(actual) != set(paths):
            yield name, format_paths(paths), format_paths(actual), Restore(prim.path, name)
    for name, wanted in spec.plain_values.items():
        value = prim.attributes.get(name)
        value = stage.fallback(prim.path, name) if value is None else value
        is_set = name.startswith(_LABELS)
        pair = (_in_order(value), _in_order(wanted)) if is_set else (value, wanted)
        if not same_value(*pair, near_zero=1e-6):
            yield name, display(wanted), display(value), Restore(prim.path, name)
