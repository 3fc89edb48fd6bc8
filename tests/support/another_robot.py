"""A stage of another robot, written by hand: below /World, with an IMU and without a camera."""

from __future__ import annotations

from pathlib import Path

NAME = "carter_yard.usda"

_HEAD = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)

def PhysicsScene "physics"
{
}

def Xform "World"
{
    def Plane "floor" (
        prepend apiSchemas = ["PhysicsCollisionAPI"]
    )
    {
        token axis = "Z"
    }

    def DomeLight "sky"
    {
    }

    def Xform "Carter"
    {
        double3 xformOp:translate = (2, -1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
"""

_LINK = """
        def Xform "{name}" (
            prepend apiSchemas = [{apis}]
        )
        {{
            float physics:mass = {mass}
            double3 xformOp:translate = {place}
            uniform token[] xformOpOrder = ["xformOp:translate"]
{inside}
        }}
"""

_WHEEL_SHAPE = """
            def Cylinder "shape" (
                prepend apiSchemas = ["PhysicsCollisionAPI"]
            )
            {
                uniform token axis = "Y"
                double radius = 0.2
                double height = 0.05
            }
"""

_IMU = """
            def IsaacImuSensor "Imu"
            {
                float sensorPeriod = 0.01
                double3 xformOp:translate = (0.1, 0, 0.05)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }
"""

_JOINT = """
        def PhysicsRevoluteJoint "{name}" (
            prepend apiSchemas = ["PhysicsDriveAPI:angular"]
        )
        {{
            uniform token physics:axis = "Y"
            rel physics:body0 = </World/Carter/chassis>
            rel physics:body1 = </World/Carter/{link}>
            point3f physics:localPos0 = (0, {y}, 0)
            point3f physics:localPos1 = (0, 0, 0)
            quatf physics:localRot0 = (1, 0, 0, 0)
            quatf physics:localRot1 = (1, 0, 0, 0)
            float drive:angular:physics:stiffness = 0
            float drive:angular:physics:damping = 5
        }}
"""

_GRAPH = """
    def OmniGraph "{name}"
    {{
        token evaluationMode = "Automatic"
        token evaluator:type = "execution"
        token fabricCacheBacking = "StageWithoutHistory"
        int2 fileFormatVersion = (1, 9)
        token pipelineStage = "pipelineStageSimulation"
{nodes}
    }}
"""

_NODE = """
        def OmniGraphNode "{name}" (
            prepend apiSchemas = ["NodeGraphNodeAPI"]
        )
        {{
            token node:type = "{type}"
            int node:typeVersion = {version}
{ports}
        }}
"""


def _node(name: str, kind: str, *ports: str, version: int = 1) -> str:
    lines = "\n".join(f"            {port}" for port in ports)
    return _NODE.format(name=name, type=kind, version=version, ports=lines)


def _wire(port: str, source: str, kind: str = "uint") -> str:
    return f"custom {kind} inputs:{port}.connect = </World/{source}>"


def _out(*names: str) -> list[str]:
    return [f"custom uint outputs:{name}" for name in names]


def _drive() -> str:
    graph = "Wheels"
    return _GRAPH.format(
        name=graph,
        nodes="".join(
            [
                _node("tick", "omni.graph.action.OnPlaybackTick", *_out("tick"), version=2),
                _node(
                    "twist",
                    "isaacsim.ros2.bridge.ROS2SubscribeTwist",
                    _wire("execIn", f"{graph}/tick.outputs:tick"),
                    'custom string inputs:topicName = "carter/cmd_vel"',
                    "custom vector3d outputs:linearVelocity",
                    "custom vector3d outputs:angularVelocity",
                ),
                _node(
                    "ahead",
                    "omni.graph.nodes.BreakVector3",
                    _wire("tuple", f"{graph}/twist.outputs:linearVelocity", "token"),
                    *_out("x"),
                ),
                _node(
                    "turn",
                    "omni.graph.nodes.BreakVector3",
                    _wire("tuple", f"{graph}/twist.outputs:angularVelocity", "token"),
                    *_out("z"),
                ),
                _node(
                    "speeds",
                    "isaacsim.robot.wheeled_robots.DifferentialController",
                    _wire("execIn", f"{graph}/tick.outputs:tick"),
                    _wire("linearVelocity", f"{graph}/ahead.outputs:x", "double"),
                    _wire("angularVelocity", f"{graph}/turn.outputs:z", "double"),
                    "custom double inputs:wheelDistance = 0.5",
                    "custom double inputs:wheelRadius = 0.2",
                    "custom double[] outputs:velocityCommand",
                ),
                _node(
                    "motors",
                    "isaacsim.core.nodes.IsaacArticulationController",
                    _wire("execIn", f"{graph}/tick.outputs:tick"),
                    _wire("velocityCommand", f"{graph}/speeds.outputs:velocityCommand", "double[]"),
                    'custom token[] inputs:jointNames = ["left_motor", "right_motor"]',
                    "custom rel inputs:targetPrim = </World/Carter/chassis>",
                ),
            ]
        ),
    )


def _imu(*more: str) -> str:
    graph = "Inertia"
    return _GRAPH.format(
        name=graph,
        nodes="".join(
            [
                _node("tick", "omni.graph.action.OnPlaybackTick", *_out("tick"), version=2),
                _node(
                    "imu",
                    "isaacsim.sensors.physics.IsaacReadIMU",
                    _wire("execIn", f"{graph}/tick.outputs:tick"),
                    "custom rel inputs:imuPrim = </World/Carter/chassis/Imu>",
                    "custom bool inputs:readGravity = 0",
                    *_out("execOut", "angVel"),
                ),
                _node(
                    "publish",
                    "isaacsim.ros2.bridge.ROS2PublishImu",
                    _wire("execIn", f"{graph}/imu.outputs:execOut"),
                    _wire("angularVelocity", f"{graph}/imu.outputs:angVel", "vector3d"),
                    'custom string inputs:frameId = "chassis"',
                ),
                *more,
            ]
        ),
    )


def write_stage(folder: Path, *nodes: str) -> Path:
    """Write the stage, with more nodes in the graph of the IMU, and return its path."""
    wheel = '"PhysicsRigidBodyAPI", "PhysicsMassAPI"'
    chassis = f'{wheel}, "PhysicsArticulationRootAPI"'
    links = [
        _LINK.format(name="chassis", apis=chassis, mass=30, place="(0, 0, 0.2)", inside=_IMU),
        _LINK.format(name="left", apis=wheel, mass=2, place="(0, 0.25, 0.2)", inside=_WHEEL_SHAPE),
        _LINK.format(
            name="right", apis=wheel, mass=2, place="(0, -0.25, 0.2)", inside=_WHEEL_SHAPE
        ),
    ]
    joints = [
        _JOINT.format(name="left_motor", link="left", y=0.25),
        _JOINT.format(name="right_motor", link="right", y=-0.25),
    ]
    text = "".join([_HEAD, *links, *joints, "    }\n", _drive(), _imu(*nodes), "}\n"])
    path = folder / NAME
    path.write_text(text)
    return path


def own_node() -> str:
    """Return a node of a type that is in no catalog, fed by the IMU."""
    return _node(
        "filter",
        "acme.filters.LowPass",
        _wire("execIn", "Inertia/imu.outputs:execOut"),
        _wire("signal", "Inertia/imu.outputs:angVel", "token"),
        "custom double inputs:cutoff = 4",
        version=3,
    )
