"""Every single fault of the graphs and sensors of a correct stage, made through the USD API."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from pxr import Gf, Sdf, Usd
from scene_stages import (
    CAMERA,
    LIDAR,
    ORIENT,
    ROBOT,
    SCALE,
    TICK,
    TRANSLATE,
    TURNS,
    Sabotage,
    clear,
    deactivate,
    define,
    detach,
    move_prim,
    put,
    remove,
    retype,
    turn,
    undefine,
    without_api,
)

from lab3_usd.isaac.values import Value
from lab3_usd.spec.graph import GraphSpec, NodeSpec, Setting, Wire
from lab3_usd.spec.lab import Checkpoint, Lab

CORE = "omni:sensor:Core:"
SCANLESS: dict[str, object] = {
    f"{CORE}patternFiringRateHz": 0,
    f"{CORE}nearRangeM": 120.0,
    f"{CORE}farRangeM": 0.0,
    f"{CORE}numberOfEmitters": 0,
    f"{CORE}emitterState:s001:azimuthDeg": [],
}


def _lidar() -> list[Sabotage]:
    elsewhere, renamed = "/World/Lidar2D", f"{ROBOT}/base_scan/Example_Rotary_2D"
    api = "OmniSensorGenericLidarCoreAPI"
    found = [
        Sabotage("no lidar", "03", remove(LIDAR), (LIDAR, None)),
        Sabotage("lidar off", "03", deactivate(LIDAR), (LIDAR, None)),
        Sabotage("lidar only over", "03", undefine(LIDAR), (LIDAR, None)),
        Sabotage("lidar a camera", "03", retype(LIDAR, "Camera"), (LIDAR, None)),
        Sabotage("lidar an Xform", "03", retype(LIDAR, "Xform"), (LIDAR, None)),
        Sabotage("lidar renamed", "03", move_prim(LIDAR, renamed), (renamed, None)),
        Sabotage("lidar elsewhere", "03", move_prim(LIDAR, elsewhere), (elsewhere, None)),
        Sabotage(
            "lidar moved", "05", put(LIDAR, TRANSLATE, Gf.Vec3d(0, 0, 0.05)), (LIDAR, TRANSLATE)
        ),
        Sabotage("lidar turned", "05", put(LIDAR, ORIENT, turn(5)), (LIDAR, ORIENT)),
        Sabotage("lidar scaled", "05", put(LIDAR, SCALE, Gf.Vec3d(1, 1, 2)), (LIDAR, SCALE)),
        Sabotage("lidar without schema", "05", without_api(LIDAR, api), (LIDAR, None)),
        Sabotage(
            "second lidar", "05", define("/World/Lidar_01", "OmniLidar"), ("/World/Lidar_01", None)
        ),
        Sabotage(
            "leftover of the menu",
            "03",
            define("/World/Example_Rotary_2D_01", "Xform"),
            ("/World/Example_Rotary_2D_01", None),
        ),
    ]
    for name, value in ((TICK, 20.0), (TURNS, 20), (TICK, 0.0), (TURNS, 0)):
        what = f"{name} {value:g}"
        found.append(Sabotage(what, "05", put(LIDAR, name, value), (LIDAR, name)))
    for name, nothing in SCANLESS.items():
        what = f"{name} {nothing}"
        found.append(Sabotage(what, "05", put(LIDAR, name, nothing), (LIDAR, name)))
    for name, metres in ((f"{CORE}farRangeM", 0.2), (f"{CORE}nearRangeM", 50.0)):
        blind = put(LIDAR, name, metres)
        found.append(
            Sabotage(f"{name} {metres:g}, within which is nothing", "05", blind, (LIDAR, name))
        )
    for path in (LIDAR, CAMERA):
        what = f"{path.rpartition('/')[2]} stays behind"
        found.append(Sabotage(what, "05", detach(path), (path, "xformOpOrder")))
    return found


def _camera() -> list[Sabotage]:
    elsewhere, renamed = "/World/Camera_1", f"{ROBOT}/base_footprint/Camera"
    typed, back = Gf.Quatd(0.5, 0.5, 0.5, -0.5), Gf.Quatd(0.5, 0.5, 0.5, 0.5)
    near, far = Gf.Vec2f(1, 100), Gf.Vec2f(0.01, 1e7)
    clip = "clippingRange"
    return [
        Sabotage("no camera", "04", remove(CAMERA), (CAMERA, None)),
        Sabotage("camera off", "04", deactivate(CAMERA), (CAMERA, None)),
        Sabotage("camera only over", "04", undefine(CAMERA), (CAMERA, None)),
        Sabotage("camera an Xform", "04", retype(CAMERA, "Xform"), (CAMERA, None)),
        Sabotage("camera renamed", "04", move_prim(CAMERA, renamed), (renamed, None)),
        Sabotage("camera elsewhere", "04", move_prim(CAMERA, elsewhere), (elsewhere, None)),
        Sabotage(
            "camera moved", "05", put(CAMERA, TRANSLATE, Gf.Vec3d(0, 0, 0.2)), (CAMERA, TRANSLATE)
        ),
        Sabotage("camera scaled", "05", put(CAMERA, SCALE, Gf.Vec3d(2, 2, 2)), (CAMERA, SCALE)),
        Sabotage("camera typed", "05", put(CAMERA, ORIENT, typed), (CAMERA, ORIENT)),
        Sabotage("camera backward", "05", put(CAMERA, ORIENT, back), (CAMERA, ORIENT)),
        Sabotage("camera level", "05", put(CAMERA, ORIENT, Gf.Quatd(1)), (CAMERA, ORIENT)),
        Sabotage("focal length", "05", put(CAMERA, "focalLength", 24.0), (CAMERA, "focalLength")),
        Sabotage("focal length unset", "05", clear(CAMERA, "focalLength"), (CAMERA, "focalLength")),
        Sabotage("near plane", "05", put(CAMERA, clip, near), (CAMERA, clip)),
        Sabotage("far plane", "05", put(CAMERA, clip, far), (CAMERA, clip)),
        Sabotage("clipping unset", "05", clear(CAMERA, clip), (CAMERA, clip)),
        Sabotage("camera rate", "05", put(CAMERA, TICK, 30.0), (CAMERA, TICK)),
    ]


def _too_early() -> list[Sabotage]:
    return [
        Sabotage(f"{path} in the starter", "00", define(path, kind), (path, None))
        for path, kind in (
            (LIDAR, "OmniLidar"),
            (CAMERA, "Camera"),
            ("/World/Example_Rotary", "OmniLidar"),
            ("/World/ActionGraph", "OmniGraph"),
            ("/World/MyGraph", "OmniGraph"),
            ("/World/ROS_Odometry", "Xform"),
        )
    ]


def sensor_sabotage() -> list[Sabotage]:
    """Return every fault of the sensors that is tried."""
    return [*_lidar(), *_camera(), *_too_early()]


# The most likely slip for a type: what a student might pick from the node list instead.
OTHER_TYPE = "omni.graph.nodes.ConstantToken"
ELSE_TYPE = "isaacsim.core.nodes.IsaacReadSimulationTime"


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: what it does to a stage, and the prims of which one must be named."""

    name: str
    kind: str
    break_it: Callable[[Usd.Stage], None]
    sites: tuple[str, ...]


def graph_faults(lab: Lab, checkpoint: Checkpoint) -> Iterator[Fault]:
    """Yield every fault of every graph that the checkpoint asks for."""
    for name in checkpoint.graphs:
        spec = lab.graphs[name]
        yield from _whole_graph(spec)
        for node in spec.nodes.values():
            yield from _node_faults(spec, node)
            for setting in node.settings:
                yield from _setting_faults(spec, node, setting)
            yield from _target_faults(spec, node)
        for wire in spec.wires:
            yield from _wire_faults(spec, wire)


def _whole_graph(spec: GraphSpec) -> Iterator[Fault]:
    def rename(stage: Usd.Stage) -> None:
        editor = Usd.NamespaceEditor(stage)
        editor.MovePrimAtPath(spec.path, f"{spec.path}_01")
        editor.ApplyEdits()

    def attribute(name: str, value: str) -> Callable[[Usd.Stage], None]:
        return lambda stage: stage.GetPrimAtPath(spec.path).GetAttribute(name).Set(value)

    where = (spec.path,)
    yield Fault(f"{spec.name} removed", "graph", lambda s: _remove(s, spec.path), where)
    yield Fault(
        f"{spec.name} deactivated", "graph",
        lambda s: _deactivate(s, spec.path), where,
    )  # fmt: skip
    yield Fault(f"{spec.name} renamed", "graph", rename, (f"{spec.path}_01",))
    yield Fault(f"{spec.name} push", "graph", attribute("evaluator:type", "push"), where)
    yield Fault(
        f"{spec.name} on demand", "graph",
        attribute("pipelineStage", "pipelineStageOnDemand"), where,
    )  # fmt: skip


def _remove(stage: Usd.Stage, path: str) -> None:
    stage.RemovePrim(path)


def _deactivate(stage: Usd.Stage, path: str) -> None:
    stage.GetPrimAtPath(path).SetActive(False)  # noqa: FBT003 - USD's signature


def _node_faults(spec: GraphSpec, node: NodeSpec) -> Iterator[Fault]:
    path = f"{spec.path}/{node.role}"
    other = OTHER_TYPE if node.type.type != OTHER_TYPE else ELSE_TYPE
    name = f"{spec.name}/{node.role}"
    yield Fault(f"{name} removed", "node", lambda s: _remove(s, path), (spec.path,))
    yield Fault(
        f"{name} deactivated", "node",
        lambda s: _deactivate(s, path), (spec.path,),
    )  # fmt: skip
    yield Fault(
        f"{name} retyped", "node",
        lambda s: s.GetPrimAtPath(path).GetAttribute("node:type").Set(other), (path,),
    )  # fmt: skip


def _wrong(value: Value) -> Value:
    """Return another value of the same type."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, (int, float)):
        return value + 1
    return f"{value}_x"


def _setting_faults(spec: GraphSpec, node: NodeSpec, setting: Setting) -> Iterator[Fault]:
    path = f"{spec.path}/{node.role}"
    name = f"{spec.name}/{node.role}.{setting.port}"
    port = node.type.port(setting.port)
    assert port is not None

    def set_wrong(stage: Usd.Stage) -> None:
        wrong = "point_cloud" if port.allowed[:1] == ("laser_scan",) else _wrong(setting.value)
        stage.GetPrimAtPath(path).GetAttribute(setting.port).Set(wrong)

    def unset(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(path).GetAttribute(setting.port).Clear()

    def retype(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(path)
        prim.RemoveProperty(setting.port)
        text = not isinstance(setting.value, str)
        kind = Sdf.ValueTypeNames.String if text else Sdf.ValueTypeNames.Int
        prim.CreateAttribute(setting.port, kind, custom=True).Set("1" if text else 1)

    yield Fault(f"{name} wrong", "value", set_wrong, (path,))
    if port.default != setting.value and str(port.default) != str(setting.value).lstrip("/"):
        yield Fault(f"{name} unset", "value", unset, (path,))
    yield Fault(f"{name} of another type", "value", retype, (path,))


def _target_faults(spec: GraphSpec, node: NodeSpec) -> Iterator[Fault]:
    path = f"{spec.path}/{node.role}"
    for target in node.targets:
        for prim in target.prims:
            yield _target_fault(path, target.port, prim, None, f"{spec.name}/{node.role}")
            yield _target_fault(path, target.port, prim, "/World", f"{spec.name}/{node.role}")


def _target_fault(path: str, port: str, prim: str, instead: str | None, name: str) -> Fault:
    def change(stage: Usd.Stage) -> None:
        relationship = stage.GetPrimAtPath(path).GetRelationship(port)
        kept = [target for target in relationship.GetTargets() if str(target) != prim]
        relationship.SetTargets([*kept, *([] if instead is None else [Sdf.Path(instead)])])

    what = "removed" if instead is None else "replaced"
    return Fault(f"{name}.{port} {prim} {what}", "target", change, (path,))


def _wire_faults(spec: GraphSpec, wire: Wire) -> Iterator[Fault]:
    target = f"{spec.path}/{wire.target.role}"
    source = f"{spec.path}/{wire.source.role}"

    def connect(*paths: str) -> Callable[[Usd.Stage], None]:
        def change(stage: Usd.Stage) -> None:
            attribute = stage.GetPrimAtPath(target).GetAttribute(wire.target.port)
            attribute.SetConnections([Sdf.Path(path) for path in paths])

        return change

    name = f"{spec.name}: {wire}"
    yield Fault(f"{name} cut", "wire", connect(), (target,))
    yield Fault(f"{name} dangling", "wire", connect(f"{source}_gone.outputs:x"), (target,))
    for port in _other_ports(spec, wire):
        yield Fault(f"{name} from {port}", "wire", connect(f"{source}.{port}"), (target,))
        break
    else:
        yield Fault(f"{name} from no port", "wire", connect(f"{source}.outputs:no"), (target,))
    yield from _moved(spec, wire, target, source)


def _other_ports(spec: GraphSpec, wire: Wire) -> Iterator[str]:
    ports = spec.nodes[wire.source.role].type.ports
    return (name for name, port in ports.items() if port.is_source and name != wire.source.port)


def _moved(spec: GraphSpec, wire: Wire, target: str, source: str) -> Iterator[Fault]:
    """Move the end of a wire to another input of the same node."""
    node_type = spec.nodes[wire.target.role].type
    for port in node_type.ports.values():
        if port.is_source or port.is_target or port.name == wire.target.port:
            continue

        def move(stage: Usd.Stage, name: str = port.name) -> None:
            prim = stage.GetPrimAtPath(target)
            prim.GetAttribute(wire.target.port).ClearConnections()
            prim.GetAttribute(name).AddConnection(f"{source}.{wire.source.port}")

        yield Fault(f"{spec.name}: {wire} moved to {port.name}", "wire", move, (target,))
        return
