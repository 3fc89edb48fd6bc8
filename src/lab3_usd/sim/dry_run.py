"""A dry run: opens a stage, plays it, and sums up what it did."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from lab3_usd.deliverables.maps import MapError, map_of_stage
from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import HERE, Behaviour, Check, Driven, Scene, Unknown
from lab3_usd.model.physics import BODY_API
from lab3_usd.sim.any_stage import Played, commanded_joints, play_any
from lab3_usd.sim.commands import as_of_kind
from lab3_usd.sim.execution.drive import NO_LIMITS, drive_of, fixed_drive
from lab3_usd.sim.judge.checks import asked_checks
from lab3_usd.sim.judge.expectations import Expected, Trial
from lab3_usd.sim.judge.localization import fit
from lab3_usd.sim.judge.topics import expected_at, expected_of_each
from lab3_usd.sim.outcome import DryRun, behaviour_of, judge_each, sent_frames, sent_topics
from lab3_usd.sim.robots import TWIST, drive_for, robot_of_kind
from lab3_usd.sim.timeline import record
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import stands_within


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
    if drive is not None:
        drive_of(drive, NO_LIMITS)  # which is refused before a stage is opened
    try:
        scene = scene_of(path, lab.platform)
    except StageError as error:
        reason = str(error).removeprefix(f"{path}: ")
        unknown = (Unknown("/", reason),)
        return DryRun(Behaviour(str(path), checkpoint, 0.0, "unreadable", not_simulated=unknown))
    if checkpoint:
        run = _at_checkpoint(path, scene, (lab, checkpoint), drive, maps)
    else:
        run = _by_itself(play_any(scene, lab.platform, drive, topic))
    behaviour = replace(run.behaviour, stage=str(path), checkpoint=checkpoint)
    return replace(run, behaviour=behaviour, scene=scene)


def _by_itself(played: Played) -> DryRun:
    """Return the results of a stage that is judged by what it shows itself."""
    first = played.plays[0].trial
    sent = first.recording.messages
    behaviour = behaviour_of(played.plays, played.whole)
    verdict, missing = behaviour.verdict, behaviour.missing
    if verdict == "ok" and played.has_commands:
        verdict, missing = "not judged", played.missing
    elif not played.robots and verdict == "not judged":
        missing = played.missing
    unasked = [f"nothing is driven: {played.missing}"] if played.missing and not missing else []
    behaviour = replace(
        behaviour,
        verdict=verdict,
        missing=missing,
        topics=tuple(sent_topics(sent, first)),
        frames=tuple(sent_frames(sent)),
        path=behaviour.path if played.robots else (),
        remarks=(*behaviour.remarks, *unasked),
        robots=tuple(
            Driven(robot.name, robot.commands.topic, robot.commands.domain)
            for robot in played.robots
        ),
    )
    return DryRun(behaviour, {each.name: each.trial for each in played.plays})


def _at_checkpoint(
    path: Path, scene: Scene, asked_by: tuple[Lab, str], drive: str | None, maps: Path | None
) -> DryRun:
    """Return the results of a stage that is judged by what a lab asks for."""
    lab, checkpoint = asked_by[0], asked_by[0].checkpoints[asked_by[1]]
    asked = expected_of_each(lab, checkpoint)
    trials: dict[str, Trial] = {}
    of_joints: list[tuple[Check, ...]] = []
    driven: list[Driven] = []
    for name, wanted in asked.items():
        trials[name] = _played_for(scene, lab, name, wanted, drive)
        if checkpoint.localization and (not name or wanted.root == lab.frames.root):
            _lay_on_map(trials[name], path, maps, lab)
        shown: tuple[Check, ...] = ()
        if wanted.joint_commands:
            robot, shown = commanded_joints(scene, lab.platform, wanted)
            of = wanted.joint_commands if wanted.commands else ""
            shown = tuple(replace(check, of=of) for check in shown)
            if robot is not None:
                driven.append(Driven(robot.name, wanted.joint_commands, wanted.domain))
        of_joints.append(shown)
    first = next(iter(trials.values()))
    shared = replace(first, wanted=expected_at(lab, checkpoint))
    judged, whole = judge_each(trials, shared, asked_checks)
    pairs = zip(judged, of_joints, strict=True)
    robots = [replace(each, checks=(*each.checks, *shown)) for each, shown in pairs]
    sent = [message for message in first.recording.messages if message.away is None]
    behaviour = replace(
        behaviour_of(robots, whole, " with the radius of the lab"),
        topics=tuple(sent_topics(sent, first)),
        frames=tuple(sent_frames(sent)),
        robots=tuple(driven),
    )
    if not behaviour.checks and not checkpoint.graphs:
        missing = _nothing_yet(lab, checkpoint.id)
        behaviour = replace(behaviour, missing=missing, is_early=True)
    return DryRun(behaviour, trials)


def _played_for(scene: Scene, lab: Lab, name: str, wanted: Expected, drive: str | None) -> Trial:
    """Play a stage with the commands of a robot of the lab, as its base can follow them."""
    robot = robot_of_kind(scene, lab.platform, wanted)
    if robot is not None and (drive is None or robot.kind != TWIST):
        sessions = drive_for(robot, scene.meters_per_unit)
    elif drive is not None:
        sessions = drive_of(drive, wanted.limits)
    else:
        stays = wanted.goes_with_environment
        fixed = fixed_drive(wanted.limits)
        sessions = tuple(each for each in fixed if not (stays and each.environment))
    watched = watched_body(wanted, name, scene, lab)
    return as_of_kind(record(scene, lab.platform, sessions, watched), robot, scene)


def watched_body(wanted: Expected, name: str, scene: Scene, lab: Lab) -> Expected:
    """Return what is expected of one of several robots, by a body that it has in the stage."""
    robot = next((robot for robot in lab.scene.robots if name and robot.title == name), None)
    if robot is None:
        return wanted
    bodies = [path for path, prim in scene.prims.items() if BODY_API in prim.apis]
    own = sorted(path for path in bodies if stands_within(path, robot.path))
    known = (path for path in (robot.base, *robot.link_paths, *own) if path in bodies)
    return replace(wanted, robot=next(known, robot.base))


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
