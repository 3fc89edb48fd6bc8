"""Who commands the robots of any stage, and whether they follow."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.isaac.topics import JOINT_STATES, TRANSFORMS
from lab3_usd.model.dry_run import Check, Scene, heading
from lab3_usd.model.transforms import Vector
from lab3_usd.physics.machine import Wheel
from lab3_usd.sim.arms import shown_prims
from lab3_usd.sim.execution.drive import STEERED
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.checks import CHECKS, verdict
from lab3_usd.sim.judge.expectations import Look, RunFault, Trial, displacement
from lab3_usd.sim.judge.motion import again, follows
from lab3_usd.sim.robots import Robot, owners_of

SIZES = (0.9, 1.1)  # of what a controller gives, that the robot does
STRAIGHT = 0.01  # radians up to which a wheel is not steered
# Times the distance of steered wheels, from which on their points are too far apart.
EXCHANGED = 1.5
_HELD = (0.2, 5.0)  # of a command, that wheels on rollers may be expected to do
# Checks of a robot that drives over ground.
OVER_GROUND = (
    "rest", "follows", "limits", "odometry", "moving frames", "mounted", "scan", "map", "again"
)  # fmt: skip
LEAST = 0.1  # part of a command that a robot on rollers does at least


def rival(robot: Robot, robots: Sequence[Robot]) -> Robot | None:
    """Return the commands of another topic or domain that move the same joints over another node.

    Each controller writes its targets at every update: what the other one wrote is lost
    (OgnIsaacArticulationController.py:103-170 of core nodes).
    """
    for other in robots:
        if robot.machine is None or other.machine is None:
            continue
        if (
            robot.machine.base == other.machine.base
            and other.commands != robot.commands
            and (robot.kind == JOINT_STATES) == (other.kind == JOINT_STATES)
            and robot.moved & other.moved
            and not robot.controllers & other.controllers
        ):
            return other
    return None


def commanded_once(robots: Sequence[Robot]) -> Iterator[RunFault]:
    """The joints of a robot are moved by the commands of one topic in one domain."""
    for number, robot in enumerate(robots):
        other = rival(robot, robots[number:])
        if other is not None:
            ways = " and ".join(
                f"{each.subscriber} ({each.commands.topic} in domain {each.commands.domain})"
                for each in (robot, other)
            )
            text = f"{robot.name} is driven by two: {ways}"
            yield RunFault(text, "several-commands", other.controller)


def hears_itself(trial: Trial, robots: Sequence[Robot]) -> Iterator[RunFault]:
    """No joint states are published where joints are commanded: they would be commands."""
    commands = {robot.commands: robot for robot in robots if robot.kind == JOINT_STATES}
    sent = {
        (domain_of(message, trial), message.topic): message.node
        for message in trial.recording.messages
        if message.type == JOINT_STATES
    }
    for endpoint, robot in commands.items():
        node = sent.get((endpoint.domain, endpoint.topic))
        if node is not None:
            text = f"{node} publishes joint states on {endpoint.topic}, on which {robot.subscriber}"
            yield RunFault(f"{text} reads them as commands", "extra-publisher", node)


def of_another(trial: Trial, robots: Sequence[Robot]) -> Iterator[RunFault]:
    """In the namespace or domain of a robot nothing is published of another robot alone.

    They are those of a robot if its commands, and those of no other, come there or below. In a
    domain another robot may be shown beside its own.
    """
    spaces: dict[tuple[int, str], set[str]] = {}
    for robot in robots:
        space = robot.commands.topic
        while space and robot.machine is not None:
            space = space.rpartition("/")[0]
            spaces.setdefault((robot.commands.domain, space), set()).add(robot.machine.base)
    owners = owners_of(robots)
    shown: dict[tuple[int, str], set[str]] = {}  # the robots, by domain and type of message
    for message in _one_of_each(trial):
        of = shown.setdefault((domain_of(message, trial), message.type), set())
        of.update(*map(owners, shown_prims(trial, message.node)))
    for message in _one_of_each(trial):
        domain, space = domain_of(message, trial), message.topic
        while space and (domain, space) not in spaces:
            space = space.rpartition("/")[0]
        expected = spaces.get((domain, space), set())
        if len(expected) != 1 or (not space and expected & shown[domain, message.type]):
            continue
        for prim, node in sorted(shown_prims(trial, message.node).items()):
            owner_paths = owners(prim)
            # A transform of another robot's base may say where that is.
            is_base = prim in owner_paths and message.type == TRANSFORMS
            if len(owner_paths) == 1 and not owner_paths & expected and not is_base:
                text = f"{message.topic} shows {prim}, which is not part of {min(expected)}"
                yield RunFault(text, "wrong-topic", node)
                break


def _one_of_each(trial: Trial) -> list[Message]:
    """Return the first message of each node on each topic."""
    first: dict[tuple[str, str], Message] = {}
    for message in trial.recording.messages:
        first.setdefault((message.node, message.topic), message)
    return list(first.values())


def domain_of(message: Message, trial: Trial) -> int:
    """Return the domain in which a message came."""
    return trial.wanted.domain if message.away is None else message.away


def follows_command(trial: Trial, robot: Robot) -> Iterator[RunFault]:
    """The robot moves as commanded; if wheels slide in a turn, only its direction counts."""
    if robot.has_rollers:
        braking = [
            wheel.joint
            for wheel in (robot.machine.wheels if robot.machine is not None else ())
            if wheel.joint.holds and robot.moved and wheel.joint.name not in robot.moved
        ]
        for joint in braking:
            text = f"no command reaches {joint.name}, whose drive brakes its wheel"
            yield RunFault(text, "wrong-command-count", joint.path)
        given = _given_motion(trial, robot)
        way, turn = (math.hypot(*given[0][:2]), abs(given[2][2])) if given else (1.0, 1.0)
        if not all(SIZES[0] <= part <= SIZES[1] for part in (way, turn)):
            text = f"its controller gives {way:.2g} m and {turn:.2g} rad for each metre and radian"
            text += " commanded, by its gains"
            trial.recording.remarks.append(f"{robot.name}: {text}")
            if not all(_HELD[0] <= part <= _HELD[1] for part in (way, turn)):
                text += ": whether its wheels hold that is not modelled"
                yield RunFault(text, "wrong-turn", robot.controller, sure=False)
        yield from _moved_as_commanded(trial, given)
        return
    yield from _turns_about_a_point(trial, robot)
    yield from follows_to_its_side(trial) if trial.scrubs else follows(trial)


def follows_to_its_side(trial: Trial) -> Iterator[RunFault]:
    """It goes ahead and back as commanded, and turns to the side that it is commanded to.

    How far it turns is up to its wheels: those of a skid steer slide.
    """
    turns = [s for s in trial.stretches("left", "right", "arc", STEERED) if s.leg.turn]
    is_right = all(stretch.turned * stretch.leg.turn > 0 for stretch in turns)
    for fault in follows(trial):
        if not (is_right and fault.kind in {"wrong-turn", "wrong-arc"}):
            yield fault


def _turns_about_a_point(trial: Trial, robot: Robot) -> Iterator[RunFault]:
    """The wheels of a car are steered about one point, or at least by one angle.

    Where the left and the right one are exchanged, their points are twice their distance apart.
    """
    machine, held = robot.machine, trial.recording.held
    if machine is None or not held or not robot.wheel_base:
        return
    base = held[0].links[machine.base]
    fixed: list[Wheel] = []
    steered: list[tuple[Wheel, float]] = []
    for wheel in machine.wheels:
        carrier = held[0].links[wheel.carrier]
        turned = base.inverse().then(carrier).then(machine.rest[wheel.carrier].inverse())
        angle = heading(turned)
        if abs(angle) > STRAIGHT:
            steered.append((wheel, angle))
        else:
            fixed.append(wheel)
    if not fixed or len(steered) < len("lr"):
        return
    u, v = fixed[0].along
    x, y = (sum(wheel.contact[i] for wheel in fixed) / len(fixed) for i in (0, 1))
    points: list[tuple[float, float, str]] = []  # how far aside, the wheel's side, its joint
    for wheel, angle in steered:
        c, s = math.cos(angle), math.sin(angle)
        a, b = c * wheel.along[0] - s * wheel.along[1], s * wheel.along[0] + c * wheel.along[1]
        across = (u * b - v * a) or 1e-9  # of the wheel's direction and the others'
        dx, dy = wheel.contact[0] - x, wheel.contact[1] - y
        points.append(((dx * a + dy * b) / across, u * dy - v * dx, wheel.joint.name))
    (one, left, first), (other, right, second) = min(points), max(points)
    if abs(one - other) > EXCHANGED * abs(left - right):
        text = f"{first} and {second} are steered about two points, the inner wheel by less"
        yield trial.motion_fault(text, "wrong-arc")


def _given_motion(trial: Trial, robot: Robot) -> tuple[Vector, ...]:
    """Return what motion the controller of a robot on rollers gives, nothing where that is open."""
    controllers = (trial.nodes[path] for path in robot.controllers)
    feeding = (node.path for controller in controllers for node in controller.feeding)
    gives = trial.recording.gives
    return next((gives[path] for path in feeding if path in gives), ())


def _moved_as_commanded(trial: Trial, given: Sequence[Vector]) -> Iterator[RunFault]:
    """The robot moves in the commanded direction, as fast as its controller's arithmetic has it."""
    if trial.never_moves():
        yield trial.motion_fault("does not move", "does-not-move")
        return
    for stretch in trial.stretches("ahead", "back", "aside", "left"):
        leg, before, poses = stretch
        ahead, left, _ = displacement(before, poses[-1])
        x, y, _ = leg.command or (0.0, 0.0, 0.0)
        size = math.hypot(x, y) * leg.seconds
        along = (ahead * x + left * y) / math.hypot(x, y) if size else 0.0
        off = math.hypot(ahead, left) - abs(along)
        # Left is positive (REP 103), whatever the angles of its wheels are.
        is_right = along > LEAST * size and off < 0.1 * along
        is_right = is_right if size else stretch.turned * leg.turn > 0
        told = ""
        if is_right and given:
            rows = [[k * v for v in row] for k, row in zip((x, y, leg.turn), given, strict=True)]
            moved = [sum(parts) for parts in zip(*rows, strict=True)]
            ideal = leg.seconds * (math.hypot(*moved[:2]) if size else moved[2])
            driven = along if size else stretch.turned
            is_right = SIZES[0] <= driven / ideal <= SIZES[1] if ideal else True
            told = f"{ideal:.2f} m" if size else f"{math.degrees(ideal):.0f} degrees"
        if not is_right:
            text = f"commanded to go {leg.name}, went {ahead:.2f} m ahead, {left:.2f} m to the left"
            text += f" and turned {math.degrees(stretch.turned):.0f} degrees"
            text += f"; the wheels that its controller has would do {told}" if told else ""
            yield trial.motion_fault(text, "wrong-distance" if size else "wrong-turn")
            return


def follows_after_replay(trial: Trial, robot: Robot) -> Iterator[RunFault]:
    """The robot drives again after Stop and Play; on rollers at full speed."""
    if len(trial.drive) < len("ab"):
        return
    leg = trial.drive[1].legs[-1]
    poses = [pose for pose in trial.recording.path if pose.session == 1 and pose.leg == leg.name]
    ahead = displacement(poses[0], poses[-1])[0] if poses else 0.0
    if not (robot.has_rollers and ahead > LEAST * leg.forward * leg.seconds):
        yield from again(trial)


def as_of_kind(trial: Trial, robot: Robot | None, scene: Scene) -> Trial:
    """Return a trial that is judged by what the base of its robot can do, as any stage is.

    A car turns about one point, and a robot on rollers goes to any side: each wheel of theirs by
    itself would slide. None is one on two wheels. Robots drive over ground along X and Y only.
    """
    if scene.up != "Z" and trial.wanted.commands:
        text = f"robots drive with Z up only, and the stage has {scene.up} up"
        trial.recording.not_simulated["/"] = text
        trial.recording.unplayed |= dict.fromkeys(OVER_GROUND, f"not simulated: {text}")
    if robot is None:
        return trial
    own = {
        "follows": Look(lambda seen: follows_command(seen, robot), CHECKS["follows"].is_asked),
        "again": Look(lambda seen: follows_after_replay(seen, robot), CHECKS["again"].is_asked),
    }
    return replace(trial, own_checks=own, scrubs=trial.scrubs and not robot.goes_otherwise)


def unmoved(robot: Robot, trial: Trial) -> Check:
    """Return the failed check of a robot whose commands reach no joints."""
    text = f"commands on {robot.commands.topic} move nothing"
    reason = "there is no articulation at its target"
    name = "joints" if robot.kind == JOINT_STATES else "follows"
    return verdict(name, [RunFault(text, "no-articulation", robot.controller, reason)], trial)
