"""Messages of ROS 2 Humble out of a recording, as the judge sees them."""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

from rosbags.serde import SerdeError

from lab3_usd.sim.bag.messages import STORE
from lab3_usd.sim.execution.record import Odometry, Scan, Transform, View

LARGEST = 4_000_000  # bytes of a message that is read as a whole
LARGEST_LIST = 200_000  # of one that is a list of records: a thousand transforms
LONGEST = 200  # characters of the name of a frame
_NANOSECONDS = 1e9
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
    known: Any = STORE.fielddefs.get(kind)
    return bool(known and known[1]) and bool(known[1][0][1][1] == _HEADER)


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


_LISTS = {"tf2_msgs/msg/TFMessage", "action_msgs/msg/GoalStatusArray"}
IMAGE = "sensor_msgs/msg/Image"


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


def _seconds(stamp: Any) -> float:  # noqa: ANN401 - the library's record
    return float(stamp.sec + stamp.nanosec / _NANOSECONDS)


def _head(said: Any) -> Header:  # noqa: ANN401
    return Header(_seconds(said.stamp), said.frame_id[:LONGEST])


def _clock(message: Any) -> Decoded:  # noqa: ANN401
    return Decoded(None, _seconds(message.clock))


def _xyz(vector: Any) -> tuple[float, float, float]:  # noqa: ANN401
    return (vector.x, vector.y, vector.z)


def _wxyz(turn: Any) -> tuple[float, float, float, float]:  # noqa: ANN401
    return (turn.w, turn.x, turn.y, turn.z)


def _twist(message: Any) -> Decoded | None:  # noqa: ANN401
    told = (message.linear.x, message.linear.y, message.angular.z)
    return Decoded(None, told) if _finite(told) else None


def _odometry(message: Any) -> Decoded | None:  # noqa: ANN401
    pose, twist = message.pose.pose, message.twist.twist
    said = (_xyz(pose.position), _wxyz(pose.orientation), _xyz(twist.linear), _xyz(twist.angular))
    if not all(map(_finite, said)):
        return None
    return Decoded(_head(message.header), Odometry(message.child_frame_id[:LONGEST], *said))


def _transforms(message: Any) -> Decoded | None:  # noqa: ANN401
    found = []
    for each in message.transforms:
        place = (_xyz(each.transform.translation), _wxyz(each.transform.rotation))
        if not all(map(_finite, place)):
            return None
        names = (each.header.frame_id[:LONGEST], each.child_frame_id[:LONGEST])
        found.append(Transform(*names, *place))
    # It has a header for each transform, and so no frame of its own.
    first = Header(_head(message.transforms[0].header).stamp, "") if found else None
    return Decoded(first, tuple(found))


def _scan(message: Any) -> Decoded | None:  # noqa: ANN401
    """Read a scan; of its rays only whether one comes back, as there is no room to compare with."""
    near, far = message.range_min, message.range_max
    ranges = message.ranges
    returned = ranges[(ranges >= near) & (ranges <= far)]
    seen = (float(returned.min()) if len(returned) else -1.0,)
    angles = (message.angle_min, message.angle_increment, near, far)
    return Decoded(_head(message.header), Scan(*angles, seen)) if _finite(angles) else None


def _info(message: Any) -> Decoded:  # noqa: ANN401
    view = View(message.width, message.height, tuple(map(float, message.k)))
    return Decoded(_head(message.header), view)


def _goals(message: Any) -> Decoded:  # noqa: ANN401
    listed = message.status_list
    return Decoded(None, tuple(Goal(bytes(e.goal_info.goal_id.uuid), e.status) for e in listed))


def _finite(numbers: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, numbers))


_READERS = {
    "rosgraph_msgs/msg/Clock": _clock,
    "geometry_msgs/msg/Twist": _twist,
    "nav_msgs/msg/Odometry": _odometry,
    "tf2_msgs/msg/TFMessage": _transforms,
    "sensor_msgs/msg/LaserScan": _scan,
    "sensor_msgs/msg/CameraInfo": _info,
    "action_msgs/msg/GoalStatusArray": _goals,
}
