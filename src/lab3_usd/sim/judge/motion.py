"""Does the robot follow its commands, and do odometry and TF agree with its motion?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice, pairwise, takewhile

from lab3_usd.model.dry_run import Affine, rotation
from lab3_usd.model.fault import FaultKind
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import Message, Odometry, Pose
from lab3_usd.sim.judge.expectations import (
    SOON,
    RunFault,
    Stretch,
    Trial,
    agree,
    angle,
    displacement,
    in_root,
)


def leg_fault(trial: Trial, stretch: Stretch) -> RunFault | None:
    """Return what is wrong with how the robot drives one leg; None where nothing is asked of it.

    How far acceleration limits let it go is known from rest alone.
    """
    check = _LEG_CHECKS.get(stretch.leg.name)
    is_open = trial.has_ramps and check in _FROM_REST and _comes_nearer(trial, stretch)
    return None if check is None or is_open else check(trial, stretch)


def _comes_nearer(trial: Trial, stretch: Stretch) -> bool:
    """Whether a robot that moves when a leg begins ends no farther from the commanded speed."""
    leg, before, poses = stretch
    earlier = takewhile(lambda pose: pose is not before, trial.recording.path)
    pairs = ((before, *earlier)[-1], before), (before, *poses)[-2:]
    start, end = ([step * RATE for step in displacement(*pair)] for pair in pairs)
    if math.hypot(*start[:2]) <= SPEED and abs(start[2]) <= SPEED:
        return False
    told = (leg.forward, 0.0, leg.turn)
    return all(
        abs(last - trial.factor * wanted) <= abs(first - trial.factor * wanted) + SPEED
        for first, last, wanted in zip(start, end, told, strict=True)
    )


def _faults(trial: Trial, *names: str) -> Iterator[RunFault]:
    """Yield what is wrong with the legs that have one of these names."""
    for stretch in trial.stretches(*names):
        fault = leg_fault(trial, stretch)
        if fault is not None:
            yield fault


def rest(trial: Trial) -> Iterator[RunFault]:
    """It stands still before and after commands, and when commanded sideways."""
    yield from _faults(trial, "idle", "sideways")
    poses = [pose for pose in trial.recording.path if not pose.session]
    for at, (pose, following) in enumerate(pairwise(poses), start=1):
        if pose.leg != "stop" and following.leg == "stop":
            later = poses[at + SOON : at + 2 * SOON + 1]
            moves = bool(later) and _moves(trial, displacement(later[0], later[-1]))
            if moves and not _slows_down(trial, poses[at:], following.leg):
                yield trial.motion_fault(f"does not stop after {pose.leg}", "does-not-stop")
                return


def _slows_down(trial: Trial, poses: Sequence[Pose], name: str) -> bool:
    """Whether a robot with acceleration limits comes to rest, as slowly as these let it."""
    own = [*takewhile(lambda pose: pose.leg == name, poses)]
    if not trial.has_ramps or len(own) <= 2 * SOON:
        return trial.has_ramps
    starts, ends = (displacement(*pair) for pair in ((own[0], own[SOON]), (own[-SOON], own[-1])))
    return math.hypot(*ends) < SLOWER * math.hypot(*starts)


def _standing(trial: Trial, stretch: Stretch) -> RunFault | None:
    leg, before, poses = stretch
    if not _moves(trial, displacement(before, poses[-1])):
        return None
    if leg.name != "idle" and _slows_down(trial, poses, leg.name):
        return None
    kind: FaultKind = "moves-uncommanded" if leg.name == "idle" else "moves-sideways"
    return trial.motion_fault(f"moves while commanded {leg.name}", kind)


def _moves(trial: Trial, way: tuple[float, float, float]) -> bool:
    ahead, left, turned = way
    near, turn = trial.tolerance.still
    return math.hypot(ahead, left) > near or abs(turned) > turn


def follows(trial: Trial) -> Iterator[RunFault]:
    """It goes ahead, back and to the left as commanded, in sense and size."""
    if not any(leg.command and any(leg.command[::2]) for leg in trial.drive[0].legs):
        return
    if trial.never_moves():
        blocked = next((pose.blocked for pose in trial.recording.path if pose.blocked), "")
        if blocked:
            yield RunFault(f"does not move: {blocked} is in the way", "wall-ahead", sure=False)
        else:
            yield trial.motion_fault("does not move", "does-not-move")
        return
    for names in (("ahead", "back"), ("left", "right"), ("arc",)):
        yield from islice(_faults(trial, *names), 1)


def _straight(trial: Trial, stretch: Stretch) -> RunFault | None:
    leg, before, poses = stretch
    ahead, left, turned = displacement(before, poses[-1])
    commanded, (judged, seconds) = leg.forward * leg.seconds, trial.judged_part(stretch)
    part, _, _ = displacement(judged.before, judged.poses[-1])
    ideal = seconds * trial.reached(leg.forward, seconds)
    if not trial.follows(part, leg.forward * ideal):
        text = f"commanded to go {commanded:.2f} m"
        went = f"{text}, went {ahead:.2f}{trial.expected_text(commanded, '.2f')}"
        wall = _stopped(trial, stretch, ahead / commanded, text, f"after {ahead:.2f} m")
        return wall or trial.motion_fault(went, "wrong-distance")
    if abs(left) > trial.tolerance.slip[0] or abs(turned) > trial.tolerance.slip[1]:
        return trial.motion_fault(f"commanded to go {leg.name}, moved sideways", "sideways-drift")
    return None


def _stopped(
    trial: Trial, stretch: Stretch, part: float, command: str, done: str
) -> RunFault | None:
    """Return the fault of a robot that something stops after a part of a command, None for none."""
    blocked = next((pose.blocked for pose in stretch.poses if pose.blocked), "")
    if not blocked or not 0 <= part < trial.factor:
        return None
    return RunFault(f"{command}, {blocked} stops it {done}", "wall-ahead", sure=False)


def _turn(trial: Trial, stretch: Stretch) -> RunFault | None:
    leg, before, poses = stretch
    ahead, left, _ = displacement(before, poses[-1])
    judged, seconds = trial.judged_part(stretch)
    ideal = seconds * trial.reached(leg.turn, seconds, turning=True)
    if not trial.follows(judged.turned, leg.turn * ideal, turning=True):
        commanded, sense = math.degrees(abs(leg.turn * leg.seconds)), -1.0 if leg.turn < 0 else 1.0
        text = f"commanded {commanded:.0f} degrees {leg.name}, turned"
        text += (
            f" {math.degrees(sense * stretch.turned):.1f}{trial.expected_text(commanded, '.1f')}"
        )
        return trial.motion_fault(text, "wrong-turn")
    (x, y), c, s = trial.wanted.centre, math.cos(stretch.turned), math.sin(stretch.turned)
    off = math.hypot(ahead - (x - c * x + s * y), left - (y - s * x - c * y))
    if off > trial.tolerance.slip[0]:
        return trial.motion_fault("commanded to turn, drove away", "turn-off-centre")
    return None


def _arc(trial: Trial, stretch: Stretch) -> RunFault | None:
    leg, (judged, seconds) = stretch.leg, trial.judged_part(stretch)
    length, turn = (
        seconds * speed * trial.reached(speed, seconds, turning=turning)
        for speed, turning in ((abs(leg.forward), False), (leg.turn, True))
    )
    if trial.follows(judged.path_length, length) and trial.follows(
        judged.turned, turn, turning=True
    ):
        return None
    text = f"commanded to go {abs(leg.forward) * leg.seconds:.2f} m and turn"
    text += f" {math.degrees(leg.turn * leg.seconds):.0f} degrees"
    done = f"{stretch.path_length:.2f} m"
    wall = _stopped(trial, stretch, judged.path_length / length, text, f"after {done}")
    text += f", did {done} and {math.degrees(stretch.turned):.0f}"
    return wall or trial.motion_fault(text, "wrong-arc")


def limits(trial: Trial) -> Iterator[RunFault]:
    """Commands beyond the robot's limits are cut down to them."""
    if not trial.never_moves():
        for name in ("fast", "spin"):
            yield from islice(_faults(trial, name), 1)


def _at_limit(trial: Trial, stretch: Stretch) -> RunFault | None:
    name, steady = stretch.leg.name, stretch.steady
    turning = name == "spin"
    limit = trial.wanted.limits[turning]
    if not limit:
        return None
    ahead, left, _ = displacement(steady.before, steady.poses[-1])
    speed = (abs(steady.turned) if turning else math.hypot(ahead, left)) / steady.seconds
    is_slow = trial.has_ramps and speed < limit * trial.factor  # and still gets faster
    if is_slow or trial.follows(speed, limit, turning=turning):
        return None
    unit = "rad" if turning else "m"
    done = f"at {speed:.2f} of {limit} {unit}/s"
    wall = _stopped(trial, stretch, speed / limit, f"commanded to go {name}", done)
    text = f"commanded beyond its limit ({name}): goes at {speed:.2f} {unit}/s, limit {limit}"
    text += trial.expected_text(limit, ".2f")
    return wall or trial.motion_fault(text, "wrong-speed-limit")


_LEG_CHECKS: Mapping[str, Callable[[Trial, Stretch], RunFault | None]] = {
    "idle": _standing,
    "sideways": _standing,
    "ahead": _straight,
    "back": _straight,
    "left": _turn,
    "right": _turn,
    "arc": _arc,
    "fast": _at_limit,
    "spin": _at_limit,
}


_FROM_REST = (_straight, _turn, _arc)


def again(trial: Trial) -> Iterator[RunFault]:
    """After Stop and Play it drives again, also where ROS_DOMAIN_ID is another."""
    if trial.never_moves():
        return
    # What it does wrong from the first Play on, it does wrong for the same reason.
    before = next((fault for fault in _faults(trial, "ahead") if fault.sure), None)
    kind: FaultKind = "wrong-distance" if before is None else before.kind
    for number, session in enumerate(trial.drive):
        leg = session.legs[-1]
        played = [pose for pose in trial.recording.path if pose.session == number]
        poses = [pose for pose in played if pose.leg == leg.name]
        if not number or leg.command is None or not poses:
            continue
        judged, seconds = trial.judged_part(Stretch(leg, poses[0], poses[1:]))
        ahead, left, _ = displacement(judged.before, judged.poses[-1])
        commanded, when = leg.forward * seconds, trial.when([number])
        follows = trial.follows(ahead, commanded * trial.reached(leg.forward, seconds))
        text, done = f"commanded to go {commanded:.2f} m{when}", f"after {ahead:.2f} m"
        wall = None if follows else _stopped(trial, judged, ahead / commanded, text, done)
        if wall is not None:
            yield wall
        elif not follows or abs(left) > trial.tolerance.slip[0]:
            yield trial.motion_fault(f"does not follow {trial.wanted.commands}{when}", kind)


SLOWER = 0.8  # part of the speed at first, from which on a robot comes to rest
ODOMETRY = (0.02, math.radians(2.0))
SPEED = 0.03  # m/s and rad/s between what odometry reports and what is
SETTLED = 8  # frames after which a leg is driven evenly


def odometry(trial: Trial) -> Iterator[RunFault]:
    """/odom starts at 0, agrees with the motion, and names the frames."""
    wanted = trial.wanted
    messages = [
        message
        for message in trial.recording.topic(wanted.odometry, 0)
        if isinstance(message.data, Odometry)
    ]
    if not messages:
        return
    first = messages[0]
    frames = (first.frame, first.data.child)
    if frames != (wanted.root, wanted.base):
        text = f"odometry names {frames[0]} and {frames[1]}, not {wanted.root} and {wanted.base}"
        yield RunFault(text, "wrong-odometry-frame", first.node)
    origin = trial.recording.path[0]
    for message in messages[:: max(1, len(messages) // 40)]:
        fault = _odometry_fault(message.data, origin, trial.pose(message))
        if fault:
            yield RunFault(fault, "wrong-odometry-pose", message.node)
            return
    yield from _velocity_faults(trial, messages)


def _odometry_fault(data: Odometry, origin: Pose, pose: Pose) -> str:
    ahead, left, _ = displacement(origin, pose)
    x, y, _ = data.position
    if math.hypot(x - ahead, y - left) > ODOMETRY[0]:
        return f"odometry reports ({x:.2f}, {y:.2f}), it went ({ahead:.2f}, {left:.2f})"
    turned = Affine(rotation(data.orientation)).rows
    estimated = math.atan2(turned[1][0], turned[0][0])
    if abs(angle(estimated - (pose.heading - origin.heading))) > ODOMETRY[1]:
        return (
            f"odometry reports {math.degrees(estimated):.0f} degrees, another angle than it turned"
        )
    return ""


def _velocity_faults(trial: Trial, messages: list[Message]) -> Iterator[RunFault]:
    for leg, _, poses in trial.stretches("ahead", "back", "left", "right", "fast"):
        if len(poses) < SETTLED:
            continue
        earlier, later = poses[-4], poses[-3]
        at = [message for message in messages if abs(message.at - later.at) < 0.5 / RATE]
        if not at:
            continue
        ahead, left, turned = (step * RATE for step in displacement(earlier, later))
        message, data = at[0], at[0].data
        if (
            math.hypot(data.linear[0] - ahead, data.linear[1] - left) > SPEED
            or abs(data.angular[2] - turned) > SPEED
        ):
            text = f"the velocities of odometry are wrong while going {leg.name}"
            yield RunFault(text, "wrong-odometry-velocity", message.node)
            return


def moving_frames(trial: Trial) -> Iterator[RunFault]:
    """TF moves the base as odometry does."""
    wanted = trial.wanted
    messages = [
        message for message in trial.recording.topic(wanted.odometry, 0) if message.data is not None
    ]
    for message in messages[len(messages) // 4 :: max(1, len(messages) // 4)]:
        place = in_root(trial, wanted.base, message)
        if place is None or not isinstance(message.data, Odometry):
            continue
        estimate = Affine(rotation(message.data.orientation), message.data.position)
        if not agree(place, estimate):
            text = f"{wanted.root} -> {wanted.base} differs from odometry"
            yield RunFault(text, "transform-unlike-odometry", message.node)
            return
