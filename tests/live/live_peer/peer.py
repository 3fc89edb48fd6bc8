"""Drives a robot over Cyclone DDS until its odometry reports that it moved: peer.py DOMAIN.

Prints one line of JSON: what it heard, and how far the robot went. The types stand here once
more, by hand, as somebody else would write them.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

MOST = 12000  # turns of a twentieth of a second: nobody is left waiting for good
LOOPBACK = """
<CycloneDDS><Domain id="any">
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs.msg.dds_.Clock_"):
    clock: Time


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Vector3
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs.msg.dds_.Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    transforms: sequence[TransformStamped]


def main() -> None:
    domain = int(sys.argv[1])
    _domain = Domain(domain, LOOPBACK)
    participant = DomainParticipant(domain)
    qos = Qos(
        Policy.Reliability.Reliable(100_000_000),
        Policy.History.KeepLast(10),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
    clocks, poses, trees = (
        DataReader(participant, Topic(participant, name, kind), qos=qos)
        for name, kind in (("rt/clock", Clock), ("rt/odom", Odometry), ("rt/tf", TFMessage))
    )
    commands = DataWriter(participant, Topic(participant, "rt/cmd_vel", Twist), qos=qos)
    times: list[float] = []
    frames: set[tuple[str, str]] = set()
    last = None
    for _ in range(MOST):
        if times and frames and last is not None and last.pose.pose.position.x >= 0.1:
            break
        commands.write(Twist(Vector3(x=0.2), Vector3()))
        time.sleep(0.05)
        times += [each.clock.sec + each.clock.nanosec / 1e9 for each in clocks.take(10)]
        for each in trees.take(10):
            frames.update((one.header.frame_id, one.child_frame_id) for one in each.transforms)
        last = [last, *poses.take(10)][-1]
    else:
        sys.exit("it does not move")
    heard = {
        "times": times,
        "frames": sorted(frames),
        "x": last.pose.pose.position.x,
        "frame": last.header.frame_id,
        "child": last.child_frame_id,
    }
    sys.stdout.write(json.dumps(heard))


main()
