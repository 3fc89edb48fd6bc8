"""Drives the joints of a robot by joint states, and judges their positions.

Positions are sent to joints that a spring drives, as an arm has them; others are left alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.model.dry_run import Affine, Check, Scene
from lab3_usd.sim.execution.drive import Leg, Session
from lab3_usd.sim.execution.recording import Held, JointStates, Message
from lab3_usd.sim.judge.causes import RunCauses
from lab3_usd.sim.judge.checks import verdict
from lab3_usd.sim.judge.expectations import RunFault, Trial, agree, in_root
from lab3_usd.sim.nodes.transforms import frame_name
from lab3_usd.sim.robot.machine import SLIDER, Joint, Machine

JOINTS, TRANSFORMS = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
TURN, WAY = 0.2, 0.05  # radians and metres that a joint is commanded to go
SETTLED, LEAST, LONGEST = 5.0, 1.0, 20.0  # times as long as a drive takes; seconds
OFF = (0.05, 2e-3)  # part of the way, and radians or metres, by which a joint may be off


def joint_drive(machine: Machine, unit: float) -> tuple[Session, ...]:
    """Return the drive of joints: there and back, and there again after Stop and Play."""
    joints = machine.articulated.values()
    driven = [joint for joint in joints if joint.stiffness > 0 and not joint.locked]
    if not driven:
        return (Session((Leg("idle", LEAST),)),)
    slowest = max(joint.damping / joint.stiffness for joint in driven)
    seconds = min(LONGEST, max(LEAST, SETTLED * slowest))
    there = tuple(
        (joint.name, _target(joint, unit) if joint in driven else math.nan) for joint in joints
    )
    back = tuple((name, place if math.isnan(place) else 0.0) for name, place in there)
    idle = Leg("idle", 0.5)
    legs = (idle, Leg("there", seconds, joints=there), Leg("back", seconds, joints=back))
    return (Session(legs), Session(legs[:2]))


def _target(joint: Joint, unit: float) -> float:
    """Return where a joint is commanded to go, within its limits."""
    low, high = joint.limits
    far = WAY / unit if joint.kind == SLIDER else TURN
    return min(far, high / 2) if high > 0 else max(-far, low / 2)


def arm_checks(trial: Trial, scene: Scene) -> Iterator[Check]:
    """Yield what joints show: whether they follow their commands, and what TF and states say."""
    if not trial.recording.held:
        text = "no joint of the robot is driven to a position"
        yield Check("joints", "not judged", text)
        return
    yield verdict("joints", list(joints(trial, 0)), trial)
    seen = _with_frames(trial, scene)
    if seen.wanted.transforms:
        yield verdict("links", list(links(seen, scene)), seen)
    if any(isinstance(message.data, JointStates) for message in trial.recording.messages):
        yield verdict("joint states", list(joint_states(trial, scene)), trial)
    if _moves(trial):
        yield replace(verdict("joints", list(joints(trial, 1)), trial), name="again")
    else:
        yield Check("again", "not judged", "the robot never moved")


def _moves(trial: Trial) -> bool:
    return any(any(held.positions.values()) for held in trial.recording.held)


def _held(trial: Trial, session: int) -> list[Held]:
    return [held for held in trial.recording.held if held.session == session]


def joints(trial: Trial, session: int) -> Iterator[RunFault]:
    """Each joint goes where it is commanded to."""
    for held in _held(trial, session):
        for name, commanded in held.commanded.items():
            stands = held.positions.get(name, math.nan)
            most = max(abs(other.commanded[name]) for other in trial.recording.held)
            if not math.isnan(commanded) and not abs(stands - commanded) <= OFF[0] * most + OFF[1]:
                cause = trial.causes.of_joints() if isinstance(trial.causes, RunCauses) else None
                text = f"{name} is commanded to {commanded:.3f} and is at {stands:.3f}"
                text += trial.when([session])
                if cause is None:
                    yield RunFault(text, "joint-off-target")
                else:
                    kind = cause.kind or "joint-off-target"
                    yield RunFault(text, kind, cause.prim, cause.reason)
                return


def _with_frames(trial: Trial, scene: Scene) -> Trial:
    """Return a trial with the topic of TF that has links of the robot, and the frame at its top."""
    names = {frame_name(scene.prims[link]) for link in trial.recording.held[0].links}
    for message in trial.recording.messages:
        if message.type != TRANSFORMS or message.away is not None:
            continue
        if names & {transform.child for transform in message.transforms}:
            up = {frame.child: frame.parent for frame in message.transforms}
            top = next(iter(up))
            for _ in up:
                top = up.get(top, top)
            wanted = replace(trial.wanted, transforms=message.topic, root=top, base=top)
            return replace(trial, wanted=wanted)
    return trial


def links(trial: Trial, scene: Scene) -> Iterator[RunFault]:
    """TF has each link where the joints put it, seen from the first link that it has."""
    for held in _held(trial, 0):
        first: tuple[Affine, Affine] | None = None
        for link, place in held.links.items():
            frame = frame_name(scene.prims[link])
            published = in_root(trial, Message("", held.at, frame, at=held.at, session=0))
            if published is None:
                continue
            if first is None:
                first = (published, place)
            elif not agree(first[0].inverse().then(published), first[1].inverse().then(place)):
                yield RunFault(f"TF does not have {frame} where its link is", "link-off-frame")
                return


def joint_states(trial: Trial, scene: Scene) -> Iterator[RunFault]:
    """Joint states are those of the joints."""
    unit = 1.0 / scene.meters_per_unit
    for held in _held(trial, 0):
        last: dict[str, tuple[float, str]] = {}
        for message in trial.recording.messages:
            data = message.data
            if isinstance(data, JointStates) and not message.session and message.at <= held.at:
                pairs = zip(data.names, data.positions, strict=False)
                last.update((name, (place, message.node)) for name, place in pairs)
        for name, (published, node) in last.items():
            actual = held.positions.get(name)
            if (
                actual is not None
                and min(abs(published - actual), abs(published - actual * unit)) > OFF[1]
            ):
                text = f"joint states have {name} at {published:.3f}, it stands at {actual:.3f}"
                yield RunFault(text, "wrong-joint-state", node)
                return
