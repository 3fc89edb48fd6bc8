"""Loads what is known of RTX sensors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.sensor_models import (
    LidarNames,
    LongList,
    SchemaAttribute,
    SchemaRules,
    SensorModels,
    SensorSchema,
)
from lab3_usd.yaml_file import read_record


class _SchemaFile(Struct, forbid_unknown_fields=True):
    about: str
    schemas: dict[str, SensorSchema]


class _ModelFile(Struct, forbid_unknown_fields=True):
    lidar: LidarNames
    renamed: dict[str, str]
    any_type: tuple[str, ...]
    schemas: dict[str, SchemaRules]


def sensor_models(folder: Path) -> SensorModels:
    """Read the schemas of sensors, and what their values must be.

    Raises:
        SpecError: a file is missing or wrong.
    """
    schemas = read_record(folder / "sensor_schemas.json", _SchemaFile).schemas
    said = read_record(folder / "sensor_models.yaml", _ModelFile)
    return SensorModels(
        {
            name: replace(
                schema,
                attributes={
                    attribute: replace(said, default=_default(said.default))
                    for attribute, said in schema.attributes.items()
                },
            )
            for name, schema in schemas.items()
        },
        said.schemas,
        said.lidar,
        said.renamed,
        frozenset(said.any_type),
    )


def _read(schema: SensorSchema) -> dict[str, SchemaAttribute]:
    return {
        name: replace(said, default=_default(said.default))
        for name, said in schema.attributes.items()
    }


def _default(said: Any) -> Any:
    """Return a default as values of stages are: lists become tuples."""
    if isinstance(said, dict):
        return LongList(said["length"], _default(said["low"]), _default(said["high"]))
    return tuple(map(_default, said)) if isinstance(said, list) else said
