"""Breaks a correct stage step by step, as a case file lists the steps.

A place is written as people say it: `ROS_Clock/ros2_context` or, with a port,
`ROS_Clock/ros2_context.inputs:domain_id`. Names of graphs stand for their paths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from made_once import copy_of
from pxr import Sdf, Ts, Usd

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint

Step = Mapping[str, Any]


@cache
def the_lab() -> Lab:
    return load_lab()


@cache
def built(checkpoint: str) -> Sdf.Layer:
    """The correct stage of a checkpoint; never changed, only copied."""
    with TemporaryDirectory() as folder:
        path = build_checkpoint(None, checkpoint, Path(folder) / "Lab3.usda")
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(Sdf.Layer.FindOrOpen(str(path)))
    return layer


def copied(layer: Sdf.Layer) -> Usd.Stage:
    """Open a copy in memory."""
    return Usd.Stage.Open(copy_of(layer))


def correct_stage(checkpoint: str) -> Usd.Stage:
    return copied(built(checkpoint))


def judged(stage: Usd.Stage, checkpoint: str) -> RuleResults:
    lab = the_lab()
    return judge(lab, lab.checkpoints[checkpoint], read_model(stage, lab.platform, "stage.usda"))


def place(text: str) -> str:
    """Return the path that is meant; what is no graph's name stays as it is."""
    for name, spec in the_lab().graphs.items():
        for mark in ("/", "."):
            if text.startswith(f"{name}{mark}"):
                return spec.path + text[len(name) :]
        if text == name:
            return spec.path
    return text


def broken(checkpoint: str, steps: list[Step]) -> Usd.Stage:
    """Return the correct stage after these steps."""
    stage = correct_stage(checkpoint)
    for step in steps:
        for name, arguments in step.items():
            values = arguments if isinstance(arguments, list) else [arguments]
            STEPS[name](stage, *values)
    return stage


def _attribute(stage: Usd.Stage, where: str) -> Usd.Attribute:
    """Return the attribute; one that is not declared yet is made as a script would."""
    path = Sdf.Path(place(where))
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    found = prim.GetAttribute(path.name)
    return found or prim.CreateAttribute(path.name, Sdf.ValueTypeNames.Token, custom=True)


def _paths(texts: tuple[str, ...]) -> list[Sdf.Path]:
    return [Sdf.Path(place(text)) for text in texts]


def _set(stage: Usd.Stage, where: str, value: Any) -> None:
    _attribute(stage, where).Set(value)


def _declare(stage: Usd.Stage, where: str, usd_type: str, value: Any = None) -> None:
    path = Sdf.Path(place(where))
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    prim.RemoveProperty(path.name)
    kind = Sdf.ValueTypeNames.Find(usd_type)
    attribute = prim.CreateAttribute(path.name, kind, custom=True)
    if value is not None:
        is_vector = isinstance(value, list) and not kind.isArray
        made = kind.type.pythonClass(*value) if is_vector else value
        attribute.Set(kind.type.pythonClass(tuple(value)) if kind.isArray else made)


def _clear(stage: Usd.Stage, where: str) -> None:
    _attribute(stage, where).Clear()


def _sample(stage: Usd.Stage, where: str, time: float, value: Any) -> None:
    _attribute(stage, where).Set(tuple(value) if isinstance(value, list) else value, time)


def _spline(stage: Usd.Stage, where: str, *knots: tuple[float, float]) -> None:
    """Write a curve that keeps the value of each knot until the next one."""
    attribute = _attribute(stage, where)
    spline = Ts.Spline(str(attribute.GetTypeName()))
    for time, value in knots:
        knot = Ts.Knot(spline.GetValueTypeName(), time=time, value=value)
        knot.SetNextInterpolation(Ts.InterpHeld)
        spline.SetKnot(knot)
    attribute.SetSpline(spline)


def _begin(stage: Usd.Stage, time: float) -> None:
    stage.SetStartTimeCode(time)


def _beside(stage: Usd.Stage, where: str, value: Any) -> None:
    """Clear a port, and write a value where Kit keeps those of extended ports."""
    attribute = _attribute(stage, where)
    attribute.Clear()
    attribute.SetCustomDataByKey("omni:graph:attrValue", value)


def _connect(stage: Usd.Stage, where: str, *sources: str) -> None:
    _attribute(stage, where).SetConnections(_paths(sources))


def _disconnect(stage: Usd.Stage, where: str) -> None:
    _attribute(stage, where).ClearConnections()


def _add_source(stage: Usd.Stage, where: str, source: str) -> None:
    _attribute(stage, where).AddConnection(place(source))


def _swap(stage: Usd.Stage, one: str, other: str) -> None:
    first, second = _attribute(stage, one), _attribute(stage, other)
    value, sources = first.Get(), first.GetConnections()
    if second.Get() is not None:
        first.Set(second.Get())
        second.Set(value)
    first.SetConnections(second.GetConnections())
    second.SetConnections(sources)


def _targets(stage: Usd.Stage, where: str, *prims: str) -> None:
    path = Sdf.Path(place(where))
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    prim.CreateRelationship(path.name, custom=True).SetTargets(_paths(prims))


def _remove(stage: Usd.Stage, where: str) -> None:
    stage.RemovePrim(place(where))


def _deactivate(stage: Usd.Stage, where: str) -> None:
    stage.GetPrimAtPath(place(where)).SetActive(False)  # noqa: FBT003 - pxr takes it so


def _over(stage: Usd.Stage, where: str) -> None:
    stage.GetPrimAtPath(place(where)).SetSpecifier(Sdf.SpecifierOver)


def _untype(stage: Usd.Stage, where: str, type_name: str = "") -> None:
    stage.GetPrimAtPath(place(where)).SetTypeName(type_name)


def _define(stage: Usd.Stage, where: str, type_name: str) -> None:
    stage.DefinePrim(place(where), type_name)


def _node(stage: Usd.Stage, where: str, node_type: str) -> None:
    prim = stage.DefinePrim(place(where), "OmniGraphNode")
    prim.CreateAttribute("node:type", Sdf.ValueTypeNames.Token, custom=False).Set(node_type)
    prim.CreateAttribute("node:typeVersion", Sdf.ValueTypeNames.Int, custom=False).Set(1)


def _schema(stage: Usd.Stage, where: str, name: str) -> None:
    stage.GetPrimAtPath(place(where)).AddAppliedSchema(name)


def _schema_off(stage: Usd.Stage, where: str, name: str) -> None:
    stage.GetPrimAtPath(place(where)).RemoveAppliedSchema(name)


def _remove_property(stage: Usd.Stage, where: str) -> None:
    path = Sdf.Path(place(where))
    stage.GetPrimAtPath(path.GetPrimPath()).RemoveProperty(path.name)


def _copy(stage: Usd.Stage, source: str, target: str) -> None:
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, place(source), layer, place(target))


def _move(stage: Usd.Stage, source: str, target: str) -> None:
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(place(source), place(target))
    editor.ApplyEdits()


def _misspell(stage: Usd.Stage, where: str, name: str) -> None:
    path, layer = Sdf.Path(place(where)), stage.GetRootLayer()
    Sdf.CopySpec(layer, path, layer, path.GetPrimPath().AppendProperty(name))
    stage.GetPrimAtPath(path.GetPrimPath()).RemoveProperty(path.name)


def _instanceable(stage: Usd.Stage, where: str) -> None:
    stage.GetPrimAtPath(place(where)).SetInstanceable(True)  # noqa: FBT003 - pxr takes it so


def _instance(stage: Usd.Stage, where: str) -> None:
    """Let the prim be an instance of an asset that holds what it held."""
    path = place(where)
    asset = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(asset, path)
    Sdf.CopySpec(stage.GetRootLayer(), path, asset, path)
    stage.RemovePrim(path)
    prim = stage.DefinePrim(path)
    prim.GetReferences().AddReference(asset.identifier, path)
    prim.SetInstanceable(True)  # noqa: FBT003 - pxr takes it so
    KEPT.append(asset)


KEPT: list[Sdf.Layer] = []  # anonymous layers live as long as somebody holds them


def _default(stage: Usd.Stage, where: str) -> None:
    stage.SetDefaultPrim(stage.GetPrimAtPath(where))


STEPS: dict[str, Callable[..., None]] = {
    "set": _set,
    "declare": _declare,
    "clear": _clear,
    "sample": _sample,
    "spline": _spline,
    "begin": _begin,
    "beside": _beside,
    "connect": _connect,
    "disconnect": _disconnect,
    "add source": _add_source,
    "swap": _swap,
    "targets": _targets,
    "remove": _remove,
    "remove property": _remove_property,
    "deactivate": _deactivate,
    "over": _over,
    "type of prim": _untype,
    "define": _define,
    "default": _default,
    "node": _node,
    "schema": _schema,
    "schema off": _schema_off,
    "copy": _copy,
    "move": _move,
    "misspell": _misspell,
    "instanceable": _instanceable,
    "instance": _instance,
}
