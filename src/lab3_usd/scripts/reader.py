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
from lab3_usd.scripts.runs import ways
from lab3_usd.scripts.sources import Source, may_build, may_change, parse, read_source
from lab3_usd.scripts.stage_model import modelled
from lab3_usd.scripts.world import BuiltNode, BuiltPort, SceneGraphs, World

_STACK = 256 * 1024 * 1024
_DEEPEST = 20_000
_T = TypeVar("_T")


class BuiltStage(Struct, frozen=True, eq=False):
    """The stage that one way through a script leaves, and the places that it came by."""

    model: StageModel
    world: World


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
        return len(
            {
                (graph.path, graph.at)
                for world in self.worlds
                for graph in world.graphs.values()
                if any(world.nodes_of(graph.path))
            }
        )

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
                for node, name, port in self._ports()
                for source, at in port.sources.items()
                if source not in port.promoted
            }
        )

    @property
    def values(self) -> int:
        """How many inputs are set, those of all ways."""
        ports = self._ports()
        return len({(node.path, name, port.at) for node, name, port in ports if port.at})

    @property
    def unknown(self) -> tuple[Unknown, ...]:
        """What is not known before it runs: values of inputs, and parts of what is built."""
        unread = {each: None for world in self.worlds for each in world.unread}
        return tuple(sorted(unread, key=lambda each: (each.line, each.why)))

    def _ports(self) -> Iterator[tuple[BuiltNode, str, BuiltPort]]:
        """Yield the ports of the nodes that the script makes or changes, with their names."""
        for world in self.worlds:
            for node in (*world.nodes.values(), *world.changed.values()):
                yield from ((node, name, port) for name, port in node.ports.items())


def read_script(path: Path, platform: Platform, scene: StageModel | None) -> ReadScript | None:
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
    followed = in_deep_thread(lambda: list(ways(parse(source), platform.building, there)))
    stages = tuple(
        BuiltStage(modelled(world, platform, scene), world)
        for way in followed
        for world in way.worlds
        if (world.nodes or world.changed or world.removed or world.faults)
        or any(graph.is_ours for graph in world.graphs.values())
    )
    stopped = {source.line(way.stopped) for way in followed if way.stopped}
    return ReadScript(source, stages, tuple(sorted(stopped))) if stages or stopped else None


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
