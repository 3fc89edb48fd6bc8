"""Which nodes publish a sensor, and which sensor that is."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.facts.execution_order import live_nodes, nodes_of
from lab3_usd.facts.render_products import sensor_of, shown_by
from lab3_usd.isaac.behaviour import SensorOf
from lab3_usd.isaac.topics import PRODUCT
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel


def read_sensors(stage: StageModel) -> Iterator[tuple[Node, SensorOf, str]]:
    """Yield the nodes that publish a sensor, with what they ask of it and its path."""
    sensors, live = stage.platform.sensors, live_nodes(stage)
    for node in nodes_of(lambda kind: kind.type in sensors, stage):
        needed = sensors.get("" if node.type is None else node.type.type)
        shown = shown_by(node, PRODUCT, stage, live)
        path = sensor_of(node, live) if shown is None else shown.sensor
        if needed is not None and path is not None:
            yield node, needed, path


def read_lidars(stage: StageModel) -> list[Prim]:
    """Return the lidars that a node publishes."""
    paths = dict.fromkeys(path for _, needed, path in read_sensors(stage) if needed.needs)
    return [prim for path in paths if (prim := stage.prim(path)) is not None]
