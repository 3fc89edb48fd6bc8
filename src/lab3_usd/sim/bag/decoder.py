"""Decodes the messages of a recording of which something is judged."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError

from lab3_usd.isaac.topics import IMAGE, STEERING, TRANSFORMS
from lab3_usd.model.dry_run import Affine, heading, rotation
from lab3_usd.model.occupancy import OccupancyMap
from lab3_usd.sim.execution.recording import JointStates, Odometry, Scan, Steering, Transform, View
from lab3_usd.sim.ros_messages import STORE

_NANOSECONDS = 1e9
MOST_NAMES = 2000  # frames, goals, joints
LARGEST = 4_000_000  # bytes of a message that is read as a whole
LARGEST_LIST = 200_000  # of one that is a list of records: a thousand transforms
LONGEST = 200  # characters of the name of a frame
MOST_RAYS = 10_000  # of a scan
_OCCUPIED = 65  # percent, from which on a cell of a map is a wall
_HEADER = "std_msgs/msg/Header"


class Header(NamedTuple):
    """When a message was made, and in which frame."""

    stamp: float
    frame: str


class Decoded(NamedTuple):
    """A message: its header, and what it says."""

    header: Header | None
    data: Any


class Goal(NamedTuple):
    """A goal of navigation, and its status."""

    id: bytes
    status: int


def has_header(kind: str) -> bool:
    """Whether messages of a type begin with a header."""
    definition: Any = STORE.fielddefs.get(kind)
    return bool(definition and definition[1]) and bool(definition[1][0][1][1] == _HEADER)


def header(data: bytes) -> Header | None:
    """Read the header at the start of a message, None where it is not whole."""
    order = ">" if data[1:2] == b"\0" else "<"
    try:
        seconds, fraction, length = struct.unpack_from(f"{order}iII", data, 4)
    except struct.error:
        return None
    if not 0 < length <= len(data) - 16:
        return None
    name = data[16 : 16 + min(length, LONGEST)]
    frame = name.rstrip(b"\0").decode("utf-8", "replace")
    return Header(seconds + fraction / _NANOSECONDS, frame)


def is_read(kind: str) -> bool:
    """Whether more than the header is judged of messages of a type."""
    return kind in _READERS or kind == IMAGE


def decode(kind: str, data: bytes) -> Decoded | None:
    """Read a message of a type that is judged, None where it is none."""
    read = _READERS.get(kind)
    if kind == IMAGE:
        return _image(data)
    if read is None or len(data) > (LARGEST_LIST if kind in _LISTS else LARGEST):
        return None
    try:
        message: Any = STORE.deserialize_cdr(data, kind)
    except (SerdeError, IndexError, OverflowError, MemoryError):
        return None
    return read(message)


_LISTS = {TRANSFORMS, "action_msgs/msg/GoalStatusArray"}


def _image(data: bytes) -> Decoded | None:
    """Read header and size of an image, and leave its pixels."""
    first = header(data)
    if first is None:
        return None
    order = ">" if data[1:2] == b"\0" else "<"
    (length,) = struct.unpack_from(f"{order}I", data, 12)
    try:
        tall, wide = struct.unpack_from(f"{order}II", data, 4 + (12 + length + 3) // 4 * 4)
    except struct.error:
        return None
    return Decoded(first, View(wide, tall))


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / _NANOSECONDS)


def _head(header_of: Any) -> Header:
    return Header(_seconds(header_of.stamp), header_of.frame_id[:LONGEST])


def _xyz(vector: Any) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _wxyz(turn: Any) -> tuple[float, float, float, float]:
    return (turn.w, turn.x, turn.y, turn.z)


def _twist(message: Any) -> Decoded | None:
    command = (message.linear.x, message.linear.y, message.angular.z)
    return Decoded(None, command) if _finite(command) else None


def _odometry(message: Any) -> Decoded | None:
    pose, twist = message.pose.pose, message.twist.twist
    values = (_xyz(pose.position), _wxyz(pose.orientation), _xyz(twist.linear), _xyz(twist.angular))
    if not all(map(_finite, values)):
        return None
    return Decoded(_head(message.header), Odometry(message.child_frame_id[:LONGEST], *values))


def _transforms(message: Any) -> Decoded | None:
    transforms = []
    for transform in message.transforms:
        place = (_xyz(transform.transform.translation), _wxyz(transform.transform.rotation))
        if not all(map(_finite, place)):
            return None
        names = (transform.header.frame_id[:LONGEST], transform.child_frame_id[:LONGEST])
        transforms.append(Transform(*names, *place))
    # It has a header for each transform, and so no frame of its own.
    first = Header(_head(message.transforms[0].header).stamp, "") if transforms else None
    return Decoded(first, tuple(transforms))


def _scan(message: Any) -> Decoded | None:
    """Read a scan; a ray that does not come back is -1."""
    near, far = message.range_min, message.range_max
    ranges = message.ranges[:MOST_RAYS]
    returned = (ranges >= near) & (ranges <= far)
    seen = tuple(np.where(returned, ranges, -1.0).tolist())
    angles = (message.angle_min, message.angle_increment, near, far)
    if not _finite((*angles, message.scan_time)):
        return None
    return Decoded(_head(message.header), Scan(*angles, seen, scan_time=message.scan_time))


def _map(message: Any) -> Decoded | None:
    """Read a map as localization publishes it: row 0 is the lowest, 100 is a wall."""
    info, place = message.info, message.info.origin
    x, y, _ = _xyz(place.position)
    turn = heading(Affine(rotation(_wxyz(place.orientation))))
    size = (info.width, info.height)
    whole = size[0] * size[1] == len(message.data) and info.resolution > 0
    if not (whole and _finite((info.resolution, x, y, turn))):
        return None
    walls = frozenset(
        (index % size[0], index // size[0])
        for index in (message.data >= _OCCUPIED).nonzero()[0].tolist()
    )
    occupancy = OccupancyMap("the recorded map", info.resolution, (x, y, turn), *size, walls)
    return Decoded(_head(message.header), occupancy)


def _steering(message: Any) -> Decoded | None:
    command = (message.drive.speed, message.drive.steering_angle)
    return Decoded(_head(message.header), Steering(*command)) if _finite(command) else None


def _joint_states(message: Any) -> Decoded:
    arrays = (message.position, message.velocity, message.effort)
    numbers = (tuple(map(float, array[:MOST_NAMES])) for array in arrays)
    names = tuple(name[:LONGEST] for name in message.name[:MOST_NAMES])
    return Decoded(_head(message.header), JointStates(names, *numbers))


def _finite(numbers: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, numbers))


_READERS: dict[str, Callable[[Any], Decoded | None]] = {
    "rosgraph_msgs/msg/Clock": lambda message: Decoded(None, _seconds(message.clock)),
    "geometry_msgs/msg/Twist": _twist,
    "nav_msgs/msg/Odometry": _odometry,
    "tf2_msgs/msg/TFMessage": _transforms,
    "sensor_msgs/msg/LaserScan": _scan,
    "sensor_msgs/msg/CameraInfo": lambda message: Decoded(
        _head(message.header), View(message.width, message.height, tuple(map(float, message.k)))
    ),
    "sensor_msgs/msg/JointState": _joint_states,
    STEERING: _steering,
    "nav_msgs/msg/OccupancyGrid": _map,
    "action_msgs/msg/GoalStatusArray": lambda message: Decoded(
        None, tuple(Goal(bytes(e.goal_info.goal_id.uuid), e.status) for e in message.status_list)
    ),
}
