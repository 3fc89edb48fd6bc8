"""Plays a stage without a checkpoint, and judges its robots, topics and TF by themselves.

Nothing of a lab is asked. Each robot is driven by its own commands, in a play of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.tree import tree_of as build_tree
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import AXES, Affine, Check, Scene, about, heading
from lab3_usd.model.fault import FaultKind
from lab3_usd.sim.arms import JOINTS, arm_checks
from lab3_usd.sim.commands import (
    commanded_once,
    domain_of,
    follows_after_replay,
    follows_command,
    hears_itself,
    note_up_axis,
    of_another,
    rival,
    unmoved,
)
from lab3_usd.sim.execution.drive import NO_LIMITS, drive_of
from lab3_usd.sim.execution.recording import Message, Recording, Scan
from lab3_usd.sim.execution.world import standing_of
from lab3_usd.sim.judge.causes import DRIVEN, RunCauses
from lab3_usd.sim.judge.checks import graphs, judge, verdict
from lab3_usd.sim.judge.expectations import CheckFunction, Expected, RunFault, Trial, agree, in_root
from lab3_usd.sim.judge.motion import odometry, rest
from lab3_usd.sim.judge.sensors import MISSED, WALL
from lab3_usd.sim.judge.topics import clock, heard_transforms, tree
from lab3_usd.sim.mounting import carried_streams, own_frames, pairs
from lab3_usd.sim.outcome import Judged
from lab3_usd.sim.own_view import kept_transforms, own_view
from lab3_usd.sim.robots import (
    TWIST,
    Robot,
    drive_for,
    expected_of,
    hears_commands,
    labels,
    listening_robots,
    owned_graphs,
    robots_of,
    scene_for,
)
from lab3_usd.sim.streams import (
    CLOCK,
    TRANSFORMS,
    advancing,
    closed,
    published,
    publishers,
    repeated,
    stamped,
    unheard_clock,
    unplayed,
    untold,
)
from lab3_usd.sim.timeline import record, uncollected

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
THROUGH = 0.02  # part of a range by which a ray may be longer
HASTE = 10.0  # times that a clock may run faster than the simulation, or slower
REPEATED = 4  # times that a transform comes which is no static one
# What a node says of commands for another robot, of the value of a moment, or of its own switch.
_PASSING: tuple[FaultKind, ...] = (
    "wrong-topic", "wrong-domain", "no-number-input", "switched-off",
)  # fmt: skip


class Played(Struct, frozen=True):
    """The results of a stage: its robots, a play of each (or one without any), the other checks."""

    robots: tuple[Robot, ...]
    plays: tuple[Judged, ...]
    whole: tuple[Check, ...]

    @property
    def has_commands(self) -> bool:
        """Whether a stage has nodes that hear or give commands, and nothing was driven by them."""
        causes = self.plays[0].trial.causes
        nodes = causes.program.nodes.values() if isinstance(causes, RunCauses) else ()
        return not self.robots and any(
            node.type.drives is not None or hears_commands(node.type) for node in nodes
        )

    @property
    def missing(self) -> str:
        """Return what a stage lacks to be driven; '' if something was driven."""
        if self.robots:
            return ""
        trial = self.plays[0].trial
        if isinstance(trial.causes, RunCauses) and trial.causes.robot is not None:
            return "no ROS command reaches the joints of a robot"
        return "no robot was found: no bodies that joints hold together"


@uncollected()
def play_any(scene: Scene, platform: Platform, drive: str | None, topic: str = "") -> Played:
    """Play a stage once for each of its robots, and judge what it shows.

    Raises:
        UsageError: the drive is none, or the topic is not that of a robot.
    """
    standing = standing_of(scene, has_ground=True)
    known = robots_of(scene, platform, topic, standing)
    robots = tuple(robot for robot in known if topic in ("", robot.commands.topic))
    plays: list[Judged] = []
    graphs_of = owned_graphs(known, scene)
    names = labels(robots) if len(robots) > 1 else [""]
    for number, (name, robot) in enumerate(zip(names, robots or (None,), strict=True)):
        legs = drive_for(robot, scene.meters_per_unit)
        if drive is not None and (robot is None or robot.kind == TWIST):
            legs = drive_of(drive, NO_LIMITS)
        # The first play shows all topics; the others, what concerns their robot.
        shown = scene_for(robot, graphs_of, scene, platform) if robot and number else scene
        play = record(shown, platform, legs, expected_of(robot), standing)
        if robot is not None and robot.kind != JOINTS:
            note_up_axis(play, scene)
        found = _checks_of(robot, known, play, scene) if robot is not None else ()
        plays.append(Judged(name, play, tuple(found)))
        if number:
            play.recording.forget_messages()
    first = plays[0].trial
    whole = [*_stage_checks(first, known)]
    if any(rival(robot, known) for robot in robots):
        whole.append(verdict("commands", list(commanded_once(known)), first))
    failures = list(_failing(plays, whole))
    if failures:
        others = [check for check in whole if check.name != "graphs"]
        whole = [verdict("graphs", [*graphs(first), *failures], first), *others]
    return Played(robots, tuple(plays), tuple(whole))


def _failing(plays: Sequence[Judged], whole: Sequence[Check]) -> Iterator[RunFault]:
    """Yield the nodes that fail to the end of every play, and that no check names."""
    told = {
        word
        for check in (*whole, *(check for play in plays for check in play.checks))
        if check.verdict != "ok"
        for word in (check.prim, *check.text.replace(";", " ").split())
    }
    known = [play.trial.causes for play in plays]
    causes = [each for each in known if isinstance(each, RunCauses)]
    for path in causes[0].program.nodes if causes else ():
        running = [each.program.nodes.get(path) for each in causes]
        failures = [node.failure for node in running if node is not None]
        if any(failure is None or failure.kind in _PASSING for failure in failures):
            continue
        cause = causes[0].broken(causes[0].program.nodes[path])
        if cause is not None and not {cause.prim, path} & told:
            yield RunFault(f"{path} fails", cause.kind or "not-executed", cause.prim, cause.reason)


def _checks_of(robot: Robot, robots: Sequence[Robot], play: Trial, scene: Scene) -> Iterator[Check]:
    """Yield the checks of a robot; what another command undoes is that one's fault."""
    if robot.machine is None:
        yield unmoved(robot, play)
        return
    if robot.reach.untold:
        named = ", ".join(f"{name} ({why})" for name, why in robot.reach.untold.items())
        play.recording.remarks.append(f"{robot.name}: not commanded on its topic: {named}")
    if play.scrubs and not (robot.wheel_base or robot.has_rollers):
        text = f"the wheels of {robot.name} slide in a turn: its angle is unknown"
        play.recording.remarks.append(text)
    if robot.kind == JOINTS:
        checks = arm_checks(play, scene, robot.machine, robot.controller)
    else:
        checks = _robot_checks(own_view(robot, robots, play, scene), robot, scene)
    other = rival(robot, robots)
    for check in checks:
        if other is not None and check.verdict == "bad" and check.name in DRIVEN:
            cause = f"it moves the same joints by what comes on {other.commands.topic}"
            yield replace(check, prim=other.controller, kind="several-commands", cause=cause)
        else:
            yield check


def commanded_joints(
    scene: Scene, platform: Platform, wanted: Expected
) -> tuple[Robot | None, tuple[Check, ...]]:
    """Play a stage with commands to the joints that a lab moves by them.

    Return the robot that listens to them, if any, and what its joints show.
    """
    topic, domain = wanted.joint_commands, wanted.domain
    listening = [each for each in listening_robots(scene, platform) if each.kind == JOINTS]
    at = (topic, domain)
    told = (each for each in listening if (each.commands.topic, each.commands.domain) == at)
    robot = next(told, None)
    seen = replace(expected_of(robot), commands=topic, domain=domain)
    play = record(scene, platform, drive_for(robot, scene.meters_per_unit), seen)
    if robot is None:
        text = f"commands on {topic} in domain {domain} move no joint"
        cause = play.causes.of_joints() if isinstance(play.causes, RunCauses) else None
        fault = RunFault(text, "does-not-move")
        if cause is not None:
            fault = RunFault(text, cause.kind or fault.kind, cause.prim, cause.reason)
        return None, (verdict("joints", [fault], play),)
    return robot, tuple(_checks_of(robot, listening, play, scene))


def _stage_checks(trial: Trial, robots: Sequence[Robot]) -> Iterator[Check]:
    """Yield the checks that concern no robot: graphs, and clock and TF of each domain."""
    recording = trial.recording
    if recording.fired or any(trial.causes.of_graphs() if trial.causes is not None else ()):
        yield verdict("graphs", list(graphs(trial)), trial)
    if any(publishers(trial)) or any(closed(trial)) or any(unplayed(trial)):
        faults = [*published(trial), *repeated(trial), *closed(trial), *untold(trial)]
        faults += hears_itself(trial, robots)
        faults += of_another(trial, robots)
        yield verdict("topics", faults, trial)
    if any(stamped(trial)):
        yield verdict("stamps", list(advancing(trial)), trial)
    if any(message.type == CAMERA_INFO for message in recording.messages):
        yield verdict("camera", list(pairs(trial)), trial)
    topics = dict.fromkeys(
        (message.type, domain_of(message, trial), message.topic)
        for message in recording.messages
        if message.type == CLOCK or (message.type == TRANSFORMS and not message.static)
    )
    there: dict[tuple[int, str], list[Message]] = {}
    kept: dict[int, list[Message]] = {}
    for message in recording.messages:
        domain = domain_of(message, trial)
        if not message.session and (message.type, domain, message.topic) in topics:
            there.setdefault((domain, message.topic), []).append(message)
        if not message.session and message.static:
            kept.setdefault(domain, []).append(message)
    for kind, domain, topic in sorted(topics):
        seen = _alone(trial, domain, topic, there.get((domain, topic), ()), kept.get(domain, ()))
        if kind == CLOCK:
            check = verdict("clock", [*running_clock(seen), *unheard_clock(seen, topics)], seen)
        else:
            count = sum(robot.commands.domain == domain for robot in robots)
            check = verdict("tree", list(one_tree(seen, count)), seen)
        several = sum(topic[0] == kind for topic in topics) > 1
        yield replace(check, of=f"{topic} in domain {domain}" if several else "")


def running_clock(trial: Trial) -> Iterator[RunFault]:
    """The clock runs on, in seconds; how fast, is up to the stage, within limits."""
    first = trial.recording.topic(trial.wanted.clock, 0)
    ran = first[-1].stamp - first[0].stamp if first else 0.0
    passed = first[-1].at - first[0].at if first else 0.0
    runs = passed / HASTE < ran < passed * HASTE
    for fault in clock(trial):
        if not (runs and fault.kind == "wrong-clock-rate"):
            yield fault


def _alone(
    trial: Trial, domain: int, topic: str, sent: Iterable[Message], kept: Sequence[Message]
) -> Trial:
    """Return the first play with what was sent on one topic, and with static transforms."""
    recording = Recording(
        trial.recording.seconds,
        [replace(message, away=None) for message in sent],
        trial.recording.path,
        static=kept_transforms(kept),
    )
    wanted = replace(trial.wanted, domain=domain, clock=topic, transforms=topic)
    return Trial(recording, trial.drive[:1], wanted, causes=trial.causes)


def one_tree(trial: Trial, robots: int) -> Iterator[RunFault]:
    """Each frame has one parent and one publisher, and there are no more trees than robots."""
    heard = build_tree(heard_transforms(trial, 0))
    if not heard.edges:
        return
    top = heard.roots[0]
    wanted = replace(trial.wanted, root=top, base=top)
    seen = Trial(trial.recording, trial.drive, wanted, causes=trial.causes)
    for fault in tree(seen):
        if fault.kind != "disconnected-frame" or len(heard.parts) > max(1, robots):
            yield fault


def _robot_checks(trial: Trial, robot: Robot, scene: Scene) -> Iterator[Check]:
    """Yield the checks of a robot: its motion, odometry, TF and sensors."""
    wanted, legs = trial.wanted, trial.drive[0].legs
    odometry_came = trial.recording.topic(wanted.odometry, 0)
    scan_came = _scans(trial)
    has_base = trial.recording.topic(wanted.transforms, 0)
    machine = robot.machine
    asked: dict[str, tuple[CheckFunction, object]] = {
        "rest": (rest, True),
        "follows": (
            lambda seen: follows_command(seen, robot),
            any(leg.command and any(leg.command[::2]) for leg in legs),
        ),
        "odometry": (odometry, odometry_came),
        "tree": (apart, has_base and any(apart(trial))),
        "moving frames": (moving, has_base),
        "mounted": (
            lambda seen: own_frames(seen, scene, machine) if machine is not None else iter(()),
            has_base and machine is not None and carried_streams(trial, scene, machine),
        ),
        "scan": (placed_scan, scan_came),
        "again": (lambda seen: follows_after_replay(seen, robot), len(trial.drive) > 1),
    }
    yield from judge(trial, {name: check for name, (check, is_asked) in asked.items() if is_asked})


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
            text += f"{trial.wanted.transforms}: no listener hears both"
            yield RunFault(text, "disconnected-frame", edges[lost])


def moving(trial: Trial) -> Iterator[RunFault]:
    """TF moves the base as the robot moves."""
    wanted = trial.wanted
    messages = _moving_messages(trial)
    for message in messages[len(messages) // 4 :: max(1, len(messages) // 4)]:
        base = Message("", message.stamp, wanted.base, at=message.at, session=message.session)
        place, pose = in_root(trial, base), trial.pose(message)
        if place is None:
            continue
        stands = trial.start.then(place)
        level = Affine(about(AXES[2], heading(stands)), stands.origin)
        actual = Affine(about(AXES[2], pose.heading), (pose.x, pose.y, stands.origin[2]))
        if not agree(level, actual):
            text = f"{wanted.root} -> {wanted.base} does not move with the robot"
            yield RunFault(text, "transform-unlike-odometry", message.node)
            return


def _scans(trial: Trial) -> list[tuple[Message, Scan]]:
    """Return the scans of the first session, whatever else comes on their topic."""
    messages = trial.recording.topic(trial.wanted.scan, 0)
    return [(message, message.data) for message in messages if isinstance(message.data, Scan)]


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
    frame, found = trial.wanted.base, messages
    for _ in up:
        sent = with_frame.get(frame, [])
        found = sent if REPEATED < len(sent) < len(found) else found
        frame = up.get(frame, "")
    return found


def placed_scan(trial: Trial) -> Iterator[RunFault]:
    """Scans end before walls where TF puts the lidar; what stands nearer may be the robot."""
    message, seen = _scans(trial)[-1]
    place = in_root(trial, message)
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
