"""Single faults of a complete submission, each with every error and warning that it gives.

A finding is written `RULE site`; the site of a finding about a stage begins with its checkpoint.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from ros_outputs import EDGES, NO_LOOKUP, NO_RATE, info, view_frames
from submissions import (
    ROBOT,
    STARTER,
    Fault,
    copy,
    delete,
    edit,
    put,
    rename,
    rewrite,
    stage_name,
)

WALL = "/Environment/Walls/East"
PARAMS = "config/nav2_params.yaml"
MAP = "maps/turtlebot3_map.yaml"
IMAGE = "maps/turtlebot3_map.pgm"


@dataclass(frozen=True)
class Case:
    """What is done to the folder, and what is said then."""

    name: str
    fault: Fault
    said: tuple[str, ...]


def case(name: str, fault: Fault, *said: str) -> Case:
    return Case(name, fault, said)


def as_crate(folder: Path) -> None:
    path = folder / stage_name("03")
    Sdf.Layer.FindOrOpen(str(path)).Export(str(path.with_suffix(".usdc")))
    path.unlink()


def emptied(*numbers: str) -> Fault:
    def change(folder: Path) -> None:
        for number in numbers:
            (folder / stage_name(number)).write_text("")

    return change


def without_rows(folder: Path) -> None:
    data = (folder / IMAGE).read_bytes()
    (folder / IMAGE).write_bytes(data.replace(b"177 162", b"177 160", 1))


def link(name: str, target: str) -> Fault:
    def change(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(target)

    return change


def pipe(name: str) -> Fault:
    def change(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)

    return change


WRONG_VALUES = {
    "maxLinearSpeed": 0.5,
    "maxAngularSpeed": 2.0,
    "wheelDistance": 0.3,
    "wheelRadius": 0.05,
}
CONTROLLER = f"{ROBOT}/ROS_Drive/differential_controller"


def wrong_values(stage: Usd.Stage) -> None:
    """Set four values of the controller otherwise: nothing is gone."""
    for name, value in WRONG_VALUES.items():
        stage.GetAttributeAtPath(f"{CONTROLLER}.inputs:{name}").Set(value)


def set_value(prim: str, name: str, value: object) -> Fault:
    return edit("08", lambda stage: stage.GetPrimAtPath(prim).GetAttribute(name).Set(value))


def heavy(stage: Usd.Stage) -> None:
    """Make the base heavier than the handout's."""
    stage.GetPrimAtPath(f"{ROBOT}/base_link").GetAttribute("physics:mass").Set(1.0)


def remove(*prims: str) -> Fault:
    return edit("08", lambda stage: [stage.RemovePrim(prim) for prim in prims])


def switch_off(prim: str) -> Fault:
    return edit("08", lambda stage: stage.GetPrimAtPath(prim).SetActive(False))  # noqa: FBT003 - pxr takes no keyword


def without_api(prim: str, api: str) -> Fault:
    return edit("08", lambda stage: stage.GetPrimAtPath(prim).RemoveAppliedSchema(api))


def collide_not(stage: Usd.Stage) -> None:
    UsdPhysics.CollisionAPI(stage.GetPrimAtPath(WALL)).CreateCollisionEnabledAttr(False)  # noqa: FBT003 - pxr takes no keyword


def damp(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath(f"{ROBOT}/base_link")
    name = "physxRigidBody:linearDamping"
    prim.CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(50.0)


def hide(stage: Usd.Stage) -> None:
    UsdGeom.Imageable(stage.GetPrimAtPath(WALL)).MakeInvisible()


def retype(prim: str, kind: str) -> Fault:
    return edit("08", lambda stage: stage.GetPrimAtPath(prim).SetTypeName(kind))


LAYOUT = [
    *(
        case(f"no stage {number}", delete(stage_name(number)), f"X01 {stage_name(number)}")
        for number in ("00", "03", "08")
    ),
    case(
        "uda", rename(stage_name("01"), stage_name("01", ".uda")), f"X04 {stage_name('01', '.uda')}"
    ),
    case(
        "one digit",
        rename(stage_name("03"), "work/Lab3_3_lidar.usda"),
        "X02 work/Lab3_3_lidar.usda",
    ),
    case("no digit", rename(stage_name("03"), "work/Lab3_lidar.usda"), "X02 work/Lab3_lidar.usda"),
    case(
        "small letters",
        rename(stage_name("04"), "work/lab3_04_camera.usda"),
        "X02 work/lab3_04_camera.usda",
    ),
    case(
        "a copy's name",
        rename(stage_name("05"), "work/Lab3_05_odometry_tf (1).usda"),
        "X02 work/Lab3_05_odometry_tf (1).usda",
    ),
    case(
        "neighbour's number",
        rename(stage_name("04"), "work/Lab3_03_camera.usda"),
        "X02 work/Lab3_03_camera.usda",
    ),
    # No name tells of the checkpoint, so that its content does.
    case(
        "a name of its own",
        rename(stage_name("03"), "work/lidar.usda"),
        f"X01 {stage_name('03')}",
        "X13 work/lidar.usda",
    ),
    case("txt", rename(stage_name("02"), stage_name("02") + ".txt"), f"X02 {stage_name('02')}.txt"),
    case("crate ending", as_crate, f"X02 {stage_name('03', '.usdc')}"),
    case(
        "beside work",
        rename(stage_name("06"), Path(stage_name("06")).name),
        f"X03 {Path(stage_name('06')).name}",
    ),
    case(
        "in two forms",
        copy(stage_name("06"), stage_name("06", ".usd")),
        f"X05 {stage_name('06', '.usd')}",
    ),
    case("starter with a graph", copy(stage_name("01"), STARTER), f"X07 {STARTER}"),
    case("starter damaged", put(STARTER, "#usda 1.0\n{"), f"X07 {STARTER}"),
    case(
        "copied stage",
        copy(stage_name("01"), stage_name("02")),
        "G01 02:/turtlebot3_burger/ROS_Drive",
        f"X09 {stage_name('02')}",
    ),
    case(
        "lost work",
        edit("04", lambda stage: stage.RemovePrim("/World/ROS_Clock")),
        "G01 04:/World/ROS_Clock",
        f"X08 {stage_name('04')}",
    ),
    case(
        "wrong values alone",
        edit("04", wrong_values),
        *(f"P01 04:{CONTROLLER}" for _ in WRONG_VALUES),
    ),
    case("empty stage", put(stage_name("07"), ""), "F01 07:/"),
    case("empty stages", emptied("01", "02"), "F01 01:/", "F01 02:/"),
    case("no USD", put(stage_name("07"), "a stage"), "F01 07:/"),
    case("link out", link(stage_name("08"), "/etc/hostname"), f"X11 {stage_name('08')}"),
    case("link to nothing", link("report.pdf", "nothing"), "X11 report.pdf"),
    case("pipe for a stage", pipe(stage_name("02")), f"X11 {stage_name('02')}"),
    case("pipe for a map", pipe(MAP), f"X11 {MAP}"),
    case("pipe for an image", pipe(IMAGE), f"X11 {IMAGE}"),
    case("pipe for parameters", pipe(PARAMS), f"X11 {PARAMS}"),
    case("pipe for an output", pipe("results/topic_list.txt"), "X11 results/topic_list.txt"),
]

MAPS = [
    case("resolution", rewrite(MAP, "0.05", "0.5"), f"M06 {MAP}"),
    case("negate", rewrite(MAP, "negate: 0", "negate: 1"), f"M06 {MAP}"),
    case("threshold", rewrite(MAP, "0.65", "0.85"), f"M06 {MAP}"),
    case("mode", rewrite(MAP, "trinary", "scale"), f"M06 {MAP}"),
    case("origin", rewrite(MAP, "[-6.2, -3.32, 0]", "[0, 0, 0]"), f"M07 {MAP}"),
    case("absolute image", rewrite(MAP, "image: ", "image: /home/ana/"), f"M02 {MAP}"),
    case("another image", rewrite(MAP, "turtlebot3_map.pgm", "my_map.pgm"), f"M03 {MAP}"),
    case("no image", delete(IMAGE), f"M04 {IMAGE}"),
    case("image of another size", without_rows, f"M08 {IMAGE}"),
    case("image is a picture", put(IMAGE, "PNG"), f"M05 {IMAGE}"),
    case("map is no YAML", put(MAP, "image: [turtlebot3_map.pgm"), f"M01 {MAP}"),
    case("no map", delete(MAP), f"M01 {MAP}"),
    case("no maps", delete("maps"), f"M01 {MAP}"),
]

PARAMETERS = [
    case("wall time", rewrite(PARAMS, "    use_sim_time: true\n", ""), f"V02 {PARAMS}"),
    case(
        "fixed scan",
        rewrite(PARAMS, "scan_topic: /scan", "scan_topic: /scan_fixed"),
        f"V05 {PARAMS}",
    ),
    case("no YAML", put(PARAMS, "amcl:\n  ros__parameters:\n\tx: 1\n"), f"V01 {PARAMS}"),
    case(
        "base frame",
        rewrite(PARAMS, "robot_base_frame: base_footprint", "robot_base_frame: base"),
        f"V03 {PARAMS}",
    ),
]


def output(name: str, text: str) -> Fault:
    return put(f"results/{name}", text)


EVIDENCE = [
    case("no rate", output("topic_hz_scan.txt", NO_RATE), "E04 results/topic_hz_scan.txt"),
    case(
        "another type",
        output("topic_type_scan.txt", "sensor_msgs/msg/PointCloud2\n"),
        "E02 results/topic_type_scan.txt",
    ),
    case(
        "lidar's frame",
        rewrite("results/topic_echo_scan.txt", "base_scan", "sim_lidar"),
        "E05 results/topic_echo_scan.txt",
    ),
    case(
        "odometry's frame",
        rewrite("results/topic_echo_odom.txt", "base_footprint", "base_link"),
        "E05 results/topic_echo_odom.txt",
    ),
    case(
        "map's width",
        rewrite("results/topic_echo_map.txt", "177", "384"),
        "E06 results/topic_echo_map.txt",
    ),
    case(
        "AMCL inactive",
        output("lifecycle_amcl.txt", "inactive [2]\n"),
        "E08 results/lifecycle_amcl.txt",
    ),
    case(
        "planner not there",
        output("lifecycle_planner_server.txt", "Node not found\n"),
        "E08 results/lifecycle_planner_server.txt",
    ),
    case(
        "no velocity smoother",
        rewrite("results/node_list.txt", "/velocity_smoother\n", ""),
        "E09 results/node_list.txt",
    ),
    case(
        "map not listed",
        rewrite("results/topic_list.txt", "/map\n", ""),
        "E03 results/topic_list.txt",
    ),
    case(
        "no odometry frame",
        output("view_frames.txt", view_frames(EDGES[0], *EDGES[2:])),
        "E11 results/view_frames.txt",
    ),
    case(
        "no camera frame",
        output("view_frames.txt", view_frames(*EDGES[:-1])),
        "E11 results/view_frames.txt",
    ),
    case(
        "two parents",
        output("view_frames.txt", view_frames(("odom", "base_link"), *EDGES)),
        "E12 results/view_frames.txt",
    ),
    case(
        "no transform",
        output("tf2_echo_map_base_footprint.txt", NO_LOOKUP),
        "E13 results/tf2_echo_map_base_footprint.txt",
    ),
    case(
        "scan is kept",
        output(
            "topic_info_scan.txt",
            info("sensor_msgs/msg/LaserScan", "lidar", durability="TRANSIENT_LOCAL"),
        ),
        "E07 results/topic_info_scan.txt",
    ),
    case(
        "two odometries",
        output("topic_info_odom.txt", info("nav_msgs/msg/Odometry", "one", "two")),
        "E14 results/topic_info_odom.txt",
    ),
    case(
        "world to odom runs",
        rewrite("results/node_list.txt", "/amcl\n", "/amcl\n/_Graph_ROS_Odometry_TFWorld2Odom\n"),
        "E15 results/node_list.txt",
    ),
    case(
        "goal aborted",
        rewrite("results/topic_echo_navigate_to_pose_action_status.txt", "status: 4", "status: 6"),
        "E16 results/topic_echo_navigate_to_pose_action_status.txt",
    ),
    case(
        "package missing",
        rewrite("results/packages.txt", "rqt_image_view\n", ""),
        "E17 results/packages.txt",
    ),
]

LOST = f"X08 {stage_name('08')}"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
CHANGED = [
    case("wall gone", remove(WALL), f"U01 08:{WALL}"),
    case("walls gone", remove("/Environment/Walls"), "U01 08:/Environment/Walls"),
    case(
        "crate off",
        switch_off("/Environment/Furniture/CrateA"),
        "U01 08:/Environment/Furniture/CrateA",
    ),
    case("sun gone", remove("/Environment/Lights/Sun"), "U01 08:/Environment/Lights/Sun"),
    case(
        "plate gone",
        remove(f"{ROBOT}/visuals/base_link/plate_top"),
        f"U01 08:{ROBOT}/base_link/visuals/plate_top",
    ),
    case("wall round", retype(WALL, "Sphere"), f"U02 08:{WALL}"),
    case(
        "fixed joint turns",
        retype(f"{ROBOT}/joints/scan_joint", "PhysicsRevoluteJoint"),
        f"S12 08:{ROBOT}/joints/scan_joint",
    ),
    case("wall lets through", without_api(WALL, "PhysicsCollisionAPI"), f"U03 08:{WALL}"),
    case("wall's collision off", edit("08", collide_not), f"U04 08:{WALL}"),
    case(
        "inertia",
        set_value(f"{ROBOT}/base_link", "physics:diagonalInertia", Gf.Vec3f(1, 1, 1)),
        f"U04 08:{ROBOT}/base_link",
    ),
    case(
        "friction",
        set_value("/Environment/PhysicsMaterials/Tyre", "physics:staticFriction", 0.1),
        "U04 08:/Environment/PhysicsMaterials/Tyre",
    ),
    case(
        "gravity",
        set_value("/physicsScene", "physics:gravityMagnitude", 1.62),
        "U04 08:/physicsScene",
    ),
    case("force", set_value(JOINT, "drive:angular:physics:maxForce", 0.1), f"U04 08:{JOINT}"),
    case(
        "wall moved",
        set_value(WALL, "xformOp:translate", Gf.Vec3d(2, 0.75, 0.25)),
        f"U05 08:{WALL}",
    ),
    case(
        "view moved",
        set_value("/World/ObservationCamera", "xformOp:translate", Gf.Vec3d(1, 1, 1)),
        "U05 08:/World/ObservationCamera",
    ),
    case(
        "sun dim",
        set_value("/Environment/Lights/Sun", "inputs:intensity", 1.0),
        "U06 08:/Environment/Lights/Sun",
    ),
    case("base damped", edit("08", damp), f"U07 08:{ROBOT}/base_link"),
    case("wall unseen", edit("08", hide), f"U06 08:{WALL}"),
    case("mass", edit("08", heavy), f"S04 08:{ROBOT}/base_link"),
    case(
        "no damping",
        set_value(JOINT, "drive:angular:physics:damping", 0.0),
        f"S10 08:{JOINT}",
    ),
    case("joint gone", remove(JOINT), f"S07 08:{JOINT}", LOST),
    case("ground off", switch_off("/Environment/GroundPlane"), "S13 08:/Environment"),
]

ALL = [*LAYOUT, *MAPS, *PARAMETERS, *EVIDENCE, *CHANGED]
