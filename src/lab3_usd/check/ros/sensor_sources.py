"""Which sensor feeds a node, and what sets the pace of what it sends."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.ros.running import (
    Nodes,
    effective_value,
    event_of,
    is_switched_on,
    live_sources,
    run_states,
    signal_sources,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.lab import Lab

_PRODUCT = "inputs:renderProductPath"
_RATE = "omni:sensor:tickRate"


def sensor_of(node: Node, live: Nodes) -> str | None:
    """Return the path of the prim whose render product the node reads, None where it reads none."""
    for source, _ in live_sources(node, _PRODUCT, live):
        for port in () if source.type is None else source.type.ports.values():
            if port.is_target and source.targets(port.name):
                return source.targets(port.name)[0]
    return None


def is_fed(node: Node, port: str, live: Nodes) -> bool:
    """Whether an input that is empty by default gets anything, by wire or as a value."""
    value = effective_value(node, port, live)
    return value is None or value not in ("", ())


def fed_by_sensor(node: Node, port: str, running: Nodes) -> bool:
    """Whether a render product reaches the node: from a node that runs, or by name."""
    if not node.sources(port):
        return bool(node.value(port))
    return any(is_switched_on(source, running) for source, _ in live_sources(node, port, running))


def rate_source(node: Node, stage: StageModel, lab: Lab, running: Nodes, *, static: bool) -> str:
    """Say what sets the pace: the sensor's own rate, the event that starts the node, or nothing."""
    state = run_states(stage, lab).get(node.path)
    if state is None:
        return "never"
    event = ", ".join(dict.fromkeys(_events(node, lab, running))) or "every update"
    event = event if state == "runs" else f"perhaps {event}"
    if static:
        return f"once after {event}"
    sensor = sensor_of(node, running)
    prim = None if sensor is None else stage.prim(sensor)
    rate = 0.0 if prim is None else _rate(prim, lab)
    return f"sensor at {rate:g} Hz" if rate > 0 else event


def _rate(prim: Prim, lab: Lab) -> float:
    """Return the sensor's own rate: as written, else what its schema takes; 0 for every frame."""
    rate = prim.attributes.get(_RATE)
    for sensor in lab.sensors.values() if rate is None else ():
        asked = sensor.attributes.get(_RATE)
        if asked and asked.unset == "right" and sensor.required_api in prim.apis:
            rate = asked.value
    return float(rate) if isinstance(rate, (int, float)) else 0.0


def _events(node: Node, lab: Lab, running: Nodes) -> Iterator[str]:
    """Yield the names of the events that the node's execution comes from, each once."""
    seen = {node.path}
    ahead = [node]
    while ahead:
        current = ahead.pop(0)
        senders = list(signal_sources(current, running))
        if event_of(current, lab) is not None or (current is not node and not senders):
            known = current.type
            yield current.type_name.rpartition(".")[2] if known is None else known.handout_name
        new = [source for source in senders if source.path not in seen]
        seen.update(source.path for source in new)
        ahead.extend(new)
