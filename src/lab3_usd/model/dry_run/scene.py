"""A composed stage as a dry run plays it: its graphs and prims, with the values at the start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec import Struct

from lab3_usd.model.dry_run.affine import Affine


class Input(Struct, frozen=True):
    """An input of a node as it is saved: the type it is declared with, its value, its wires."""

    type: str
    value: Any = None
    literal: Any = None  # what an extended port holds beside its value
    sources: tuple[str, ...] = ()


class Node(Struct, frozen=True):
    """A node prim."""

    path: str
    type: str
    version: int
    inputs: dict[str, Input]
    targets: dict[str, tuple[str, ...]]
    namespace: str = ""


class Graph(Struct, frozen=True):
    """A graph prim and its nodes, in the order of the stage."""

    path: str
    evaluator: str
    pipeline: str
    mode: str
    nodes: tuple[Node, ...]


class Prim(Struct, frozen=True):
    """Any other prim that is in the scene; `world` is where it is authored to stand."""

    path: str
    type: str
    apis: frozenset[str]
    world: Affine
    values: dict[str, Any]
    targets: dict[str, tuple[str, ...]]
    seen: bool
    loose: bool = False  # `!resetXformStack!`: it does not go with what is above it


class Scene(Struct, frozen=True):
    """A stage: its units, its graphs, and its prims by path in the order of the stage.

    `missing` are the assets that cannot be found, by the prim that refers to them.
    """

    meters_per_unit: float
    up: str
    graphs: tuple[Graph, ...]
    prims: dict[str, Prim]
    missing: dict[str, str]

    def below(self, path: str) -> Iterator[Prim]:
        """Yield a prim and all below it."""
        inside = f"{path}/"
        for each in self.prims.values():
            if each.path == path or each.path.startswith(inside):
                yield each

    def above(self, path: str) -> Iterator[Prim]:
        """Yield a prim and all above it, nearest first."""
        while path:
            if path in self.prims:
                yield self.prims[path]
            path = path.rpartition("/")[0]
