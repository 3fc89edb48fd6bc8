"""What nodes change in the scene and in the run while the timeline plays."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.facts.execution_order import nodes_of_their_own
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.isaac.behaviour import WriterPorts
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.stage import Node, StageModel, once_per_stage


@once_per_stage
def writing_nodes(stage: StageModel) -> tuple[tuple[Node, WriterPorts], ...]:
    """Return the nodes that change something by themselves, with the inputs that say what."""
    nodes = nodes_of_their_own(stage).values()
    pairs = ((node, stage.platform.writers.get(node.type_name)) for node in nodes)
    return tuple((node, ports) for node, ports in pairs if ports is not None)


def written_paths(node: Node, ports: WriterPorts, live: Nodes) -> Iterator[str]:
    """Yield the paths that a node may write to, as far as the stage tells them."""
    for short in ports.prims:
        yield from node.targets(INPUT + short)
    for short in ports.paths:
        value = effective_value(node, INPUT + short, live)
        texts = value if isinstance(value, tuple) else (value,)
        yield from (text for text in texts if isinstance(text, str) and text.startswith("/"))
    for short in ports.wires:
        yield from (source.path for source, _ in live_sources(node, INPUT + short, live))


def effect_on_run(node: Node, ports: WriterPorts, live: Nodes) -> str:
    """Return what a node does to the run, as a verb and its object; '' for nothing."""
    if ports.by and effective_value(node, INPUT + ports.by, live) not in ports.only:
        return ""
    is_usual = bool(ports.value) and effective_value(node, INPUT + ports.value, live) is ports.usual
    return "" if is_usual else ports.run
