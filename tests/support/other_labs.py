"""Labs beside the bundled one: the small frozen `labs/mini`, another robot, a fixed arm."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from unittest.mock import patch

from foreign_robots import (
    JOINT_STATES,
    TICK,
    Nodes,
    add_api,
    body,
    empty_stage,
    revolute,
    wheel,
    write_graph,
)
from grade_files import build_all
from places import TESTS
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.new_lab.lab import describe_lab
from lab3_usd.spec.load.loader import load_lab

MINI = TESTS / "labs" / "mini"
LAB = load_lab(MINI)
LAST = list(LAB.checkpoints)[-1]


def in_force() -> patch.dict[str, str]:
    """Let the small lab stand for the bundled one, here and in child processes."""
    return patch.dict("os.environ", {LAB_VARIABLE: str(MINI)})


def copied(folder: Path) -> Path:
    """Copy the files of the lab, to be changed."""
    return shutil.copytree(MINI, folder, ignore=shutil.ignore_patterns("__pycache__"))


@cache
def built() -> Path:
    """Build the stages and the starter once, and return their folder."""
    with in_force():
        return build_all(LAB)


def starter() -> Path:
    return built() / "starter.usda"


def stage(number: str) -> Path:
    return built() / "work" / f"{LAB.checkpoints[number].file}.usda"


def submission(folder: Path, *numbers: str, work: str = "work") -> Path:
    """Write a submission with these stages, all of them when none is named."""
    (folder / work).mkdir(parents=True, exist_ok=True)
    for number in numbers or LAB.checkpoints:
        shutil.copyfile(stage(number), folder / work / stage(number).name)
    return folder


def cut_wire(path: Path) -> Path:
    """Take the execution wire of the clock out of a stage."""
    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    clock = LAB.graphs["ROS_Clock"].path
    attribute = layer.GetAttributeAtPath(f"{clock}/ros2_publish_clock.inputs:execIn")
    attribute.connectionPathList.ClearEditsAndMakeExplicit()
    layer.Export(str(path))
    return path


def files_below(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its path there."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


NAME = "carter_yard.usda"
CARTER = "/World/Carter"
CHASSIS = f"{CARTER}/chassis"
WHEELS: Nodes = {
    "tick": TICK,
    "twist": ("ros.ROS2SubscribeTwist", {"topicName": "carter/cmd_vel"}),
    "ahead": ("nodes.BreakVector3", {}),
    "turn": ("nodes.BreakVector3", {}),
    "speeds": ("wheeled.DifferentialController", {"wheelDistance": 0.5, "wheelRadius": 0.2}),
    "motors": (
        "core.IsaacArticulationController",
        {"jointNames": ["left_motor", "right_motor"], "targetPrim": CHASSIS},
    ),
}
WHEEL_WIRES = (
    *(f"tick.tick -> {node}.execIn" for node in ("twist", "speeds", "motors")),
    "twist.linearVelocity -> ahead.tuple",
    "twist.angularVelocity -> turn.tuple",
    "ahead.x -> speeds.linearVelocity",
    "turn.z -> speeds.angularVelocity",
    "speeds.velocityCommand -> motors.velocityCommand",
)
INERTIA: Nodes = {
    "tick": TICK,
    "imu": ("sensors.IsaacReadIMU", {"imuPrim": f"{CHASSIS}/Imu", "readGravity": False}),
    "publish": ("ros.ROS2PublishImu", {"frameId": "chassis"}),
}
INERTIA_WIRES = (
    "tick.tick -> imu.execIn",
    "imu.execOut -> publish.execIn",
    "imu.angVel -> publish.angularVelocity",
)
OWN: Nodes = {"filter": ("acme.filters.LowPass", {})}  # a type of no catalog
OWN_WIRES = ("imu.execOut -> filter.execIn", "imu.angVel -> filter.signal")


def write_stage(folder: Path, own: Nodes | None = None, wires: tuple[str, ...] = ()) -> Path:
    """Write the stage, with nodes of its own in the graph of the IMU, and return its path."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    UsdPhysics.Scene.Define(stage, "/physics")
    stage.SetDefaultPrim(stage.DefinePrim("/World", "Xform"))
    add_api(UsdGeom.Plane.Define(stage, "/World/floor").GetPrim(), "PhysicsCollisionAPI")
    stage.GetAttributeAtPath("/World/floor.axis").Set("Z")
    stage.DefinePrim("/World/sky", "DomeLight")
    UsdGeom.Xform.Define(stage, CARTER).AddTranslateOp().Set((2.0, -1.0, 0.0))
    links = {"chassis": (body(stage, CHASSIS, (0, 0, 0.2)), 30.0)}
    for side, y in (("left", 0.25), ("right", -0.25)):
        links[side] = (wheel(stage, f"{CARTER}/{side}", (0, y, 0.2), 0.2), 2.0)
        place = (CHASSIS, f"{CARTER}/{side}", (0, y, 0), "Y")
        revolute(stage, f"{CARTER}/{side}_motor", *place)
    for link, mass in links.values():
        UsdPhysics.MassAPI.Apply(link).CreateMassAttr(mass)
    add_api(links["chassis"][0], "PhysicsArticulationRootAPI")
    imu = stage.DefinePrim(f"{CHASSIS}/Imu", "IsaacImuSensor")
    imu.CreateAttribute("sensorPeriod", Sdf.ValueTypeNames.Float, custom=False).Set(0.01)
    UsdGeom.Xformable(imu).AddTranslateOp().Set((0.1, 0.0, 0.05))
    write_graph(stage, "/World/Wheels", WHEELS, WHEEL_WIRES)
    write_graph(stage, "/World/Inertia", {**INERTIA, **(own or {})}, (*INERTIA_WIRES, *wires))
    stage.GetRootLayer().Export(str(folder / NAME))
    return folder / NAME


ROBOT = "/World/Panda"
LINKS = tuple(f"link{number}" for number in range(8))
JOINTS = tuple(f"joint{number}" for number in range(1, 8))
LIMITS = (-160.0, 160.0)  # degrees
STATES = "/panda/joint_states"
COMMANDS = "/panda/joint_command"
FILES = ("Arm_1_scene", "Arm_2_clock", "Arm_3_states", "Arm_4_commands", "Arm_5_frames")

_TICK = ("action.OnPlaybackTick", {})
_CONTEXT = ("ros.ROS2Context", {"domain_id": 0, "useDomainIDEnvVar": False})
_TIME = ("core.IsaacReadSimulationTime", {"resetOnStop": False})
_COMMON: Nodes = {"tick": _TICK, "context": _CONTEXT}
_TIMED: Nodes = {**_COMMON, "time": _TIME}
_ARRAYS = ("parentFrames", "childFrames", "translations", "orientations")
_SENT = ("jointNames", "positionCommand", "velocityCommand", "effortCommand")

GRAPHS: Mapping[str, tuple[Nodes, tuple[str, ...]]] = {
    "Clock": (
        {**_TIMED, "clock": ("ros.ROS2PublishClock", {"topicName": "clock"})},
        (
            "tick.tick -> clock.execIn",
            "context.context -> clock.context",
            "time.simulationTime -> clock.timeStamp",
        ),
    ),
    "States": (
        {
            **_TIMED,
            "read": ("sensors.IsaacReadJointState", {"prim": ROBOT}),
            "publish": ("ros.ROS2PublishJointState", {"topicName": STATES}),
        },
        (
            "tick.tick -> read.execIn",
            "read.execOut -> publish.execIn",
            "context.context -> publish.context",
            "time.simulationTime -> publish.timeStamp",
            *(f"read.{port} -> publish.{port}" for port in JOINT_STATES),
        ),
    ),
    "Commands": (
        {
            **_COMMON,
            "listen": ("ros.ROS2SubscribeJointState", {"topicName": COMMANDS}),
            "motors": ("core.IsaacArticulationController", {"targetPrim": ROBOT}),
        },
        (
            "tick.tick -> listen.execIn",
            "tick.tick -> motors.execIn",
            "context.context -> listen.context",
            *(f"listen.{port} -> motors.{port}" for port in _SENT),
        ),
    ),
    "Frames": (
        {
            **_TIMED,
            "frames": ("core.IsaacComputeTransformTree", {"targetPrims": ROBOT}),
            "publish": ("ros.ROS2PublishTransformTree", {"topicName": "tf"}),
        },
        (
            "tick.tick -> frames.execIn",
            "frames.execOut -> publish.execIn",
            "context.context -> publish.context",
            "time.simulationTime -> publish.timeStamp",
            *(f"frames.{array} -> publish.{array}" for array in _ARRAYS),
        ),
    ),
}


def scene() -> Usd.Stage:
    """The supplied scene: the arm on a table, fixed to the world."""
    stage = empty_stage("Z", 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    stage.DefinePrim("/World/PhysicsScene", "PhysicsScene")
    stage.DefinePrim("/World/Light", "DistantLight")
    floor = UsdGeom.Plane.Define(stage, "/World/Floor")
    floor.CreateAxisAttr("Z")
    UsdPhysics.CollisionAPI.Apply(floor.GetPrim())
    robot = UsdGeom.Xform.Define(stage, ROBOT)
    robot.AddTranslateOp().Set(Gf.Vec3d(0.4, 0.0, 0.0))
    add_api(robot.GetPrim(), "PhysicsArticulationRootAPI", "IsaacRobotAPI")
    for number, name in enumerate(LINKS):
        link = body(stage, f"{ROBOT}/{name}", (0, 0, 0.15 * number))
        UsdPhysics.MassAPI.Apply(link).CreateMassAttr(2.7 if not number else 1.3)
    fixed = UsdPhysics.FixedJoint.Define(stage, f"{ROBOT}/root_joint")
    fixed.CreateBody1Rel().SetTargets([f"{ROBOT}/{LINKS[0]}"])
    for number, name in enumerate(JOINTS):
        ends = (f"{ROBOT}/{LINKS[number]}", f"{ROBOT}/{LINKS[number + 1]}")
        joint = revolute(stage, f"{ROBOT}/{name}", *ends, (0, 0, 0.15), "Z")
        UsdPhysics.DriveAPI(joint, "angular").GetStiffnessAttr().Set(3200.0)
        UsdPhysics.RevoluteJoint(joint).CreateLowerLimitAttr(LIMITS[0])
        UsdPhysics.RevoluteJoint(joint).CreateUpperLimitAttr(LIMITS[1])
    return stage


def write_stages(folder: Path) -> list[Path]:
    """Write every solution, and return the files in their order."""
    stage, written = scene(), []
    for name, graph in zip(FILES, (None, *GRAPHS), strict=True):
        if graph is not None:
            write_graph(stage, f"/World/{graph}", *GRAPHS[graph])
        written.append(folder / f"{name}.usda")
        stage.GetRootLayer().Export(str(written[-1]))
    return written


def describe(stages: list[Path], folder: Path) -> Path:
    """Write the lab that is described after the stages, none of which is judged by it."""
    files = describe_lab(stages, load_lab()).files
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder
