"""Time samples: what holds when the timeline starts, and what changes after that.

Isaac Sim opens a stage at its first time code and plays from there on, and a time sample beats the
default value. So the values of that moment are written into the session layer of a stage, where
everybody who asks for a value finds them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from msgspec.structs import astuple
from pxr import Sdf, Usd

from lab3_usd.model.stage import AnimatedAttribute
from lab3_usd.stage.read.plain_values import plain_value

_KEY = "changes after the start"
_RELATIVE = 1e-6


def hold_start_values(stage: Usd.Stage) -> None:
    """Have every attribute with time samples hold the value that it starts with.

    A stage is held once, as it was when that was asked first. Prims of instances stay as they are,
    for no layer can say anything else of one instance.
    """
    session = stage.GetSessionLayer()
    layers = stage.GetUsedLayers()
    if _KEY in session.customLayerData or not any(each.ListAllTimeSamples() for each in layers):
        return
    start = stage.GetStartTimeCode()
    sampled = list(_sampled(stage))
    held = [(each, each.Get(start)) for each in sampled]
    changes = [found for each, value in held for found in _changes(each, value, start)]
    with Sdf.ChangeBlock():
        for attribute, value in held:
            _write(session, attribute, value)
        import json  # noqa: PLC0415 - few stages have samples

        session.customLayerData = {_KEY: json.dumps([astuple(each) for each in changes])}


def release_start_values(stage: Usd.Stage) -> None:
    """Have every attribute say again what its layers say, as before it was held."""
    if _KEY in stage.GetSessionLayer().customLayerData:
        stage.GetSessionLayer().Clear()


def changes_after_start(stage: Usd.Stage) -> tuple[AnimatedAttribute, ...]:
    """Return what changes after the start, of a stage that was held there."""
    written = stage.GetSessionLayer().customLayerData.get(_KEY)
    if written is None:
        return ()
    import json  # noqa: PLC0415 - few stages have samples

    return tuple(AnimatedAttribute(*each) for each in json.loads(written))


def _sampled(stage: Usd.Stage) -> Iterator[Usd.Attribute]:
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate):
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetNumTimeSamples():
                yield attribute


def _changes(attribute: Usd.Attribute, first: Any, start: float) -> Iterator[AnimatedAttribute]:  # noqa: ANN401
    """Yield the first sample after the start that is not as the value there."""
    for time in attribute.GetTimeSamples():
        then = attribute.Get(time) if time > start else first
        if then != first and not _alike(plain_value(first), plain_value(then)):
            prim, name = str(attribute.GetPrim().GetPath()), str(attribute.GetName())
            yield AnimatedAttribute(prim, name, time, _text(first), _text(then))
            return


def _alike(one: Any, other: Any) -> bool:  # noqa: ANN401 - plain values of any depth
    """Whether two values are the same up to float noise."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=_RELATIVE, abs_tol=_RELATIVE)
    return bool(one == other) and one is not None


def _text(value: Any) -> str:  # noqa: ANN401
    known = plain_value(value)
    return "another value" if known is None else str(known)


def _write(session: Sdf.Layer, attribute: Usd.Attribute, value: Any) -> None:  # noqa: ANN401
    prim = Sdf.CreatePrimInLayer(session, attribute.GetPrim().GetPath())
    spec = Sdf.AttributeSpec(prim, attribute.GetName(), attribute.GetTypeName())
    spec.default = Sdf.ValueBlock() if value is None else value
