"""A dry run: opens a stage, plays it, and sums up what it did."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.deliverables.maps import MapError, map_of_stage
from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import HERE, Behaviour, Check, Driven, Scene, Unknown
from lab3_usd.sim.any_stage import Played, joint_checks, play_any
from lab3_usd.sim.execution.drive import NO_LIMITS, drive_of
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.expectations import Trial
from lab3_usd.sim.judge.localization import fit
from lab3_usd.sim.judge.topics import expected_at, expected_of_each
from lab3_usd.sim.outcome import (
    DryRun,
    Judged,
    behaviour_of,
    judge_each,
    sent_frames,
    sent_topics,
)
from lab3_usd.sim.plays import asked_plays
from lab3_usd.sim.robots import Robot, hears_commands
from lab3_usd.spec.lab import Lab


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
    sent = played.plays[0].trial.recording.messages
    run = _summed_up(played.plays, played.whole, played.robots, sent)
    if played.robots:
        return run
    causes, behaviour = played.plays[0].trial.causes, run.behaviour
    types = [node.type for node in played.plays[0].trial.nodes.values()]
    is_commanded = any(kind.drives is not None or hears_commands(kind) for kind in types)
    why = "no robot was found: no bodies that joints hold together"
    if causes is not None and causes.robot is not None:
        why = "no ROS command reaches the joints of a robot"
    behaviour = replace(behaviour, path=())
    if behaviour.verdict == "not judged" or (behaviour.verdict == "ok" and is_commanded):
        behaviour = replace(behaviour, verdict="not judged", missing=why)
    else:
        remarks = (*behaviour.remarks, f"nothing is driven: {why}")
        behaviour = replace(behaviour, remarks=remarks)
    return replace(run, behaviour=behaviour)


def _summed_up(
    judged: Sequence[Judged],
    whole: Sequence[Check],
    robots: Iterable[Robot],
    sent: Sequence[Message],
    radius_of: str = "",
) -> DryRun:
    """Return the results of plays: what was sent is that of the first, `robots` are named."""
    behaviour = replace(
        behaviour_of(judged, whole, radius_of),
        topics=tuple(sent_topics(sent, judged[0].trial)),
        frames=tuple(sent_frames(sent)),
        robots=tuple(
            Driven(robot.name, robot.commands.topic, robot.commands.domain) for robot in robots
        ),
    )
    return DryRun(behaviour, {each.name: each.trial for each in judged})


def _at_checkpoint(
    path: Path, scene: Scene, asked_by: tuple[Lab, str], drive: str | None, maps: Path | None
) -> DryRun:
    """Return the results of a stage that is judged by what a lab asks for."""
    lab, checkpoint = asked_by[0], asked_by[0].checkpoints[asked_by[1]]
    trials: dict[str, Trial] = {}
    of_joints: dict[str, list[Check]] = {}
    arms: list[Robot] = []
    for play in asked_plays(scene, lab, expected_of_each(lab, checkpoint), drive):
        trial = play.recorded(scene, lab.platform)
        if play.is_of_joints:
            of = play.wanted.commands if trials[play.name].wanted.commands else ""
            shown = joint_checks(play, trial, scene)
            of_joints[play.name] = [replace(check, of=of) for check in shown]
            arms += [] if play.robot is None else [play.robot]
            continue
        if checkpoint.localization and (not play.name or play.wanted.root == lab.frames.root):
            _lay_on_map(trial, path, maps, lab)
        trials[play.name] = trial
    first = next(iter(trials.values()))
    shared = replace(first, wanted=expected_at(lab, checkpoint))
    judged, whole = judge_each(trials, shared)
    judged = [
        replace(each, checks=(*each.checks, *of_joints.get(each.name, ()))) for each in judged
    ]
    sent = [message for message in first.recording.messages if message.away is None]
    run = _summed_up(judged, whole, arms, sent, " with the radius of the lab")
    if not run.behaviour.checks and not checkpoint.graphs:
        missing = _nothing_yet(lab, checkpoint.id)
        return replace(run, behaviour=replace(run.behaviour, missing=missing, is_early=True))
    return run


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
