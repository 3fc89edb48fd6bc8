"""Loads the node types of Isaac Sim from `graphs/isaac/`, completed by those of the lab."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import INPUT, Catalog
from lab3_usd.spec.files import CATALOG
from lab3_usd.spec.isaac import BodyOf, IsaacTypes, Need, Release, SensorOf, UnitOf
from lab3_usd.spec.load.catalog import parse_catalog, parse_types
from lab3_usd.spec.load.records import record
from lab3_usd.spec.yaml_file import read_yaml

TYPES = "node_types.yaml"
NEEDS = "needs.yaml"
VERSIONS = "versions.yaml"
RENAMES = "renames.yaml"
SENSORS = "sensors.yaml"
BODIES = "bodies.yaml"
UNITS = "units.yaml"
APPLICATION = "application.yaml"


class _Renames(Struct, forbid_unknown_fields=True):
    prefixes: dict[str, str]
    renamed: dict[str, str]


class _Application(Struct, forbid_unknown_fields=True):
    prims: tuple[str, ...]


def assemble_types(folder: Path) -> IsaacTypes:
    """Read the files of `folder`, and the lab's node types beside it, which win.

    Raises:
        SpecError: a file is missing or wrong.
    """
    lab_data = read_yaml(folder.parent / CATALOG)
    lab = parse_catalog(lab_data)
    data = read_yaml(folder / TYPES)
    usd_types = {**lab_data["usd_types"], **data["usd_types"]}
    types = parse_types(data["types"], usd_types, f"{folder.name}/{TYPES}")
    names = record(read_yaml(folder / RENAMES), _Renames, f"{folder.name}/{RENAMES}")
    catalog = replace(
        lab,
        types={**types, **lab.types},
        prefixes={**names.prefixes, **lab.prefixes},
        renamed={**names.renamed, **lab.renamed},
    )
    where = f"{folder.name}/{VERSIONS}"
    releases = record(_tuples(read_yaml(folder / VERSIONS)), dict[str, Release], where)
    needs = _needs(folder, catalog, releases)
    sensors = record(read_yaml(folder / SENSORS), dict[str, SensorOf], f"{folder.name}/{SENSORS}")
    bodies = record(read_yaml(folder / BODIES), dict[str, BodyOf], f"{folder.name}/{BODIES}")
    units = record(read_yaml(folder / UNITS), dict[str, UnitOf], f"{folder.name}/{UNITS}")
    where = f"{folder.name}/{APPLICATION}"
    made = record(read_yaml(folder / APPLICATION), _Application, where)
    return IsaacTypes(catalog, needs, releases, sensors, bodies, units, made.prims)


def _tuples(data: Any) -> Any:  # noqa: ANN401 - whatever YAML holds
    """Make lists of values comparable with the values of ports."""
    if isinstance(data, dict):
        return {key: _tuples(each) for key, each in data.items()}
    return tuple(_tuples(each) for each in data) if isinstance(data, list) else data


def _needs(
    folder: Path, catalog: Catalog, releases: Mapping[str, Release]
) -> dict[str, tuple[Need, ...]]:
    where = f"{folder.name}/{NEEDS}"
    needs = record(read_yaml(folder / NEEDS), dict[str, tuple[Need, ...]], where)
    for name, entries in needs.items():
        kind = catalog.types.get(name)
        if kind is None:
            message = f"{where}: '{name}' is no node type"
            raise SpecError(message)
        known = set(kind.ports)
        for release in releases.values():
            known |= set(release.types[name].gone if name in release.types else ())
        for short in (each for need in entries for each in _named(need)):
            if INPUT + short not in known:
                message = f"{where}: {name} has no input '{short}'"
                raise SpecError(message)
    return needs


def _named(need: Need) -> Iterator[str]:
    """Yield the inputs that an entry names."""
    yield from need.inputs
    yield from filter(None, (need.when, need.when_wired, need.unless))
