"""Reads a script into stages as plain data: one for each way through it that builds graphs."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from msgspec import Struct

from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.stage import StageModel, Unknown
from lab3_usd.scripts.runs import Way, ways
from lab3_usd.scripts.sources import Source, may_build, may_change, parse, read_source
from lab3_usd.scripts.stage_model import modelled
from lab3_usd.scripts.values import At
from lab3_usd.scripts.world import BuiltNode, SceneGraphs, World

_STACK = 256 * 1024 * 1024
_DEEPEST = 20_000
_T = TypeVar("_T")


class BuiltStage(Struct, frozen=True, eq=False):
    """The stage that one way through a script leaves, and the places that it came by.

    `start` numbers the starts of the script: ways of one start are alternatives.
    """

    model: StageModel
    world: World
    start: int


class ReadScript(Struct, frozen=True, eq=False):
    """A script with the stages that it builds; `stopped` are lines at which reading ended early."""

    source: Source
    stages: tuple[BuiltStage, ...]
    stopped: tuple[int, ...] = ()

    @property
    def worlds(self) -> list[World]:
        """What each way builds."""
        return [stage.world for stage in self.stages]

    @property
    def graphs(self) -> int:
        """How many graphs are built, those of all ways."""
        paths = {
            (path, graph.at)
            for world in self.worlds
            for path, graph in world.graphs.items()
            if any(True for _ in world.nodes_of(path))
        }
        return len(paths)

    @property
    def nodes(self) -> int:
        """How many nodes are built, those of all ways."""
        return len({(node.path, node.at) for world in self.worlds for node in world.nodes.values()})

    @property
    def wires(self) -> int:
        """How many wires are drawn, those of all ways."""
        return len(
            {
                (node.path, name, source, at)
                for world in self.worlds
                for node in _changed(world)
                for name, port in node.ports.items()
                for source, (at, _, _) in port.sources.items()
                if not port.is_promoted(source)
            }
        )

    @property
    def values(self) -> int:
        """How many inputs are set, those of all ways."""
        return len(
            {
                (node.path, name, port.at)
                for world in self.worlds
                for node in _changed(world)
                for name, port in node.ports.items()
                if port.at is not None
            }
        )

    @property
    def unknown(self) -> tuple[Unknown, ...]:
        """What is not known before it runs: values of inputs, and parts of what is built."""
        unread = {each: None for world in self.worlds for each in world.unread}
        return tuple(sorted(unread, key=lambda each: (each.line, each.why)))


def _changed(world: World) -> Iterator[BuiltNode]:
    """Yield the nodes that a script makes, and those of its scene that it changes."""
    yield from world.nodes.values()
    yield from world.changed.values()


def read_script(
    path: Path, platform: Platform, scene: StageModel | None = None
) -> ReadScript | None:
    """Read the graphs that a script builds, None where it builds none.

    Nothing of it is run, and nothing that it imports or names is opened. `scene` is the stage that
    it loads, if that is known.

    Raises:
        StageError: the script cannot be read; a line says why.
    """
    is_candidate = may_build if scene is None else may_change
    if not is_candidate(path, platform.building.module):
        return None
    source = read_source(path)
    graphs = () if scene is None else scene.graphs
    nodes = {node.path: node for graph in graphs for node in graph.nodes}
    there = SceneGraphs(frozenset(graph.path for graph in graphs), nodes)
    starts = in_deep_thread(lambda: list(ways(parse(source), platform.building, there)))
    stages: list[BuiltStage] = []
    stopped: set[int] = set()
    for number, alternatives in enumerate(starts):
        for way in alternatives:
            if way.stopped:
                stopped.add(source.line(way.stopped))
            stages += (
                BuiltStage(modelled(world, platform, scene), world, number)
                for world in way.worlds
                if (world.nodes or world.changed or world.removed or world.faults)
                or any(graph.is_ours for graph in world.graphs.values())
            )
    if not stages and not stopped:
        return None
    return ReadScript(source, tuple(stages), tuple(sorted(stopped)))


def in_deep_thread(function: Callable[[], _T]) -> _T:
    """Call a function where calls may nest deeply.

    Raises:
        StageError: they nest more deeply than that.
    """
    results: list[_T] = []
    errors: list[BaseException] = []

    def call() -> None:
        try:
            results.append(function())
        except (RecursionError, MemoryError):
            errors.append(StageError("the script is nested too deeply to be read"))
        except BaseException as error:  # noqa: BLE001 - it is raised where it is waited for
            errors.append(error)

    before, limit = threading.stack_size(_STACK), sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, _DEEPEST))
    try:
        thread = threading.Thread(target=call)
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
        sys.setrecursionlimit(limit)
    if errors:
        raise errors[0]
    return results[0]


__all__ = ["At", "BuiltStage", "ReadScript", "Way", "read_script"]
