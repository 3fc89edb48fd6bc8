"""Loads the recipes of graphs, checked against the node types that they name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from lab3_usd.errors import SpecError
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.yaml_file import as_record, read_yaml

FOLDER = "recipes"
_WIRE = re.compile(r"^(\w+)\.(\w+) -> (\w+)\.(\w+)$")


def load_recipes(folder: Path, types: Mapping[str, NodeType]) -> dict[str, Recipe]:
    """Return the recipes of a folder by kind, in the order of their files' names.

    Raises:
        SpecError: a file is wrong; the line names file, role and port.
    """
    recipes = {}
    for file in sorted((folder / FOLDER).glob("*.yaml")):
        recipe = as_record(read_yaml(file), Recipe, file.name)
        _check(recipe, types, file.name)
        recipes[recipe.kind] = recipe
    return recipes


def _check(recipe: Recipe, types: Mapping[str, NodeType], file: str) -> None:
    for role, node in recipe.nodes.items():
        if node.type not in types:
            raise SpecError(f"{file}: {role}: '{node.type}' is not a node type")
        kind = types[node.type]
        for port in (*node.set, *node.targets, *node.ports):
            if kind.input(port) is None and not kind.grows_by_message:
                raise SpecError(f"{file}: {role}: {node.type} has no input '{port}'")
    for text in recipe.wires:
        match = _WIRE.match(text)
        ends = (match[1], match[3]) if match else ()
        if match is None or any(role not in recipe.nodes for role in ends):
            raise SpecError(f"{file}: wire '{text}': is not written 'role.port -> role.port'")
