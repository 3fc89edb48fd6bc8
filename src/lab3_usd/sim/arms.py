"""Drives the joints of a robot by joint states, and judges how they follow.

Every commanded joint is sent to its own target within its limits and back, or gets its own speed,
depending on its drive and its controller.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import get_args

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.dry_run import Affine, Check, Scene
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.joint_drives import DRIVEN_AXES, JointCommand, moving_command
from lab3_usd.model.physics import FAR, JOINT_ENABLED
from lab3_usd.physics.bodies import has_drive, is_kinematic
from lab3_usd.physics.loads import Burden, burdens
from lab3_usd.physics.machine import FIXED, HINGE, SLIDER, Joint, Machine
from lab3_usd.physics.machine import JOINTS as JOINT_TYPES
from lab3_usd.sim.execution.drive import Leg, Session
from lab3_usd.sim.execution.node_instance import NodeInstance
from lab3_usd.sim.execution.recording import Held, JointStates, Message, Odometry
from lab3_usd.sim.execution.world import World
from lab3_usd.sim.judge.checks import verdict
from lab3_usd.sim.judge.expectations import Cause, RunFault, Trial, agree, caused, in_root
from lab3_usd.sim.mounting import carried_streams, held_frames
from lab3_usd.sim.nodes.transforms import frame_name

TURN, WAY = 0.3, 0.05  # radians and metres that the last joint is commanded to go
LEAST_SHARE = 1 / 3  # of that for the first joint; each goes further than the one before
MARGIN = 0.1  # part of its limits by which a joint that cannot stand at 0 keeps from them
SETTLED, LEAST, LONGEST = 5.0, 2.0, 20.0  # times as long as a drive takes; seconds
OFF = (0.05, 2e-3)  # part of the way, and radians or metres, by which a joint may be off
_NAMES, _INDICES = "jointNames", "jointIndices"
_COMMAND = "Command"  # how the inputs of a controller end, behind position, velocity and effort
_MIMIC = "Mimic"
_ROLLING = ("the robot rolls on it", "it turns freely, as wheels do")


class Reach(Struct, frozen=True):
    """The joints that messages of one topic reach.

    `names` are those of a message in its order; the joints of `told` are commanded and judged,
    those of `untold` not, for the reasons given. `kind` is what the messages command.
    """

    names: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    untold: dict[str, str] = {}
    kind: JointCommand = "position"


def reach_of(
    controller: NodeInstance, machine: Machine, world: World, taken: Collection[str]
) -> Reach:
    """Return the joints that messages move over a controller, before one came.

    `taken` are the joints that other controllers name. Names that come with the messages may be
    those of any joint of the robot; what is not meant to be commanded is left alone.
    """
    articulated = machine.articulated
    fixed = named_joints(controller, machine, world)
    if controller.items(_NAMES, world) and not _is_outward(fixed, machine):
        # A message gives them from the base outwards, as joint states do.
        fixed = [name for name in articulated if name in fixed]
    if fixed:
        kind = _commanded(machine, fixed, controller)
        return Reach(tuple(fixed), tuple(fixed), kind=kind) if kind is not None else Reach()
    is_by_message = _NAMES in controller.fed
    missing = tuple(_missing(machine, world)) if is_by_message else ()
    untold = dict(_left_alone(machine, world, taken))
    names = (*articulated, *missing)
    told = tuple(name for name in names if name not in untold)
    kind = _commanded(machine, told, controller)
    wheels = {
        name
        for name, joint in articulated.items()
        if untold.get(name) in _ROLLING and has_drive(world.scene.prims[joint.path])
    }
    with_wheels = tuple(name for name in names if name in told or name in wheels)
    if kind != "position" and _commanded(machine, with_wheels, controller) == "velocity":
        told, kind = with_wheels, "velocity"
        untold = {name: why for name, why in untold.items() if name not in wheels}
    if kind is None:
        return Reach(untold=untold)
    return Reach(told if is_by_message else tuple(articulated), told, untold, kind)


def named_joints(controller: NodeInstance, machine: Machine, world: World) -> list[str]:
    """Return the joints that a controller names itself, or by their numbers."""
    names = [str(name) for name in controller.items(_NAMES, world)]
    every = [*machine.articulated]
    indices = controller.numbers(_INDICES, world)
    if names or not any(indices):
        return names
    return [every[int(index)] for index in indices if 0 <= index < len(every)]


def _is_outward(names: Sequence[str], machine: Machine) -> bool:
    """Whether no joint is named before one that it hangs on."""
    for number, name in enumerate(names):
        joint = machine.articulated.get(name)
        if joint is not None:
            above = {each.name for each in machine.above(machine.link_of(joint))} - {name}
            if above & {*names[number + 1 :]}:
                return False
    return True


def _left_alone(
    machine: Machine, world: World, taken: Collection[str]
) -> Iterator[tuple[str, str]]:
    """Yield the joints that are not meant to be commanded, each with the reason."""
    prims, is_chain = world.scene.prims, not _has_loop(machine, world)
    wheels = () if machine.held else machine.wheels
    rolling = {wheel.joint.name for wheel in wheels}
    rolling |= {joint.name for wheel in wheels for joint in machine.above(wheel.carrier)}
    for name, joint in machine.articulated.items():
        prim = prims[joint.path]
        if name in taken:
            yield name, "another controller names it"
        elif joint.kind not in DRIVEN_AXES:
            yield name, "it has several axes"
        elif name in rolling:
            yield name, _ROLLING[0]
        elif any(_MIMIC in api for api in prim.apis):
            yield name, "it follows another joint"
        elif not machine.held and _turns_freely(joint, machine, world):
            yield name, _ROLLING[1]
        elif not is_chain and not has_drive(prim):
            yield name, "a closed chain moves it"


def _turns_freely(joint: Joint, machine: Machine, world: World) -> bool:
    """Whether a joint turns something with a shape freely.

    It carries no other joint, or has no drive.
    """
    link = machine.link_of(joint)
    has_shape = bool(world.machines.bodies.shapes[link])
    carries = any(other is not joint and link in other.bodies for other in machine.parents.values())
    is_endless = joint.limits[1] - joint.limits[0] > math.radians(FAR) and joint.stiffness <= 0
    is_loose = joint.kind == HINGE and is_endless and has_shape
    return is_loose and not (carries and has_drive(world.scene.prims[joint.path]))


def _has_loop(machine: Machine, world: World) -> bool:
    """Whether joints of a robot close a chain; a second one of two bodies only locks them."""
    pairs = set()
    for prim in world.scene.prims.values():
        if prim.type in JOINT_TYPES and prim.type != FIXED:
            ends = frozenset(map(world.machines.body_of, prim.ends))
            if prim.values.get(JOINT_ENABLED) is not False and ends <= machine.rest.keys():
                pairs.add(ends)
    tree = {frozenset(joint.bodies) for joint in machine.parents.values()}
    return bool(pairs - tree)


def _missing(machine: Machine, world: World) -> Iterator[str]:
    """Yield the joints with a drive that the articulation lacks: excluded or switched off.

    One that closes a chain is no part of an articulation (PhysX), so that nobody commands it.
    """
    if _has_loop(machine, world):
        return
    for path, prim in world.scene.prims.items():
        name = path.rpartition("/")[2]
        if prim.type not in DRIVEN_AXES or name in machine.articulated:
            continue
        ends = [*map(world.machines.body_of, prim.ends)]
        is_off = prim.values.get(JOINT_ENABLED) is False and not {*ends} <= machine.rest.keys()
        is_excluded = name in machine.joints and machine.joints[name].path == path
        is_own = any(end in machine.rest for end in ends)
        is_cut = any(is_kinematic(above) for end in prim.ends for above in world.scene.above(end))
        if is_own and has_drive(prim) and (is_off or is_excluded or is_cut):
            yield name


def _commanded(
    machine: Machine, told: Sequence[str], controller: NodeInstance
) -> JointCommand | None:
    """Return what moves joints of what a controller takes, None where there is none."""
    joints = [machine.joints[name] for name in told if name in machine.joints]
    gains = [(joint.stiffness, joint.damping) for joint in joints]
    kinds: tuple[JointCommand, ...] = get_args(JointCommand)
    given = [kind for kind in kinds if kind + _COMMAND in controller.fed]
    return moving_command(given, gains) if told else None


def joint_drive(machine: Machine, reach: Reach, unit: float) -> tuple[Session, ...]:
    """Return the drive of joints: there and back, and there again after Stop and Play."""
    joints = {name: machine.joints[name] for name in reach.told if name in machine.joints}
    if not reach.told:
        return (Session((Leg("idle", LEAST),)),)
    slow = [j.damping / j.stiffness for j in joints.values() if j.stiffness > 0 and not j.locked]
    seconds = min(LONGEST, max(LEAST, SETTLED * max(slow, default=0.0)))
    step = (1.0 - LEAST_SHARE) / max(1, len(reach.told) - 1)
    ways = {
        name: _way(joints.get(name), LEAST_SHARE + step * reach.told.index(name), unit)
        for name in reach.told
    }
    stay = (math.nan, math.nan)
    if reach.kind == "velocity":
        ways = {name: ((a - b) / seconds, (b - a) / seconds) for name, (a, b) in ways.items()}
    there = tuple((name, ways.get(name, stay)[1]) for name in reach.names)
    home = tuple((name, ways.get(name, stay)[0]) for name in reach.names)
    legs = (
        Leg("idle", 0.5),
        Leg("there", seconds, joints=there, kind=reach.kind),
        Leg("back", seconds, joints=home, kind=reach.kind),
    )
    return (Session(legs), Session(legs[:2]))


def _way(joint: Joint | None, share: float, unit: float) -> tuple[float, float]:
    """Return two places of a joint inside its limits: where it stands, and away from there."""
    low, high = joint.limits if joint is not None else (-math.inf, math.inf)
    far = share * (WAY / unit if joint is not None and joint.kind == SLIDER else TURN)
    keep = MARGIN * (high - low) if low > 0 or high < 0 else 0.0
    keep = min(keep, far)
    home = min(max(0.0, low + keep), high - keep)
    if high - home >= home - low:
        return home, home + min(far, share * (high - home))
    return home, home - min(far, share * (home - low))


def arm_checks(trial: Trial, scene: Scene, machine: Machine, controller: str) -> Iterator[Check]:
    """Yield what joints show: whether they follow their commands, and what TF and states say."""
    if not trial.recording.held:
        text, stopped = "no joint of the robot is commanded", _stopped(trial, controller)
        if stopped is None or stopped.kind is None:
            yield Check("joints", "not judged", text)
        else:
            fault = RunFault(text, stopped.kind, stopped.prim, stopped.reason)
            yield verdict("joints", [fault], trial)
        return
    told = trial.recording.held[0].commanded
    is_placed = trial.recording.held[0].kind == "position"
    weak = [*burdens(scene, machine, told)] if is_placed else []
    yield _judged(trial, 0, machine, controller, weak)
    seen = _with_frames(trial, scene, machine)
    if seen.wanted.transforms:
        yield verdict("links", list(links(seen, scene)), seen)
        if carried_streams(trial, scene, machine):
            faults = list(held_frames(seen, scene, machine))
            yield verdict("mounted", faults, seen) if faults else Check("mounted", "ok")
    faults = list(odometry_of_part(trial, scene, machine))
    if faults:
        yield verdict("odometry", faults, trial)
    if any(_own_states(trial, machine)):
        yield verdict("joint states", list(joint_states(trial, scene, machine)), trial)
    if any(any(held.positions.values()) for held in trial.recording.held):
        yield replace(_judged(trial, 1, machine, controller, weak), name="again")
    else:
        yield Check("again", "not judged", "the robot never moved")


def _judged(
    trial: Trial, session: int, machine: Machine, controller: str, weak: Sequence[Burden]
) -> Check:
    """Return whether joints follow; what efforts do to them is not judged."""
    faults = list(joints(trial, session, machine, controller))
    for burden in weak:
        text = f"{burden.joint.name} does not hold the weight on it{trial.when([session])}"
        site = burden.joint.path
        faults.append(RunFault(text, "weak-drive", site, burden.text, sure=burden.is_sure))
    check = verdict("joints", faults, trial)
    if trial.recording.held[0].kind == "effort" and check.verdict == "ok":
        text = "how far an effort moves a joint depends on masses, which are not simulated"
        return Check("joints", "not judged", text)
    return check


def _held(trial: Trial, session: int) -> list[Held]:
    return [held for held in trial.recording.held if held.session == session]


def joints(trial: Trial, session: int, machine: Machine, controller: str) -> Iterator[RunFault]:
    """Each joint goes where it is commanded to, or as fast."""
    held = _held(trial, session)
    stopped, command = _stopped(trial, controller), trial.recording.held[0].kind
    for name in dict.fromkeys(name for each in held for name in each.commanded):
        joint = machine.articulated.get(name)
        why = joint.hindrances.get(command, "") if joint is not None else ""
        off = _off_target(name, held)
        if joint is not None and why and not math.isnan(held[0].commanded[name]):
            kind: FaultKind = "no-velocity-drive" if command == "velocity" else "no-position-drive"
            kind = "limited-joint" if joint.limits[0] == joint.limits[1] else kind
            text = f"{name} does not follow its commands{trial.when([session])}"
            yield RunFault(text, kind, joint.path, f"it {why}")
        elif off and joint is not None and joint.locked:
            yield RunFault(off, "locked-joint", joint.path, "another joint holds it")
        elif off and joint is not None and (speed := _own_speed(joint, held)):
            yield RunFault(off + trial.when([session]), "joint-off-target", joint.path, speed)
        elif off or (command == "effort" and stopped is not None and stopped.kind is not None):
            off = off or f"{name} does not follow its commands"
            yield caused(off + trial.when([session]), "joint-off-target", stopped)
            if stopped is not None and stopped.kind is not None:
                return  # which keeps all joints


def _own_speed(joint: Joint, held: Sequence[Held]) -> str:
    """Return how the stage's target velocity keeps a joint off commanded positions, '' if not.

    The drive rests where stiffness * (target - position) + damping * speed is 0.
    """
    last = held[-1]
    if last.kind != "position" or not joint.stiffness:
        return ""
    beyond = joint.damping / joint.stiffness * joint.authored[0]
    away = last.positions.get(joint.name, math.nan) - last.commanded[joint.name]
    if not beyond or not math.isclose(away, beyond, abs_tol=OFF[1]):
        return ""
    return f"the targetVelocity of its drive keeps it {beyond:+.3f} from each target; set it to 0"


def _off_target(name: str, held: Sequence[Held]) -> str:
    """Return a text with the position of a joint that missed its target, '' if it reached it.

    For commanded velocities the text has the speed. The effect of an effort is unknown.
    """
    places = [each.commanded[name] for each in held]
    way = max(places) - min(places) or max(map(abs, places))
    for each in held:
        is_speed = each.kind == "velocity"
        actual = each.velocities if is_speed else each.positions
        commanded, stands = each.commanded[name], actual.get(name, math.nan)
        is_off = not abs(stands - commanded) <= OFF[0] * way + OFF[1]
        if each.kind == "effort" or math.isnan(commanded) or not is_off:
            continue
        if is_speed:
            return f"{name} is commanded to move at {commanded:.3f} and moves at {stands:.3f}"
        return f"{name} is commanded to {commanded:.3f} and is at {stands:.3f}"
    return ""


def _stopped(trial: Trial, controller: str) -> Cause | None:
    """Return what keeps commands from the joints, at least the node that gives them."""
    if trial.causes is None:
        return None
    node = trial.causes.program.nodes.get(controller)
    if node is None:
        return trial.causes.of_joints()
    return trial.causes.broken(node) or Cause(controller, "", None)


def shown_prims(trial: Trial, node: str) -> dict[str, str]:
    """Return the prims that a node publishes about, each with the node that names it.

    Those that they are relative to are left out.
    """
    running = trial.nodes.get(node)
    return {
        prim: feeding.path
        for feeding in (running.feeding if running is not None else ())
        for port, paths in feeding.node.targets.items()
        if feeding.type.tf is None or port not in feeding.type.tf.prims[:1]
        for prim in paths
    }


def concerns(trial: Trial, node: str, machine: Machine) -> bool:
    """Whether what a node publishes comes from a robot, or from nothing that names one."""
    prims = shown_prims(trial, node)
    return not prims or machine.is_named_by(prims)


def _with_frames(trial: Trial, scene: Scene, machine: Machine) -> Trial:
    """Return a trial with the topic of TF that has links of the robot, and the frame at its top."""
    names = {frame_name(scene.prims[link]) for link in trial.recording.held[0].links}
    for message in trial.recording.messages:
        if message.type != TRANSFORMS or message.away is not None:
            continue
        if not concerns(trial, message.node, machine):
            continue
        up = {child: parent for parent, child in message.frames}
        if names & up.keys():
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
            published = in_root(trial, frame, held)
            if published is None:
                continue
            if first is None:
                first = (published, place)
            elif not agree(first[0].inverse().then(published), first[1].inverse().then(place)):
                yield RunFault(f"TF does not have {frame} where its link is", "link-off-frame")
                return


def odometry_of_part(trial: Trial, scene: Scene, machine: Machine) -> Iterator[RunFault]:
    """Odometry follows the link whose frame it names, or one that keeps its place against it."""
    held, judged = _held(trial, 0), set[str]()
    for message in trial.recording.messages:
        if not isinstance(message.data, Odometry) or message.node in judged:
            continue
        judged.add(message.node)
        named = [p for p in machine.rest if frame_name(scene.prims[p]) == message.data.child]
        for body, node in shown_prims(trial, message.node).items():
            if not named or body not in machine.rest or body in named:
                continue
            seen = [each.links[named[0]].inverse().then(each.links[body]) for each in held]
            if not all(agree(seen[0], place) for place in seen):
                text = f"{message.topic} follows {body}, which moves against {named[0]}"
                text += f", whose frame {message.data.child} it names"
                yield RunFault(text, "wrong-odometry-frame", node)


def _own_states(trial: Trial, machine: Machine) -> Iterator[Message]:
    """Yield the joint states of the first session that are those of a robot."""
    nodes: dict[str, bool] = {}
    for message in trial.recording.messages:
        if isinstance(message.data, JointStates) and not message.session:
            if message.node not in nodes:
                nodes[message.node] = concerns(trial, message.node, machine)
            if nodes[message.node]:
                yield message


def joint_states(trial: Trial, scene: Scene, machine: Machine) -> Iterator[RunFault]:
    """Joint states are those of the joints."""
    unit = 1.0 / scene.meters_per_unit
    for held in _held(trial, 0):
        last: dict[str, tuple[float, str]] = {}
        for message in _own_states(trial, machine):
            data = message.data
            if message.at <= held.at:
                pairs = zip(data.names, data.positions, strict=False)
                last.update((name, (place, message.node)) for name, place in pairs)
        for name, (published, node) in last.items():
            actual = held.positions.get(name)
            if (
                actual is not None
                and min(abs(published - actual), abs(published - actual * unit)) > OFF[1]
            ):
                text = f"joint states have {name} at {published:.3f}, it is at {actual:.3f}"
                yield RunFault(text, "wrong-joint-state", node)
                return
