"""Does odometry agree with the motion, and TF with odometry?"""

from __future__ import annotations

import math
from collections.abc import Iterator

from lab3_usd.model.dry_run.affine import Affine, rotation
from lab3_usd.sim.behaviour.evidence import Evidence, Fault, angle, displacement
from lab3_usd.sim.behaviour.tf_lookup import agree, in_root
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.record import Message, Odometry, Pose

ODOMETRY = (0.02, math.radians(2.0))
SPEED = 0.03  # m/s and rad/s between what odometry says and what is
SETTLED = 8  # frames after which a leg is driven evenly


def odometry(evidence: Evidence) -> Iterator[Fault]:
    """/odom starts at 0, agrees with the motion, and names the frames."""
    wanted = evidence.wanted
    messages = [
        each
        for each in evidence.recording.topic(wanted.odometry, 0)
        if isinstance(each.data, Odometry)
    ]
    if not messages:
        return
    first = messages[0]
    frames = (first.frame, first.data.child)
    if frames != (wanted.root, wanted.base):
        said = f"odometry names {frames[0]} and {frames[1]}, not {wanted.root} and {wanted.base}"
        yield Fault(said, "P02", first.node)
    origin = evidence.recording.path[0]
    for message in messages[:: max(1, len(messages) // 40)]:
        fault = _odometry_fault(message.data, origin, evidence.pose(message))
        if fault:
            yield Fault(fault, "W02", message.node)
            return
    yield from _velocity_faults(evidence, messages)


def _odometry_fault(data: Odometry, origin: Pose, pose: Pose) -> str:
    ahead, left, _ = displacement(origin, pose)
    x, y, _ = data.position
    if math.hypot(x - ahead, y - left) > ODOMETRY[0]:
        return f"odometry says ({x:.2f}, {y:.2f}), it went ({ahead:.2f}, {left:.2f})"
    turned = Affine(rotation(data.orientation)).rows
    says = math.atan2(turned[1][0], turned[0][0])
    if abs(angle(says - (pose.heading - origin.heading))) > ODOMETRY[1]:
        return f"odometry says {math.degrees(says):.0f} degrees, it turned otherwise"
    return ""


def _velocity_faults(evidence: Evidence, messages: list[Message]) -> Iterator[Fault]:
    for leg, _, poses in evidence.stretches("ahead", "back", "left", "right", "fast"):
        if len(poses) < SETTLED:
            continue
        one, other = poses[-4], poses[-3]
        at = [each for each in messages if abs(each.at - other.at) < 0.5 / RATE]
        if not at:
            continue
        ahead, left, turned = (each * RATE for each in displacement(one, other))
        says, data = at[0], at[0].data
        if (
            math.hypot(data.linear[0] - ahead, data.linear[1] - left) > SPEED
            or abs(data.angular[2] - turned) > SPEED
        ):
            said = f"the velocities of odometry are wrong while going {leg.name}"
            yield Fault(said, "W02", says.node)
            return


def moving_frames(evidence: Evidence) -> Iterator[Fault]:
    """TF moves the base as odometry does."""
    wanted = evidence.wanted
    messages = [e for e in evidence.recording.topic(wanted.odometry, 0) if e.data is not None]
    for message in messages[len(messages) // 4 :: max(1, len(messages) // 4)]:
        asked = Message("", message.stamp, wanted.base, at=message.at, session=message.session)
        place = in_root(evidence, asked)
        if place is None or not isinstance(message.data, Odometry):
            continue
        says = Affine(rotation(message.data.orientation), message.data.position)
        if not agree(place, says):
            said = f"{wanted.root} -> {wanted.base} is not what odometry says"
            yield Fault(said, "W01", message.node)
            return
