"""Ways to spread one stage over files, and stages of which some files did not come along."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from foreign_robots import rover
from handout_table import GRAPHS, graphs_until
from models import LINKS, ROBOT
from pxr import Sdf, Usd, UsdGeom, UsdPhysics
from scene_stages import CAMERA, LIDAR, built
from second_author import Style, author_graph, author_lab, author_sensors

ROVER = "/World/Rover"
LACKING = (
    '(subLayers = [@./edits.usda@])\ndef Xform "Walls"\n{\n    def Xform "inner"\n    {\n    }\n}\n'
)


def behind_a_missing_robot(checkpoint: str) -> Usd.Stage:
    """A stage as its author saves it over a robot file that did not come along."""
    stage = built(checkpoint)
    for prim in list(stage.GetPrimAtPath(ROBOT).GetChildren()):
        if prim.GetName() not in LINKS and prim.GetTypeName() != "OmniGraph":
            stage.RemovePrim(prim.GetPath())
    layer = stage.GetRootLayer()
    for link in LINKS:
        spec = layer.GetPrimAtPath(f"{ROBOT}/{link}")
        for child in [each.name for each in spec.nameChildren]:
            if f"{spec.path}/{child}" not in {LIDAR, CAMERA}:
                del spec.nameChildren[child]
        for name in [each.name for each in spec.properties]:
            spec.RemoveProperty(spec.properties[name])
        spec.ClearInfo("apiSchemas")
        spec.specifier = Sdf.SpecifierOver
        spec.typeName = ""
    stage.GetPrimAtPath(ROBOT).GetPayloads().AddPayload("./turtlebot3_burger.usd")
    return stage


def over_an_asset(folder: Path, text: str, *, payload: bool = False, top: str = "") -> Usd.Stage:
    """A stage whose walls come from an asset that holds this text."""
    (folder / "walls.usda").write_text(f"#usda 1.0\n{text}")
    stage = built("05")
    walls = stage.DefinePrim("/Environment/More", "Xform")
    arcs = walls.GetPayloads() if payload else walls.GetReferences()
    add = arcs.AddPayload if payload else arcs.AddReference
    add(str(folder / "walls.usda"), Sdf.Path(top or "/Walls"))
    return stage


def rover_of_a_missing_asset() -> Usd.Stage:
    stage = rover()
    for prim in list(stage.GetPrimAtPath(ROVER).GetChildren()):
        stage.RemovePrim(prim.GetPath())
    stage.GetPrimAtPath(ROVER).GetReferences().AddReference("./rover.usd")
    return stage


def copied(starter: Path) -> Usd.Stage:
    """A stage in memory with the content of the starter."""
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().TransferContent(Sdf.Layer.FindOrOpen(str(starter)))
    return stage


def empty(path: Path) -> Usd.Stage:
    """A new file that says of units and axes what Isaac Sim says."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    return stage


def _export(stage: Usd.Stage, path: Path) -> None:
    stage.GetRootLayer().Export(str(path))


def _layered(path: Path, *sublayers: Path) -> Usd.Stage:
    stage = empty(path)
    stage.GetRootLayer().subLayerPaths = [sublayer.name for sublayer in sublayers]
    return Usd.Stage.Open(stage.GetRootLayer())


def one_text_file(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    stage = copied(starter)
    author_lab(stage, checkpoint, style)
    path = folder / "whole.usda"
    stage.GetRootLayer().Export(str(path))
    return path


def one_binary_file(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    stage = copied(starter)
    author_lab(stage, checkpoint, style)
    path = folder / "whole.usd"
    stage.GetRootLayer().Export(str(path), args={"format": "usdc"})
    return path


def over_a_sublayer(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """The starter below, everything the lab adds in the root layer."""
    _export(copied(starter), folder / "starter.usda")
    stage = _layered(folder / "root.usda", folder / "starter.usda")
    author_lab(stage, checkpoint, style)
    stage.GetRootLayer().Save()
    return folder / "root.usda"


def in_several_layers(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """Each graph in a sublayer of its own, the strongest first; the root says nothing."""
    _export(copied(starter), folder / "starter.usda")
    files = [folder / "starter.usda"]
    author = [author_sensors, *(_author_of(number, style) for number in range(len(GRAPHS)))]
    for number, write in enumerate(author):
        stage = _layered(folder / f"layer{number}.usda", *files[::-1])
        write(stage, checkpoint)
        stage.GetRootLayer().subLayerPaths = []
        stage.GetRootLayer().Save()
        files.append(folder / f"layer{number}.usda")
    stage = _layered(folder / "root.usda", *files[::-1])
    stage.GetRootLayer().Save()
    return folder / "root.usda"


def _author_of(number: int, style: Style) -> Callable[[Usd.Stage, str], None]:
    def write(stage: Usd.Stage, checkpoint: str) -> None:
        if GRAPHS[number] in graphs_until(checkpoint):
            author_graph(stage, GRAPHS[number], style)

    return write


def by_reference(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """Every prim of the root comes from another file by reference."""
    inner = one_text_file(folder, starter, checkpoint, style)
    stage = empty(folder / "root.usda")
    layer = Sdf.Layer.FindOrOpen(str(inner))
    for prim in layer.rootPrims:
        over = stage.OverridePrim(prim.path)
        over.GetReferences().AddReference(inner.name, prim.path)
    stage.GetRootLayer().Save()
    return folder / "root.usda"


def payload_with_overs(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """Nodes and wires in a payload; all values, targets and the sensors in overs above it."""
    bare = Style(names=style.names, values="none", seed=style.seed, list_edits=style.list_edits)
    inner = copied(starter)
    for graph in graphs_until(checkpoint):
        author_graph(inner, graph, bare)
    inner.GetRootLayer().Export(str(folder / "inner.usda"))
    stage = empty(folder / "root.usda")
    for prim in inner.GetRootLayer().rootPrims:
        stage.OverridePrim(prim.path).GetPayloads().AddPayload("inner.usda", prim.path)
    author_lab(stage, checkpoint, style)
    _undefine(stage.GetRootLayer())
    stage.GetRootLayer().Save()
    return folder / "root.usda"


def _undefine(layer: Sdf.Layer) -> None:
    """Make overs of the graph prims that the payload defines already."""

    def visit(path: Sdf.Path) -> None:
        prim = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if prim is not None and prim.typeName in {"OmniGraph", "OmniGraphNode"}:
            prim.specifier = Sdf.SpecifierOver
            prim.typeName = ""

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)


def corrected_above(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """A weaker layer wires from the wrong port; the root deletes that and wires it right."""
    wrong = over_a_sublayer(folder, starter, checkpoint, style)
    below = Sdf.Layer.FindOrOpen(str(wrong))
    below.Export(str(folder / "below.usda"))
    lower = Usd.Stage.Open(str(folder / "below.usda"))
    stage = _layered(folder / "top.usda", folder / "below.usda")
    for prim in list(lower.Traverse()):
        for attribute in prim.GetAttributes() if prim.GetTypeName() == "OmniGraphNode" else ():
            _correct(lower, stage, attribute)
    lower.GetRootLayer().Save()
    stage.GetRootLayer().Save()
    return folder / "top.usda"


def _correct(lower: Usd.Stage, stage: Usd.Stage, attribute: Usd.Attribute) -> None:
    right = attribute.GetConnections()
    if not right:
        return
    wrong = Sdf.Path(f"{ROBOT}/ROS_Drive/gone.outputs:x")
    lower.GetAttributeAtPath(attribute.GetPath()).SetConnections([wrong])
    over = stage.OverridePrim(attribute.GetPrim().GetPath())
    spec = over.CreateAttribute(attribute.GetName(), attribute.GetTypeName(), custom=True)
    items = spec.GetPropertyStack()[0].connectionPathList
    items.deletedItems.append(wrong)
    for source in right:
        items.prependedItems.append(source)


def with_relative_paths(folder: Path, starter: Path, checkpoint: str, style: Style) -> Path:
    """Connections as scripts write them by hand: `<../node.outputs:tick>`."""
    path = one_text_file(folder, starter, checkpoint, style)
    text = path.read_text()
    for graph in graphs_until(checkpoint):
        text = text.replace(f".connect = <{graph.path}/", ".connect = <../")
    path.write_text(text)
    return path


LAYERINGS = (
    one_text_file,
    one_binary_file,
    over_a_sublayer,
    in_several_layers,
    by_reference,
    payload_with_overs,
    corrected_above,
    with_relative_paths,
)
