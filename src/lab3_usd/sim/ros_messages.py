"""Messages of ROS 2 Humble, serialized as its middleware has them (CDR)."""

from __future__ import annotations

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lab3_usd.isaac.topics import JOINT_STATES, STEERING, TWIST
from lab3_usd.model.dry_run import Quaternion
from lab3_usd.model.transforms import Vector
from lab3_usd.sim.execution.drive import Leg, joint_command
from lab3_usd.sim.execution.recording import (
    Inertia,
    JointStates,
    Message,
    Odometry,
    Scan,
    Steering,
    Transform,
    Transforms,
    View,
)

STORE = get_typestore(Stores.ROS2_HUMBLE)
_STEERED = "ackermann_msgs/msg/AckermannDrive"
# Of a package that is not in ROS 2 itself (ros-drivers/ackermann_msgs, ros2).
_DRIVE = "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
_DRIVE += "float32 acceleration\nfloat32 jerk\n"
STORE.register(get_types_from_msg(_DRIVE, _STEERED))
_STAMPED = "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
STORE.register(get_types_from_msg(_STAMPED, STEERING))
_NANOSECONDS = 1_000_000_000


def _new(name: str, *values: Any) -> object:
    """Return a message of a type with its fields in the order of the definition."""
    return STORE.types[name](*values)


def serialized(message: Message) -> bytes | None:
    """Return a message in CDR, None for what a dry run does not know: pixels and points."""
    data = message.data.each() if isinstance(message.data, Transforms) else message.data
    made: object = None
    if isinstance(data, Odometry):
        made = _odometry(message, data)
    elif isinstance(data, Scan):
        made = _scan(message, data)
    elif isinstance(data, View):
        made = _info(message, data) if data.matrix else None
    elif isinstance(data, JointStates):
        arrays = (data.positions, data.velocities, data.efforts)
        numbers = (np.array(array, dtype=np.float64) for array in arrays)
        made = _new(message.type, _header(message, ""), [*data.names], *numbers)
    elif isinstance(data, Steering):
        drive = _new(_STEERED, data.angle, 0.0, data.speed, 0.0, 0.0)
        made = _new(STEERING, _header(message, message.frame), drive)
    elif isinstance(data, Inertia):
        made = _inertia(message, data)
    elif isinstance(data, tuple):
        transforms = [_transform(message, transform) for transform in data]
        made = _new(message.type, transforms)
    elif isinstance(data, float):
        made = _new(message.type, _time(data))
    return None if made is None else bytes(STORE.serialize_cdr(made, message.type))


def command_message(leg: Leg) -> tuple[str, bytes]:
    """Return the message of a leg, and its type."""
    if leg.joints:
        message = Message(JOINT_STATES, 0.0, data=joint_command(leg))
        return JOINT_STATES, serialized(message) or b""
    if leg.steer is not None:
        message = Message(STEERING, 0.0, data=Steering(leg.forward, leg.steer))
        return STEERING, serialized(message) or b""
    linear = _vector((leg.forward, leg.command[1] if leg.command else 0.0, 0.0))
    made = _new(TWIST, linear, _vector((0.0, 0.0, leg.turn)))
    return TWIST, bytes(STORE.serialize_cdr(made, TWIST))


def nanoseconds(seconds: float) -> int:
    """Return a time as ROS 2 counts it."""
    return round(seconds * _NANOSECONDS)


def _time(seconds: float) -> object:
    whole, rest = divmod(nanoseconds(seconds), _NANOSECONDS)
    return _new("builtin_interfaces/msg/Time", whole, rest)


def _header(message: Message, frame: str) -> object:
    return _new("std_msgs/msg/Header", _time(message.stamp), frame)


def _vector(vector: Vector, name: str = "Vector3") -> object:
    return _new(f"geometry_msgs/msg/{name}", *vector)


def _quaternion(turn: Quaternion) -> object:
    w, x, y, z = turn
    return _new("geometry_msgs/msg/Quaternion", x, y, z, w)


def _odometry(message: Message, odometry: Odometry) -> object:
    place = (_vector(odometry.position, "Point"), _quaternion(odometry.orientation))
    speed = (_vector(odometry.linear), _vector(odometry.angular))
    unknown = np.zeros(36, dtype=np.float64)
    pose = _new("geometry_msgs/msg/Pose", *place)
    twist = _new(TWIST, *speed)
    return _new(
        message.type,
        _header(message, message.frame),
        odometry.child,
        _new("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
        _new("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
    )


def _transform(message: Message, transform: Transform) -> object:
    moved = (_vector(transform.translation), _quaternion(transform.rotation))
    return _new(
        "geometry_msgs/msg/TransformStamped",
        _header(message, transform.parent),
        transform.child,
        _new("geometry_msgs/msg/Transform", *moved),
    )


_BRIGHT = 255.0  # of a ray that returns: how much a material reflects is not known


def _scan(message: Message, scan: Scan) -> object:
    """Return a scan as Isaac Sim fills it: its angles end where the turn does.

    Ros2Message.cpp:1574-1596, OgnROS2RtxLidarHelper.py:134-150,
    OgnROS2PublishLaserScan.cpp:169-200.
    """
    count = len(scan.ranges)
    end = scan.angle_min + scan.angle_increment * count
    angles = (scan.angle_min, end, scan.angle_increment)
    times = (scan.scan_time / count if count else 0.0, scan.scan_time)
    ranges = np.array(scan.ranges, dtype=np.float32)
    bright = np.where(ranges > 0.0, np.float32(_BRIGHT), np.float32(0.0))
    return _new(
        message.type,
        _header(message, message.frame),
        *angles,
        *times,
        scan.range_min,
        scan.range_max,
        ranges,
        bright,
    )


def _inertia(message: Message, data: Inertia) -> object:
    """Return what an inertial sensor says; a covariance that begins with -1 is not measured."""
    parts = (data.orientation, data.angular, data.linear)
    covariances = [np.array([0.0 if part else -1.0, *(0.0,) * 8]) for part in parts]
    return _new(
        message.type,
        _header(message, message.frame),
        _quaternion(data.orientation or (1.0, 0.0, 0.0, 0.0)),
        covariances[0],
        _vector(data.angular or (0.0, 0.0, 0.0)),
        covariances[1],
        _vector(data.linear or (0.0, 0.0, 0.0)),
        covariances[2],
    )


def _info(message: Message, view: View) -> object:
    fx, _, cx, _, fy, cy, *_ = view.matrix
    projection = (fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    arrays = (np.zeros(5), np.array(view.matrix), np.eye(3).ravel(), np.array(projection))
    return _new(
        message.type,
        _header(message, message.frame),
        view.height,
        view.width,
        "plumb_bob",
        *arrays,
        0,
        0,
        _new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False),  # noqa: FBT003
    )
