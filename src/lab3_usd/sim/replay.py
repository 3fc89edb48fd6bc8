"""What there is to draw of a run: moments of its first session, and the room."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lab3_usd.model.affine import Affine, heading, rotation
from lab3_usd.model.behaviour import Moment, Place, Replay
from lab3_usd.sim.behaviour.evidence import Evidence
from lab3_usd.sim.behaviour.places import in_root
from lab3_usd.sim.record import Message, Odometry, Pose, Scan

MOMENTS = 48
RAYS = 180  # drawn of a scan, as it may have thousands


def replay(evidence: Evidence) -> Replay:
    """Return what there is to draw."""
    poses = [each for each in evidence.recording.path if not each.session]
    every = max(1, math.ceil(len(poses) / MOMENTS))
    chosen = [*poses[every - 1 : -1 : every], *poses[-1:]]
    odometry = _last_before(evidence.recording.topic(evidence.wanted.odometry, 0), chosen)
    scans = _last_before(evidence.recording.topic(evidence.wanted.scan, 0), chosen)
    moments = (
        Moment(
            round(pose.at, 3),
            pose.leg,
            (pose.x, pose.y, pose.heading),
            _told(said, evidence.start),
            _points(evidence, seen),
        )
        for pose, said, seen in zip(chosen, odometry, scans, strict=True)
    )
    recording = evidence.recording
    return Replay(evidence.room, evidence.radius, tuple(moments), recording.fired)


def _last_before(messages: Sequence[Message], poses: Sequence[Pose]) -> list[Message | None]:
    """Return for each pose the last message that had come by then."""
    found: list[Message | None] = []
    last, ahead = None, 0
    for pose in poses:
        while ahead < len(messages) and messages[ahead].at <= pose.at + 1e-9:
            last, ahead = messages[ahead], ahead + 1
        found.append(last)
    return found


def _told(message: Message | None, start: Affine) -> Place | None:
    """Return where odometry has the robot, in the world."""
    if message is None or not isinstance(message.data, Odometry):
        return None
    place = start.then(Affine(rotation(message.data.orientation), message.data.position))
    return (place.origin[0], place.origin[1], heading(place))


def _points(evidence: Evidence, message: Message | None) -> tuple[tuple[float, float], ...]:
    """Return where the rays end that come back: where TF has the lidar, else where it is."""
    if message is None or not isinstance(message.data, Scan):
        return ()
    scan = message.data
    by_frames = in_root(evidence, message)
    place = evidence.start.then(by_frames) if by_frames is not None else scan.place
    if place is None:
        return ()
    found = []
    for number in range(0, len(scan.ranges), max(1, len(scan.ranges) // RAYS)):
        length = scan.ranges[number]
        if length > 0:
            angle = scan.angle_min + number * scan.angle_increment
            x, y, _ = place.point((length * math.cos(angle), length * math.sin(angle), 0.0))
            found.append((x, y))
    return tuple(found)
