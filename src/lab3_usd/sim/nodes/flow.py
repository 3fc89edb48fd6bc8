"""Kit's nodes that pass a signal on: sequences, branches, the first signal alone.

After NVIDIA's published documentation of the nodes, as those of arithmetic.
"""

from __future__ import annotations

from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.world import World


@computes("PrintText")
def print_text(node: NodeInstance, world: World) -> bool:
    """omni-graph-ui-nodes/printtext-1.html: nothing comes of it but a line in the log."""
    del world
    return node.goes_on()


@computes("Sequence", "Multisequence")
def sequence(node: NodeInstance, world: World) -> bool:
    """omni-graph-action/multisequence-2.html: a signal goes on at each output in turn."""
    del world
    node.enabled += sorted(node.follows, key=lambda port: (len(port), port))
    return True


@computes("Once")
def once(node: NodeInstance, world: World) -> bool:
    """OgnOnce.html: the first signal goes on at one output, those after it at the other."""
    del world
    node.enabled.append("after" if "signalled" in node.memory else "once")
    node.memory["signalled"] = True
    return True


@computes("Branch")
def branch(node: NodeInstance, world: World) -> bool:
    """omni-graph-action/branch-1.html: a signal goes on at one of two outputs."""
    node.enabled.append("execTrue" if node.flag("condition", world) else "execFalse")
    return True
