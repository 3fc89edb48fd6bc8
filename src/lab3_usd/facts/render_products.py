"""What a render product shows, its sensor and its size, and which nodes publish a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes, nodes_in
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.isaac.behaviour import SensorOf
from lab3_usd.isaac.topics import PRODUCT, product_input
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel


class Shown(Struct, frozen=True):
    """The sensor whose product reaches a node, and the size; None where that is unknown.

    `maker` is the node that makes the product, or names it itself.
    """

    sensor: str
    size: tuple[int, int] | None
    maker: str


def shown_by(node: Node, port: str, stage: StageModel, live: Mapping[str, Node]) -> Shown | None:
    """Return what the product at an input shows, None where nothing tells it.

    A product that is named is used as it is (OgnIsaacCreateRenderProduct.py:113-142), and so is one
    whose path is written into the input (OgnROS2CameraHelper.py:258-264).
    """
    if not node.sources(port):
        written = stage.products.get(str(node.value(port)))
        if written is None or not written.camera:
            return None
        return Shown(written.camera, _size(written.size), node.path)
    sources = live_sources(node, port, live)
    maker = sources[0][0] if len(sources) == 1 else None
    ports = maker.type.product if maker is not None and maker.type is not None else None
    if maker is None or ports is None:
        return None
    named = maker.targets(ports.named)
    if len(named) == 1 and named[0] in stage.products:
        product = stage.products[named[0]]
        return Shown(product.camera, _size(product.size), maker.path) if product.camera else None
    cameras = maker.targets(ports.camera)
    size = tuple(effective_value(maker, name, live) for name in ports.size)
    return Shown(cameras[0], _size(size), maker.path) if cameras else None


def _size(values: tuple[object, ...]) -> tuple[int, int] | None:
    sides = [value for value in values if isinstance(value, int) and not isinstance(value, bool)]
    return (sides[0], sides[1]) if len(sides) == len(values) == len(("width", "height")) else None


def stereo_products(
    node: Node, stage: StageModel, live: Mapping[str, Node]
) -> tuple[Shown, Shown] | None:
    """Return what the products of a stereo pair show, left and right; None for no known pair."""
    topics = () if node.type is None else node.type.topics
    if len(topics) < len(("left", "right")):
        return None
    ports = dict.fromkeys(map(product_input, topics))
    shown = [shown_by(node, port, stage, live) for port in ports if node.has_port(port)]
    if len(shown) != len(("left", "right")) or shown[0] is None or shown[1] is None:
        return None
    return shown[0], shown[1]


def has_two_sizes(pair: tuple[Shown, Shown] | None) -> bool:
    """Whether the images of a stereo pair surely differ in size.

    Then neither camera info is sent (OgnROS2CameraInfoHelper.py:350-354).
    """
    sizes = {shown.size for shown in pair or ()}
    return None not in sizes and len(sizes) > 1


def sensor_of(node: Node, live: Nodes) -> str | None:
    """Return the path of the prim whose render product the node reads, None where it reads none."""
    for source, _ in live_sources(node, PRODUCT, live):
        for port in () if source.type is None else source.type.ports.values():
            if port.is_target and source.targets(port.name):
                return source.targets(port.name)[0]
    return None


def sensor_shown(node: Node, stage: StageModel, live: Nodes) -> str | None:
    """Return the path of the sensor of a node's product, also of one that is used as it is."""
    shown = shown_by(node, PRODUCT, stage, live)
    return sensor_of(node, live) if shown is None else shown.sensor


def read_sensors(stage: StageModel) -> Iterator[tuple[Node, SensorOf, Prim]]:
    """Yield the nodes that publish a sensor of the scene, with what they ask of it and its prim."""
    live = live_nodes(stage)
    for node, needed in nodes_in(stage.platform.sensors, stage):
        prim = stage.prim(sensor_shown(node, stage, live) or "")
        if prim is not None:
            yield node, needed, prim


def read_lidars(stage: StageModel) -> list[Prim]:
    """Return the lidars that a node publishes."""
    lidars = (prim for _, needed, prim in read_sensors(stage) if needed.needs)
    return list({prim.path: prim for prim in lidars}.values())
