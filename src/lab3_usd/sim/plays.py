"""What is played of a stage: the robots, the commands that drive each, and what is expected of it.

A lab says whom it expects where; without one the stage shows who listens to which commands.
"""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import JOINT_STATES, TWIST
from lab3_usd.model.dry_run import Scene
from lab3_usd.model.physics import BODY_API
from lab3_usd.sim.commands import as_of_kind
from lab3_usd.sim.execution.drive import Session, drive_of, fixed_drive
from lab3_usd.sim.execution.world import Standing
from lab3_usd.sim.judge.expectations import Expected, Trial
from lab3_usd.sim.robots import (
    ROLLERS,
    WHEEL_BASE,
    Robot,
    drive_for,
    expected_of,
    labels,
    listening_robots,
    robots_of,
)
from lab3_usd.sim.timeline import Player, played, trial_of
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import stands_within


class Play(Struct, frozen=True):
    """A play of one robot by name, '' for the only one: its drive, and what is expected of it.

    Without a robot it is one on two wheels, or there is none.
    """

    name: str
    wanted: Expected
    drive: tuple[Session, ...]
    robot: Robot | None = None
    among: tuple[Robot, ...] = ()  # the robots that listen in the stage, as far as anybody looked

    @property
    def is_of_joints(self) -> bool:
        """Whether its commands say where joints are to go."""
        return bool(self.wanted.commands) and self.wanted.commands == self.wanted.joint_commands

    def recorded(self, scene: Scene, platform: Platform, standing: Standing | None = None) -> Trial:
        """Play it, and return what is judged of it."""
        return self.shown_by(played(scene, platform, self.drive, self.wanted, standing))

    def shown_by(self, player: Player) -> Trial:
        """Return what is judged of it, where somebody has played it."""
        trial = trial_of(player, self.drive, self.wanted)
        return trial if self.is_of_joints else as_of_kind(trial, self.robot, player.world.scene)


def asked_plays(
    scene: Scene, lab: Lab, each: Mapping[str, Expected], drive: str | None = None
) -> list[Play]:
    """Return what is played by what a lab expects of each robot by name.

    The joints that it moves by commands have a play of their own.
    """
    robots: tuple[Robot, ...] = ()
    if any(wanted.joint_commands for wanted in each.values()) or _may_go_otherwise(scene, lab):
        robots = tuple(listening_robots(scene, lab.platform))
    plays = []
    for name, wanted in each.items():
        told = (robot for robot in robots if robot.hears(wanted.commands, wanted.domain))
        robot = next((robot for robot in told if robot.goes_otherwise), None)
        seen = _watched(wanted, name, scene, lab)
        plays.append(_driven(name, seen, robot, scene, drive, fixed_drive(wanted.limits)))
        topic = wanted.joint_commands
        if topic:
            told = (robot for robot in robots if robot.hears(topic, wanted.domain))
            arm = next((robot for robot in told if robot.kind == JOINT_STATES), None)
            seen = replace(expected_of(arm), commands=topic, joint_commands=topic)
            plays.append(_driven(name, replace(seen, domain=wanted.domain), arm, scene))
    return [replace(play, among=robots) for play in plays]


def _may_go_otherwise(scene: Scene, lab: Lab) -> bool:
    """Whether a node has an input that only controllers of cars, or of rollers, have."""
    types = {node.type for graph in scene.graphs for node in graph.nodes}
    node_types = [kind for kind in map(lab.platform.get, types) if kind is not None]
    return any(kind.port(INPUT + name) for kind in node_types for name in (ROLLERS, WHEEL_BASE))


def shown_plays(
    scene: Scene,
    platform: Platform,
    standing: Standing,
    drive: str | None = None,
    topic: str = "",
) -> list[Play]:
    """Return what is played by what a stage shows: one play of each of its robots, or without any.

    Raises:
        UsageError: the drive is none, or the topic is not that of a robot.
    """
    robots = robots_of(scene, platform, topic, standing)
    driven = [robot for robot in robots if topic in ("", robot.commands.topic)]
    names = labels(driven) if len(driven) > 1 else [""]
    plays = (
        _driven(name, expected_of(robot), robot, scene, drive)
        for name, robot in zip(names, driven or (None,), strict=True)
    )
    return [replace(play, among=robots) for play in plays]


def _driven(
    name: str,
    wanted: Expected,
    robot: Robot | None,
    scene: Scene,
    drive: str | None = None,
    usual: tuple[Session, ...] = (),
) -> Play:
    """Return the play of a robot as its base can follow it; one on two wheels is driven as usual.

    A drive says how fast to go and to turn: cars and joints are asked otherwise.
    """
    if drive is not None and (robot is None or robot.kind == TWIST):
        return Play(name, wanted, drive_of(drive, wanted.limits), robot)
    if robot is not None or not usual:
        return Play(name, wanted, drive_for(robot, scene.meters_per_unit), robot)
    stays = wanted.goes_with_environment
    legs = tuple(session for session in usual if not (stays and session.environment))
    return Play(name, wanted, legs)


def _watched(wanted: Expected, name: str, scene: Scene, lab: Lab) -> Expected:
    """Return what is expected of one of several robots, by a body that it has in the stage."""
    robot = next((robot for robot in lab.scene.robots if name and robot.title == name), None)
    if robot is None:
        return wanted
    bodies = [path for path, prim in scene.prims.items() if BODY_API in prim.apis]
    own = sorted(path for path in bodies if stands_within(path, robot.path))
    body_paths = (path for path in (robot.base, *robot.link_paths, *own) if path in bodies)
    return replace(wanted, robot=next(body_paths, robot.base))
