"""Node types that the catalog of the lab does not describe, as far as they run here."""

from __future__ import annotations

from executor.scene import Node
from lab3_usd.spec.catalog import Catalog, NodeType, Port

_USD = {"execution": "uint"}
_CONSTANT = "omni.graph.nodes.Constant"


def _type(name: str, ports: dict[str, str]) -> NodeType:
    made = {each: Port(each, kind, _USD.get(kind, kind)) for each, kind in ports.items()}
    return NodeType(name, 1, name, name, name, made)


_OTHERS = {
    each.type: each
    for each in (
        _type(
            "omni.graph.action.OnTick",
            {
                "outputs:tick": "execution",
                "outputs:deltaSeconds": "double",
                "outputs:time": "double",
                "outputs:frame": "double",
            },
        ),
        _type(
            "isaacsim.core.nodes.OnPhysicsStep",
            {
                "outputs:step": "execution",
                "outputs:deltaSimulationTime": "double",
                "outputs:deltaSystemTime": "double",
            },
        ),
        _type("isaacsim.core.nodes.IsaacReadSystemTime", {"outputs:systemTime": "double"}),
    )
}


def type_of(node: Node, catalog: Catalog) -> NodeType | None:
    """Return the type of a node; a constant of whatever kind is what it is declared as."""
    known = catalog.get(node.type) or _OTHERS.get(catalog.modern(node.type))
    if known is not None or not node.type.startswith(_CONSTANT):
        return known
    kind = node.inputs["inputs:value"].type if "inputs:value" in node.inputs else "token"
    port = Port("inputs:value", kind, kind, output_only=True)
    return NodeType(node.type, 1, node.type, node.type, node.type, {port.name: port})
