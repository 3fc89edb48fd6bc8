"""Messages of a run as those of ROS 2 Humble, serialized."""

from __future__ import annotations

import numpy as np
from rosbags.typesys import Stores, get_typestore

from lab3_usd.model.dry_run.affine import Quaternion
from lab3_usd.model.transform_math import Vector
from lab3_usd.sim.execution.drive import Leg
from lab3_usd.sim.execution.record import Message, Odometry, Scan, Transform, View

STORE = get_typestore(Stores.ROS2_HUMBLE)
TWIST = "geometry_msgs/msg/Twist"
_NANOSECONDS = 1_000_000_000


def _new(name: str, *values: object) -> object:
    """Return a message of a type with its fields in the order of the definition."""
    return STORE.types[name](*values)


def serialized(message: Message) -> bytes | None:
    """Return a message in CDR, None for what a dry run does not know: pixels and points."""
    data = message.data
    made: object = None
    if isinstance(data, Odometry):
        made = _odometry(message, data)
    elif isinstance(data, Scan):
        made = _scan(message, data)
    elif isinstance(data, View):
        made = _info(message, data) if data.matrix else None
    elif isinstance(data, tuple):
        transforms = [_transform(message, each) for each in data]
        made = _new(message.type, transforms)
    elif isinstance(data, float):
        made = _new(message.type, _time(data))
    return None if made is None else bytes(STORE.serialize_cdr(made, message.type))


def command(leg: Leg) -> bytes:
    """Return what a leg sends."""
    linear = _vector((leg.forward, leg.command[1] if leg.command else 0.0, 0.0))
    made = _new(TWIST, linear, _vector((0.0, 0.0, leg.turn)))
    return bytes(STORE.serialize_cdr(made, TWIST))


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


def _odometry(message: Message, said: Odometry) -> object:
    place = (_vector(said.position, "Point"), _quaternion(said.orientation))
    speed = (_vector(said.linear), _vector(said.angular))
    unknown = np.zeros(36, dtype=np.float64)
    pose = _new("geometry_msgs/msg/Pose", *place)
    twist = _new(TWIST, *speed)
    return _new(
        message.type,
        _header(message, message.frame),
        said.child,
        _new("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
        _new("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
    )


def _transform(message: Message, said: Transform) -> object:
    moved = (_vector(said.translation), _quaternion(said.rotation))
    return _new(
        "geometry_msgs/msg/TransformStamped",
        _header(message, said.parent),
        said.child,
        _new("geometry_msgs/msg/Transform", *moved),
    )


def _scan(message: Message, said: Scan) -> object:
    last = said.angle_min + said.angle_increment * (len(said.ranges) - 1)
    angles = (said.angle_min, last, said.angle_increment)
    times = (0.0, 0.0)  # the whole scan is of one moment
    ranges = np.array(said.ranges, dtype=np.float32)
    return _new(
        message.type,
        _header(message, message.frame),
        *angles,
        *times,
        said.range_min,
        said.range_max,
        ranges,
        np.zeros(0, dtype=np.float32),
    )


def _info(message: Message, said: View) -> object:
    fx, _, cx, _, fy, cy, *_ = said.matrix
    projection = (fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    arrays = (np.zeros(5), np.array(said.matrix), np.eye(3).ravel(), np.array(projection))
    return _new(
        message.type,
        _header(message, message.frame),
        said.height,
        said.width,
        "plumb_bob",
        *arrays,
        0,
        0,
        _new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False),  # noqa: FBT003
    )
