"""A second author of the lab's five graphs and two sensors, who has never seen the first.

Written from the table of the handout, with pxr and nothing else, so that what the builder and the
checker might both get wrong comes to light. A `Style` says how the same graph is written.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from handout_table import CAMERA, LIDAR, TYPES, Graph, Wire, graphs_until
from pxr import Gf, Sdf, Tf, Usd, UsdUI
from second_ports import KINDS, SIGNALS, Port

KIND_OF = {kind.type: kind for kind in KINDS.values()}
_UNIFORM = Sdf.VariabilityUniform


@dataclass(frozen=True)
class Style:
    """How a graph is written; every style means the same graph.

    `values`: what the handout names; only what is not the default; everything there is.
    `declare`: every port of the type without a value, or only those that are used.
    """

    names: Literal["handout", "editor", "menu", "random"] = "handout"
    values: Literal["handout", "needed", "all", "none"] = "handout"
    declare: Literal["used", "all"] = "all"
    seed: int | None = None
    editor_api: bool = True
    noise: bool = False
    backing: str = "StageWithoutHistory"
    wired_dt: bool = False
    slash: bool = True
    list_edits: bool = False
    old_versions: bool = False
    backwards: bool = False


def author_sensors(stage: Usd.Stage, checkpoint: str) -> None:
    """Add the lidar of D3 to D5 and the camera of E3 to E5."""
    if int(checkpoint) >= 3:
        lidar = stage.DefinePrim(LIDAR, "OmniLidar")
        lidar.AddAppliedSchema("OmniSensorGenericLidarCoreAPI")
        _set(lidar, "omni:sensor:tickRate", "float", 10.0)
        _set(lidar, "omni:sensor:Core:scanRateBaseHz", "uint", 10)
        _set(lidar, "omni:sensor:Core:patternFiringRateHz", "uint", 3600)
        _set(lidar, "omni:sensor:Core:nearRangeM", "float", 0.1)
        _set(lidar, "omni:sensor:Core:farRangeM", "float", 20.0)
        for name in ("numberOfEmitters", "numberOfChannels"):
            _set(lidar, f"omni:sensor:Core:{name}", "uint", 1)
        for name in ("azimuthDeg", "elevationDeg"):
            _set(lidar, f"omni:sensor:Core:emitterState:s001:{name}", "float[]", [0.0])
        for name, value in (("channelId", 1), ("fireTimeNs", 0)):
            _set(lidar, f"omni:sensor:Core:emitterState:s001:{name}", "uint[]", [value])
        _place(lidar, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if int(checkpoint) >= 4:
        camera = stage.DefinePrim(CAMERA, "Camera")
        _set(camera, "focalLength", "float", 18.0)
        _set(camera, "clippingRange", "float2", Gf.Vec2f(0.01, 100.0))
        _place(camera, (0.1, 0.0, 0.2), (90.0, 0.0, -90.0))


def _set(prim: Usd.Prim, name: str, usd_type: str, value: Any) -> None:
    prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(usd_type), custom=False).Set(value)


def _place(prim: Usd.Prim, position: Sequence[float], degrees: Sequence[float]) -> None:
    names = ("xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale")
    for name, value in zip(names, (position, degrees, (1.0, 1.0, 1.0)), strict=True):
        _set(prim, name, "double3", Gf.Vec3d(*value))
    prim.CreateAttribute(
        "xformOpOrder", Sdf.ValueTypeNames.TokenArray, custom=False, variability=_UNIFORM
    ).Set(list(names))


def author_graph(stage: Usd.Stage, graph: Graph, style: Style) -> dict[str, Usd.Prim]:
    """Write one graph at the stage's edit target and return its prims by node."""
    prim = stage.DefinePrim(graph.path, "OmniGraph")
    for name, value in (
        ("evaluationMode", "Automatic"),
        ("evaluator:type", "execution"),
        ("fabricCacheBacking", style.backing),
        ("pipelineStage", "pipelineStageSimulation"),
    ):
        _set(prim, name, "token", value)
    _set(prim, "fileFormatVersion", "int2", Gf.Vec2i(1, 9))
    rng = random.Random(style.seed)  # noqa: S311 - the same on every run
    prims = {}
    for node, name in _in_order(names_of(graph, style), style, rng):
        prims[node] = _define(stage, f"{graph.path}/{name}", graph.nodes[node], style)
    for node, node_prim in prims.items():
        _author_ports(node_prim, graph, node, style, rng)
    for wire in wires_of(graph, style):
        _connect(prims, wire, style)
    return prims


def _in_order(items: Mapping[str, str], style: Style, rng: random.Random) -> list[tuple[str, str]]:
    pairs = list(items.items())
    if style.seed is not None:
        rng.shuffle(pairs)
    return pairs[::-1] if style.backwards else pairs


def names_of(graph: Graph, style: Style) -> dict[str, str]:
    """Name the prims; the editor and the menus number those that would be called the same."""
    if style.names == "handout":
        return {node: Tf.MakeValidIdentifier(f"{node}_node") for node in graph.nodes}
    if style.names == "random":
        rng = random.Random(f"{graph.path}{style.seed}")  # noqa: S311 - the same on every run
        numbers = rng.sample(range(10**6), len(graph.nodes))
        return {node: f"n{number:06}" for node, number in zip(graph.nodes, numbers, strict=True)}
    names: dict[str, str] = {}
    for node, node_type in graph.nodes.items():
        name = KIND_OF[node_type].names[0 if style.names == "editor" else 1]
        names[node] = f"{name}_01" if name in names.values() else name
    return names


def _define(stage: Usd.Stage, path: str, node_type: str, style: Style) -> Usd.Prim:
    kind = KIND_OF[node_type]
    prim = stage.DefinePrim(path, "OmniGraphNode")
    _set(prim, "node:type", "token", kind.type)
    _set(prim, "node:typeVersion", "int", kind.old_version if style.old_versions else kind.version)
    if style.editor_api:
        UsdUI.NodeGraphNodeAPI.Apply(prim)
        place = prim.CreateAttribute(
            "ui:nodegraph:node:pos", Sdf.ValueTypeNames.Float2, custom=False, variability=_UNIFORM
        )
        place.Set(Gf.Vec2f(-190.2, 250.9))
    return prim


def _author_ports(
    prim: Usd.Prim, graph: Graph, node: str, style: Style, rng: random.Random
) -> None:
    ports = list(_ports_of(graph, node))
    if style.seed is not None:
        rng.shuffle(ports)
    values, targets = graph.values.get(node, {}), graph.targets.get(node, {})
    for port in ports:
        if port.type == "rel":
            _author_target(prim, port, targets.get(port.name, ()), style)
            continue
        value = _value(port, values.get(port.name), style)
        if value is not None or style.declare == "all":
            declare(prim, port, value)


def _ports_of(graph: Graph, node: str) -> Iterator[Port]:
    node_type = graph.nodes[node]
    yield from KIND_OF[node_type].ports()
    if node_type == TYPES["Make Array"]:
        yield Port("inputs:input1", "token")


def _author_target(prim: Usd.Prim, port: Port, paths: Sequence[str], style: Style) -> None:
    if not paths and style.declare == "used":
        return
    relationship = prim.CreateRelationship(port.name, custom=True)
    relationship.SetCustomData({"omni": {"graph": {"relType": "target"}}})
    if paths and style.values != "none":
        relationship.SetTargets([Sdf.Path(path) for path in paths])


def _value(port: Port, asked: Any, style: Style) -> Any:
    """Return what is written at a port in this style, None for nothing."""
    if style.values == "none":
        return None
    if asked is not None:
        if style.values == "needed" and _bare(asked) == port.default:
            return None
        return _spelt(port, asked, style)
    written = style.values == "all" and port.name.startswith("inputs:")
    return port.default if written else None


def _bare(value: Any) -> Any:
    return value.strip("/") if isinstance(value, str) else value


def _spelt(port: Port, value: Any, style: Style) -> Any:
    if port.name.endswith("topicName") and not style.slash:
        return value.lstrip("/")
    if isinstance(value, float) and style.noise:
        return float(Gf.Vec2f(value, 0.0)[0])
    return value


def declare(prim: Usd.Prim, port: Port, value: Any = None) -> Usd.Attribute:
    """Declare a port as Isaac Sim does, with a value or without."""
    sdf_type = Sdf.ValueTypeNames.Find(port.type)
    attribute = prim.CreateAttribute(port.name, sdf_type, custom=True)
    if port.name.partition(":")[2] in SIGNALS:
        attribute.SetCustomDataByKey("isExecution", value=True)
    if value is not None:
        attribute.Set(_typed(sdf_type, value))
    return attribute


def _typed(sdf_type: Sdf.ValueTypeName, value: Any) -> Any:
    if not isinstance(value, list):
        return value
    if sdf_type == Sdf.ValueTypeNames.Quatd:
        x, y, z, w = value
        return Gf.Quatd(w, x, y, z)
    maker = sdf_type.type.pythonClass
    return maker(value) if sdf_type.isArray else maker(*value)


def wires_of(graph: Graph, style: Style) -> Iterator[Wire]:
    wires = list(graph.wires)
    if style.wired_dt and "differential_controller" in graph.nodes:
        tick = ("on_playback_tick", "outputs:deltaSeconds")
        wires.append((*tick, "differential_controller", "inputs:dt"))
    yield from wires[::-1] if style.backwards else wires


def _connect(prims: Mapping[str, Usd.Prim], wire: Wire, style: Style) -> None:
    source, output, target, port = wire
    path = prims[source].GetPath().AppendProperty(output)
    attribute = _declared(prims[target], port)
    if not style.list_edits:
        attribute.AddConnection(path)
        return
    # What re-wiring in the editor leaves behind: the same source deleted and put in front again.
    connections = attribute.GetPropertyStack()[0].connectionPathList
    connections.deletedItems.append(path)
    connections.deletedItems.append(path.ReplaceName("outputs:gone"))
    connections.prependedItems.append(path)


def _declared(prim: Usd.Prim, name: str) -> Usd.Attribute:
    attribute = prim.GetAttribute(name)
    if attribute:
        return attribute
    kind = KIND_OF[prim.GetAttribute("node:type").Get()]
    found = [port for port in kind.ports() if port.name == name]
    return declare(prim, found[0] if found else Port(name, "token"))


def author_lab(stage: Usd.Stage, checkpoint: str, style: Style) -> None:
    """Add everything that a checkpoint adds to the starter."""
    author_sensors(stage, checkpoint)
    graphs = graphs_until(checkpoint)
    for graph in graphs[::-1] if style.backwards else graphs:
        author_graph(stage, graph, style)


STYLES = {
    "as the handout names it": Style(),
    "placed in the editor": Style(names="editor", noise=True, backing="Shared"),
    "made by Isaac's menus": Style(names="menu", values="all", editor_api=False),
    "names that say nothing": Style(names="random", seed=1),
    "all defaults written": Style(values="all", seed=2),
    "only wrong defaults written": Style(names="editor", values="needed"),
    "made by a script": Style(names="menu", values="needed", declare="used", editor_api=False),
    "numbers as spinners round them": Style(values="all", noise=True),
    "dt wired to the tick": Style(wired_dt=True),
    "topics without a slash": Style(slash=False),
    "re-wired in the editor": Style(names="editor", list_edits=True),
    "ports and versions of 4.5": Style(declare="used", old_versions=True),
    "shuffled": Style(names="random", seed=3, backwards=True),
    "shuffled again": Style(names="editor", seed=4, list_edits=True, wired_dt=True, slash=False),
}

MIXED = Style(names="editor", values="needed", seed=5, noise=True, list_edits=True, backwards=True)
