"""Puts nodes of a graph into a compound, as Kit does with a selection of nodes."""

from __future__ import annotations

from pxr import Sdf, Usd

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
