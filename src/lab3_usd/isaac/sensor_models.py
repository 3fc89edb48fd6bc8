"""The schemas of RTX sensors: their attributes, and what the values of these must be."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal

from msgspec import Struct

INSTANCE = "*"  # the name of an instance, in the names of attributes that each instance has
_ANY = "omni:"  # how a whole name begins


class LongList(Struct, frozen=True, forbid_unknown_fields=True):
    """A long default: how many entries it has, the lowest and the highest."""

    length: int
    low: Any
    high: Any


class SchemaAttribute(Struct, frozen=True, forbid_unknown_fields=True):
    """An attribute of a schema: its USD type, its default and its tokens, where there are any."""

    type: str
    default: Any = None
    tokens: tuple[str, ...] = ()


class SensorSchema(Struct, frozen=True, forbid_unknown_fields=True):
    """An applied schema: its attributes, and the schemas that it brings, with their instances."""

    brings: tuple[str, ...]
    attributes: Mapping[str, SchemaAttribute]


Ends = Literal["model", "scan", "returns"]


class ValueRule(Struct, frozen=True, forbid_unknown_fields=True):
    """What the values of the attributes `of` must be, one by one and entry by entry.

    A limit is a number or an attribute, whose entries are the limits of entries. A value may be
    above `most` by `spare`. `entries` is how many a list has (`or_empty`: or none; `from_one`: no
    range counts as one). `distinct` is the attribute with the most values that all instances
    together may have. A value lies in the period of the rate `period_of` in ns, is `ordered` where
    none is less than the one before, and is one of `among`, whatever its case. With `some`, an
    entry is true. The formula `holds` is true, in which each of `of` has the last part of its name
    (`facts.formulas`).

    It counts `when` attributes have these values, `when_above` these numbers, and `unless` one has
    a value. Where it is broken, the `model` does not start, no laser `scan` comes, or one without
    `returns`, or `effect` says what happens. `since` is the first release that is known to ask for
    it, `until` the last, `source` who says so.
    """

    of: tuple[str, ...]
    source: str
    severity: Literal["error", "warning", "note"] = "warning"
    since: str = "6.0"
    until: str = ""
    effect: str = ""
    when: Mapping[str, Any] = {}
    when_above: Mapping[str, float] = {}
    unless: str = ""
    entries: int | str | None = None
    or_empty: bool = False
    from_one: bool = False
    above: float | str | None = None
    least: float | str | None = None
    below: float | str | None = None
    most: float | str | None = None
    spare: int = 0
    period_of: str = ""
    ordered: bool = False
    some: bool = False
    distinct: str = ""
    among: tuple[Any, ...] = ()
    holds: str = ""
    ends: Ends = "model"


class SchemaRules(Struct, frozen=True, forbid_unknown_fields=True):
    """The rules of a schema, whose names stand below `namespace`.

    `instances` are patterns of the names that instances of schemas should have.
    """

    rules: tuple[ValueRule, ...]
    namespace: str = ""
    instances: Mapping[str, str] = {}

    def whole(self, name: str, instance: str = "") -> str:
        """Return the whole name of an attribute, of an instance."""
        full = name if name.startswith(_ANY) else self.namespace + name
        return full.replace(INSTANCE, instance) if instance else full


class LidarNames(Struct, frozen=True, forbid_unknown_fields=True):
    """Attributes of a lidar that the program asks for by itself.

    Its `rate` of reading, turns and firings a second, the ranges within which it sees, the angles
    of its emitters, by instance. Its `kind` is `still` where it does not turn; `whole` says whether
    each output is a whole turn. `circle` are the limits of the azimuth, with their usual values;
    rays with other values than those of `played` go elsewhere than a dry run plays them.
    """

    rate: str
    turns: str
    firings: str
    near: str
    far: str
    azimuths: str
    elevations: str
    kind: str
    still: str
    whole: str
    circle: Mapping[str, float]
    played: Mapping[str, tuple[Any, ...]]


class SensorModels(Struct, frozen=True, eq=False):
    """What is known of RTX sensors.

    `renamed` maps names of earlier releases to those of today. Values of `any_type` may have
    another type than the schema's.
    """

    schemas: Mapping[str, SensorSchema]
    rules: Mapping[str, SchemaRules]
    lidar: LidarNames
    renamed: Mapping[str, str]
    any_type: frozenset[str]
    known: dict[frozenset[str], dict[str, SchemaAttribute]] = {}

    def is_sensor(self, apis: Iterable[str]) -> bool:
        """Whether one of these applied schemas is a sensor's."""
        return any(api.partition(":")[0] in self.schemas for api in apis)

    def attributes_of(self, apis: Iterable[str]) -> Mapping[str, SchemaAttribute]:
        """Return the attributes that applied schemas give a prim, by whole name.

        A schema overrides those that it brings.
        """
        applied = frozenset(apis)
        if applied not in self.known:
            attributes: dict[str, SchemaAttribute] = {}
            named = sorted(
                self.applied(applied), key=lambda pair: bool(self.schemas[pair[0]].brings)
            )
            for name, instance in named:
                for attribute, said in self.schemas[name].attributes.items():
                    attributes[attribute.replace(INSTANCE, instance)] = said
            self.known[applied] = attributes
        return self.known[applied]

    def applied(self, apis: Iterable[str]) -> Iterator[tuple[str, str]]:
        """Yield the sensor schemas that are applied, with those that they bring, and instances."""
        own = dict.fromkeys(api for api in apis if api.partition(":")[0] in self.schemas)
        brought = (more for api in own for more in self.schemas[api.partition(":")[0]].brings)
        for api in dict.fromkeys((*brought, *own)):
            name, _, instance = api.partition(":")
            yield name, instance
