"""What is wrong with the values of a sensor, by its schemas and what is known of its model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from re import escape, fullmatch
from typing import Any

from msgspec import Struct

from lab3_usd.facts.likely_names import near_name
from lab3_usd.facts.sensor_rules import breaches
from lab3_usd.facts.sensor_values import SensorValues, values_of
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.isaac.sensor_models import INSTANCE, Ends, SensorModels
from lab3_usd.model.finding import Severity, display
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, once_per_stage

_KNOWN_SINCE = "6.0"  # the first release whose schemas are known
_KINDS: Mapping[str, type] = {
    "bool": bool,
    **dict.fromkeys(("uchar", "int", "uint", "int64", "uint64"), int),
    **dict.fromkeys(("half", "float", "double"), float),
    **dict.fromkeys(("string", "token"), str),
}
_SCHEMA = "the schema"
_MOST_KNOWN = 1000  # sensors whose faults are kept for further stages
_ALIKE = 0.6  # of a name and the one that was likely meant
_LONG = 1000  # entries of a list that is not compared with those of other sensors


class SensorFault(Struct, frozen=True):
    """A value that a sensor cannot have, or that does not fit another one.

    `attributes` are those that it is about, first the one to repair; an instance with an odd name
    has none. It `ends` what it prevents, where it is an error. `is_open` tells whether an asset
    that is missing could say otherwise, `is_type` whether the value has another type than it must.
    """

    attributes: tuple[str, ...]
    message: str
    expected: str
    severity: Severity
    source: str
    ends: Ends = "model"
    is_open: bool = False
    is_type: bool = False

    def stops(self, *, is_scan: bool) -> bool:
        """Whether nothing comes of the sensor, where its node publishes a laser scan or not."""
        return self.severity == "error" and self.ends in (
            ("model", "scan") if is_scan else ("model",)
        )


@once_per_stage
def faults_of(prim: Prim, stage: StageModel) -> tuple[SensorFault, ...]:
    """Return what is wrong with the values of a sensor's prim."""
    # A missing asset may be above one of several that are alike.
    alike = (prim.type, prim.apis, stage.unknown(prim.path) is None)
    return known_faults(stage.platform, values_of(prim, stage), alike)


def known_faults(
    platform: Platform, values: SensorValues, alike: tuple[object, ...] = ()
) -> tuple[SensorFault, ...]:
    """Return what `sensor_faults` does, and keep it: many robots are alike, and many stages.

    Sensors with the same values are `alike` where nothing else says what attributes they have.
    """
    if any(len(value) > _LONG for value in values.written.values() if type(value) is tuple):
        return sensor_faults(platform, values)
    stored = _known_faults(platform)
    key = (alike or values.apis, repr([*values.written.items()]))
    if key not in stored:
        if len(stored) >= _MOST_KNOWN:
            stored.clear()
        stored[key] = sensor_faults(platform, values)
    return stored[key]


@lru_cache(maxsize=4)
def _known_faults(
    _platform: Platform,
) -> dict[tuple[object, ...], tuple[SensorFault, ...]]:
    """Keep what is wrong with the values of sensors, by their schemas and values."""
    return {}


def sensor_faults(platform: Platform, values: SensorValues) -> tuple[SensorFault, ...]:
    """Return what is wrong with the values that a stage has written of a sensor.

    What rests on a value that is wrong by itself is not judged.
    """
    faults: list[SensorFault] = []
    wrong: set[str] = set()
    for fault in _all_faults(platform, values, wrong) if values.attributes else ():
        faults.append(fault)
        wrong.update(fault.attributes[:1])
    return tuple(faults)


def _all_faults(platform: Platform, values: SensorValues, wrong: set[str]) -> Iterator[SensorFault]:
    models, release = platform.sensor_models, platform.release
    is_known = is_release_within(release, _KNOWN_SINCE, "")
    if is_known:
        yield from _types(values, models)
    for name in dict.fromkeys(name for name, _ in models.applied(values.apis)):
        part = models.rules.get(name)
        for rule in () if part is None else part.rules:
            if part is not None and is_release_within(release, rule.since, rule.until):
                for breach in breaches(rule, part, values, wrong):
                    yield SensorFault(
                        breach.names,
                        f"{breach.message}{rule.effect and ': '}{rule.effect}",
                        breach.expected,
                        rule.severity,
                        rule.source,
                        rule.ends,
                        breach.is_list,
                    )
    if is_known:
        yield from _tokens(values, platform, wrong)
        yield from _unknown_names(values, models)
        yield from _odd_instances(values.apis, models)


def _types(values: SensorValues, models: SensorModels) -> Iterator[SensorFault]:
    for name, value in values.written.items():
        said = values.attributes.get(name)
        if said is None:
            continue
        if name not in models.any_type and not _fits(value, said.type):
            message = f"{name} has type {_type_of(value)}, expected {said.type}"
            yield SensorFault((name,), message, said.type, "error", _SCHEMA, is_type=True)
        elif not _is_finite(value):
            message = f"{name} is {display(value)}, which is not a finite number"
            yield SensorFault((name,), message, "a finite number", "warning", _SCHEMA)


def _fits(value: Any, usd_type: str) -> bool:
    """Whether a value is of a type; whole numbers of any size are alike, and so are others."""
    if usd_type.endswith("[]"):
        return isinstance(value, tuple) and all(_fits(item, usd_type[:-2]) for item in value)
    kind = _KINDS.get(usd_type)
    if kind is not None:
        return type(value) is kind
    kind = _KINDS.get(usd_type.rstrip("234"))  # of a vector
    return kind is None or (isinstance(value, tuple) and all(type(item) is kind for item in value))


def _type_of(value: Any) -> str:
    if isinstance(value, tuple):
        return f"{_type_of(value[0]) if value else ''}[]"
    return "string" if isinstance(value, str) else type(value).__name__


def _is_finite(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


def _tokens(values: SensorValues, platform: Platform, wrong: set[str]) -> Iterator[SensorFault]:
    """Yield tokens that the schema does not have, where no rule speaks of them."""
    for name, value in values.written.items():
        said = values.attributes.get(name)
        tokens = () if said is None or name in wrong else said.tokens
        if tokens and value not in tokens and not _is_token_judged(name, platform):
            expected = " or ".join(tokens)
            message = f"{name} is {display(value)}, expected {expected}"
            yield SensorFault((name,), message, expected, "warning", _SCHEMA)


def _is_token_judged(name: str, platform: Platform) -> bool:
    """Whether a rule says what the token of an attribute must be."""
    return any(
        name in map(part.whole, rule.of)
        for part in platform.sensor_models.rules.values()
        for rule in part.rules
        if rule.among and is_release_within(platform.release, rule.since, rule.until)
    )


def _unknown_names(values: SensorValues, models: SensorModels) -> Iterator[SensorFault]:
    """Yield attributes that no schema has, and those of an instance that is not applied."""
    spaces = tuple(dict.fromkeys(f"{name.rpartition(':')[0]}:" for name in values.attributes))
    for name in values.written:
        if name in values.attributes or not name.startswith(spaces):
            continue
        attributes = [each for schema in models.schemas.values() for each in schema.attributes]
        if name in attributes:
            continue
        instance = next(filter(None, (_instance_in(name, each) for each in attributes)), "")
        nearest = models.renamed.get(name) or _nearest(name, values.attributes)
        if instance:
            reason, expected = f"'{instance}' is not applied", f"'{instance}' applied"
        elif nearest:
            reason, expected = f"no schema has it; the nearest is {nearest}", nearest
        else:
            reason, expected = "no schema has it", "a name that a schema has"
        message = f"{name} is ignored: {reason}"
        yield SensorFault((name,), message, expected, "warning", _SCHEMA, is_open=True)


def _instance_in(name: str, template: str) -> str:
    """Return the instance that a name is of where a template is its own, else ''."""
    if INSTANCE not in template:
        return ""
    match = fullmatch(escape(template).replace(escape(INSTANCE), "([^:]+)"), name)
    return match[1] if match else ""


def _nearest(name: str, attributes: Iterable[str]) -> str:
    """Return the known name whose last part is the most like that of a name, '' for none."""
    short = {each.rpartition(":")[2].lower(): each for each in attributes}
    near = near_name(name.rpartition(":")[2].lower(), short, _ALIKE)
    return "" if near is None else short[near]


def _odd_instances(apis: tuple[str, ...], models: SensorModels) -> Iterator[SensorFault]:
    """Yield instances of schemas with other names than they should have."""
    patterns = {
        schema: pattern
        for part in models.rules.values()
        for schema, pattern in part.instances.items()
    }
    for name, instance in models.applied(apis):
        pattern = patterns.get(name)
        if pattern is not None and fullmatch(pattern, instance) is None:
            message = f"the instance '{instance}' of {name} is expected to be called {pattern}"
            yield SensorFault((), message, pattern, "warning", _SCHEMA, is_open=True)
