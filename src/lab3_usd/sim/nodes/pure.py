"""Kit's pure nodes, as `isaac/pure_nodes.py` says what each computes, and variables of a graph."""

from __future__ import annotations

from functools import partial

from lab3_usd.isaac.pure_nodes import PURE_NODES, NoOutputError, last_part
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.world import World


@computes(*PURE_NODES)
def pure(node: NodeInstance, world: World) -> bool:
    """Give what the node makes of its inputs."""
    function = PURE_NODES[last_part(node.type.type)]
    try:
        node.outputs.update(function(partial(node.get, world=world), node.values))
    except NoOutputError as error:
        return node.fails(error.reason, error.kind)
    return True


@computes("ReadVariable")
def read_variable(node: NodeInstance, world: World) -> bool:
    """omni-graph-core/readvariable-2.html: what a variable of the graph holds."""
    name, path = node.text("variableName", world), node.path.rpartition("/")[0]
    targets = node.targets("graph")
    path = targets[0] if targets else path
    graph = next((graph for graph in world.scene.graphs if graph.path == path), None)
    if graph is None or name not in graph.variables:
        return node.fails(f"the graph has no variable '{name}'", "no-number-input")
    node.outputs["value"] = graph.variables[name]
    return True
