"""Rules about the values by which a lidar gives no scan, or another one than the lab needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.match.conformance import same_value
from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.sensors.placement import PresentSensor, present_sensors
from lab3_usd.check.scene.sensor_location import LIDAR
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import display
from lab3_usd.model.prims import Prim
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.scene import ScanSpec, SensorAttribute

_TURN = 360.0
_Fault = tuple[str, str, str]  # attribute, message, what is expected


def _number(prim: Prim, name: str) -> float | None:
    value = prim.attributes.get(name)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number and isinstance(value, (int, float)) else None


def _short(name: str) -> str:
    return name.rpartition(":")[2]


def _scanning(subject: StageSubject) -> Iterator[tuple[PresentSensor, ScanSpec]]:
    """Yield the lidars of which the lab says when they scan, and what it says of each."""
    for found in present_sensors(subject, LIDAR):
        if found.spec.scan is not None:
            yield found, found.spec.scan


def _problem(found: PresentSensor, scan: ScanSpec, fault: _Fault) -> Problem:
    name, message, expected = fault
    actual, related = display(found.prim.attributes.get(name)), found.place.related
    return Problem(found.prim.path, message, name, expected, actual, scan.handout, related)


@rule("L09", "no-scan", scope="stage")
def no_scan(subject: StageSubject) -> Iterator[Problem]:
    """A value of the lidar prevents any scan: a rate of 0, no emitter, or an empty range.

    Why: the lidar helper computes the beams of a scan from these values. Without beams, or with a
    near range beyond the far range, the scan is silent or holds no distances.

    Fix: select the lidar, search the Property panel for the name given here and type a value above
    0, or delete the lidar and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: `omni:sensor:Core:patternFiringRateHz` 0.
    """
    for found, scan in _scanning(subject):
        prim, asked = found.prim, found.spec.required
        for fault in (*_zeros(prim, scan), *_empty(prim, scan), *_falling(prim, scan, asked)):
            yield _problem(found, scan, fault)


def _zeros(prim: Prim, scan: ScanSpec) -> Iterator[_Fault]:
    for name in scan.above_zero:
        value = _number(prim, name)
        if value is not None and not value > 0:
            yield name, f"{name} is {display(value)}, which gives no scan", "more than 0"


def _empty(prim: Prim, scan: ScanSpec) -> Iterator[_Fault]:
    for name, value in prim.attributes.items():
        if name.startswith(scan.emitters) and value == ():
            yield name, f"{name} is empty: the lidar has no emitter", "one entry for each emitter"


def _falling(prim: Prim, scan: ScanSpec, asked: Mapping[str, SensorAttribute]) -> Iterator[_Fault]:
    for low, high in scan.rising:
        # A wrong value of what the handout asks for is told by its own rule.
        is_asked = low in asked
        least = float(asked[low].value) if is_asked else _number(prim, low)
        most = _number(prim, high)
        if least is not None and most is not None and most > 0 and not least < most:
            message = (
                f"{low} is {display(least)} and {_short(high)} is {display(most)}, so no scan fits"
            )
            yield high if is_asked else low, message, f"{_short(low)} below {_short(high)}"


@rule("L10", "other-scan", scope="stage", severity="warning")
def other_scan(subject: StageSubject) -> Iterator[Problem]:
    """The lidar scans part of the circle, is tilted, or publishes points in another form.

    Why: the map and AMCL assume a full circle at the height of the lidar. Walls outside the scanned
    part are missing. What the lidar sees above or below appears as a wall in its plane.

    Fix: select the lidar, search the Property panel for the name given here and type the expected
    value, or reset it with the blue square beside it.

    Example: `omni:sensor:Core:validEndAzimuthDeg` 180.
    """
    for found, scan in _scanning(subject):
        prim = found.prim
        for fault in (*_partial(prim, scan), *_tilted(prim, scan), *_changed(prim, scan)):
            yield _problem(found, scan, fault)


def _partial(prim: Prim, scan: ScanSpec) -> Iterator[_Fault]:
    limits = [_number(prim, name) for name in scan.circle]
    start, end = (
        usual if limit is None else limit
        for limit, usual in zip(limits, scan.circle.values(), strict=True)
    )
    covered = end - start if end >= start else (end - start) % _TURN
    if not covered >= scan.whole:
        written = [name for name, limit in zip(scan.circle, limits, strict=True) if limit]
        name = written[-1] if written else [*scan.circle][-1]
        message = (
            f"the lidar covers {covered:g} degrees of the circle, from azimuth {start:g} to {end:g}"
        )
        yield name, message, f"{_TURN:g} degrees"


def _tilted(prim: Prim, scan: ScanSpec) -> Iterator[_Fault]:
    for name, value in prim.attributes.items():
        if not (name.startswith(scan.emitters) and _short(name) == scan.elevation):
            continue
        steepest = max(_degrees(value), key=abs, default=0.0)
        if not abs(steepest) <= scan.level:
            where = "up" if steepest > 0 else "down"
            message = f"{name} reaches {steepest:g} degrees: the lidar looks {where}"
            yield name, message, "0 degrees"


def _degrees(value: Value) -> list[float]:
    items = value if isinstance(value, tuple) else (value,)
    return [float(item) for item in items if isinstance(item, (int, float))]


def _changed(prim: Prim, scan: ScanSpec) -> Iterator[_Fault]:
    for name, kept in scan.keep.items():
        actual = prim.attributes.get(name)
        if actual is not None and not same_value(actual, kept.value):
            expected = display(kept.value)
            message = f"{name} is {display(actual)}, expected {expected}; {kept.otherwise}"
            yield name, message, expected


@rule("L11", "lidar-asset", scope="stage", severity="warning")
def lidar_asset(subject: StageSubject) -> Iterator[Problem]:
    """The lidar refers to another lidar asset of the vendor than the handout names.

    Why: the menu lists lidars with similar names. Another one may also look up and down, or rotate
    differently, so the scan is silent or not flat. The check cannot open the asset, but it sees the
    name.

    Fix: delete the lidar and create it with Create > Sensors > RTX Lidar{lidar_menu}.

    Example: a reference to `Example_Rotary.usda`, created with Example Rotary instead of Example
    Rotary 2D.
    """
    for found in present_sensors(subject, LIDAR):
        expected = _stem(found.spec.asset_suffix)
        others = {*subject.lab.scene.forbidden.lidar.names} - {expected}
        for missing in subject.stage.unresolved:
            made_of = _stem(missing.asset)
            if missing.prim == found.prim.path and made_of in others:
                yield Problem(
                    found.prim.path,
                    f"the lidar is made of {made_of}, expected {expected}",
                    None,
                    expected,
                    made_of,
                    found.spec.handout,
                    found.place.related,
                )


def _stem(asset: str) -> str:
    """Return the name of an asset's file without its ending."""
    return asset.rpartition("/")[2].partition(".")[0]
