"""Edits of a stage that are drawn by chance, but the same ones for the same number."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from breaking import the_lab
from msgspec import Struct
from pxr import Gf, Sdf, Usd, UsdGeom

ROBOT = "/turtlebot3_burger"
TEXTS = ("", "scan", "/scan", "odom", "base_link", "base_footprint", "map", "world", "cmd_vel", "x")
NUMBERS = (-1.0, 0.0, 0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 60.0, 640.0)
POWERS = (-2.0, -1.0, -0.5, 0.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0)
PRIMS = (
    ROBOT,
    f"{ROBOT}/base_link",
    f"{ROBOT}/base_footprint",
    f"{ROBOT}/base_scan",
    f"{ROBOT}/wheel_left_link",
    f"{ROBOT}/joints",
    f"{ROBOT}/base_scan/Lidar2D",
    f"{ROBOT}/base_footprint/Camera_1",
    "/World",
)
APIS = (
    "PhysicsArticulationRootAPI", "PhysicsRigidBodyAPI", "PhysicsCollisionAPI", "IsaacLinkAPI",
    "IsaacSiteAPI", "IsaacRobotAPI", "OmniSensorAPI", "PhysicsDriveAPI:angular",
)  # fmt: skip


class Edit(Struct, frozen=True):
    """An edit, made already: what was changed from what to what."""

    number: int
    kind: str
    text: str


Change = Callable[[Usd.Stage, random.Random], str]


def edit(stage: Usd.Stage, number: int) -> Edit:
    """Make the edit of this number; where one cannot be made there, the next chance is taken."""
    chance = random.Random(number)  # noqa: S311 - no secret
    for _ in range(50):
        kind = chance.choice(list(KINDS))
        text = KINDS[kind](stage, chance)
        if text:
            return Edit(number, kind, text)
    raise AssertionError(number)


def _nodes(stage: Usd.Stage) -> list[Usd.Prim]:
    return [each for each in stage.Traverse() if each.GetTypeName() == "OmniGraphNode"]


def _ports(node: Usd.Prim, start: str) -> list[Usd.Attribute]:
    return [
        attribute
        for attribute in node.GetAuthoredAttributes()
        if attribute.GetName().startswith(start)
    ]


def _sources(stage: Usd.Stage, chance: random.Random, node: Usd.Prim) -> Sdf.Path | None:
    """Choose an output, mostly of the same graph."""
    nodes = _nodes(stage)
    if chance.random() < 0.8:
        nodes = [each for each in nodes if each.GetParent() == node.GetParent()]
    source = chance.choice(nodes)
    start = "outputs:" if chance.random() < 0.8 else "inputs:"
    ports = _ports(source, start)
    return chance.choice(ports).GetPath() if ports else None


def _rewire(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    ports = _ports(node, "inputs:")
    source = _sources(stage, chance, node)
    if not ports or source is None:
        return ""
    port = chance.choice(ports)
    port.SetConnections([source])
    return f"{port.GetPath()} from {source}"


def _add_wire(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    wired = [each for each in _ports(node, "inputs:") if each.HasAuthoredConnections()]
    source = _sources(stage, chance, node)
    if not wired or source is None:
        return ""
    port = chance.choice(wired)
    port.AddConnection(source)
    return f"{port.GetPath()} also from {source}"


def _cut(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    wired = [each for each in _ports(node, "inputs:") if each.HasAuthoredConnections()]
    if not wired:
        return ""
    port = chance.choice(wired)
    port.ClearConnections()
    return f"{port.GetPath()} cut"


def _value(attribute: Usd.Attribute, chance: random.Random) -> Any:
    """Choose a value of an attribute's type, or None where it is no simple one."""
    kind, now = str(attribute.GetTypeName()), attribute.Get()
    if kind == "bool":
        return not now
    if kind in {"string", "token"}:
        return chance.choice(TEXTS)
    if kind in {"float", "double"}:
        return float(now) * chance.choice(POWERS) if now else chance.choice(NUMBERS)
    if kind in {"int", "uint", "int64", "uint64", "uchar"}:
        return chance.choice((0, 1, 2, 5, 10, 20, 60))
    return _array(kind, now, chance)


def _array(kind: str, now: Any, chance: random.Random) -> Any:
    if now is None:
        return None
    if kind.startswith(("float3", "double3", "vector3", "point3", "color3")) and "[]" not in kind:
        return type(now)(*(each + chance.choice((0.0, 0.1, -0.3)) for each in now))
    if kind in {"quatf", "quatd"}:
        turn = Gf.Rotation(Gf.Vec3d(*chance.choice(((1, 0, 0), (0, 1, 0), (0, 0, 1)))), 30.0)
        return now * type(now)(turn.GetQuat())
    if kind == "float2":
        return type(now)(now[0] * chance.choice((0.5, 2.0)), now[1])
    return None


def _set_input(stage: Usd.Stage, chance: random.Random) -> str:
    ports = _ports(chance.choice(_nodes(stage)), "inputs:")
    return _set(chance.choice(ports), chance) if ports else ""


def _set(attribute: Usd.Attribute, chance: random.Random) -> str:
    value = _value(attribute, chance)
    if value is None or value == attribute.Get():
        return ""
    before = attribute.Get()
    attribute.Set(value)
    return f"{attribute.GetPath()} = {value!r} (was {before!r})"


def _aim(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    ports = [
        relationship
        for relationship in node.GetAuthoredRelationships()
        if relationship.GetTargets()
    ]
    if not ports:
        return ""
    port = chance.choice(ports)
    targets = list(port.GetTargets())
    target = Sdf.Path(chance.choice(PRIMS))
    targets = [target] if chance.random() < 0.5 else [*targets, target]
    port.SetTargets(targets)
    return f"{port.GetPath()} = {[str(each) for each in targets]}"


def _retype(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    new = chance.choice(list(the_lab().platform.types)[:21])
    return _replace(node.GetAttribute("node:type"), new)


def _replace(attribute: Usd.Attribute, new: str) -> str:
    if attribute.Get() == new:
        return ""
    attribute.Set(new)
    return f"{attribute.GetPath()} = {new}"


def _graph(stage: Usd.Stage, chance: random.Random) -> str:
    graphs = [each for each in stage.Traverse() if each.GetTypeName() == "OmniGraph"]
    graph = chance.choice(graphs)
    name, values = chance.choice(
        (
            ("evaluator:type", ("push", "dirty_push", "execution")),
            ("pipelineStage", ("pipelineStageOnDemand", "pipelineStagePreRender")),
            ("evaluationMode", ("Instanced", "Standalone")),
        )
    )
    return _replace(graph.GetAttribute(name), chance.choice(values))


def _drop(stage: Usd.Stage, chance: random.Random) -> str:
    prims = [each for each in stage.Traverse() if not each.IsInstanceProxy()]
    prim = chance.choice(prims)
    prim.SetActive(False)  # noqa: FBT003 - pxr takes it so
    return f"{prim.GetPath()} deactivated"


def _copy(stage: Usd.Stage, chance: random.Random) -> str:
    node = chance.choice(_nodes(stage))
    layer = stage.GetRootLayer()
    new = f"{node.GetPath()}_01"
    Sdf.CopySpec(layer, node.GetPath(), layer, new)
    return f"{node.GetPath()} copied"


def _scene(stage: Usd.Stage, chance: random.Random) -> str:
    prims = [each for each in stage.Traverse() if each.GetTypeName() != "OmniGraphNode"]
    prim = chance.choice([each for each in prims if each.GetAuthoredAttributes()])
    attributes = [
        attribute
        for attribute in prim.GetAuthoredAttributes()
        if not attribute.GetName().startswith(("primvars", "ui:", "inputs:"))
    ]
    return _set(chance.choice(attributes), chance) if attributes else ""


def _api(stage: Usd.Stage, chance: random.Random) -> str:
    prims = [each for each in stage.Traverse() if each.GetTypeName() != "OmniGraphNode"]
    prim = chance.choice(prims)
    own = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
    if own and chance.random() < 0.5:
        api = chance.choice(own)
        prim.RemoveAppliedSchema(api)
        return f"{prim.GetPath()} without {api}"
    api = chance.choice(APIS)
    prim.AddAppliedSchema(api)
    return "" if api in own else f"{prim.GetPath()} with {api}"


def _move(stage: Usd.Stage, chance: random.Random) -> str:
    prims = [each for each in stage.Traverse() if UsdGeom.Xformable(each)]
    prim = chance.choice(prims)
    shift = Gf.Vec3d(*(chance.choice((0.0, 0.05, -0.2)) for _ in range(3)))
    attribute = prim.GetAttribute("xformOp:translate")
    if not shift.GetLength() or not attribute or attribute.Get() is None:
        return ""
    attribute.Set(type(attribute.Get())(Gf.Vec3d(attribute.Get()) + shift))
    return f"{prim.GetPath()} moved by {shift}"


def _name_space(stage: Usd.Stage, chance: random.Random) -> str:
    prim = chance.choice(list(stage.Traverse()))
    name = chance.choice(("isaac:namespace", "isaac:nameOverride"))
    prim.CreateAttribute(name, Sdf.ValueTypeNames.String).Set("tb3")
    return f"{prim.GetPath()}.{name} = 'tb3'"


def _sample(stage: Usd.Stage, chance: random.Random) -> str:
    """Let a value be another one from the first frame on."""
    ports = [port for node in _nodes(stage) for port in _ports(node, "inputs:")]
    ports += [attribute for prim in stage.Traverse() for attribute in prim.GetAuthoredAttributes()]
    attribute = chance.choice(ports)
    value = _value(attribute, chance)
    if value is None or value == attribute.Get() or attribute.GetName().startswith("primvars"):
        return ""
    attribute.Set(value, 0.0)
    return f"{attribute.GetPath()} = {value!r} at time 0"


KINDS: dict[str, Change] = {
    "rewire": _rewire,
    "add wire": _add_wire,
    "cut": _cut,
    "value": _set_input,
    "target": _aim,
    "type": _retype,
    "graph": _graph,
    "drop": _drop,
    "copy": _copy,
    "scene": _scene,
    "api": _api,
    "move": _move,
    "namespace": _name_space,
    "sample": _sample,
}
