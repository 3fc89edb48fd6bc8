"""The rule about things of a scene: their number, schemas, materials, labels and values."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.model.changes import ApplySchema, Edit, Restore
from lab3_usd.model.finding import Problem, display, format_paths
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import same_value
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
    for name, spec in subject.lab.props_at(subject.checkpoint).items():
        found = [*_found(spec, subject)]
        count = 1 if spec.count is None and not found else spec.count
        if count is not None and len(found) != count:
            yield _wrong_count(name, spec, found, count, subject)
        for prim in found:
            yield from _wrong_parts(name, spec, prim, subject)


def _found(spec: PropSpec, subject: StageSubject) -> Iterator[Prim]:
    for path in subject.stage.prims:
        if spec.stands_at(path):
            prim = subject.stage.prim(path)
            if prim is not None and spec.type in ("", prim.type):
                yield prim


def _wrong_count(
    name: str, spec: PropSpec, found: list[Prim], count: int, subject: StageSubject
) -> Problem:
    kind = f" of type {spec.type}" if spec.type else ""
    return Problem(
        spec.path,
        f"{len(found)} of {name} are there, expected {count}: prims at {spec.path}{kind}",
        expected=str(count),
        actual=str(len(found)),
        handout=spec.handout,
        related=tuple(prim.path for prim in found),
        unmet=(_demand(name),),
        absent=not found,
        rests_on=None if len(found) > count else subject.stage.unknown(spec.path.split("*")[0]),
    )


def _wrong_parts(name: str, spec: PropSpec, prim: Prim, subject: StageSubject) -> Iterator[Problem]:
    missing = next((a for a in subject.stage.unresolved if a.prim == prim.path), None)
    if spec.resolved and missing is not None:
        message = f"{missing.asset}, to which {prim.name} refers, cannot be found"
        yield Problem(prim.path, message, handout=spec.handout, unmet=(_demand(name),))
    for part, wanted, actual, fix in _differences(spec, prim):
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


def _differences(spec: PropSpec, prim: Prim) -> Iterator[tuple[str, str, str, Edit]]:
    """Yield what a thing has otherwise: the part, what it should be and is, and the repair."""
    for api in spec.apis:
        if api not in prim.apis:
            yield api, "applied", "missing", ApplySchema(prim.path, api)
    for name, paths in spec.targets.items():
        actual = prim.relationships.get(name, ())
        if set(actual) != set(paths):
            yield name, format_paths(paths), format_paths(actual), Restore(prim.path, name)
    for name, wanted in spec.plain_values.items():
        value = prim.attributes.get(name)
        if not same_value(value, wanted, near_zero=1e-6):
            yield name, display(wanted), display(value), Restore(prim.path, name)
