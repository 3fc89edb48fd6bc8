"""The lab as it reads where the articulation root is on the robot root.

Isaac Sim looks for an articulation at the target prim and below, never above: with the root there,
the handout's target finds none.
"""

from __future__ import annotations

from msgspec.structs import replace

from lab3_usd.spec.spec import GraphSpec, Lab, NodeSpec, Target


def lab_of_root(lab: Lab) -> Lab:
    """Return the lab with the robot root as the target of what looks for the articulation."""
    return replace(lab, graphs={name: _graph(spec, lab) for name, spec in lab.graphs.items()})


def _graph(spec: GraphSpec, lab: Lab) -> GraphSpec:
    return replace(spec, nodes={role: _node(node, lab) for role, node in spec.nodes.items()})


def _node(node: NodeSpec, lab: Lab) -> NodeSpec:
    return replace(node, targets=tuple(_target(each, node, lab) for each in node.targets))


def _target(target: Target, node: NodeSpec, lab: Lab) -> Target:
    robot = lab.scene["robot"]
    if target.port not in node.type.articulation:
        return target
    if target.prims != (robot["articulation"]["target"],):
        return target
    return replace(target, prims=(robot["path"],), handout_prims=target.prims)
