"""Node types that the catalog of the lab does not describe, as far as they run here."""

from __future__ import annotations

from lab3_usd.model.scene import Node
from lab3_usd.sim.execution.registry import CONSTANT
from lab3_usd.spec.catalog import Catalog, NodeType, Port

_USD = {"execution": "uint"}
_OTHERS = {
    "OnTick": {
        "outputs:tick": "execution",
        "outputs:deltaSeconds": "double",
        "outputs:time": "double",
        "outputs:frame": "double",
    },
    "OnPhysicsStep": {
        "outputs:step": "execution",
        "outputs:deltaSimulationTime": "double",
        "outputs:deltaSystemTime": "double",
    },
    "IsaacReadSystemTime": {"outputs:systemTime": "double"},
}


def type_of(node: Node, catalog: Catalog) -> NodeType | None:
    """Return the type of a node; a constant of whatever kind is what it is declared as."""
    known = catalog.get(node.type)
    if known is not None:
        return known
    modern = catalog.modern(node.type)
    family, _, name = modern.rpartition(".")
    if family not in _families(catalog):
        return None
    if name.startswith(CONSTANT):
        return _constant(node)
    return _made(modern, _OTHERS[name]) if name in _OTHERS else None


def _families(catalog: Catalog) -> frozenset[str]:
    """Return what stands before the names of types: the extensions that are known at all."""
    return frozenset(each.rpartition(".")[0] for each in (*catalog.types, *catalog.events))


def _made(name: str, ports: dict[str, str]) -> NodeType:
    made = {each: Port(each, kind, _USD.get(kind, kind)) for each, kind in ports.items()}
    return NodeType(name, 1, name, name, name, made)


def _constant(node: Node) -> NodeType:
    kind = node.inputs["inputs:value"].type if "inputs:value" in node.inputs else "token"
    port = Port("inputs:value", kind, kind, output_only=True)
    return NodeType(node.type, 1, node.type, node.type, node.type, {port.name: port})
