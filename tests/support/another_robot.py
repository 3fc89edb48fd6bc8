"""A stage of another robot: below /World, with an IMU and without a camera."""

from __future__ import annotations

from pathlib import Path

from foreign_robots import TICK, Nodes, add_api, body, revolute, wheel, write_graph
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

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
