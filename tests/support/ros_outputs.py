"""What the diagnostic commands print on ROS 2 Humble when the lab works, by command line.

The formats come from the humble branches of the sources that stand beside each.
"""

from __future__ import annotations

import stat
from pathlib import Path

# ros2/ros2cli: ros2topic/ros2topic/verb/list.py
TOPICS = """\
/amcl_pose
/camera/camera_info
/camera/image_raw
/clock
/cmd_vel
/goal_pose
/map
/odom
/parameter_events
/rosout
/scan
/tf
/tf_static
"""
# ros2/ros2cli: ros2node/ros2node/verb/list.py
NODES = """\
/World_ROS_Clock_ros2_publish_clock
/amcl
/behavior_server
/bt_navigator
/controller_server
/lifecycle_manager_localization
/lifecycle_manager_navigation
/map_server
/planner_server
/velocity_smoother
/waypoint_follower
"""
# ros2/ros2cli: ros2pkg/ros2pkg/verb/list.py
PACKAGES = """\
nav2_amcl
nav2_bringup
rqt_image_view
rviz2
teleop_twist_keyboard
tf2_tools
"""
# ros2/ros2cli: ros2topic/ros2topic/verb/type.py
TYPES = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/odom": "nav_msgs/msg/Odometry",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/map": "nav_msgs/msg/OccupancyGrid",
}
# ros2/ros2cli: ros2topic/ros2topic/verb/hz.py, ROSTopicHz.print_hz
RATE = """\
average rate: 9.998
\tmin: 0.099s max: 0.101s std dev: 0.00061s window: 11
average rate: 10.002
\tmin: 0.098s max: 0.102s std dev: 0.00072s window: 22
"""
NO_RATE = "WARNING: topic [/scan] does not appear to be published yet\n"
# ros2/ros2cli: ros2topic/ros2topic/verb/echo.py prints rosidl_runtime_py's message_to_yaml
CLOCK = "clock:\n  sec: 34\n  nanosec: 516667466\n---\n"
SCAN = """\
header:
  stamp:
    sec: 34
    nanosec: 516667466
  frame_id: base_scan
angle_min: -3.1415927410125732
angle_max: 3.1241390705108643
angle_increment: 0.01745329238474369
time_increment: 0.0
scan_time: 0.10000000149011612
range_min: 0.11999999731779099
range_max: 100.0
ranges:
- 1.25
- .inf
- '...'
intensities:
- 0.0
- '...'
---
"""
IMAGE = """\
header:
  stamp:
    sec: 34
    nanosec: 516667466
  frame_id: Camera_1
height: 480
width: 640
encoding: rgb8
is_bigendian: 0
step: 1920
data:
- 12
- '...'
---
"""
ODOM = """\
header:
  stamp:
    sec: 34
    nanosec: 516667466
  frame_id: odom
child_frame_id: base_footprint
pose:
  pose:
    position:
      x: 0.25
      y: 0.0
      z: 0.0
---
"""
MAP = """\
header:
  stamp:
    sec: 12
    nanosec: 0
  frame_id: map
info:
  map_load_time:
    sec: 12
    nanosec: 0
  resolution: 0.05000000074505806
  width: 177
  height: 162
  origin:
    position:
      x: -6.2
      y: -3.32
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: 0.0
      w: 1.0
data:
- -1
- '...'
---
"""
POSE = "header:\n  frame_id: map\npose:\n  pose:\n    position:\n      x: 1.8\n      y: 0.0\n---\n"
# action_msgs/msg/GoalStatusArray of ros2/rcl_interfaces; 4 is STATUS_SUCCEEDED
STATUS = """\
status_list:
- goal_info:
    goal_id:
      uuid:
      - 10
      - 20
    stamp:
      sec: 40
      nanosec: 1
  status: 6
- goal_info:
    goal_id:
      uuid:
      - 30
      - 40
    stamp:
      sec: 60
      nanosec: 2
  status: 4
---
"""
# ros2/ros2cli: ros2lifecycle/ros2lifecycle/verb/get.py
ACTIVE = "active [3]\n"
# ros2/geometry2: tf2_ros/src/tf2_echo.cpp
LOOKUP = """\
[INFO] [1732180000.123456789] [tf2_echo]: Waiting for transform odom ->  base_footprint: Invalid \
frame ID "odom" passed to canTransform argument target_frame - frame does not exist
At time 35.16667
- Translation: [0.250, 0.001, 0.000]
- Rotation: in Quaternion [0.000, 0.000, 0.010, 1.000]
- Rotation: in RPY (radian) [0.000, -0.000, 0.020]
- Rotation: in RPY (degree) [0.000, -0.000, 1.146]
- Matrix:
  1.000 -0.020  0.000  0.250
  0.020  1.000  0.000  0.001
  0.000  0.000  1.000  0.000
  0.000  0.000  0.000  1.000
"""
NO_LOOKUP = LOOKUP.splitlines(keepends=True)[0] * 3
EDGES = (
    ("map", "odom"),
    ("odom", "base_footprint"),
    ("base_footprint", "base_link"),
    ("base_footprint", "base_scan"),
    ("base_footprint", "wheel_left_link"),
    ("base_footprint", "wheel_right_link"),
    ("base_footprint", "caster_back_link"),
    ("base_footprint", "Camera_1"),
)


def info(topic_type: str, *publishers: str, durability: str = "VOLATILE") -> str:
    """Print `ros2 topic info --verbose`.

    ros2/ros2cli: ros2topic/ros2topic/verb/info.py; ros2/rclpy: rclpy/rclpy/topic_endpoint_info.py.
    """
    blocks = [
        f"Node name: {node}\nNode namespace: /\nTopic type: {topic_type}\n"
        f"Endpoint type: {kind}\nGID: 01.0f.89.6f.1e.00.c3.66.00.00.00.00.00.00.12.03.00\n"
        "QoS profile:\n  Reliability: RELIABLE\n  History (Depth): UNKNOWN\n"
        f"  Durability: {policy}\n  Lifespan: Infinite\n  Deadline: Infinite\n"
        "  Liveliness: AUTOMATIC\n  Liveliness lease duration: Infinite\n"
        for node, kind, policy in [
            *((node, "PUBLISHER", durability) for node in publishers),
            ("rviz", "SUBSCRIPTION", "VOLATILE"),
        ]
    ]
    return (
        f"Type: {topic_type}\n\nPublisher count: {len(publishers)}\n\n"
        + "\n".join(blocks[:-1])
        + f"\nSubscription count: 1\n\n{blocks[-1]}\n"
    )


def frames_yaml(*edges: tuple[str, str]) -> str:
    """Write the frames as ros2/geometry2 does: tf2/src/buffer_core.cpp, allFramesAsYAML."""
    return "".join(
        f"{child}: \n  parent: '{parent}'\n  broadcaster: 'default_authority'\n  rate: 20.250\n"
        "  most_recent_transform: 35.200000\n  oldest_transform: 30.200000\n"
        "  buffer_length: 5.000\n"
        for parent, child in edges
    )


def view_frames(*edges: tuple[str, str]) -> str:
    """Print the log of ros2/geometry2: tf2_tools/tf2_tools/view_frames.py."""
    shown = frames_yaml(*edges).replace("\n", "\\n")
    return (
        "[INFO] [1732180000.0] [view_frames]: Listening to tf data for 5.0 seconds...\n"
        "[INFO] [1732180005.0] [view_frames]: Generating graph in frames.pdf file...\n"
        "[INFO] [1732180005.1] [view_frames]: "
        f'Result:tf2_msgs.srv.FrameGraph_Response(frame_yaml="{shown}")\n'
    )


def frames_gv(*edges: tuple[str, str]) -> str:
    """Write the .gv file of ros2/geometry2: tf2_tools/tf2_tools/view_frames.py, generate_dot."""
    lines = "".join(
        f'"{parent}" -> "{child}"[label=" Broadcaster: default_authority\\nAverage rate: 20.25\\n'
        'Buffer length: 5.0\\nMost recent transform: 35.2\\nOldest transform: 30.2\\n"];\n'
        for parent, child in edges
    )
    return (
        f"digraph G {{\n{lines}edge [style=invis];\n"
        ' subgraph cluster_legend { style=bold; color=black; label ="view_frames Result";\n'
        '"Recorded at time: 35.2"[ shape=plaintext ] ;\n}->"map";\n}'
    )


def good_outputs() -> dict[str, str]:
    """Return the output of every command of the lab, by its words up to the options."""
    echoes = {
        "/clock": CLOCK,
        "/scan": SCAN,
        "/camera/image_raw": IMAGE,
        "/odom": ODOM,
        "/map": MAP,
        "/amcl_pose": POSE,
        "/navigate_to_pose/_action/status": STATUS,
    }
    infos = {
        "/scan": info(TYPES["/scan"], "World_ROS_Lidar2D_helper"),
        "/camera/image_raw": info(TYPES["/camera/image_raw"], "World_ROS_Camera_helper"),
        "/odom": info(TYPES["/odom"], "World_ROS_OdomTF_odometry"),
        "/tf": info(
            "tf2_msgs/msg/TFMessage", "amcl", "World_ROS_OdomTF_raw", "World_ROS_OdomTF_tf"
        ),
        "/tf_static": info("tf2_msgs/msg/TFMessage"),
        "/map": info(TYPES["/map"], "map_server", durability="TRANSIENT_LOCAL"),
        "/clock": info(TYPES["/clock"], "World_ROS_Clock_clock"),
    }
    nodes = ("map_server", "amcl", "controller_server", "planner_server", "bt_navigator")
    return {
        "ros2 pkg list": PACKAGES,
        "ros2 node list": NODES,
        "ros2 topic list": TOPICS,
        **{f"ros2 topic type {topic}": f"{kind}\n" for topic, kind in TYPES.items()},
        **{f"ros2 topic hz {topic}": RATE for topic in TYPES},
        **{f"ros2 topic echo {topic}": text for topic, text in echoes.items()},
        **{f"ros2 topic info {topic}": text for topic, text in infos.items()},
        **{f"ros2 lifecycle get /{node}": ACTIVE for node in nodes},
        "ros2 run tf2_ros tf2_echo": LOOKUP,
        "ros2 run tf2_tools view_frames": view_frames(*EDGES),
    }


def fake_ros2(folder: Path, outputs: dict[str, str]) -> None:
    """Put a `ros2` into `folder` that prints the output of the first command that fits."""
    texts = folder / "texts"
    texts.mkdir(parents=True)
    cases = []
    for number, (command, text) in enumerate(sorted(outputs.items(), reverse=True)):
        (texts / str(number)).write_text(text)
        cases.append(f'"{command.removeprefix("ros2 ")}"*) cat "{texts}/{number}" ;;')
    script = folder / "ros2"
    lines = ["#!/bin/sh", 'case "$*" in', *cases, "*) echo unknown; exit 1 ;;", "esac", ""]
    script.write_text("\n".join(lines))
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
