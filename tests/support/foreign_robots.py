"""Robots that are not the lab's: bare, and with the graphs that let them drive and sense."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import Any

from breaking import copied
from places import REPOSITORY
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from lab3_usd.author.adding import AddOptions, add_graphs
from lab3_usd.author.request import Request
from lab3_usd.isaac.releases import BASE
from lab3_usd.spec.load.loader import load_platform

ROVER = REPOSITORY / "docs" / "examples" / "rover.usda"
LIDAR_API = "OmniSensorGenericLidarCoreAPI"


def new_stage(path: Path, metres: float = 1.0, up: str = "Z") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def add_link(stage: Usd.Stage, path: str, at: Gf.Vec3d) -> Usd.Prim:
    link = UsdGeom.Xform.Define(stage, path)
    link.AddTranslateOp().Set(at)
    UsdPhysics.RigidBodyAPI.Apply(link.GetPrim())
    return link.GetPrim()


def add_joint(
    stage: Usd.Stage,
    path: str,
    bodies: tuple[str, str],
    at: Gf.Vec3d,
    axis: str = "Y",
    *,
    gains: tuple[float, float] | None = (0.0, 1000.0),
    limits: tuple[float, float] | None = None,
) -> Usd.Prim:
    joint = UsdPhysics.RevoluteJoint.Define(stage, path)
    joint.CreateAxisAttr(axis)
    joint.CreateBody0Rel().SetTargets([bodies[0]])
    joint.CreateBody1Rel().SetTargets([bodies[1]])
    joint.CreateLocalPos0Attr(Gf.Vec3f(at))
    if limits is not None:
        joint.CreateLowerLimitAttr(limits[0])
        joint.CreateUpperLimitAttr(limits[1])
    if gains is not None:
        drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular")
        drive.CreateStiffnessAttr(gains[0])
        drive.CreateDampingAttr(gains[1])
    return joint.GetPrim()


def add_wheel(stage: Usd.Stage, path: str, at: Gf.Vec3d, radius: float, axis: str = "Y") -> None:
    add_link(stage, path, at)
    shape = UsdGeom.Cylinder.Define(stage, f"{path}/collider")
    shape.CreateAxisAttr(axis)
    shape.CreateRadiusAttr(radius)
    shape.CreateHeightAttr(radius / 2)
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())


def add_rover(
    stage: Usd.Stage,
    root: str = "/World/Bot",
    *,
    radius: float = 0.05,
    distance: float = 0.3,
    rows: tuple[float, ...] = (0.0,),
    names: tuple[str, str] = ("left", "right"),
    gains: tuple[float, float] | None = (0.0, 1000.0),
) -> None:
    """Add a robot with wheels left and right in rows along X; lengths in metres."""
    unit = 1 / UsdGeom.GetStageMetersPerUnit(stage)
    UsdGeom.Xform.Define(stage, root)
    base = add_link(stage, f"{root}/base", Gf.Vec3d(0, 0, radius) * unit)
    UsdPhysics.ArticulationRootAPI.Apply(base)
    for row, ahead in enumerate(rows):
        for name, side in zip(names, (1, -1), strict=True):
            path = f"{root}/{name}_wheel{row or ''}"
            at = Gf.Vec3d(ahead, side * distance / 2, 0) * unit
            add_wheel(stage, path, at + Gf.Vec3d(0, 0, radius) * unit, radius * unit)
            joint = f"{root}/joints/{name}_joint{row or ''}"
            add_joint(stage, joint, (f"{root}/base", path), at, gains=gains)


def add_lidar(stage: Usd.Stage, path: str, *, with_api: bool = True) -> Usd.Prim:
    prim = stage.DefinePrim(path, "OmniLidar")
    if with_api:
        prim.SetMetadata("apiSchemas", Sdf.TokenListOp.Create(prependedItems=[LIDAR_API]))
    return prim


def rover_at(folder: Path, name: str = "rover.usda") -> Path:
    """Copy the rover of the documentation."""
    path = folder / name
    path.write_bytes(ROVER.read_bytes())
    return path


def carter_at(folder: Path) -> Path:
    """Copy the carter of the documentation, without its graphs."""
    path = folder / "carter.usda"
    layer = Sdf.Layer.FindOrOpen(str(REPOSITORY / "docs" / "examples" / "carter.usda"))
    bare = Sdf.Layer.CreateNew(str(path))
    bare.TransferContent(layer)
    for name in ("differential_drive", "odometry"):
        del bare.GetPrimAtPath("/World/Carter").nameChildren[name]
    bare.Save()
    return path


def payload_at(folder: Path) -> Path:
    """Write a stage that holds the rover of the documentation behind a payload."""
    stage = new_stage(folder / "payload.usda")
    robot = stage.DefinePrim("/World/Robot", "Xform")
    robot.GetPayloads().AddPayload(f"./{rover_at(folder).name}", "/World/Rover")
    stage.Save()
    return folder / "payload.usda"


BARE = {"rover": rover_at, "carter": carter_at, "payload": payload_at}


def with_three_graphs(path: Path) -> Path:
    """Add what three commands add: clock, drive and odometry."""
    added = add_graphs(path, [Request(k) for k in ("clock", "drive", "odometry")], AddOptions(BASE))
    assert added.data is not None
    path.write_bytes(added.data)
    return path


Ports = Mapping[str, Any]
Nodes = Mapping[str, tuple[str, Ports]]
_ROS, _CORE = "isaacsim.ros2.bridge.", "isaacsim.core.nodes."
_SENSORS, _WHEELED = "isaacsim.sensors.physics.", "isaacsim.robot.wheeled_robots."
_PREFIXES = {"ros.": _ROS, "core.": _CORE, "sensors.": _SENSORS, "wheeled.": _WHEELED}
_PREFIXES |= {"action.": "omni.graph.action.", "nodes.": "omni.graph.nodes."}
_SIGNAL = {"isExecution": True}


def full_type(short: str) -> str:
    """Return the whole name of a node type: `ros.ROS2Context` is one of the bridge's."""
    prefix = next((each for each in _PREFIXES if short.startswith(each)), "")
    return _PREFIXES.get(prefix, "") + short[len(prefix) :]


def write_graph(
    stage: Usd.Stage, path: str, nodes: Nodes, wires: Sequence[str], **attributes: Any
) -> None:
    """Write an Action Graph: values and targets of its nodes, and wires `a.x -> b.y`."""
    prim = stage.DefinePrim(path, "OmniGraph")
    said = {
        "evaluationMode": "Automatic",
        "evaluator:type": "execution",
        "pipelineStage": "pipelineStageSimulation",
        **attributes,
    }
    for name, value in said.items():
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Token, custom=False).Set(value)
    for name, (kind, ports) in nodes.items():
        write_node(stage, f"{path}/{name}", kind, ports)
    for wire in wires:
        source, target = wire.split(" -> ")
        connect(stage, path, source, target)


def write_node(stage: Usd.Stage, path: str, kind: str, ports: Ports) -> Usd.Prim:
    known = load_platform().types.get(full_type(kind))
    node = stage.DefinePrim(path, "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token, custom=False).Set(full_type(kind))
    version = 1 if known is None else known.version
    node.CreateAttribute("node:typeVersion", Sdf.ValueTypeNames.Int, custom=False).Set(version)
    for short, value in ports.items():
        port = None if known is None else known.input(short)
        name = f"inputs:{short}"
        if port is not None and port.is_target:
            node.CreateRelationship(name, custom=True).SetTargets(
                [Sdf.Path(each) for each in ([value] if isinstance(value, str) else value)]
            )
        else:
            usd_type = "token" if port is None else port.usd_type
            node.CreateAttribute(name, Sdf.ValueTypeNames.Find(usd_type), custom=True).Set(
                _as_usd(value, usd_type)
            )
    return node


def _as_usd(value: Any, usd_type: str) -> Any:
    if usd_type == "token[]":
        return Vt.TokenArray(value)
    return Gf.Vec3d(*value) if usd_type in {"vector3d", "double3"} else value


def connect(stage: Usd.Stage, graph: str, source: str, target: str) -> None:
    """Wire one port to another, each declared as the application declares it."""
    source_path = _declared(stage, graph, source, is_output=True)
    target_path = _declared(stage, graph, target, is_output=False)
    target_attribute = stage.GetAttributeAtPath(target_path)
    target_attribute.AddConnection(source_path)


def _declared(stage: Usd.Stage, graph: str, ref: str, *, is_output: bool) -> Sdf.Path:
    name, _, short = ref.partition(".")
    node = stage.GetPrimAtPath(f"{graph}/{name}")
    kind = load_platform().get(str(node.GetAttribute("node:type").Get()))
    port = None if kind is None else (kind.source(short) if is_output else kind.input(short))
    full = port.name if port is not None else f"{'outputs' if is_output else 'inputs'}:{short}"
    if not node.HasAttribute(full):
        usd_type = "token" if port is None else port.usd_type
        attribute = node.CreateAttribute(full, Sdf.ValueTypeNames.Find(usd_type), custom=True)
        if port is not None and port.is_execution:
            for key, value in _SIGNAL.items():
                attribute.SetCustomDataByKey(key, value)
    return Sdf.Path(f"{graph}/{name}.{full}")


def empty_stage(up: str, meters_per_unit: float) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    stage.DefinePrim("/World", "Xform")
    UsdPhysics.Scene.Define(stage, "/World/physicsScene")
    return stage


def add_api(prim: Usd.Prim, *names: str) -> Usd.Prim:
    """Apply schemas that usd-core may not know."""
    for name in names:
        prim.AddAppliedSchema(name)
    return prim


def body(stage: Usd.Stage, path: str, at: Sequence[float]) -> Usd.Prim:
    xform = UsdGeom.Xform.Define(stage, path)
    xform.AddTranslateOp().Set(Gf.Vec3d(*at))
    return add_api(xform.GetPrim(), "PhysicsRigidBodyAPI")


def wheel(
    stage: Usd.Stage, path: str, at: Sequence[float], radius: float, axis: str = "Y"
) -> Usd.Prim:
    made = body(stage, path, at)
    shape = UsdGeom.Cylinder.Define(stage, f"{path}/collision")
    shape.CreateRadiusAttr(radius)
    shape.CreateHeightAttr(radius / 2)
    shape.CreateAxisAttr(axis)
    add_api(shape.GetPrim(), "PhysicsCollisionAPI")
    return made


def revolute(
    stage: Usd.Stage, path: str, base: str, moved: str, at: Sequence[float], axis: str
) -> Usd.Prim:
    """A joint with a velocity drive, as an importer writes it."""
    joint = UsdPhysics.RevoluteJoint.Define(stage, path)
    joint.CreateBody0Rel().SetTargets([base])
    joint.CreateBody1Rel().SetTargets([moved])
    joint.CreateAxisAttr(axis)
    joint.CreateLocalPos0Attr(Gf.Vec3f(*at))
    drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular")
    drive.CreateStiffnessAttr(0.0)
    drive.CreateDampingAttr(1000.0)
    return joint.GetPrim()


TICK = ("action.OnPlaybackTick", {})
CONTEXT = ("ros.ROS2Context", {})
TIME = ("core.IsaacReadSimulationTime", {"resetOnStop": True})


def made_once(make: Callable[[], Usd.Stage]) -> Callable[[], Usd.Stage]:
    """Let whoever asks for a robot again have a copy of the first."""
    first = cache(make)
    return wraps(make)(lambda: copied(first().GetRootLayer()))


@made_once
def rover() -> Usd.Stage:
    """A differential robot in centimetres: clock, drive, odometry, TF, lidar, camera, joints."""
    stage = rover_scene()
    _rover_graphs(stage, "/World/Rover")
    return stage


@made_once
def rover_scene() -> Usd.Stage:
    """The same robot without a graph."""
    stage = empty_stage("Z", 0.01)
    robot = "/World/Rover"
    add_api(UsdGeom.Xform.Define(stage, robot).GetPrim(), "IsaacRobotAPI")
    base = body(stage, f"{robot}/chassis", (0, 0, 10))
    add_api(base, "PhysicsArticulationRootAPI", "IsaacLinkAPI")
    for side, y in (("left", 20), ("right", -20)):
        add_api(wheel(stage, f"{robot}/{side}_wheel", (0, y, 10), 10.0), "IsaacLinkAPI")
        revolute(
            stage,
            f"{robot}/{side}_wheel_joint",
            f"{robot}/chassis",
            f"{robot}/{side}_wheel",
            (0, y, 0),
            "Y",
        )
    _rover_sensors(stage, f"{robot}/chassis")
    return stage


def lidar(stage: Usd.Stage, path: str, hertz: int = 10) -> Usd.Prim:
    """A lidar of one emitter that fires 360 times a turn."""
    made = add_api(stage.DefinePrim(path, "OmniLidar"), "OmniSensorGenericLidarCoreAPI")
    for name, usd_type, value in (
        ("omni:sensor:tickRate", "float", float(hertz)),
        ("omni:sensor:Core:scanRateBaseHz", "uint", hertz),
        ("omni:sensor:Core:patternFiringRateHz", "uint", 360 * hertz),
        ("omni:sensor:Core:nearRangeM", "float", 0.2),
        ("omni:sensor:Core:farRangeM", "float", 30.0),
        ("omni:sensor:Core:numberOfEmitters", "uint", 1),
        ("omni:sensor:Core:numberOfChannels", "uint", 1),
        ("omni:sensor:Core:emitterState:s001:azimuthDeg", "float[]", [0.0]),
        ("omni:sensor:Core:emitterState:s001:elevationDeg", "float[]", [0.0]),
        ("omni:sensor:Core:emitterState:s001:channelId", "uint[]", [1]),
        ("omni:sensor:Core:emitterState:s001:fireTimeNs", "uint[]", [0]),
    ):
        made.CreateAttribute(name, Sdf.ValueTypeNames.Find(usd_type), custom=False).Set(value)
    return made


def _rover_sensors(stage: Usd.Stage, base: str) -> None:
    lidar(stage, f"{base}/laser", 20)
    UsdGeom.Camera.Define(stage, f"{base}/eye")


def context_of(domain: int | None) -> tuple[str, Ports]:
    """A context: the domain of the environment, or one of its own."""
    own = {"domain_id": domain, "useDomainIDEnvVar": False}
    return CONTEXT if domain is None else ("ros.ROS2Context", own)


def write_clock(stage: Usd.Stage, path: str = "/World/Clock", domain: int | None = None) -> None:
    """Write the graph of a clock."""
    nodes = {"tick": TICK, "context": context_of(domain), "time": TIME}
    wires = [
        "tick.tick -> clock.execIn",
        "context.context -> clock.context",
        "time.simulationTime -> clock.timeStamp",
    ]
    write_graph(stage, path, {**nodes, "clock": ("ros.ROS2PublishClock", {})}, wires)


def _rover_graphs(stage: Usd.Stage, robot: str) -> None:
    write_clock(stage)
    write_graph(
        stage,
        "/World/Drive",
        {
            "tick": TICK,
            "context": CONTEXT,
            "twist": ("ros.ROS2SubscribeTwist", {"topicName": "cmd_vel"}),
            "metres": ("core.OgnIsaacScaleToFromStageUnit", {}),
            "linear": ("nodes.BreakVector3", {}),
            "angular": ("nodes.BreakVector3", {}),
            "drive": (
                "wheeled.DifferentialController",
                {"wheelRadius": 10.0, "wheelDistance": 40.0, "maxLinearSpeed": 150.0},
            ),
            "left": ("nodes.ConstantToken", {"value": "left_wheel_joint"}),
            "right": ("nodes.ConstantToken", {"value": "right_wheel_joint"}),
            "names": ("nodes.ConstructArray", {"arraySize": 2, "arrayType": "token[]"}),
            "move": ("core.IsaacArticulationController", {"targetPrim": robot}),
        },
        [
            "tick.tick -> twist.execIn",
            "tick.tick -> drive.execIn",
            "tick.tick -> move.execIn",
            "context.context -> twist.context",
            "twist.linearVelocity -> metres.value",
            "metres.result -> linear.tuple",
            "twist.angularVelocity -> angular.tuple",
            "linear.x -> drive.linearVelocity",
            "angular.z -> drive.angularVelocity",
            "tick.deltaSeconds -> drive.dt",
            "left.value -> names.input0",
            "right.value -> names.input1",
            "names.array -> move.jointNames",
            "drive.velocityCommand -> move.velocityCommand",
        ],
    )
    base = f"{robot}/chassis"
    write_graph(
        stage,
        "/World/Odometry",
        {
            "tick": TICK,
            "context": CONTEXT,
            "time": TIME,
            "compute": ("core.IsaacComputeOdometry", {"chassisPrim": base}),
            "odometry": ("ros.ROS2PublishOdometry", {"chassisFrameId": "chassis"}),
            "transform": ("ros.ROS2PublishRawTransformTree", {"childFrameId": "chassis"}),
            "frames": (
                "core.IsaacComputeTransformTree",
                {
                    "parentPrim": base,
                    "targetPrims": [
                        f"{robot}/left_wheel",
                        f"{robot}/right_wheel",
                        f"{base}/laser",
                        f"{base}/eye",
                    ],
                },
            ),
            "tree": ("ros.ROS2PublishTransformTree", {}),
            "joints": ("ros.ROS2PublishJointState", {"targetPrim": base}),
        },
        [
            "tick.tick -> compute.execIn",
            "compute.execOut -> odometry.execIn",
            "tick.tick -> transform.execIn",
            "tick.tick -> frames.execIn",
            "frames.execOut -> tree.execIn",
            "tick.tick -> joints.execIn",
            *(f"context.context -> {publisher}.context" for publisher in PUBLISHERS),
            *(f"time.simulationTime -> {publisher}.timeStamp" for publisher in PUBLISHERS),
            "compute.position -> odometry.position",
            "compute.orientation -> odometry.orientation",
            "compute.linearVelocity -> odometry.linearVelocity",
            "compute.angularVelocity -> odometry.angularVelocity",
            "compute.position -> transform.translation",
            "compute.orientation -> transform.rotation",
            *(f"frames.{array} -> tree.{array}" for array in ARRAYS),
        ],
    )
    sensor_graph(stage, "/World/Lidar", f"{base}/laser", "ros.ROS2RtxLidarHelper", "laser", "scan")
    sensor_graph(stage, "/World/Camera", f"{base}/eye", "ros.ROS2CameraHelper", "eye", "rgb")


PUBLISHERS = ("odometry", "transform", "tree", "joints")
ARRAYS = ("parentFrames", "childFrames", "translations", "orientations")


def sensor_graph(
    stage: Usd.Stage, path: str, sensor: str, helper: str, frame: str, topic: str
) -> None:
    """Write the graph of one sensor, as the menus of Isaac Sim do."""
    write_graph(
        stage,
        path,
        {
            "tick": TICK,
            "context": CONTEXT,
            "once": ("core.OgnIsaacRunOneSimulationFrame", {}),
            "product": ("core.IsaacCreateRenderProduct", {"cameraPrim": sensor}),
            "helper": (helper, {"frameId": frame, "topicName": topic}),
        },
        [
            "tick.tick -> once.execIn",
            "once.step -> product.execIn",
            "product.execOut -> helper.execIn",
            "product.renderProductPath -> helper.renderProductPath",
            "context.context -> helper.context",
        ],
    )


@made_once
def truck() -> Usd.Stage:
    """A car of four wheels with Y up, in a namespace: steering by position, driving by velocity."""
    stage = empty_stage("Y", 1.0)
    robot = "/Fleet/Truck"
    add_api(UsdGeom.Xform.Define(stage, robot).GetPrim(), "IsaacRobotAPI")
    base = f"{robot}/frame"
    frame = add_api(body(stage, base, (0, 0.5, 0)), "PhysicsArticulationRootAPI")
    frame.CreateAttribute("isaac:namespace", Sdf.ValueTypeNames.String).Set("truck_1")
    joints = f"{robot}/joints"
    for name, x, z in (("front_left", 1, -0.6), ("front_right", 1, 0.6)):
        body(stage, f"{robot}/{name}", (x, 0.5, z))
        steer = revolute(stage, f"{joints}/{name}", base, f"{robot}/{name}", (x, 0, z), "Y")
        UsdPhysics.DriveAPI(steer, "angular").GetStiffnessAttr().Set(5000.0)
    for name, carrier, x, z in (
        ("front_left_wheel", "front_left", 1, -0.6),
        ("front_right_wheel", "front_right", 1, 0.6),
        ("rear", "frame", -1, -0.6),
        ("rear_right", "frame", -1, 0.6),
    ):
        wheel(stage, f"{robot}/{name}", (x, 0.5, z), 0.5, "Z")
        at = (x, 0, z) if carrier == "frame" else (0, 0, 0)
        revolute(stage, f"{joints}/{name}", f"{robot}/{carrier}", f"{robot}/{name}", at, "Z")
    UsdGeom.Camera.Define(stage, f"{robot}/frame/front_camera")
    camera = f"{robot}/frame/front_camera"
    write_graph(
        stage,
        f"{robot}/Steering",
        {
            "tick": TICK,
            "context": context_of(7),
            "command": ("ros.ROS2SubscribeAckermannDrive", {"topicName": "drive"}),
            "ackermann": (
                "wheeled.AckermannController",
                {
                    "wheelBase": 2.0,
                    "trackWidth": 1.2,
                    "frontWheelRadius": 0.5,
                    "backWheelRadius": 0.5,
                },
            ),
            "steer": (
                "core.IsaacArticulationController",
                {"targetPrim": f"{robot}/frame", "jointNames": ["front_left", "front_right"]},
            ),
            "push": (
                "core.IsaacArticulationController",
                {
                    "targetPrim": f"{robot}/frame",
                    "jointNames": ["front_left_wheel", "front_right_wheel", "rear", "rear_right"],
                },
            ),
        },
        [
            "tick.tick -> command.execIn",
            "tick.tick -> ackermann.execIn",
            "tick.tick -> steer.execIn",
            "tick.tick -> push.execIn",
            "tick.deltaSeconds -> ackermann.dt",
            "context.context -> command.context",
            "command.speed -> ackermann.speed",
            "command.steeringAngle -> ackermann.steeringAngle",
            "ackermann.wheelAngles -> steer.positionCommand",
            "ackermann.wheelRotationVelocity -> push.velocityCommand",
        ],
    )
    write_graph(
        stage,
        f"{robot}/State",
        {
            "tick": TICK,
            "context": context_of(7),
            "time": ("core.IsaacReadSimulationTime", {}),
            "clock": ("ros.ROS2PublishClock", {}),
            "compute": ("core.IsaacComputeOdometry", {"chassisPrim": f"{robot}/frame"}),
            "odometry": (
                "ros.ROS2PublishOdometry",
                {"chassisFrameId": "frame", "topicName": "state/odom"},
            ),
            "transform": ("ros.ROS2PublishRawTransformTree", {"childFrameId": "frame"}),
            "tree": (
                "ros.ROS2PublishTransformTree",
                {"parentPrim": f"{robot}/frame", "targetPrims": [camera]},
            ),
        },
        [
            "tick.tick -> clock.execIn",
            "tick.tick -> compute.execIn",
            "compute.execOut -> odometry.execIn",
            "compute.execOut -> transform.execIn",
            "tick.tick -> tree.execIn",
            *(f"context.context -> {each}.context" for each in _TOLD),
            *(f"time.simulationTime -> {each}.timeStamp" for each in _TOLD),
            *(f"compute.{each} -> odometry.{each}" for each in _POSE),
            "compute.position -> transform.translation",
            "compute.orientation -> transform.rotation",
        ],
    )
    sensor_graph(
        stage, f"{robot}/Eye", camera, "ros.ROS2CameraInfoHelper", "front_camera", "camera_info"
    )
    context = stage.GetPrimAtPath(f"{robot}/Eye/context")
    context.CreateAttribute("inputs:domain_id", Sdf.ValueTypeNames.UChar, custom=True).Set(7)
    context.CreateAttribute("inputs:useDomainIDEnvVar", Sdf.ValueTypeNames.Bool, custom=True).Set(
        False  # noqa: FBT003 - pxr takes it so
    )
    return stage


_TOLD = ("clock", "odometry", "transform", "tree")
_POSE = ("position", "orientation", "linearVelocity", "angularVelocity")


@made_once
def arm() -> Usd.Stage:
    """An arm that is told joint states and tells its own, with an inertial sensor, at the root."""
    stage = empty_stage("Z", 1.0)
    root = "/arm"
    add_api(UsdGeom.Xform.Define(stage, root).GetPrim(), "PhysicsArticulationRootAPI")
    links = ("base", "shoulder", "elbow", "tool")
    for number, name in enumerate(links):
        body(stage, f"{root}/{name}", (0, 0, 0.3 * number))
    for number, name in enumerate(links[1:]):
        joint = revolute(
            stage,
            f"{root}/{name}_joint",
            f"{root}/{links[number]}",
            f"{root}/{name}",
            (0,) * 3,
            "Z",
        )
        UsdPhysics.DriveAPI(joint, "angular").GetStiffnessAttr().Set(3000.0)  # follows in 2 s
    stage.DefinePrim(f"{root}/tool/imu", "IsaacImuSensor")
    write_graph(
        stage,
        "/ActionGraph",
        {
            "on_tick": TICK,
            "ros2_context": CONTEXT,
            "read_time": ("core.IsaacReadSimulationTime", {}),
            "clock": ("ros.ROS2PublishClock", {}),
            "read_joints": ("sensors.IsaacReadJointState", {"prim": root}),
            "joint_states": ("ros.ROS2PublishJointState", {}),
            "command": ("ros.ROS2SubscribeJointState", {}),
            "controller": ("core.IsaacArticulationController", {"targetPrim": root}),
            "imu": ("sensors.IsaacReadIMU", {"imuPrim": f"{root}/tool/imu"}),
            "publish_imu": ("ros.ROS2PublishImu", {"frameId": "tool"}),
            "frames": (
                "core.IsaacComputeTransformTree",
                {"parentPrim": f"{root}/base", "targetPrims": [f"{root}/{n}" for n in links[1:]]},
            ),
            "tf": ("ros.ROS2PublishTransformTree", {}),
        },
        [
            *(f"on_tick.tick -> {each}.execIn" for each in _TICKED),
            "read_joints.execOut -> joint_states.execIn",
            "imu.execOut -> publish_imu.execIn",
            "frames.execOut -> tf.execIn",
            *(f"ros2_context.context -> {each}.context" for each in _IN_CONTEXT),
            *(f"read_time.simulationTime -> {each}.timeStamp" for each in _STAMPED),
            *(f"read_joints.{each} -> joint_states.{each}" for each in JOINT_STATES),
            *(f"command.{command} -> controller.{command}" for command in COMMANDS),
            "imu.linAcc -> publish_imu.linearAcceleration",
            "imu.angVel -> publish_imu.angularVelocity",
            "imu.orientation -> publish_imu.orientation",
            *(f"frames.{array} -> tf.{array}" for array in ARRAYS),
        ],
    )
    return stage


def car_and_arm(domain: int) -> Usd.Stage:
    """A car and an arm in one stage, the arm in a domain of its own."""
    stage, other = car(), arm()
    for path in ("/arm", "/ActionGraph"):
        Sdf.CopySpec(other.GetRootLayer(), path, stage.GetRootLayer(), path)
    context = stage.GetPrimAtPath("/ActionGraph/ros2_context")
    context.CreateAttribute("inputs:useDomainIDEnvVar", Sdf.ValueTypeNames.Bool).Set(False)  # noqa: FBT003
    context.CreateAttribute("inputs:domain_id", Sdf.ValueTypeNames.UChar).Set(domain)
    return stage


_TICKED = ("clock", "read_joints", "command", "controller", "imu", "frames")
_STAMPED = ("clock", "joint_states", "publish_imu", "tf")
_IN_CONTEXT = (*_STAMPED, "command")
COMMANDS = ("positionCommand", "velocityCommand", "effortCommand", "jointNames")
JOINT_STATES = (
    "jointNames",
    "jointPositions",
    "jointVelocities",
    "jointEfforts",
    "jointDofTypes",
    "stageMetersPerUnit",
)


@made_once
def car() -> Usd.Stage:
    """A car that is driven by its rear wheels and steered by knuckles, 0.6 m between the axles."""
    stage = empty_stage("Z", 1.0)
    robot = "/World/Car"
    add_api(UsdGeom.Xform.Define(stage, robot).GetPrim(), "PhysicsArticulationRootAPI")
    body(stage, f"{robot}/base", (0, 0, 0.1))
    for name, x, y in (
        ("front_left", 0.3, 0.2),
        ("front_right", 0.3, -0.2),
        ("rear_left", -0.3, 0.2),
        ("rear_right", -0.3, -0.2),
    ):
        wheel(stage, f"{robot}/{name}", (x, y, 0.1), 0.1)
        carrier, at = f"{robot}/base", (x, y, 0.0)
        if name.startswith("front"):
            carrier, at = f"{robot}/{name}_knuckle", (0.0, 0.0, 0.0)
            body(stage, carrier, (x, y, 0.1))
            steer = revolute(
                stage, f"{robot}/{name}_steer", f"{robot}/base", carrier, (x, y, 0), "Z"
            )
            UsdPhysics.DriveAPI(steer, "angular").GetStiffnessAttr().Set(20000.0)
        revolute(stage, f"{robot}/{name}_joint", carrier, f"{robot}/{name}", at, "Y")
    sizes = {"wheelBase": 0.6, "trackWidth": 0.4, "frontWheelRadius": 0.1, "backWheelRadius": 0.1}
    steering = ["front_left_steer", "front_right_steer"]
    wheels = ["front_left_joint", "front_right_joint", "rear_left_joint", "rear_right_joint"]
    move = "core.IsaacArticulationController"
    write_graph(
        stage,
        "/World/Drive",
        {
            "tick": TICK,
            "context": CONTEXT,
            "command": ("ros.ROS2SubscribeAckermannDrive", {"topicName": "drive"}),
            "ackermann": ("wheeled.AckermannController", sizes),
            "steer": (move, {"targetPrim": robot, "jointNames": steering}),
            "roll": (move, {"targetPrim": robot, "jointNames": wheels}),
            "compute": ("core.IsaacComputeOdometry", {"chassisPrim": f"{robot}/base"}),
            "odometry": ("ros.ROS2PublishOdometry", {"chassisFrameId": "base"}),
            "time": TIME,
        },
        [
            *(f"tick.tick -> {name}.execIn" for name in ("command", "ackermann", "steer", "roll")),
            "tick.tick -> compute.execIn",
            "compute.execOut -> odometry.execIn",
            "context.context -> command.context",
            "command.speed -> ackermann.speed",
            "command.steeringAngle -> ackermann.steeringAngle",
            "ackermann.wheelAngles -> steer.positionCommand",
            "ackermann.wheelRotationVelocity -> roll.velocityCommand",
            *(f"compute.{port} -> odometry.{port}" for port in _POSE),
            "time.simulationTime -> odometry.timeStamp",
        ],
    )
    return stage


ROBOTS: dict[str, Callable[[], Usd.Stage]] = {"rover": rover, "truck": truck, "arm": arm}
