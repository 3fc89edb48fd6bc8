"""The solutions of a third course: a fixed arm of seven joints without wheels, camera and map.

Written with pxr alone. `Arm_1_scene` is the supplied scene, each later stage adds a part.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from foreign_robots import Nodes, add_api, body, empty_stage, revolute, write_graph
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from lab3_usd.new_lab.lab import describe_lab
from lab3_usd.spec.load.loader import load_lab, load_platform

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
_READ = (
    "jointNames",
    "jointPositions",
    "jointVelocities",
    "jointEfforts",
    "jointDofTypes",
    "stageMetersPerUnit",
)
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
            *(f"read.{port} -> publish.{port}" for port in _READ),
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
    files = describe_lab(stages, load_lab(), load_platform()).files
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder
