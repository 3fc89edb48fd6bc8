"""A dry run: opens a stage, plays it, and sums up what it did."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.deliverables.maps import MapError, map_of_stage
from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import (
    FOLLOWS,
    HERE,
    Behaviour,
    Check,
    Driven,
    Frame,
    Leg,
    Replay,
    Scene,
    Topic,
    Unknown,
)
from lab3_usd.model.physics import BODY_API
from lab3_usd.sim.any_stage import Played, commanded_joints, play_any
from lab3_usd.sim.commands import as_of_kind, domain_of
from lab3_usd.sim.execution.drive import RATE, drive_of, fixed_drive
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.checks import OF_STAGE, judge, whole_verdict
from lab3_usd.sim.judge.expectations import Expected, Stretch, Trial, displacement
from lab3_usd.sim.judge.localization import fit
from lab3_usd.sim.judge.motion import leg_fault
from lab3_usd.sim.judge.sensors import rate_of
from lab3_usd.sim.judge.topics import expected_at, expected_of_each
from lab3_usd.sim.replay import replay
from lab3_usd.sim.robots import TWIST, Robot, drive_for, expected_of, labels, robot_of_kind
from lab3_usd.sim.timeline import record
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import stands_within

EVERY = 6  # frames of the path, for each kept one


def outcome(stage: str, checkpoint: str, trial: Trial) -> Behaviour:
    """Return the results of a run, judged by the requirements of its checkpoint."""
    checks = tuple(check for check in judge(trial) if is_asked(check.name, trial))
    return _outcome(stage, checkpoint, trial, checks)


def outcome_of_robots(
    stage: str, checkpoint: str, plays: Mapping[str, Trial], everything: Expected
) -> Behaviour:
    """Return the results of the plays of several robots, by name.

    What the stage shows as a whole is judged by `everything` that the lab asks for, in the first.
    """
    first = next(iter(plays.values()))
    whole = replace(first, wanted=everything)
    checks = [c for c in judge(whole) if c.name in OF_STAGE and is_asked(c.name, whole)]
    legs: list[Leg] = []
    for name, trial in plays.items():
        own = [c for c in judge(trial) if c.name not in OF_STAGE and is_asked(c.name, trial)]
        checks += [replace(check, of=name) for check in own]
        legs += [replace(leg, name=f"{name}: {leg.name}") for leg in driven_legs(trial, own)]
    behaviour = _outcome(stage, checkpoint, whole, tuple(checks))
    remarks = [f"{name}: {text}" for name, play in plays.items() for text in _remarks(play, checks)]
    sizes = [
        f"{name}: {text}"
        for name, play in plays.items()
        for text in _sizes(play, " with the radius of the lab")
    ]
    return replace(
        behaviour,
        seconds=sum(play.recording.seconds for play in plays.values()),
        legs=tuple(legs),
        remarks=tuple(remarks),
        sizes=tuple(sizes),
        fit=next((play.fit for play in plays.values() if play.fit is not None), None),
    )


def _outcome(stage: str, checkpoint: str, trial: Trial, checks: tuple[Check, ...]) -> Behaviour:
    recording = trial.recording
    reasons = {**recording.not_simulated, **recording.assumed}
    verdict, missing = whole_verdict(checks)
    return Behaviour(
        stage,
        checkpoint,
        recording.seconds,
        verdict,
        tuple(_topics((each for each in recording.messages if each.away is None), trial)),
        tuple(_frames(trial)),
        checks,
        tuple(path_rows(trial)),
        tuple(Unknown(prim, reasons[prim]) for prim in sorted(reasons)),
        tuple(driven_legs(trial, checks)),
        tuple(_remarks(trial, checks)),
        missing=missing,
        fit=trial.fit,
        sizes=tuple(_sizes(trial, " with the radius of the lab")),
    )


def outcome_of_any(stage: str, played: Played) -> Behaviour:
    """Return the results of a stage without a checkpoint, judged by themselves."""
    first = played.plays[0]
    verdict, missing = whole_verdict(played.checks)
    if verdict == "ok" and played.has_commands:
        verdict, missing = "not judged", played.missing
    elif not played.robots and verdict == "not judged":
        missing = played.missing
    recording = first.recording
    reasons = {**recording.not_simulated, **recording.assumed}
    unasked = [f"nothing is driven: {played.missing}"] if played.missing and not missing else []
    several = len(played.robots) > 1
    legs = (
        replace(leg, name=f"{label}: {leg.name}" if several else leg.name)
        for label, play in zip(labels(played.robots), played.plays, strict=False)
        for leg in driven_legs(play, played.checks)
    )
    everywhere = replace(
        first, recording=replace(recording, messages=[*map(_at_home, recording.messages)])
    )
    remarks = [remark for play in played.plays for remark in _remarks(play, played.checks)]
    remarks += unasked
    remarks += [
        f"the wheels of {robot.name} slide in a turn: its angle is unknown"
        for robot, play in zip(played.robots, played.plays, strict=False)
        if play.scrubs and not (robot.wheel_base or robot.has_rollers)
    ]
    return Behaviour(
        stage,
        "",
        sum(play.recording.seconds for play in played.plays),
        verdict,
        tuple(_topics(recording.messages, first)),
        tuple(_frames(everywhere)),
        played.checks,
        tuple(path_rows(first)) if played.robots else (),
        tuple(Unknown(prim, reasons[prim]) for prim in sorted(reasons)),
        tuple(legs),
        tuple(dict.fromkeys(remarks)),
        missing=missing,
        robots=tuple(
            Driven(robot.name, robot.commands.topic, robot.commands.domain)
            for robot in played.robots
        ),
        sizes=tuple(dict.fromkeys(text for play in played.plays for text in _sizes(play))),
    )


def _at_home(message: Message) -> Message:
    """Return a message with the domain of the lab."""
    return replace(message, away=None)


def is_asked(name: str, trial: Trial) -> bool:
    """Whether a checkpoint and the drive ask for what a check looks at, and something came."""
    wanted = trial.wanted
    topics = {
        "clock": (wanted.clock,),
        "stamps": (wanted.clock,),
        "odometry": (wanted.odometry,),
        "tree": (wanted.transforms,),
        "moving frames": (wanted.odometry, wanted.transforms),
        "mounted": (wanted.transforms, wanted.scan or wanted.image),
        "scan": (wanted.scan,),
        "camera": (wanted.image, wanted.info),
    }
    if name == "map":
        return trial.fit is not None or bool(trial.map_fault)
    if name in topics:
        return all(topic and trial.recording.topic(topic) for topic in topics[name])
    if name == "graphs":
        dead = trial.causes.of_graphs() if trial.causes is not None else ()
        return bool(trial.recording.fired) or any(dead)
    if name == "topics":
        return bool(wanted.types)
    legs = trial.drive[0].legs
    driven = {
        "follows": any(leg.command and any(leg.command[::2]) for leg in legs),
        "limits": any(leg.name in {"fast", "spin"} for leg in legs) and any(wanted.limits),
        "again": len(trial.drive) > 1,
    }
    return bool(wanted.commands) and driven.get(name, True)


def _topics(sent: Iterable[Message], trial: Trial) -> Iterator[Topic]:
    """Yield the topics of the messages of the first session, by name."""
    streams: dict[tuple[str, str, int], list[Message]] = {}
    for message in sent:
        if not message.session:
            key = (message.topic, message.type, domain_of(message, trial))
            streams.setdefault(key, []).append(message)
    for (topic, kind, domain), messages in sorted(streams.items()):
        frames = dict.fromkeys(message.frame for message in messages if message.frame)
        yield Topic(topic, kind, round(rate_of(messages), 2), ", ".join(frames), domain=domain)


def _frames(trial: Trial) -> Iterator[Frame]:
    """Yield each transform once, as tf2 takes it, in the order in which they are sent."""
    seen: dict[Frame, None] = {}
    for message in trial.recording.messages:
        for frames in message.frames if message.away is None else ():
            seen.setdefault(Frame(*frames, message.static))
    yield from seen


def path_rows(trial: Trial) -> Iterator[tuple[float, float, float, float]]:
    """Yield where the robot was, in seconds since the first Play."""
    for number, pose in enumerate(trial.recording.path):
        if number % EVERY == 0:
            seconds = (number + 1) / RATE
            yield (round(seconds, 3), round(pose.x, 4), round(pose.y, 4), round(pose.heading, 4))


def driven_legs(trial: Trial, checks: Sequence[Check] = ()) -> Iterator[Leg]:
    """Yield what was commanded and driven in each leg of the first session that has a command."""
    if not trial.wanted.commands:
        return
    stretches = list(trial.stretches(*{leg.name for leg in trial.drive[0].legs}))
    for stretch, fault in zip(stretches, _leg_faults(trial, stretches, checks), strict=True):
        leg, before, poses = stretch
        if leg.command is None or not any(leg.command):
            continue
        ahead, aside, _ = displacement(before, poses[-1])
        commanded = (leg.forward * leg.seconds, math.degrees(leg.turn * leg.seconds))
        if leg.name == "aside":
            commanded, ahead = (leg.command[1] * leg.seconds, 0.0), aside
        driven = (round(ahead, 3) + 0.0, round(math.degrees(stretch.turned), 1) + 0.0)
        yield Leg(leg.name, leg.seconds, commanded, driven, fault)


def _leg_faults(
    trial: Trial, stretches: Sequence[Stretch], checks: Sequence[Check]
) -> Iterator[str]:
    """Yield what is wrong with each leg, '' for nothing that a failed check speaks of."""
    messages = "; ".join(check.message for check in checks if check.verdict == "bad")
    faults = [
        leg_fault(trial, stretch) if messages and stretch.leg.command else None
        for stretch in stretches
    ]
    # A check names the first of several legs that are wrong in the same way.
    kinds = {fault.kind for fault in faults if fault is not None and fault.message in messages}
    is_all = "does not move" in messages
    for fault in faults:
        is_known = fault is not None and fault.sure and (is_all or fault.kind in kinds)
        yield fault.message if fault is not None and is_known else ""


def _sizes(trial: Trial, of_lab: str = "") -> Iterator[str]:
    """Yield how far wheels of another radius than their controller has take the robot."""
    if trial.recording.radii is None:
        return
    wheel, stated = trial.recording.radii
    far = wheel / stated
    if far <= 0.0:
        return  # a check says that it stands, or which way it goes
    text = f"the wheels measure {wheel:g} m and the controller has {stated:g} m: the robot goes"
    is_expected = abs(far / trial.factor - 1.0) <= FOLLOWS
    yield f"{text} {far:.2f} times as far as commanded" + (
        f", as expected{of_lab}" if is_expected else ""
    )


def _remarks(trial: Trial, checks: Sequence[Check]) -> Iterator[str]:
    """Yield what else is known of the robot."""
    blocked = next((pose for pose in trial.recording.path if pose.blocked), None)
    if blocked is not None:
        yield f"{blocked.blocked} stops the robot while it is commanded to go {blocked.leg}"
    if trial.fit is not None:
        yield trial.fit.text
    yield from trial.recording.remarks
    if trial.recording.not_simulated and any(check.verdict == "not judged" for check in checks):
        yield "apparent faults may come from parts that are not simulated, and are not counted"


class DryRun(Struct, frozen=True):
    """The results of a dry run, its scene, and its plays by the robot that is driven.

    The only play has no name; an unreadable stage has none. `robots` are those of a stage without a
    checkpoint.
    """

    behaviour: Behaviour
    plays: Mapping[str, Trial] = {}
    scene: Scene | None = None
    robots: tuple[Robot, ...] = ()

    @property
    def trial(self) -> Trial | None:
        """The first play."""
        return next(iter(self.plays.values()), None)

    @property
    def replays(self) -> dict[str, Replay]:
        """The data of the drawings of each play that has some."""
        drawn = {name: replay(trial) for name, trial in self.plays.items()}
        return {name: each for name, each in drawn.items() if each.moments}


def scene_of(path: Path, platform: Platform) -> Scene:
    """Open a stage, and return what is needed to play it.

    Raises:
        StageError: it cannot be read.
    """
    from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
    from lab3_usd.stage.read.scene import read_scene

    with quiet(), stage_errors(path):
        return read_scene(open_stage(path), platform)


def dry_run(
    path: Path,
    lab: Lab,
    checkpoint: str,
    drive: str | None = None,
    topic: str = "",
    maps: Path | None = None,
) -> DryRun:
    """Play a stage and judge what it does by what the lab asks for at a checkpoint.

    Without a checkpoint it is judged by what it shows itself, driven over the topic, if one is
    named, else over those that its robots listen to. `maps` is where its map is, a folder or a
    file; without it that beside the stage is taken, else the lab's.

    Raises:
        UsageError: the drive is none, or the topic is not that of a robot.
    """
    asked = {"": expected_of(None)}
    if checkpoint:
        asked = expected_of_each(lab, lab.checkpoints[checkpoint])
    drives = {
        name: fixed_drive(wanted.limits) if drive is None else drive_of(drive, wanted.limits)
        for name, wanted in asked.items()
    }
    try:
        scene = scene_of(path, lab.platform)
    except StageError as error:
        reason = str(error).removeprefix(f"{path}: ")
        unknown = (Unknown("/", reason),)
        return DryRun(Behaviour(str(path), checkpoint, 0.0, "unreadable", not_simulated=unknown))
    platform = lab.platform
    if not checkpoint:
        played = play_any(scene, platform, drive, topic)
        names = labels(played.robots) if len(played.robots) > 1 else [""]
        by_name = dict(zip(names, played.plays, strict=False))
        return DryRun(outcome_of_any(str(path), played), by_name, scene, played.robots)
    plays = {}
    for name, wanted in asked.items():
        stays = wanted.goes_with_environment
        robot = robot_of_kind(scene, platform, wanted)
        sessions = tuple(s for s in drives[name] if not (stays and s.environment))
        if robot is not None and (drive is None or robot.kind != TWIST):
            sessions = drive_for(robot, scene.meters_per_unit)
        watched = watched_body(wanted, name, scene, lab)
        plays[name] = as_of_kind(record(scene, platform, sessions, watched), robot)
        is_localized = lab.checkpoints[checkpoint].localization
        if is_localized and (not name or wanted.root == lab.frames.root):
            _lay_on_map(plays[name], path, maps, lab)
    trial = next(iter(plays.values()))
    if "" in plays:
        behaviour = outcome(str(path), checkpoint, trial)
    else:
        everything = expected_at(lab, lab.checkpoints[checkpoint])
        behaviour = outcome_of_robots(str(path), checkpoint, plays, everything)
    for name, wanted in asked.items():
        if wanted.joint_commands:
            behaviour = _with_joints(behaviour, scene, platform, wanted, name)
    if not behaviour.checks and not lab.checkpoints[checkpoint].graphs:
        behaviour = replace(behaviour, missing=_nothing_yet(lab, checkpoint), is_early=True)
    return DryRun(behaviour, plays, scene)


def watched_body(wanted: Expected, name: str, scene: Scene, lab: Lab) -> Expected:
    """Return what is expected of one of several robots, by a body that it has in the stage."""
    robot = next((robot for robot in lab.scene.robots if name and robot.title == name), None)
    if robot is None:
        return wanted
    bodies = [path for path, prim in scene.prims.items() if BODY_API in prim.apis]
    own = sorted(path for path in bodies if stands_within(path, robot.path))
    known = (path for path in (robot.base, *robot.link_paths, *own) if path in bodies)
    return replace(wanted, robot=next(known, robot.base))


def _with_joints(
    behaviour: Behaviour, scene: Scene, platform: Platform, wanted: Expected, name: str
) -> Behaviour:
    """Add what the joints show that the lab moves by commands of their own."""
    robot, shown = commanded_joints(scene, platform, wanted)
    of = name or (wanted.joint_commands if wanted.commands else "")
    checks = (*behaviour.checks, *(replace(check, of=of) for check in shown))
    verdict, missing = whole_verdict(checks)
    topic, domain = wanted.joint_commands, wanted.domain
    driven = (Driven(robot.name, topic, domain),) if robot is not None else ()
    robots = (*behaviour.robots, *driven)
    return replace(behaviour, checks=checks, verdict=verdict, missing=missing, robots=robots)


def _nothing_yet(lab: Lab, checkpoint: str) -> str:
    """Name the first checkpoint with graphs, for one without."""
    numbers = list(lab.checkpoints)
    later = numbers[numbers.index(checkpoint) :]
    first = next((number for number in later if lab.checkpoints[number].graphs), None)
    if first is None:
        return "nothing to run: the lab asks for no graphs"
    return f"nothing to run yet: the graphs come with checkpoint {first}"


def _lay_on_map(trial: Trial, path: Path, maps: Path | None, lab: Lab) -> None:
    """Note how the scans lie on the map, whose frame is the world's or that of the start."""
    try:
        trial.map = map_of_stage(path, maps, lab)
    except MapError as error:
        trial.map_fault = str(error)
    trial.located = ([(0.0, trial.start)], [(0.0, HERE)])
    trial.fit = fit(trial)
