"""The topics of sensors: which sensor each shows, in which size, and in which frame.

Prims are those of frames by their names, so that a frame stands for a place in the stage.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.followed_bodies import moving_source
from lab3_usd.facts.frame_targets import parent_frame, parent_prim
from lab3_usd.facts.frames import all_edges, heard_trees
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.render_products import Shown, shown_by
from lab3_usd.isaac.behaviour import SensorOf
from lab3_usd.isaac.topics import frame_ports, product_input
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, listed_once, once_per_stage


class SensorTopic(Struct, frozen=True, eq=False):
    """A topic on which a sensor is published.

    `port` names its frame, `product` its render product. `others` are the sensors that the same
    node publishes on its other topics.
    """

    endpoint: Endpoint
    reads: SensorOf
    sensor: Prim
    shown: Shown
    port: str
    frame: str
    product: str
    others: tuple[str, ...] = ()


@listed_once
def sensor_topics(stage: StageModel) -> Iterator[SensorTopic]:
    """Yield the topics of sensors that are sent, where sensor and frame are known."""
    live = live_nodes(stage)
    for endpoint in endpoints(stage):
        node, kind = endpoint.node, endpoint.node.type
        reads = None if kind is None else stage.platform.sensors.get(kind.type)
        if kind is None or reads is None or endpoint.type is None or not endpoint.runs:
            continue
        product = product_input(endpoint.port)
        shown = shown_by(node, product, stage, live)
        sensor = None if shown is None else stage.prim(shown.sensor)
        port = next(iter(frame_ports(kind, endpoint.port)), "")
        frame = effective_value(node, port, live) if port else None
        if shown is None or sensor is None or not isinstance(frame, str):
            continue
        former = reads.schemas_in(stage.platform.release)
        if sensor.type not in reads.types and former.isdisjoint(sensor.apis):
            continue
        products = (product_input(topic) for topic in kind.topics)
        views = (shown_by(node, other, stage, live) for other in products if other != product)
        paths = tuple(dict.fromkeys(other.sensor for other in views if other is not None))
        yield SensorTopic(endpoint, reads, sensor, shown, port, frame, product, paths)


@once_per_stage
def frame_prims(stage: StageModel) -> Mapping[tuple[str, str], tuple[str, ...]]:
    """Return the prims whose places the frames of each domain have, by domain and frame."""
    prims_of: dict[tuple[str, str], dict[str, None]] = {}
    live = live_nodes(stage)
    for edge in all_edges(stage):
        maker = live[edge.cause]
        above = parent_prim(maker)
        if edge.prim:
            prims_of.setdefault((edge.domain.name, edge.child), {})[edge.prim] = None
            if stage.prim(above) and edge.parent == parent_frame(maker, stage):
                prims_of.setdefault((edge.domain.name, edge.parent), {})[above] = None
    return {key: tuple(prims) for key, prims in prims_of.items()}


@once_per_stage
def resting_frames(stage: StageModel) -> frozenset[tuple[str, str]]:
    """Return the frames that stay where they are while robots move, by domain: as `odom` does.

    They are above a transform that follows a body, or the world's, below which prims hang that
    have no other parent.
    """
    live, prims_of = live_nodes(stage), frame_prims(stage)
    resting: set[tuple[str, str]] = set()
    for heard in heard_trees(stage):
        for edge in heard.tree.edges:
            maker = live[edge.cause]
            is_odometry = edge.prim is None and moving_source(maker, stage) is not None
            is_world = edge.prim is not None and edge.parent == stage.platform.world_frame
            if is_odometry or (is_world and not parent_prim(maker)):
                above = (edge.parent, *heard.tree.above(edge.parent))
                resting.update((heard.domain, name) for name in above)
    return frozenset(key for key in resting if key not in prims_of)
