"""Messages of a recording: what is read of each type, and what is none."""

from __future__ import annotations

import math
from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")

import numpy as np

from lab3_usd.sim.bag.decoder import IMAGE, MOST_RAYS, Decoded, decode, header
from lab3_usd.sim.execution.recording import Transform, View
from lab3_usd.sim.ros_messages import STORE

TYPES = STORE.types
HEAD = TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](3, 500_000_000), "odom")


def vector(x: float = 1.0) -> Any:
    return TYPES["geometry_msgs/msg/Vector3"](x, 2.0, 3.0)


def pose(x: float) -> Any:
    point = TYPES["geometry_msgs/msg/Point"](x, 2.0, 0.0)
    return TYPES["geometry_msgs/msg/Pose"](
        point, TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    )


def twist(x: float) -> Any:
    return TYPES["geometry_msgs/msg/Twist"](vector(x), vector(0.5))


def odometry(x: float) -> Any:
    none = np.zeros(36)
    return TYPES["nav_msgs/msg/Odometry"](
        HEAD,
        "base",
        TYPES["geometry_msgs/msg/PoseWithCovariance"](pose(x), none),
        TYPES["geometry_msgs/msg/TwistWithCovariance"](twist(0.1), none),
    )


def transforms(x: float) -> Any:
    turn = TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    transform = TYPES["geometry_msgs/msg/Transform"](vector(x), turn)
    stamped = TYPES["geometry_msgs/msg/TransformStamped"](HEAD, "base", transform)
    return TYPES["tf2_msgs/msg/TFMessage"]([stamped])


def scan(near: float) -> Any:
    ranges = np.array([0.05, 0.2, 9.0, math.inf, *[1.0] * MOST_RAYS], dtype=np.float32)
    angles = (-1.0, 1.0, 0.5, 0.0, 0.125)
    return TYPES["sensor_msgs/msg/LaserScan"](
        HEAD, *angles, near, 4.0, ranges, np.zeros(0, dtype=np.float32)
    )


def grid(x: float, cells: int = 6) -> Any:
    info = TYPES["nav_msgs/msg/MapMetaData"](HEAD.stamp, 0.5, 3, 2, pose(x))
    data = np.array([0, 64, 65, 100, -1, 0][:cells], dtype=np.int8)
    return TYPES["nav_msgs/msg/OccupancyGrid"](HEAD, info, data)


def read(message: Any) -> Decoded | None:
    kind = message.__msgtype__
    return decode(kind, bytes(STORE.serialize_cdr(message, kind)))


def data_of(message: Any) -> Any:
    found = read(message)
    assert found is not None
    return found.data


def test_what_is_read_of_each_type() -> None:
    assert data_of(twist(0.25)) == (0.25, 2.0, 3.0)
    found = data_of(odometry(1.5))
    assert (found.child, found.position, found.orientation) == (
        "base",
        (1.5, 2.0, 0.0),
        (1, 0, 0, 0),
    )
    assert data_of(transforms(4.0)) == (Transform("odom", "base", (4.0, 2.0, 3.0), (1, 0, 0, 0)),)
    seen = data_of(scan(0.125)).ranges
    assert seen[:5] == pytest.approx((-1.0, 0.2, -1.0, -1.0, 1.0))
    assert len(seen) == MOST_RAYS
    found = data_of(grid(-1.0))
    assert (found.origin, found.walls) == ((-1.0, 2.0, 0.0), {(2, 0), (0, 1)})


@pytest.mark.parametrize("message", [twist, odometry, transforms, scan, grid])
@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_message_with_what_is_no_number_is_none(message: Any, number: float) -> None:
    assert read(message(number)) is None


def test_a_map_that_lacks_cells_is_none() -> None:
    assert read(grid(0.0, cells=5)) is None


def test_an_image_has_its_size_and_its_pixels_are_left() -> None:
    message = TYPES[IMAGE](HEAD, 480, 640, "rgb8", 0, 3 * 640, np.zeros(9, dtype=np.uint8))
    data = bytes(STORE.serialize_cdr(message, IMAGE))
    found = decode(IMAGE, data)
    assert found is not None
    assert (found.data, found.header) == (View(640, 480), header(data))
    assert decode(IMAGE, data[:24]) is None


def test_a_header_that_is_cut_is_none() -> None:
    data = bytes(STORE.serialize_cdr(odometry(0.0), "nav_msgs/msg/Odometry"))
    found = header(data)
    assert found is not None
    assert (found.stamp, found.frame) == (3.5, "odom")
    assert [header(data[:length]) for length in (0, 15, 18)] == [None] * 3
