"""Plays a stage without a checkpoint, and judges its robots, topics and TF by themselves.

Nothing of a lab is asked. Each robot is driven by its own commands, in a play of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import CAMERA_INFO, CLOCK, JOINT_STATES, TRANSFORMS
from lab3_usd.model.dry_run import AXES, Affine, Check, Scene, about, heading
from lab3_usd.model.fault import FaultKind
from lab3_usd.physics.machine import Machine
from lab3_usd.sim.arms import arm_checks
from lab3_usd.sim.commands import (
    commanded_once,
    domain_of,
    hears_itself,
    of_another,
    rival,
    unmoved,
)
from lab3_usd.sim.execution.recording import Message, Recording, kept_transforms
from lab3_usd.sim.execution.world import standing_of
from lab3_usd.sim.judge.causes import DRIVEN
from lab3_usd.sim.judge.checks import CHECKS, OF_ALL, asked_checks, graphs, judge, verdict
from lab3_usd.sim.judge.expectations import Expected, Look, RunFault, Trial, agree, caused, in_root
from lab3_usd.sim.judge.sensors import MISSED, WALL, scans
from lab3_usd.sim.judge.topics import clock, tree
from lab3_usd.sim.mounting import carried_streams, own_frames, pairs
from lab3_usd.sim.outcome import Judged
from lab3_usd.sim.own_view import own_view
from lab3_usd.sim.plays import Play, shown_plays
from lab3_usd.sim.robots import Robot, owned_graphs, scene_for
from lab3_usd.sim.streams import (
    advancing,
    spoken_of,
    stamped,
    unheard,
    unheard_clock,
)
from lab3_usd.sim.timeline import uncollected

THROUGH = 0.02  # part of a range by which a ray may be longer
REPEATED = 4  # times that a transform comes which is no static one
_MOVED = 1e-3  # metres or radians; less is numerical noise
# What a node says of commands for another robot, of the value of a moment, or of its own switch.
_PASSING: tuple[FaultKind, ...] = (
    "wrong-topic", "wrong-domain", "no-number-input", "switched-off",
)  # fmt: skip


class Played(Struct, frozen=True):
    """The results of a stage: its robots, a play of each (or one without any), the other checks."""

    robots: tuple[Robot, ...]
    plays: tuple[Judged, ...]
    whole: tuple[Check, ...]


@uncollected()
def play_any(scene: Scene, platform: Platform, drive: str | None, topic: str = "") -> Played:
    """Play a stage once for each of its robots, and judge what it shows.

    Raises:
        UsageError: the drive is none, or the topic is not that of a robot.
    """
    standing = standing_of(scene, has_ground=True)
    shown = shown_plays(scene, platform, standing, drive, topic)
    all_robots = shown[0].among
    robots = tuple(play.robot for play in shown if play.robot is not None)
    plays: list[Judged] = []
    graphs_of = owned_graphs(all_robots, scene)
    for number, play in enumerate(shown):
        robot = play.robot
        # The first play shows all topics; the others, what concerns their robot.
        part = scene_for(robot, graphs_of, scene, platform) if robot and number else scene
        trial = play.recorded(part, platform, standing)
        checks = _robot_checks(robot, all_robots, trial, scene) if robot is not None else ()
        plays.append(Judged(play.name, trial, tuple(checks)))
        if number:
            trial.recording.forget_messages()
    first = plays[0].trial
    whole = [*_stage_checks(first, all_robots)]
    if any(rival(robot, all_robots) for robot in robots):
        whole.append(verdict("commands", list(commanded_once(all_robots)), first))
    failures = list(_failing(plays, whole))
    if failures:
        rest = [check for check in whole if check.name != "graphs"]
        whole = [verdict("graphs", [*graphs(first), *failures], first), *rest]
    return Played(robots, tuple(plays), tuple(whole))


def effects_of(stage: Any, platform: Platform) -> frozenset[str]:
    """Return what an open stage does in a dry run: which nodes publish what, and what moves.

    Nothing is known of one that cannot be played. `lab3 fix` calls it before and after repairs.
    """
    from lab3_usd.stage.read.opening import quiet
    from lab3_usd.stage.read.scene import read_scene

    try:
        with quiet():
            played = play_any(read_scene(stage, platform), platform, None)
    except StageError:
        return frozenset()
    # The first play shows the messages of all.
    sent = {(message.node, message.type) for message in played.plays[0].trial.recording.messages}
    pairs = zip(played.robots, played.plays, strict=False)
    moving = [robot for robot, play in pairs if _moves(play.trial)]
    return frozenset(
        (
            *(f"{node} publishes {kind}" for node, kind in sent),
            *(f"{robot.controller} moves its robot" for robot in moving),
        )
    )


def _moves(trial: Trial) -> bool:
    """Whether a robot goes anywhere, or one of its joints does."""
    of_joints = zip(*(each.positions.values() for each in trial.recording.held), strict=False)
    ways = (max(positions) - min(positions) for positions in of_joints)
    return not trial.never_moves() or any(way > _MOVED for way in ways)


def _failing(plays: Sequence[Judged], whole: Sequence[Check]) -> Iterator[RunFault]:
    """Yield the nodes that fail to the end of every play, and that no check names."""
    told = {
        word
        for check in (*whole, *(check for play in plays for check in play.checks))
        if check.verdict != "ok"
        for word in (check.prim, *check.text.replace(";", " ").split())
    }
    first = plays[0].trial
    for path, node in first.nodes.items():
        running = [play.trial.nodes.get(path) for play in plays]
        failures = [other.failure for other in running if other is not None]
        if any(failure is None or failure.kind in _PASSING for failure in failures):
            continue
        cause = first.causes.broken(node) if first.causes is not None else None
        if cause is not None and not {cause.prim, path} & told:
            yield caused(f"{path} fails", "not-executed", cause)


def _robot_checks(
    robot: Robot, robots: Sequence[Robot], play: Trial, scene: Scene
) -> Iterator[Check]:
    """Yield the checks of a robot; what another command undoes is that one's fault."""
    if robot.machine is None:
        yield unmoved(robot, play)
        return
    if robot.reach.untold:
        named = ", ".join(f"{name} ({why})" for name, why in robot.reach.untold.items())
        play.recording.remarks.append(f"{robot.name}: not commanded on its topic: {named}")
    if play.scrubs:
        text = f"the wheels of {robot.name} slide in a turn: its angle is unknown"
        play.recording.remarks.append(text)
    if robot.kind == JOINT_STATES:
        checks = arm_checks(play, scene, robot.machine, robot.controller)
    else:
        seen = _as_it_shows(own_view(robot, robots, play, scene), robot.machine, scene)
        own = {name: look for name, look in asked_checks(seen).items() if name not in OF_ALL}
        checks = iter(judge(seen, own))
    other = rival(robot, robots)
    for check in checks:
        if other is not None and check.verdict == "bad" and check.name in DRIVEN:
            cause = f"it moves the same joints by what comes on {other.commands.topic}"
            yield replace(check, prim=other.controller, kind="several-commands", cause=cause)
        else:
            yield check


def joint_checks(play: Play, trial: Trial, scene: Scene) -> list[Check]:
    """Return the checks of the joints that a lab moves by commands of their own."""
    if play.robot is not None:
        return [*_robot_checks(play.robot, play.among, trial, scene)]
    text = f"commands on {play.wanted.commands} in domain {play.wanted.domain} move no joint"
    cause = trial.causes.of_joints() if trial.causes is not None else None
    return [verdict("joints", [caused(text, "does-not-move", cause)], trial)]


def _as_it_shows(trial: Trial, machine: Machine, scene: Scene) -> Trial:
    """Return the play of a robot by its own topics, with checks for what no lab asks of them.

    TF is held against the motion, as nothing says that it has to be that of odometry. A lidar may
    see parts of its robot, and no wall. A lab says where its sensors are; here each is held
    against the prim that it shows.
    """
    own = {
        "tree": Look(apart, lambda seen: _has_tree(seen) and any(apart(seen))),
        "moving frames": Look(moving, _has_tree),
        "mounted": Look(
            lambda seen: own_frames(seen, scene, machine),
            lambda seen: _has_tree(seen) and any(carried_streams(seen, scene, machine)),
        ),
        "scan": Look(placed_scan, lambda seen: bool(scans(seen))),
    }
    return replace(trial, own_checks={**trial.own_checks, **own})


def _has_tree(trial: Trial) -> bool:
    return bool(trial.recording.topic(trial.wanted.transforms, 0))


def _stage_checks(trial: Trial, robots: Sequence[Robot]) -> Iterator[Check]:
    """Yield the checks that concern no robot: graphs, and clock and TF of each domain."""
    recording = trial.recording
    if CHECKS["graphs"].is_asked(trial):
        yield verdict("graphs", list(graphs(trial)), trial)
    if spoken_of(trial):
        faults = [*unheard(trial), *hears_itself(trial, robots), *of_another(trial, robots)]
        yield verdict("topics", faults, trial)
    if any(stamped(trial)):
        yield verdict("stamps", list(advancing(trial)), trial)
    if any(message.type == CAMERA_INFO for message in recording.messages):
        yield verdict("camera", list(pairs(trial)), trial)
    heard: dict[tuple[str, int, str], list[Message]] = {}
    kept: dict[int, list[Message]] = {}
    for message in recording.messages:
        domain = domain_of(message, trial)
        if message.type in {CLOCK, TRANSFORMS}:
            heard.setdefault((message.type, domain, message.topic), []).append(message)
        if message.static:
            kept.setdefault(domain, []).append(message)
    topics = [topic for topic, sent in heard.items() if not all(each.static for each in sent)]
    for kind, domain, topic in sorted(topics):
        trees = sum(robot.commands.domain == domain for robot in robots)
        wanted = replace(
            trial.wanted, domain=domain, clock=topic, transforms=topic, trees=max(1, trees)
        )
        seen = _alone(trial, wanted, heard[kind, domain, topic], kept.get(domain, ()))
        if kind == CLOCK:
            check = verdict("clock", [*clock(seen), *unheard_clock(seen, topics)], seen)
        else:
            check = verdict("tree", list(tree(seen)), seen)
        several = sum(topic[0] == kind for topic in topics) > 1
        yield replace(check, of=f"{topic} in domain {domain}" if several else "")


def _alone(
    trial: Trial, wanted: Expected, sent: Iterable[Message], kept: Iterable[Message]
) -> Trial:
    """Return the first session with what was sent on one topic, and with static transforms."""
    recording = Recording(
        trial.recording.seconds,
        [replace(message, away=None) for message in sent if not message.session],
        trial.recording.path,
        static=kept_transforms(message for message in kept if not message.session),
    )
    return Trial(recording, trial.drive[:1], wanted, causes=trial.causes)


def apart(trial: Trial) -> Iterator[RunFault]:
    """No frames of a robot hang below its base on another topic, where nobody hears both.

    A topic that also has transforms of the first one has a tree of its own.
    """
    on: dict[str, dict[tuple[str, str], str]] = {}  # topics: transforms, and their nodes
    for message in trial.recording.messages:
        if message.type == TRANSFORMS and not (message.static or message.session):
            edges = on.setdefault(message.topic, {})
            edges.update(dict.fromkeys(message.frames, message.node))
    own = on.pop(trial.wanted.transforms, {})
    base = next((edge for edge in own if edge[1] == trial.wanted.base), None)
    for topic, edges in on.items():
        lost = next((edge for edge in edges if edge[0] in {child for _, child in own}), None)
        if base and lost and not own.keys() & edges:
            text = f"{lost[0]} -> {lost[1]} is on {topic}, and {base[0]} -> {base[1]} on "
            text += f"{trial.wanted.transforms}: no listener receives both"
            yield RunFault(text, "disconnected-frame", edges[lost])


def moving(trial: Trial) -> Iterator[RunFault]:
    """TF moves the base as the robot moves."""
    wanted = trial.wanted
    messages = _moving_messages(trial)
    for message in messages[len(messages) // 4 :: max(1, len(messages) // 4)]:
        place, pose = in_root(trial, wanted.base, message), trial.pose(message)
        if place is None:
            continue
        stands = trial.start.then(place)
        level = Affine(about(AXES[2], heading(stands)), stands.origin)
        actual = Affine(about(AXES[2], pose.heading), (pose.x, pose.y, stands.origin[2]))
        if not agree(level, actual):
            text = f"{wanted.root} -> {wanted.base} does not move with the robot"
            yield RunFault(text, "transform-unlike-odometry", message.node)
            return


def _moving_messages(trial: Trial) -> list[Message]:
    """Return the messages with the transform above the base that comes least often.

    Between them that transform is older than the others, and the robot has moved on.
    """
    messages = trial.recording.topic(trial.wanted.transforms, 0)
    with_frame: dict[str, list[Message]] = {}
    up: dict[str, str] = {}
    for message in messages:
        for parent, child in message.frames:
            with_frame.setdefault(child, []).append(message)
            up[child] = parent
    frame, kept = trial.wanted.base, messages
    for _ in up:
        sent = with_frame.get(frame, [])
        kept = sent if REPEATED < len(sent) < len(kept) else kept
        frame = up.get(frame, "")
    return kept


def placed_scan(trial: Trial) -> Iterator[RunFault]:
    """Scans end before walls where TF puts the lidar; what stands nearer may be the robot."""
    message = scans(trial)[-1]
    place, seen = in_root(trial, message.frame, message), message.data
    if place is None or trial.walls is None:
        text = f"TF does not have {message.frame} below {trial.wanted.root or 'any frame'}"
        yield RunFault(text, "unknown-frame", message.node, sure=False)
        return
    walls = trial.walls(trial.start.then(place), seen)
    there = [number for number, wall in enumerate(walls) if wall >= 0]
    through = sum(
        seen.ranges[number] < 0 or seen.ranges[number] > walls[number] * (1 + THROUGH) + WALL
        for number in there
    )
    if not there:
        text, is_empty = "no wall is in range of the lidar", seen.range_min >= seen.range_max
        if is_empty:
            text = f"its range is from {seen.range_min:g} to {seen.range_max:g} m: no ray returns"
        yield RunFault(text, "no-ray-returns", message.node if is_empty else "", sure=is_empty)
    elif through > MISSED * len(there):
        text = f"{through} of {len(there)} rays go through walls"
        yield RunFault(text, "scan-off-walls", message.node)
