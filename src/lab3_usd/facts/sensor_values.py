"""The values that a sensor has: as a stage has written them, or else by its schemas."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.sensor_models import INSTANCE, LidarNames, LongList, SchemaAttribute
from lab3_usd.model.physics import number
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel


class SensorValues(Struct, frozen=True, eq=False):
    """The applied schemas of a sensor, their attributes, and the values that a stage has written.

    Where an asset is missing, the attributes have no defaults: it may have other values.
    """

    apis: tuple[str, ...]
    attributes: Mapping[str, SchemaAttribute]
    written: Mapping[str, Any]

    def get(self, name: str) -> Any:
        """Return the value of an attribute, None where neither stage nor schema has one."""
        value = self.written.get(name)
        return self.default(name) if value is None else value

    def default(self, name: str) -> Any:
        """Return the value by schema, None where it has none."""
        said = self.attributes.get(name)
        return None if said is None else said.default

    def number(self, name: str) -> float | None:
        """Return a value that is a number: as written, else by schema; None without one."""
        written = number(self.written.get(name))
        return number(self.default(name)) if written is None else written

    def of_instances(self, name: str) -> dict[str, Any]:
        """Return the values of an attribute that each instance has, by whole name."""
        start, _, end = name.partition(INSTANCE)
        names = (full for full in self.attributes if full.startswith(start) and full.endswith(end))
        return {full: self.get(full) for full in names}


def sensor_values(
    platform: Platform, apis: Iterable[str], written: Mapping[str, Any]
) -> SensorValues:
    """Return the values of a prim with these applied schemas and these written values."""
    applied = tuple(apis)
    return SensorValues(applied, platform.sensor_models.attributes_of(applied), written)


def values_of(prim: Prim, stage: StageModel) -> SensorValues:
    """Return the values of a sensor's prim.

    A missing asset is taken to bring the schema that nodes need of a sensor of this type.
    """
    if stage.unknown(prim.path) is None:
        return sensor_values(stage.platform, prim.apis, prim.attributes)
    needed = (each.needs for each in stage.platform.sensors.values() if prim.type in each.types)
    values = sensor_values(stage.platform, (*prim.apis, *filter(None, needed)), prim.attributes)
    open_ones = {name: replace(said, default=None) for name, said in values.attributes.items()}
    return replace(values, attributes=open_ones)


def reading_rates(values: SensorValues, names: LidarNames) -> tuple[float, float] | None:
    """Return how often a lidar is read and turns in a second, None where these are the same."""
    tick, turns = values.number(names.rate), values.number(names.turns)
    is_apart = tick is not None and tick >= 0 and turns and tick != turns
    return (tick, turns) if is_apart and tick is not None and turns is not None else None


def listed_entries(value: Any) -> tuple[Any, ...]:
    """Return the entries of a list, of a long default its lowest and highest, or a single value."""
    if isinstance(value, LongList):
        return (value.low, value.high)
    return value if isinstance(value, tuple) else (value,)


def entry_count(value: Any) -> int:
    """Return how many entries a list has, 0 where it is none."""
    if isinstance(value, LongList):
        return value.length
    return len(value) if isinstance(value, tuple) else 0
