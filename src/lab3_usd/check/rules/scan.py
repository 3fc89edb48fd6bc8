"""Rules about the values by which a lidar gives no scan, or another one than the lab needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.check.finding import Problem
from lab3_usd.check.met import same_value
from lab3_usd.check.model import Prim
from lab3_usd.check.registry import rule
from lab3_usd.check.say import shown
from lab3_usd.check.sensor_place import Place, sensor_place
from lab3_usd.check.subject import StageSubject
from lab3_usd.spec.catalog import Value

SENSOR = "lidar"
_TURN = 360.0
_Fault = tuple[str, str, str]  # attribute, message, what is expected


def _lidar(subject: StageSubject) -> tuple[Place, Prim] | None:
    place = sensor_place(subject, SENSOR)
    return None if place is None or place.prim is None else (place, place.prim)


def _number(prim: Prim, name: str) -> float | None:
    value = prim.attributes.get(name)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number and isinstance(value, (int, float)) else None


def _short(name: str) -> str:
    return name.rpartition(":")[2]


def _problem(subject: StageSubject, place: Place, prim: Prim, fault: _Fault) -> Problem:
    name, message, expected = fault
    handout = str(subject.lab.scene[SENSOR]["scan"]["handout"])
    actual = shown(prim.attributes.get(name))
    return Problem(prim.path, message, name, expected, actual, handout, place.related)


@rule("L09", "no-scan", scope="stage")
def no_scan(subject: StageSubject) -> Iterator[Problem]:
    """A value of the lidar leaves no scan: a rate of 0, no emitter, or a range that ends at once.

    Why: the lidar helper computes the beams of a scan from these values. Without beams, or with a
    nearest range beyond the farthest, `/scan` stays silent or holds no distance.

    Fix: select the lidar, search the Property panel for the name given here and type a value above
    0, or delete the lidar and make it with Create > Sensors > RTX Lidar > NVIDIA > Example Rotary
    2D.

    Example: `omni:sensor:Core:patternFiringRateHz` 0.
    """
    found = _lidar(subject)
    if found is None:
        return
    place, prim = found
    spec = subject.lab.scene[SENSOR]["scan"]
    for fault in (*_zeros(prim, spec), *_empty(prim, spec), *_falling(subject, prim, spec)):
        yield _problem(subject, place, prim, fault)


def _zeros(prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    for name in spec["above_zero"]:
        value = _number(prim, name)
        if value is not None and not value > 0:
            yield name, f"{name} is {shown(value)}, which gives no scan", "more than 0"


def _empty(prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    for name, value in prim.attributes.items():
        if name.startswith(spec["emitters"]) and value == ():
            yield name, f"{name} is empty: the lidar has no emitter", "one entry for each emitter"


def _falling(subject: StageSubject, prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    attributes = subject.lab.scene[SENSOR]["attributes"]
    for low, high in spec["rising"]:
        asked = attributes.get(low, {})
        # A wrong value of what the handout asks for is told by its own rule.
        is_asked = bool(asked.get("required"))
        least = float(asked["value"]) if is_asked else _number(prim, low)
        most = _number(prim, high)
        if least is not None and most is not None and most > 0 and not least < most:
            message = (
                f"{low} is {shown(least)} and {_short(high)} is {shown(most)}, so no scan fits"
            )
            yield high if is_asked else low, message, f"{_short(low)} below {_short(high)}"


@rule("L10", "other-scan", scope="stage", severity="warning")
def other_scan(subject: StageSubject) -> Iterator[Problem]:
    """The lidar scans a part of the circle, looks up or down, or gives its points another way.

    Why: the map and AMCL take a scan for the whole circle at the height of the lidar. Where it
    does not look, walls are missing; what it sees above or below is drawn as a wall in its plane.

    Fix: select the lidar, search the Property panel for the name given here and type the value
    that is expected, or reset it with the blue square beside it.

    Example: `omni:sensor:Core:validEndAzimuthDeg` 180.
    """
    found = _lidar(subject)
    if found is None:
        return
    place, prim = found
    spec = subject.lab.scene[SENSOR]["scan"]
    for fault in (*_partial(prim, spec), *_tilted(prim, spec), *_changed(prim, spec)):
        yield _problem(subject, place, prim, fault)


def _partial(prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    limits = [_number(prim, name) for name in spec["circle"]]
    start, end = (
        usual if limit is None else limit
        for limit, usual in zip(limits, spec["circle"].values(), strict=True)
    )
    covered = end - start if end >= start else (end - start) % _TURN
    if not covered >= spec["whole"]:
        written = [name for name, limit in zip(spec["circle"], limits, strict=True) if limit]
        name = written[-1] if written else [*spec["circle"]][-1]
        message = (
            f"the lidar covers {covered:g} degrees of the circle, from azimuth {start:g} to {end:g}"
        )
        yield name, message, f"{_TURN:g} degrees"


def _tilted(prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    for name, value in prim.attributes.items():
        if not (name.startswith(spec["emitters"]) and _short(name) == spec["elevation"]):
            continue
        steepest = max(_degrees(value), key=abs, default=0.0)
        if not abs(steepest) <= spec["level"]:
            where = "up" if steepest > 0 else "down"
            message = f"{name} reaches {steepest:g} degrees: the lidar looks {where}"
            yield name, message, "0 degrees"


def _degrees(value: Value) -> list[float]:
    items = value if isinstance(value, tuple) else (value,)
    return [float(item) for item in items if isinstance(item, (int, float))]


def _changed(prim: Prim, spec: Mapping[str, Any]) -> Iterator[_Fault]:
    for name, kept in spec["keep"].items():
        actual = prim.attributes.get(name)
        if actual is not None and not same_value(actual, kept["value"]):
            expected = shown(kept["value"])
            message = f"{name} is {shown(actual)}, expected {expected}; {kept['otherwise']}"
            yield name, message, expected


@rule("L11", "lidar-asset", scope="stage", severity="warning")
def lidar_asset(subject: StageSubject) -> Iterator[Problem]:
    """The lidar refers to another of the vendor's lidars than the handout's.

    Why: the menu lists lidars with alike names. Another one looks up and down as well, or turns
    otherwise, so that `/scan` is silent or holds no flat turn. What the asset holds cannot be seen
    from here; its name can.

    Fix: delete the lidar and make it with Create > Sensors > RTX Lidar > NVIDIA > Example Rotary
    2D.

    Example: a reference to `Example_Rotary.usda`, made with Example Rotary instead of Example
    Rotary 2D.
    """
    found = _lidar(subject)
    if found is None:
        return
    place, prim = found
    spec = subject.lab.scene[SENSOR]
    others = {*subject.lab.scene["forbidden"][SENSOR]["names"]} - {_stem(spec["asset_suffix"])}
    for missing in subject.stage.unresolved:
        if missing.prim == prim.path and _stem(missing.asset) in others:
            is_, expected = _stem(missing.asset), _stem(spec["asset_suffix"])
            message = f"the lidar is made of {is_}, expected {expected}"
            yield Problem(prim.path, message, None, expected, is_, spec["handout"], place.related)


def _stem(asset: str) -> str:
    """Return the name of an asset's file without its ending."""
    return asset.rpartition("/")[2].partition(".")[0]
