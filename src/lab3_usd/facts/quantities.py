"""The unit of length and the quantity of the values that reach an input."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.articulations import Command, commands, joints_commanded
from lab3_usd.facts.execution_order import live_nodes, run_states
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.isaac.behaviour import UnitOf
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel, listed_once

_WHEEL_SPEEDS = "speeds of wheels"
_COMPONENTS = ("x", "y", "z")


def unit_of(node: Node, port: str, stage: StageModel, depth: int = 8) -> float | None:
    """Return how many metres are 1 in what comes into an input, None where nothing tells it."""
    fed = _only_source(node, port, stage) if depth else None
    if fed is None:
        return None
    source, out = fed
    units = _units(source, stage.platform)
    if units is None or out in units.metres:
        return None if units is None else 1.0
    unit = unit_of(source, INPUT + units.passes, stage, depth - 1) if units.passes else None
    if unit is None or not units.by:
        return unit
    stage_unit = stage.meters_per_unit or 1.0
    factors = {units.to_stage: stage_unit, units.to_metres: 1.0 / stage_unit}
    factor = factors.get(str(effective_value(source, INPUT + units.by, live_nodes(stage))))
    return None if factor is None else unit * factor


class Quantity(Struct, frozen=True, eq=False):
    """What a value is, with the component of a vector behind a comma, and the node it is from."""

    name: str
    maker: Node


def quantity_of(
    node: Node,
    port: str,
    stage: StageModel,
    component: str = "",
    depth: int = 8,
) -> Quantity | None:
    """Return the quantity that comes into an input, None where nothing tells it."""
    fed = _only_source(node, port, stage) if depth else None
    if fed is None:
        return None
    source, out = fed
    quantity = None if source.type is None else stage.platform.quantities.get(source.type.type)
    if quantity is not None and out in quantity.gives:
        name = quantity.gives[out]
        return Quantity(f"{name}, {component}" if component else name, source)
    units = _units(source, stage.platform)
    if units is None or not units.passes:
        return None
    part = out if out in _COMPONENTS else component
    return quantity_of(source, INPUT + units.passes, stage, part, depth - 1)


@listed_once
def wheel_commands(stage: StageModel) -> Iterator[tuple[Command, tuple[Prim, ...]]]:
    """Yield the commands that a controller of wheels computes, with the joints of the wheels."""
    for command in commands(stage):
        _, velocity, _ = command.ports.commands
        given = quantity_of(command.node, velocity, stage) if command.roots else None
        is_of_wheels = given is not None and given.name == _WHEEL_SPEEDS
        if is_of_wheels and command.node.path in run_states(stage):
            yield command, tuple(joints_commanded(command, velocity, stage))


def _units(node: Node, platform: Platform) -> UnitOf | None:
    return None if node.type is None else platform.units.get(node.type.type)


def _only_source(node: Node, port: str, stage: StageModel) -> tuple[Node, str] | None:
    """Return the node and the output, by its short name, that alone feed an input."""
    sources = live_sources(node, port, live_nodes(stage))
    if len(sources) != 1:
        return None
    source, out = sources[0]
    return source, out.removeprefix(OUTPUT)
