"""Right stages of many kinds of robots with the graphs that they need, written with pxr alone.

`tests/robots.yaml` lists what each publishes, `tests/robot_faults.yaml` faults seeded
into them. Those of `foreign_robots.py` are among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from foreign_robots import (
    ARRAYS,
    COMMANDS,
    CONTEXT,
    JOINT_STATES,
    ROBOTS,
    TICK,
    TIME,
    add_api,
    body,
    car,
    connect,
    context_of,
    empty_stage,
    lidar,
    made_once,
    revolute,
    rover,
    wheel,
    write_clock,
    write_graph,
    write_node,
)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

POSE = ("position", "orientation", "linearVelocity", "angularVelocity")
_JOINTS = ("jointNames", "jointPositions", "jointVelocities", "jointEfforts")
_MOVE = "core.IsaacArticulationController"


def _ticked(*names: str) -> list[str]:
    return [f"tick.tick -> {name}.execIn" for name in names]


def _named(prim: Usd.Prim, name: str) -> None:
    prim.CreateAttribute("isaac:nameOverride", Sdf.ValueTypeNames.String).Set(name)


def _lidar(stage: Usd.Stage, path: str, at: tuple[float, float, float], yaw: float = 0.0) -> None:
    _place(lidar(stage, path), at, (0, 0, yaw))


def _camera(stage: Usd.Stage, path: str, at: tuple[float, float, float], yaw: float = 0.0) -> None:
    """A camera that looks along +X of its link, turned about Z by a yaw."""
    _place(UsdGeom.Camera.Define(stage, path).GetPrim(), at, (90, 0, yaw - 90))


def _place(prim: Usd.Prim, at: Iterable[float], turned: tuple[float, float, float]) -> None:
    xform = UsdGeom.Xformable(prim)
    xform.AddTranslateOp().Set(Gf.Vec3d(*at))
    xform.AddRotateXYZOp().Set(Gf.Vec3f(*turned))


def _mobile(stage: Usd.Stage, robot: str, y: float = 0.0, prefix: str = "") -> None:
    """A robot on two wheels of 0.1 m with a lidar and a camera; metres."""
    UsdGeom.Xform.Define(stage, robot).AddTranslateOp().Set(Gf.Vec3d(0, y, 0))
    base = add_api(body(stage, f"{robot}/base", (0, 0, 0.1)), "PhysicsArticulationRootAPI")
    links = [base]
    for side, offset in (("left", 0.2), ("right", -0.2)):
        link = f"{robot}/{side}_wheel"
        links.append(wheel(stage, link, (0, offset, 0.1), 0.1))
        joint = f"{robot}/{side}_wheel_joint"
        revolute(stage, joint, f"{robot}/base", link, (0, offset, 0), "Y")
    _lidar(stage, f"{robot}/base/laser", (0.1, 0, 0.2))
    _camera(stage, f"{robot}/base/eye", (0.2, 0, 0.1))
    links += [stage.GetPrimAtPath(f"{robot}/base/{name}") for name in ("laser", "eye")]
    for link in links if prefix else ():
        _named(link, f"{prefix}_{link.GetName()}")


def _driven(base: str, topic: str, space: Mapping[str, str]) -> Any:
    """Return the nodes and wires that drive a robot on two wheels."""
    joints = ["left_wheel_joint", "right_wheel_joint"]
    nodes = {
        "twist": ("ros.ROS2SubscribeTwist", {"topicName": topic, **space}),
        "linear": ("nodes.BreakVector3", {}),
        "angular": ("nodes.BreakVector3", {}),
        "drive": ("wheeled.DifferentialController", {"wheelRadius": 0.1, "wheelDistance": 0.4}),
        "move": (_MOVE, {"targetPrim": base, "jointNames": joints}),
    }
    wires = [
        *_ticked("twist", "drive", "move"),
        "context.context -> twist.context",
        "twist.linearVelocity -> linear.tuple",
        "twist.angularVelocity -> angular.tuple",
        "linear.x -> drive.linearVelocity",
        "angular.z -> drive.angularVelocity",
        "drive.velocityCommand -> move.velocityCommand",
    ]
    return nodes, wires


def _odometry(
    base: str, targets: list[str], prefix: str, start: str, space: Mapping[str, str]
) -> Any:
    """Return the nodes and wires of odometry and TF; `prefix` is before frames, `start` topics."""
    odom, name = f"{prefix}odom", f"{prefix}{base.rpartition('/')[2]}"
    frames = {"odomFrameId": odom, "chassisFrameId": name, "topicName": f"{start}odom"}
    raw = {"parentFrameId": odom, "childFrameId": name}
    nodes = {
        "time": TIME,
        "compute": ("core.IsaacComputeOdometry", {"chassisPrim": base}),
        "odometry": ("ros.ROS2PublishOdometry", {**frames, **space}),
        "transform": ("ros.ROS2PublishRawTransformTree", {**raw, **space}),
        "frames": ("core.IsaacComputeTransformTree", {"parentPrim": base, "targetPrims": targets}),
        "tree": ("ros.ROS2PublishTransformTree", {**space}),
    }
    sent = ("odometry", "transform", "tree")
    wires = [
        *_ticked("compute", "frames"),
        "compute.execOut -> odometry.execIn",
        "compute.execOut -> transform.execIn",
        "frames.execOut -> tree.execIn",
        *(f"context.context -> {name}.context" for name in sent),
        *(f"time.simulationTime -> {name}.timeStamp" for name in sent),
        *(f"compute.{port} -> odometry.{port}" for port in POSE),
        "compute.position -> transform.translation",
        "compute.orientation -> transform.rotation",
        *(f"frames.{array} -> tree.{array}" for array in ARRAYS),
    ]
    return nodes, wires


def _sensor(name: str, sensor: str, helper: str, ports: Mapping[str, Any]) -> Any:
    """Return the nodes and wires of one sensor: its product and its helper."""
    nodes = {
        f"{name}_once": ("core.OgnIsaacRunOneSimulationFrame", {}),
        f"{name}_product": ("core.IsaacCreateRenderProduct", {"cameraPrim": sensor}),
        name: (helper, ports),
    }
    wires = [
        *_ticked(f"{name}_once"),
        f"{name}_once.step -> {name}_product.execIn",
        f"{name}_product.execOut -> {name}.execIn",
        f"{name}_product.renderProductPath -> {name}.renderProductPath",
        f"context.context -> {name}.context",
    ]
    return nodes, wires


def _more(name: str, product: str, helper: str, ports: Mapping[str, Any]) -> Any:
    """Return the node and wires of another helper of a product."""
    return {name: (helper, ports)}, [
        f"{product}.execOut -> {name}.execIn",
        f"{product}.renderProductPath -> {name}.renderProductPath",
        f"context.context -> {name}.context",
    ]


def _graph(stage: Usd.Stage, path: str, domain: int | None, *parts: Any, **attributes: Any) -> None:
    nodes: dict[str, Any] = {"tick": TICK, "context": context_of(domain)}
    wires: list[str] = []
    for added, more in parts:
        nodes |= added
        wires += more
    write_graph(stage, path, nodes, wires, **attributes)


_LIDAR, _IMAGE = "ros.ROS2RtxLidarHelper", "ros.ROS2CameraHelper"
_INFO, _PAIR = "ros.ROS2CameraInfoHelper", ("image_raw", "camera_info")


def _mobile_graph(
    stage: Usd.Stage,
    path: str,
    robot: str,
    *,
    space: str = "",
    prefix: str = "",
    domain: int | None = None,
) -> None:
    """Write the graph of a mobile robot: its topics in a namespace, or begun with a prefix."""
    base = f"{robot}/base"
    spaced = {"nodeNamespace": space} if space else {}
    start, frame = (f"{prefix}/", f"{prefix}_") if prefix else ("", "")
    links = [f"{robot}/{side}_wheel" for side in ("left", "right")]
    links += [f"{base}/{name}" for name in ("laser", "eye")]
    laser = {"frameId": f"{frame}laser", "topicName": f"{start}scan", **spaced}
    eye = {"frameId": f"{frame}eye", **spaced}
    image, info = (
        {**eye, "topicName": f"{start}camera/{name}"} for name in ("image_raw", "camera_info")
    )
    _graph(
        stage,
        path,
        domain,
        _driven(base, f"{start}cmd_vel", spaced),
        _odometry(base, links, frame, start, spaced),
        _sensor("laser", f"{base}/laser", _LIDAR, laser),
        _sensor("image", f"{base}/eye", _IMAGE, image),
        _more("info", "image_product", _INFO, info),
    )


_TWO = {"alpha": 0.0, "beta": 3.0}


@made_once
def mobile() -> Usd.Stage:
    """A robot on two wheels in metres."""
    stage = empty_stage("Z", 1.0)
    _mobile(stage, "/World/Robot")
    write_clock(stage)
    _mobile_graph(stage, "/World/ROS", "/World/Robot")
    return stage


SETUP = ("wheelRadius", "wheelPositions", "wheelOrientations", "mecanumAngles", "wheelAxis")


@made_once
def four_wheels() -> Usd.Stage:
    """A rover of four driven wheels, two controllers of two joints each."""
    stage = empty_stage("Z", 1.0)
    robot = "/World/Four"
    add_api(UsdGeom.Xform.Define(stage, robot).GetPrim(), "PhysicsArticulationRootAPI")
    body(stage, f"{robot}/base", (0, 0, 0.1))
    for end, x in (("front", 0.2), ("rear", -0.2)):
        for side, y in (("left", 0.15), ("right", -0.15)):
            name = f"{end}_{side}"
            wheel(stage, f"{robot}/{name}", (x, y, 0.1), 0.1)
            link = f"{robot}/{name}"
            revolute(stage, f"{robot}/{name}_joint", f"{robot}/base", link, (x, y, 0), "Y")
    move = "core.IsaacArticulationController"
    write_graph(
        stage,
        "/World/Drive",
        {
            "tick": TICK,
            "context": CONTEXT,
            "twist": ("ros.ROS2SubscribeTwist", {"topicName": "four/cmd_vel"}),
            "linear": ("nodes.BreakVector3", {}),
            "angular": ("nodes.BreakVector3", {}),
            "drive": (
                "wheeled.DifferentialController",
                {"wheelRadius": 0.1, "wheelDistance": 0.3},
            ),
            "front": (
                move,
                {"targetPrim": robot, "jointNames": ["front_left_joint", "front_right_joint"]},
            ),
            "rear": (
                move,
                {"targetPrim": robot, "jointNames": ["rear_left_joint", "rear_right_joint"]},
            ),
        },
        [
            "tick.tick -> twist.execIn",
            "twist.execOut -> drive.execIn",
            "twist.execOut -> front.execIn",
            "twist.execOut -> rear.execIn",
            "context.context -> twist.context",
            "twist.linearVelocity -> linear.tuple",
            "twist.angularVelocity -> angular.tuple",
            "linear.x -> drive.linearVelocity",
            "angular.z -> drive.angularVelocity",
            "drive.velocityCommand -> front.velocityCommand",
            "drive.velocityCommand -> rear.velocityCommand",
        ],
    )
    write_clock(stage)
    wheels = [f"{robot}/{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
    _graph(stage, "/World/State", None, _odometry(f"{robot}/base", wheels, "", "", {}))
    return stage


@made_once
def car_with_clock() -> Usd.Stage:
    """A car that is steered by knuckles."""
    stage = car()
    write_clock(stage)
    connect(stage, "/World/Drive", "context.context", "odometry.context")
    return stage


def _roller(
    stage: Usd.Stage,
    link: str,
    number: int,
    at: tuple[float, float, float],
    inside: tuple[float, float, float],
) -> None:
    """A ball at the rim of a wheel that turns freely about an axis of its own."""
    path = f"{link}_roller_{number}"
    body(stage, path, at)
    ball = UsdGeom.Sphere.Define(stage, f"{path}/ball")
    ball.CreateRadiusAttr(0.02)
    add_api(ball.GetPrim(), "PhysicsCollisionAPI")
    joint = revolute(stage, f"{path}_joint", link, path, inside, "X")
    joint.RemoveAPI(UsdPhysics.DriveAPI, "angular")


@made_once
def rollers() -> Usd.Stage:
    """A robot on four wheels with rollers, at the corners of a square of 0.4 m; metres."""
    stage = empty_stage("Z", 1.0)
    robot = "/World/Mecanum"
    add_api(UsdGeom.Xform.Define(stage, robot).GetPrim(), "PhysicsArticulationRootAPI")
    body(stage, f"{robot}/base", (0, 0, 0.1))
    for name, x, y, angle in (
        ("front_left", 0.2, 0.2, -135.0),
        ("front_right", 0.2, -0.2, -45.0),
        ("rear_left", -0.2, 0.2, -45.0),
        ("rear_right", -0.2, -0.2, -135.0),
    ):
        link = f"{robot}/{name}"
        body(stage, link, (x, y, 0.1))
        joint = revolute(stage, f"{robot}/{name}_joint", f"{robot}/base", link, (x, y, 0), "Y")
        for k, (u, v) in enumerate(((0.0, -0.08), (0.0, 0.08), (-0.08, 0.0), (0.08, 0.0))):
            _roller(stage, link, k, (x + u, y, 0.1 + v), (u, 0.0, v))
        for part, value in (("angle", angle), ("radius", 0.1)):
            joint.CreateAttribute(f"isaacmecanumwheel:{part}", Sdf.ValueTypeNames.Float).Set(value)
    base = f"{robot}/base"
    write_graph(
        stage,
        "/World/Drive",
        {
            "tick": TICK,
            "context": CONTEXT,
            "twist": ("ros.ROS2SubscribeTwist", {}),
            "linear": ("nodes.BreakVector3", {}),
            "angular": ("nodes.BreakVector3", {}),
            "told": ("nodes.MakeVector3", {}),
            "setup": ("wheeled.HolonomicRobotUsdSetup", {"robotPrim": robot, "comPrim": base}),
            # It turns against what it is told (holonomic_controller.py:138, cross(V, place)).
            "holonomic": ("wheeled.HolonomicController", {"angularGain": -1.0}),
            "move": ("core.IsaacArticulationController", {"targetPrim": robot}),
        },
        [
            *(f"tick.tick -> {name}.execIn" for name in ("twist", "holonomic", "move")),
            "context.context -> twist.context",
            "twist.linearVelocity -> linear.tuple",
            "twist.angularVelocity -> angular.tuple",
            "linear.x -> told.x",
            "linear.y -> told.y",
            "angular.z -> told.z",
            "told.tuple -> holonomic.inputVelocity",
            *(f"setup.{port} -> holonomic.{port}" for port in SETUP),
            "setup.wheelDofNames -> move.jointNames",
            "holonomic.jointVelocityCommand -> move.velocityCommand",
        ],
    )
    write_clock(stage)
    wheels = [f"{robot}/{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
    _graph(stage, "/World/State", None, _odometry(base, wheels, "", "", {}))
    return stage


@made_once
def in_namespaces() -> Usd.Stage:
    """Two robots, each with a node namespace of its own, TF included."""
    return _fleet(_TWO)


def fleet(count: int) -> Usd.Stage:
    """Robots in a row, each with a node namespace of its own."""
    return _fleet({f"robot_{number}": 3.0 * number for number in range(count)})


def heap(count: int) -> Usd.Stage:
    """Robots that all stand in one place, each with a node namespace of its own."""
    return _fleet(dict.fromkeys((f"robot_{number}" for number in range(count)), 0.0))


def faulty_fleet(count: int) -> Usd.Stage:
    """Return robots of which each has frames with a slash, and messages without a time."""
    stage = fleet(count)
    for prim in stage.Traverse():
        frame, time = (prim.GetAttribute(f"inputs:{name}") for name in ("frameId", "timeStamp"))
        if frame:
            frame.Set(f"/{frame.Get()}")
        if time:
            time.ClearConnections()
    return stage


def pairs(count: int) -> Sdf.Layer:
    """One rover with many pairs of graphs, a clock and a drive, each pair below a scope."""
    source = rover().GetRootLayer()
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(source)
    for graph in ("Clock", "Drive", "Odometry", "Lidar", "Camera"):
        del layer.GetPrimAtPath("/World").nameChildren[graph]
    for number in range(count):
        space = Sdf.CreatePrimInLayer(layer, f"/World/P{number}")
        space.specifier, space.typeName = Sdf.SpecifierDef, "Scope"
        for graph in ("Clock", "Drive"):
            Sdf.CopySpec(source, f"/World/{graph}", layer, f"{space.path}/{graph}")
    return layer


def _fleet(places: Mapping[str, float]) -> Usd.Stage:
    stage = empty_stage("Z", 1.0)
    write_clock(stage)
    for name, y in places.items():
        _mobile(stage, f"/World/{name}", y)
        _mobile_graph(stage, f"/World/{name}_ROS", f"/World/{name}", space=name)
    return stage


@made_once
def by_prefixes() -> Usd.Stage:
    """Two robots on one TF topic, told apart by the beginnings of topics and frames."""
    stage = empty_stage("Z", 1.0)
    write_clock(stage)
    for name, y in _TWO.items():
        _mobile(stage, f"/World/{name}", y, name)
        _mobile_graph(stage, f"/World/{name}_ROS", f"/World/{name}", prefix=name)
    return stage


@made_once
def by_attribute() -> Usd.Stage:
    """Two robots with their graphs inside, each below an `isaac:namespace`."""
    stage = empty_stage("Z", 1.0)
    write_clock(stage)
    for name, y in _TWO.items():
        _mobile(stage, f"/World/{name}", y)
        prim = stage.GetPrimAtPath(f"/World/{name}")
        prim.CreateAttribute("isaac:namespace", Sdf.ValueTypeNames.String).Set(name)
        _mobile_graph(stage, f"/World/{name}/ROS", f"/World/{name}")
    return stage


@made_once
def in_domains() -> Usd.Stage:
    """Two robots with the same topics, each in a domain of its own."""
    stage = empty_stage("Z", 1.0)
    for domain, (name, y) in enumerate(_TWO.items(), 1):
        _mobile(stage, f"/World/{name}", y)
        write_clock(stage, f"/World/{name}_Clock", domain)
        _mobile_graph(stage, f"/World/{name}_ROS", f"/World/{name}", domain=domain)
    return stage


def _chain(stage: Usd.Stage, root: str, x: float = 0.0, base: str = "") -> None:
    """An arm of three links that stand on one another, fixed to the world or on a base."""
    UsdGeom.Xform.Define(stage, root).AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
    links = ("pedestal", "shoulder", "elbow", "tool")
    height = 0.2 if base else 0.0
    for number, name in enumerate(links):
        body(stage, f"{root}/{name}", (0, 0, height + 0.3 * number))
    if not base:
        add_api(stage.GetPrimAtPath(root), "PhysicsArticulationRootAPI")
    fixed = UsdPhysics.FixedJoint.Define(stage, f"{root}/mount")
    fixed.CreateBody1Rel().SetTargets([f"{root}/pedestal"])
    if base:
        fixed.CreateBody0Rel().SetTargets([base])
        fixed.CreateLocalPos0Attr(Gf.Vec3f(0, 0, 0.1))
    for number, name in enumerate(links[1:]):
        joint = revolute(
            stage,
            f"{root}/{name}_joint",
            f"{root}/{links[number]}",
            f"{root}/{name}",
            (0, 0, 0.3),
            "Z" if number == 0 else "Y",
        )
        _held(joint)


def _held(joint: Usd.Prim) -> None:
    """Let a joint hold positions between -120 and 120 degrees."""
    drive = UsdPhysics.DriveAPI(joint, "angular")
    drive.GetStiffnessAttr().Set(8000.0)
    limits = UsdPhysics.RevoluteJoint(joint)
    limits.CreateLowerLimitAttr(-120.0)
    limits.CreateUpperLimitAttr(120.0)


def _joints(root: str, space: Mapping[str, str], topics: tuple[str, str], names: Any = None) -> Any:
    """Return nodes and wires of joint commands and joint states."""
    named = {} if names is None else {"jointNames": names}
    nodes = {
        "time": TIME,
        "read": ("sensors.IsaacReadJointState", {"prim": root}),
        "states": ("ros.ROS2PublishJointState", {"topicName": topics[0], **space}),
        "command": ("ros.ROS2SubscribeJointState", {"topicName": topics[1], **space}),
        "control": (_MOVE, {"targetPrim": root, **named}),
    }
    wires = [
        *_ticked("read", "command", "control"),
        "read.execOut -> states.execIn",
        *(f"context.context -> {name}.context" for name in ("states", "command")),
        "time.simulationTime -> states.timeStamp",
        *(f"read.{port} -> states.{port}" for port in JOINT_STATES),
        *(
            f"command.{port} -> control.{port}"
            for port in COMMANDS
            if names is None or port != "jointNames"
        ),
    ]
    return nodes, wires


def _frames(base: str | list[str], targets: list[str], space: Mapping[str, str]) -> Any:
    """Return nodes and wires of the TF of links."""
    nodes = {
        "time": TIME,
        "frames": ("core.IsaacComputeTransformTree", {"parentPrim": base, "targetPrims": targets}),
        "tree": ("ros.ROS2PublishTransformTree", {**space}),
    }
    return nodes, [
        *_ticked("frames"),
        "frames.execOut -> tree.execIn",
        "context.context -> tree.context",
        "time.simulationTime -> tree.timeStamp",
        *(f"frames.{array} -> tree.{array}" for array in ARRAYS),
    ]


_STATES = ("joint_states", "joint_command")


def _links(root: str) -> list[str]:
    return [f"{root}/{name}" for name in ("shoulder", "elbow", "tool")]


@made_once
def two_arms() -> Usd.Stage:
    """Two arms of one make in two namespaces."""
    stage = empty_stage("Z", 1.0)
    write_clock(stage)
    for name, x in _TWO.items():
        root, space = f"/World/{name}", {"nodeNamespace": name}
        _chain(stage, root, x)
        tree = _frames(f"{root}/pedestal", _links(root), space)
        _graph(stage, f"/World/{name}_ROS", None, _joints(root, space, _STATES), tree)
    return stage


@made_once
def base_with_arm() -> Usd.Stage:
    """A mobile robot that carries an arm, one articulation."""
    stage = mobile()
    _chain(stage, "/World/Robot/Arm", 0.0, "/World/Robot/base")
    root, tree = "/World/Robot/base", "/World/ROS/frames.inputs:targetPrims"
    relation = stage.GetRelationshipAtPath(tree)
    relation.SetTargets(
        [*relation.GetTargets(), "/World/Robot/Arm/pedestal", *_links("/World/Robot/Arm")]
    )
    names = ["shoulder_joint", "elbow_joint", "tool_joint"]
    _graph(stage, "/World/Arm_ROS", None, _joints(root, {}, _STATES, names))
    return stage


@made_once
def gripper() -> Usd.Stage:
    """Two fingers that slide."""
    stage = empty_stage("Z", 1.0)
    root = "/World/Gripper"
    add_api(UsdGeom.Xform.Define(stage, root).GetPrim(), "PhysicsArticulationRootAPI")
    body(stage, f"{root}/palm", (0, 0, 0.5))
    UsdPhysics.FixedJoint.Define(stage, f"{root}/mount").CreateBody1Rel().SetTargets(
        [f"{root}/palm"]
    )
    for side, y in (("left", 0.02), ("right", -0.02)):
        body(stage, f"{root}/{side}_finger", (0, y, 0.5))
        joint = UsdPhysics.PrismaticJoint.Define(stage, f"{root}/{side}_finger_joint")
        joint.CreateBody0Rel().SetTargets([f"{root}/palm"])
        joint.CreateBody1Rel().SetTargets([f"{root}/{side}_finger"])
        joint.CreateAxisAttr("Y")
        joint.CreateLocalPos0Attr(Gf.Vec3f(0, y, 0))
        joint.CreateLowerLimitAttr(0.0 if side == "left" else -0.04)
        joint.CreateUpperLimitAttr(0.04 if side == "left" else 0.0)
        drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "linear")
        drive.CreateStiffnessAttr(2000.0)
        drive.CreateDampingAttr(100.0)
    write_clock(stage)
    fingers = [f"{root}/{side}_finger" for side in ("left", "right")]
    topics = ("gripper/states", "gripper/command")
    _graph(
        stage, "/World/ROS", None, _joints(root, {}, topics), _frames(f"{root}/palm", fingers, {})
    )
    return stage


@made_once
def quadruped() -> Usd.Stage:
    """Four legs with a hip and a knee each, held by springs."""
    stage = empty_stage("Z", 1.0)
    root = "/World/Dog"
    UsdGeom.Xform.Define(stage, root)
    add_api(body(stage, f"{root}/trunk", (0, 0, 0.4)), "PhysicsArticulationRootAPI")
    targets = []
    for leg, x, y in (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1)):
        above, at = f"{root}/trunk", (x, y, 0.0)
        for part, height in (("thigh", 0.4), ("foot", 0.2)):
            link = f"{root}/{leg}_{part}"
            body(stage, link, (x, y, height))
            joint = revolute(stage, f"{root}/{leg}_{part}_joint", above, link, at, "Y")
            _held(joint)
            targets.append(link)
            above, at = link, (0.0, 0.0, -0.2)
        ball = UsdGeom.Sphere.Define(stage, f"{root}/{leg}_foot/collision")
        ball.CreateRadiusAttr(0.02)
        ball.AddTranslateOp().Set(Gf.Vec3d(0, 0, -0.18))
        add_api(ball.GetPrim(), "PhysicsCollisionAPI")
    write_clock(stage)
    parts = _joints(f"{root}/trunk", {}, _STATES), _odometry(f"{root}/trunk", targets, "", "", {})
    _graph(stage, "/World/ROS", None, *parts)
    return stage


@made_once
def drone() -> Usd.Stage:
    """A body without joints that publishes its pose, IMU and camera; nothing commands it."""
    stage = empty_stage("Z", 1.0)
    root = "/World/Drone/body"
    UsdGeom.Xform.Define(stage, "/World/Drone")
    body(stage, root, (0, 0, 1.0))
    stage.DefinePrim(f"{root}/imu", "IsaacImuSensor")
    _camera(stage, f"{root}/eye", (0.1, 0, 0))
    write_clock(stage)
    imu = {
        "imu": ("sensors.IsaacReadIMU", {"imuPrim": f"{root}/imu"}),
        "publish_imu": ("ros.ROS2PublishImu", {"frameId": "body"}),
    }
    wires = [
        *_ticked("imu"),
        "imu.execOut -> publish_imu.execIn",
        "context.context -> publish_imu.context",
        "time.simulationTime -> publish_imu.timeStamp",
        "imu.linAcc -> publish_imu.linearAcceleration",
        "imu.angVel -> publish_imu.angularVelocity",
        "imu.orientation -> publish_imu.orientation",
    ]
    image = _sensor("image", f"{root}/eye", _IMAGE, {"frameId": "eye", "topicName": "image_raw"})
    odometry = _odometry(root, [f"{root}/eye"], "", "", {})
    _graph(stage, "/World/ROS", None, odometry, (imu, wires), image)
    return stage


@made_once
def services() -> Usd.Stage:
    """The mobile robot, and services of prims and of a message of its own."""
    stage = mobile()
    asked = {"messagePackage": "std_srvs", "messageSubfolder": "srv", "messageName": "SetBool"}
    nodes = {
        "prims": ("ros.ROS2ServicePrim", {}),
        "request": ("ros.OgnROS2ServiceServerRequest", {"serviceName": "switch", **asked}),
        "response": ("ros.OgnROS2ServiceServerResponse", asked),
    }
    wires = [
        *_ticked("prims", "request"),
        "context.context -> prims.context",
        "context.context -> request.context",
        "context.context -> response.context",
        "request.onReceived -> response.onReceived",
        "request.serverHandle -> response.serverHandle",
    ]
    _graph(stage, "/World/Services", None, (nodes, wires))
    return stage


@made_once
def generic_topics() -> Usd.Stage:
    """The mobile robot, and a generic publisher and subscriber."""
    stage = mobile()
    number = {"messagePackage": "std_msgs", "messageSubfolder": "msg", "messageName": "Float64"}
    nodes = {
        "level": ("ros.ROS2Publisher", {"topicName": "battery", **number}),
        "lamp": ("ros.ROS2Subscriber", {"topicName": "lamp", **number}),
    }
    wires = [*_ticked("level", "lamp"), *(f"context.context -> {name}.context" for name in nodes)]
    _graph(stage, "/World/Generic", None, (nodes, wires))
    data = stage.GetPrimAtPath("/World/Generic/level").CreateAttribute(
        "inputs:data", Sdf.ValueTypeNames.Double
    )
    data.Set(12.0)
    return stage


def _two_eyes(stage: Usd.Stage) -> None:
    base = "/World/Robot/base"
    _camera(stage, f"{base}/right_eye", (0.2, -0.06, 0.1))
    tree = stage.GetRelationshipAtPath("/World/ROS/frames.inputs:targetPrims")
    tree.AddTarget(f"{base}/right_eye")


@made_once
def stereo() -> Usd.Stage:
    """The mobile robot with two cameras side by side; images and infos are in the left frame."""
    stage = mobile()
    _two_eyes(stage)
    eyes = {
        name: f"/World/Robot/base/{path}"
        for name, path in (("left", "eye"), ("right", "right_eye"))
    }
    product = "core.IsaacCreateRenderProduct"
    nodes: dict[str, Any] = {"once": ("core.OgnIsaacRunOneSimulationFrame", {})}
    for name, eye in eyes.items():
        nodes[f"{name}_product"] = (product, {"cameraPrim": eye})
        nodes[name] = (_IMAGE, {"frameId": "eye", "topicName": f"stereo/{name}/image_raw"})
    ports = {"frameId": "eye", "topicName": "stereo/left/camera_info"}
    ports |= {"frameIdRight": "eye", "topicNameRight": "stereo/right/camera_info"}
    nodes["info"] = (_INFO, ports)
    # The info helper reads both products at its first signal: both are made before it.
    wires = [
        *_ticked("once"),
        "once.step -> left_product.execIn",
        "left_product.execOut -> right_product.execIn",
        *(f"right_product.execOut -> {name}.execIn" for name in (*eyes, "info")),
        *(f"{name}_product.renderProductPath -> {name}.renderProductPath" for name in eyes),
        "left_product.renderProductPath -> info.renderProductPath",
        "right_product.renderProductPath -> info.renderProductPathRight",
        *(f"context.context -> {name}.context" for name in (*eyes, "info")),
    ]
    _graph(stage, "/World/Stereo", None, (nodes, wires))
    return stage


@made_once
def depth_camera() -> Usd.Stage:
    """The mobile robot with color, depth and points of one camera, in its optical frame."""
    stage = mobile()
    eye = "/World/Robot/base/eye"
    kinds = {"color": "rgb", "depth": "depth", "points": "depth_pcl"}
    helpers = {
        name: {"frameId": "eye", "topicName": f"depth_camera/{name}", "type": kind}
        for name, kind in kinds.items()
    }
    first = _sensor("color", eye, _IMAGE, helpers["color"])
    others = [_more(name, "color_product", _IMAGE, helpers[name]) for name in ("depth", "points")]
    ports = {"frameId": "eye", "topicName": "depth_camera/camera_info"}
    _graph(
        stage, "/World/Depth", None, first, *others, _more("info", "color_product", _INFO, ports)
    )
    return stage


@made_once
def two_lidars() -> Usd.Stage:
    """The mobile robot with a second lidar at its back, which looks backward."""
    stage = mobile()
    rear = "/World/Robot/base/rear_laser"
    _lidar(stage, rear, (-0.1, 0, 0.2), 180)
    stage.GetRelationshipAtPath("/World/ROS/frames.inputs:targetPrims").AddTarget(rear)
    ports = {"frameId": "rear_laser", "topicName": "rear_scan"}
    _graph(stage, "/World/Rear", None, _sensor("rear", rear, _LIDAR, ports))
    return stage


@made_once
def payload() -> Usd.Stage:
    """A robot that comes with a payload, as large assets do."""
    stage = mobile()
    layer = stage.GetRootLayer()
    Sdf.CreatePrimInLayer(layer, "/Assets").specifier = Sdf.SpecifierClass
    Sdf.CopySpec(layer, "/World/Robot", layer, "/Assets/Robot")
    stage.RemovePrim("/World/Robot")
    stage.DefinePrim("/World/Robot").GetPayloads().AddInternalPayload("/Assets/Robot")
    return stage


@made_once
def on_demand() -> Usd.Stage:
    """The mobile robot with its clock on physics steps, in an on-demand graph."""
    stage = mobile()
    scene = stage.GetPrimAtPath("/World/physicsScene")
    scene.CreateAttribute("physxScene:timeStepsPerSecond", Sdf.ValueTypeNames.UInt).Set(120)
    graph = stage.GetPrimAtPath("/World/Clock")
    graph.GetAttribute("pipelineStage").Set("pipelineStageOnDemand")
    stage.RemovePrim("/World/Clock/tick")
    write_node(stage, "/World/Clock/step", "core.OnPhysicsStep", {})
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    connect(stage, "/World/Clock", "step.step", "clock.execIn")
    return stage


@made_once
def gated() -> Usd.Stage:
    """The mobile robot with odometry and its transform at 10 Hz."""
    stage = mobile()
    write_node(stage, "/World/ROS/gate", "core.IsaacSimulationGate", {"step": 6})
    connect(stage, "/World/ROS", "compute.execOut", "gate.execIn")
    for name in ("odometry", "transform"):
        stage.GetAttributeAtPath(f"/World/ROS/{name}.inputs:execIn").ClearConnections()
        connect(stage, "/World/ROS", "gate.execOut", f"{name}.execIn")
    return stage


@made_once
def with_profiles() -> Usd.Stage:
    """The mobile robot with a QoS profile for its sensors."""
    stage = mobile()
    write_node(stage, "/World/ROS/qos", "ros.ROS2QoSProfile", {"createProfile": "Sensor Data"})
    for name in ("laser", "image", "info"):
        connect(stage, "/World/ROS", "qos.qosProfile", f"{name}.qosProfile")
    return stage


@made_once
def segmented() -> Usd.Stage:
    """The mobile robot with a semantic segmentation beside its image."""
    stage = mobile()
    ports = {"frameId": "eye", "topicName": "camera/semantic", "type": "semantic_segmentation"}
    _graph(stage, "/World/Labels", None, _sensor("labels", "/World/Robot/base/eye", _IMAGE, ports))
    return stage


@made_once
def watching_camera() -> Usd.Stage:
    """A camera on a wall, and no robot."""
    stage = empty_stage("Z", 1.0)
    _camera(stage, "/World/wall_camera", (0, 0, 2))
    write_clock(stage)
    eye = "/World/wall_camera"
    image, info = (
        {"frameId": "wall_camera", "topicName": f"wall/{name}"}
        for name in ("image_raw", "camera_info")
    )
    parts = _sensor("image", eye, _IMAGE, image), _more("info", "image_product", _INFO, info)
    _graph(stage, "/World/ROS", None, *parts, _frames([], [eye], {}))
    return stage


@made_once
def gimbal() -> Usd.Stage:
    """The mobile robot with a camera on a mast that turns."""
    stage = mobile()
    robot = "/World/Robot"
    mast = f"{robot}/mast"
    body(stage, mast, (0, 0, 0.5))
    joint = revolute(stage, f"{robot}/mast_joint", f"{robot}/base", mast, (0, 0, 0.4), "Z")
    _held(joint)
    _camera(stage, f"{mast}/top_eye", (0.05, 0, 0))
    tree = stage.GetRelationshipAtPath("/World/ROS/frames.inputs:targetPrims")
    for path in (mast, f"{mast}/top_eye"):
        tree.AddTarget(path)
    ports = {"frameId": "top_eye", "topicName": "top/image_raw"}
    names = ["mast_joint"]
    joints = _joints(f"{robot}/base", {}, ("mast/states", "mast/command"), names)
    image = _sensor("image", f"{mast}/top_eye", _IMAGE, ports)
    _graph(stage, "/World/Mast_ROS", None, joints, image)
    return stage


@made_once
def rooted_robot() -> Usd.Stage:
    """The rover with one target for all links of TF, its root."""
    stage = rover()
    tree = stage.GetRelationshipAtPath("/World/Odometry/frames.inputs:targetPrims")
    eyes = [f"/World/Rover/chassis/{name}" for name in ("laser", "eye")]
    tree.SetTargets(["/World/Rover", *eyes])
    return stage


KINDS: dict[str, Callable[[], Usd.Stage]] = {
    **ROBOTS,
    "mobile": mobile,
    "two robots in namespaces": in_namespaces,
    "two robots by prefixes": by_prefixes,
    "two robots by isaac:namespace": by_attribute,
    "two robots in two domains": in_domains,
    "mecanum": rollers,
    "car": car_with_clock,
    "skid steer": four_wheels,
    "two arms": two_arms,
    "a base with an arm": base_with_arm,
    "gripper": gripper,
    "quadruped": quadruped,
    "drone": drone,
    "services": services,
    "generic topics": generic_topics,
    "stereo cameras": stereo,
    "depth camera": depth_camera,
    "two lidars": two_lidars,
    "payload": payload,
    "on-demand graph": on_demand,
    "gated odometry": gated,
    "QoS profiles": with_profiles,
    "semantic segmentation": segmented,
    "watching camera": watching_camera,
    "camera on a mast": gimbal,
    "one target for all links": rooted_robot,
}
