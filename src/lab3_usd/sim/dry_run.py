"""Opens a stage, plays it, and keeps what there is to draw of the run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import StageError
from lab3_usd.model.dry_run.affine import Affine, heading, rotation
from lab3_usd.model.dry_run.behaviour import Behaviour, Moment, Place, Replay, Unknown
from lab3_usd.model.dry_run.scene import Scene
from lab3_usd.sim.behaviour.evidence import Evidence
from lab3_usd.sim.behaviour.ros_interface import interface
from lab3_usd.sim.behaviour.tf_lookup import in_root
from lab3_usd.sim.execution.drive import drive_of, fixed_drive
from lab3_usd.sim.execution.record import Message, Odometry, Pose, Scan
from lab3_usd.sim.outcome import outcome
from lab3_usd.sim.play import record
from lab3_usd.spec.lab import Lab

_MOMENTS = 48
_RAYS = 180  # drawn of a scan, as it may have thousands


class DryRun(Struct, frozen=True):
    """What a stage does, and all that it did; there is no evidence of one that cannot be read."""

    behaviour: Behaviour
    evidence: Evidence | None = None

    @property
    def replay(self) -> Replay | None:
        """What there is to draw of it."""
        return replay(self.evidence) if self.evidence is not None else None


def scene_of(path: Path) -> Scene:
    """Open a stage, and return what is needed to play it.

    Raises:
        StageError: it cannot be read.
    """
    from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors  # noqa: PLC0415 - pxr
    from lab3_usd.stage.read.scene import read_scene  # noqa: PLC0415

    with quiet(), stage_errors(path):
        return read_scene(open_stage(path))


def dry_run(path: Path, lab: Lab, checkpoint: str, drive: str | None = None) -> DryRun:
    """Play a stage and judge what it does by what the lab asks for at a checkpoint.

    Raises:
        UsageError: the drive is none.
    """
    wanted = interface(lab, lab.checkpoints[checkpoint])
    sessions = fixed_drive() if drive is None else drive_of(drive, wanted.limits)
    try:
        scene = scene_of(path)
    except StageError as error:
        reason = str(error).removeprefix(f"{path}: ")
        unknown = (Unknown("/", reason),)
        return DryRun(Behaviour(str(path), checkpoint, 0.0, "unreadable", not_simulated=unknown))
    evidence = record(scene, lab.catalog, sessions, wanted)
    return DryRun(outcome(str(path), checkpoint, evidence), evidence)


def replay(evidence: Evidence) -> Replay:
    """Return what there is to draw."""
    poses = [each for each in evidence.recording.path if not each.session]
    every = max(1, math.ceil(len(poses) / _MOMENTS))
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
    for number in range(0, len(scan.ranges), max(1, len(scan.ranges) // _RAYS)):
        length = scan.ranges[number]
        if length > 0:
            angle = scan.angle_min + number * scan.angle_increment
            x, y, _ = place.point((length * math.cos(angle), length * math.sin(angle), 0.0))
            found.append((x, y))
    return tuple(found)
