"""The node types of a new lab that are not among the public ones."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from msgspec.structs import replace

from lab3_usd.data import data_folder
from lab3_usd.describe.yaml_text import document
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, OUTPUT, Catalog
from lab3_usd.spec.files import CATALOG
from lab3_usd.spec.load.catalog import parse_types
from lab3_usd.spec.values import is_known_type
from lab3_usd.spec.yaml_file import read_yaml

_HEAD = "What the stage has beside the public node types of Isaac Sim and their names of today."
_NOTES = {
    "renamed": "Names of earlier releases.",
    "types": "The ports are those of the stage: say what they are.",
}
_SIGNAL = re.compile(r"exec", re.IGNORECASE)


def unknown_types(nodes: Iterable[Node]) -> dict[str, dict[str, Any]]:
    """Describe the types that no catalog has by the ports that the nodes show."""
    found: dict[str, dict[str, Any]] = {}
    for node in nodes:
        if node.type is not None or not node.type_name:
            continue
        word = node.type_name.rpartition(".")[2]
        said = found.setdefault(
            node.type_name,
            {"version": 1, "name": word, "prim": _prim_name(word), "inputs": {}, "outputs": {}},
        )
        said["version"] = max(said["version"], node.version or 1)
        for name, state in node.ports.items():
            side = "inputs" if name.startswith(INPUT) else "outputs"
            short = name.removeprefix(INPUT).removeprefix(OUTPUT)
            kind = said[side].get(short, "union")
            said[side][short] = _ogn_type(short, state.usd_type) if kind == "union" else kind
    return found


def _prim_name(word: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word).lower()


def _ogn_type(short: str, usd_type: str) -> str:
    if usd_type == "rel":
        return "target"
    if _SIGNAL.match(short):
        return "execution"
    return usd_type if is_known_type(usd_type) else "union"


def with_types(catalog: Catalog, unknown: Mapping[str, Any]) -> Catalog:
    """Return a catalog that has these types as well."""
    if not unknown:
        return catalog
    usd_types = read_yaml(data_folder("graphs") / CATALOG)["usd_types"]
    return replace(catalog, types={**catalog.types, **parse_types(unknown, usd_types, CATALOG)})


def catalog_text(used: Mapping[str, str], known: Catalog, unknown: Mapping[str, Any]) -> str:
    """Return `node_types.yaml`, '' where every type of the stage is a public one of today.

    `used` maps the names of types as the stage writes them to those of today, `known` is the
    bundled lab's catalog.
    """
    old = {name: new for name, new in sorted(used.items()) if known.modern(name) != new}
    data: dict[str, Any] = {}
    if old:
        data["renamed"] = {**known.renamed, **old}
    if unknown:
        data["types"] = unknown
    return document(_HEAD, data, _NOTES) if data else ""
