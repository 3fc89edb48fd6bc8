"""Recipes: Action Graphs with holes, which facts of a stage fill.

A hole is a value `$name`. A node with `when` is there while all of these holes are filled (`!name`:
while it is not) and the release has the node types that it names, one with `each` once for each
entry of a list; `$item.key` is a hole of the entry.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import Struct


class SensorKind(Struct, frozen=True, forbid_unknown_fields=True):
    """The prims that a recipe publishes: of these types, with this schema, inside a body.

    Before the release `since` such sensors were other prims.
    """

    types: tuple[str, ...]
    since: str = ""
    needs: str = ""
    inside: str = ""


class RecipeNode(Struct, frozen=True, forbid_unknown_fields=True):
    """A node of a recipe, by its role.

    One that is `shared` may be a node that the graph has already, where it does the same.
    """

    type: str
    set: Mapping[str, Any] = {}
    targets: Mapping[str, Any] = {}
    ports: tuple[str, ...] = ()
    when: tuple[str, ...] = ()
    each: str = ""
    shared: bool = False


class Recipe(Struct, frozen=True, forbid_unknown_fields=True):
    """A graph with holes, and what it needs.

    `title` says what it does, `graph` is its usual name. `needs` are the facts that fill the holes,
    `options` those of the command that it takes, `usual` values of holes that nothing else fills.
    `outputs` are what can be published, each with its holes, `publishes` what is without a choice.
    `joint_mark` is the attribute of the joints that it is about. `leaves` are rules whose findings
    something else resolves, and what. One that `is_single` is there once for a robot.
    """

    kind: str
    title: str
    graph: str
    nodes: Mapping[str, RecipeNode]
    wires: tuple[str, ...]
    needs: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    usual: Mapping[str, Any] = {}
    outputs: Mapping[str, Mapping[str, Any]] = {}
    publishes: tuple[str, ...] = ()
    sensor: SensorKind | None = None
    joint_mark: str = ""
    leaves: Mapping[str, str] = {}
    is_single: bool = False
