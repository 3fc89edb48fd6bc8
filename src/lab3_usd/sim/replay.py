"""The data of the drawings of a run: where the robot was, what it saw, how fast it went."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from lab3_usd.model.dry_run import (
    Affine,
    HeardFrame,
    Moment,
    Place,
    Replay,
    Speeds,
    heading,
    rotation,
)
from lab3_usd.sim.commands import domain_of
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import Message, Odometry, Pose, Scan
from lab3_usd.sim.judge.expectations import Trial, displacement, in_root

_MOMENTS = 48
_SPEEDS = 240  # moments of which speeds are drawn
RADIUS = 0.15  # metres, of a robot whose size is unknown
_RAYS = 180  # drawn of a scan, as it may have thousands


def replay(trial: Trial) -> Replay:
    """Return the data of the drawings."""
    poses = [pose for pose in trial.recording.path if not pose.session]
    every = max(1, math.ceil(len(poses) / _MOMENTS))
    chosen = [*poses[every - 1 : -1 : every], *poses[-1:]]
    odometry = _last_before(trial.recording.topic(trial.wanted.odometry, 0), chosen)
    seen_at = trial.recording.topic(trial.wanted.scan, 0)
    whole = [each for each in seen_at if not isinstance(each.data, Scan) or each.data.whole]
    scans = _last_before(whole, chosen)
    moments = (
        Moment(
            round(pose.at, 3),
            pose.leg,
            (pose.x, pose.y, pose.heading),
            _odometry_place(message, trial.start),
            _points(trial, seen),
        )
        for pose, message, seen in zip(chosen, odometry, scans, strict=True)
    )
    recording = trial.recording
    return Replay(
        trial.room,
        trial.radius or RADIUS,
        tuple(moments),
        recording.fired,
        trial.fit,
        tuple(_speeds(trial, poses)),
        recording.wheels,
        tuple(_heard_frames(trial)),
    )


def _speeds(trial: Trial, poses: Sequence[Pose]) -> Iterator[Speeds]:
    """Yield what was commanded and what was done, between some poses of the first session."""
    every = max(1, math.ceil(len(poses) / _SPEEDS))
    commands = [
        leg.command for leg in trial.drive[0].legs for _ in range(round(leg.seconds * RATE))
    ]
    for number in range(every, len(poses), every):
        before, after = poses[number - every], poses[number]
        ahead, _, turned = displacement(before, after)
        seconds = after.at - before.at
        if not seconds:  # a node has stopped the simulation
            break
        command = commands[number] if number < len(commands) else None
        yield Speeds(
            round(after.at, 3),
            (round(ahead / seconds, 4), round(turned / seconds, 4)),
            None if command is None else (command[0], command[2]),
            tuple(round(speed, 3) for speed in after.wheels),
        )


def _heard_frames(trial: Trial) -> Iterator[HeardFrame]:
    """Yield each transform of the first session once, of all domains."""
    seen: dict[HeardFrame, None] = {}
    for message in trial.recording.messages:
        domain = domain_of(message, trial)
        for names in message.frames if not message.session else ():
            seen.setdefault(HeardFrame(*names, message.static, message.node, message.topic, domain))
    for transform, node in trial.recording.static:
        if not any(frame.child == transform.child for frame in seen):
            seen.setdefault(HeardFrame(transform.parent, transform.child, True, node))  # noqa: FBT003
    yield from seen


def _last_before(messages: Sequence[Message], poses: Sequence[Pose]) -> list[Message | None]:
    """Return for each pose the last message that had come by then."""
    latest: list[Message | None] = []
    last, ahead = None, 0
    for pose in poses:
        while ahead < len(messages) and messages[ahead].at <= pose.at + 1e-9:
            last, ahead = messages[ahead], ahead + 1
        latest.append(last)
    return latest


def _odometry_place(message: Message | None, start: Affine) -> Place | None:
    """Return where odometry has the robot, in the world."""
    if message is None or not isinstance(message.data, Odometry):
        return None
    place = start.then(Affine(rotation(message.data.orientation), message.data.position))
    return (place.origin[0], place.origin[1], heading(place))


def _points(trial: Trial, message: Message | None) -> tuple[tuple[float, float], ...]:
    """Return where the rays end that come back: where TF has the lidar, else where it is."""
    if message is None or not isinstance(message.data, Scan):
        return ()
    scan = message.data
    by_frames = in_root(trial, message.frame, message)
    place = trial.start.then(by_frames) if by_frames is not None else scan.place
    if place is None:
        return ()
    points = []
    for number in range(0, len(scan.ranges), max(1, len(scan.ranges) // _RAYS)):
        length = scan.ranges[number]
        if length > 0:
            angle = scan.angle_min + number * scan.angle_increment
            x, y, _ = place.point((length * math.cos(angle), length * math.sin(angle), 0.0))
            points.append((x, y))
    return tuple(points)
