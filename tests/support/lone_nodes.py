"""A node by itself with the world that it asks, and nodes put into a compound."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.model.dry_run import Scene, SceneNode
from lab3_usd.sim.execution.node_instance import NodeInstance, function_of
from lab3_usd.sim.execution.world import Network, RosEndpoint
from lab3_usd.spec.load.loader import load_platform

COMPOUND = "omni.graph.nodes.CompoundSubgraph"


def into_compound(stage: Usd.Stage, graph: str, names: list[str], compound: str) -> None:
    """Move nodes of a graph into a compound of it: wires pass through ports of the compound."""
    outer, inner = f"{graph}/{compound}", f"{graph}/{compound}/Graph"
    node = stage.DefinePrim(outer, "OmniGraphNode")
    node.AddAppliedSchema("OmniGraphCompoundNodeAPI")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(COMPOUND)
    node.CreateRelationship("omni:graph:compoundGraph").SetTargets([Sdf.Path(inner)])
    stage.DefinePrim(inner, "OmniGraph")
    edit = Sdf.BatchNamespaceEdit()
    for name in names:
        edit.Add(Sdf.Path(f"{graph}/{name}"), Sdf.Path(f"{inner}/{name}"))
    assert stage.GetRootLayer().Apply(edit)
    moved = [(Sdf.Path(f"{graph}/{name}"), Sdf.Path(f"{inner}/{name}")) for name in names]
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes() if prim.GetPath() != outer else ():
            sources = [
                _passed(node, attribute, _new_place(source, moved), Sdf.Path(inner))
                for source in attribute.GetConnections()
            ]
            if sources:
                attribute.SetConnections(sources)


def _new_place(source: Sdf.Path, moved: list[tuple[Sdf.Path, Sdf.Path]]) -> Sdf.Path:
    return next(
        (source.ReplacePrefix(*pair) for pair in moved if source.HasPrefix(pair[0])), source
    )


def _passed(node: Usd.Prim, attribute: Usd.Attribute, start: Sdf.Path, inner: Sdf.Path) -> Sdf.Path:
    """Return from where a wire comes now, through a port of the compound where it crosses it."""
    is_inside = attribute.GetPath().HasPrefix(inner)
    if is_inside is start.HasPrefix(inner):
        return start
    side, at = ("inputs", attribute.GetPath()) if is_inside else ("outputs", start)
    name = f"{side}:{at.GetPrimPath().name}_{at.name.partition(':')[2]}"
    port = node.CreateAttribute(name, attribute.GetTypeName())
    port.SetConnections([start])
    return Sdf.Path(port.GetPath())


def node(name: str, values: dict[str, Any] | None = None, **targets: str) -> NodeInstance:
    """A node of a type, with values at its inputs and no wires; the others have their defaults."""
    node_type = load_platform().get(name)
    assert node_type is not None
    defaults = {port.short: port.default for port in node_type.ports.values()}
    given = values or {}
    bare = SceneNode(
        "/Graph/node",
        name,
        node_type.version,
        {f"inputs:{port}": given[port] for port in given if port not in defaults},  # added to it
        {f"inputs:{port}": (path,) for port, path in targets.items()},
    )
    function = function_of(node_type)
    assert function is not None
    return NodeInstance(bare.path, node_type, function, {}, bare, {**defaults, **given})


def world(**known: Any) -> Any:
    """What the functions ask of the world, with an empty stage."""
    given = {
        "scene": Scene(1.0, "Z", (), {}, {}),
        "platform": load_platform(),
        "network": Network("", commands=RosEndpoint(0, "/cmd_vel")),
        "frame": 1,
        "reading": 1,
        "unplayed": {},
        "dt": 0.5,
        "since_play": 2.0,
        "simulated": 7.0,
        "wall": 100.0,
        "session": 0,
        "products": {},
        "writers": [],
        "not_simulated": {},
        "gives": {},
    }
    return SimpleNamespace(**{**given, **known})
