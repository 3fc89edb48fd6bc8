"""What sets the pace of a message: the rate of a sensor, the event behind a node, or nothing."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.facts.execution_order import event_of, run_states, signals
from lab3_usd.facts.reaching_values import Nodes, effective_value
from lab3_usd.facts.render_products import sensor_shown
from lab3_usd.facts.sensor_values import values_of
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.stage import Node, StageModel

_SKIPPED = "inputs:frameSkipCount"  # frames of the sensor that a helper leaves out after each


def rate_source(node: Node, stage: StageModel, running: Nodes, *, static: bool) -> str:
    """Say what sets the pace: the sensor's own rate, the event that starts the node, or nothing."""
    state = run_states(stage).get(node.path)
    if state is None:
        return "never"
    event = ", ".join(dict.fromkeys(_events(node, stage.platform, running))) or "every update"
    event = event if state == "runs" else f"perhaps {event}"
    if static:
        return f"once after {event}"
    sensor = sensor_shown(node, stage, running)
    prim = None if sensor is None else stage.prim(sensor)
    rate = 0.0  # for every frame
    if prim is not None:
        rate = values_of(prim, stage).number(stage.platform.sensor_models.lidar.rate) or 0.0
    skipped = effective_value(node, _SKIPPED, running)
    rate /= skipped + 1 if isinstance(skipped, int) and skipped > 0 else 1
    return f"sensor at {rate:g} Hz" if rate > 0 else event


def _events(node: Node, platform: Platform, running: Nodes) -> Iterator[str]:
    """Yield the names of the events that the node's execution comes from, each once."""
    seen = {node.path}
    for current in (ahead := [node]):
        senders = signals(current, running)
        if event_of(current, platform) is not None or (current is not node and not senders):
            kind = current.type
            yield (current.type_name.rpartition(".")[2] if kind is None else kind.handout_name)
        for source, _ in senders:
            if source.path not in seen:
                seen.add(source.path)
                ahead.append(source)
