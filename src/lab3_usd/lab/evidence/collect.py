"""Writes the bash script that saves the output of every diagnostic command."""

from __future__ import annotations

import re
import shlex

from lab3_usd.lab.evidence.reader import MANIFEST
from lab3_usd.lab.fill import fill_template
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import Command, GoalSpec, RosSpec

SCRIPT = "collect.sh"
RESULTS = "results"
GOAL_FILE = "goal.txt"
GOAL_POSE_FILE = "goal_pose.txt"
DAEMON_FILE = "daemon.txt"
ROBOT_BEFORE_FILE = "goal_robot_before.txt"
BAG = "recording"
# The topics of goals are hidden ones; images are large, and their info says when they came.
_RECORD = ("ros2", "bag", "record", "--all", "--include-hidden-topics")
_IMAGE = "sensor_msgs/msg/Image"


def collect_script(lab: Lab) -> str:
    """Return the script for the commands of `ros.yaml`, each with its time limit."""
    ros = lab.ros
    frames = next((each for each in ros.commands if each.kind.name == "view_frames"), None)
    return fill_template(
        "collect.sh.j2",
        script=SCRIPT,
        lab=lab.title,
        results=next(iter(lab.submission.folders.shown), RESULTS),
        navigation=ros.navigation is not None,
        manifest=MANIFEST,
        setup=shlex.quote(ros.system.setup),
        domain=ros.system.domain,
        distribution=ros.system.distribution,
        commands=[_line(command) for command in ros.commands],
        goal=None if ros.goal is None else _goal(ros, ros.goal),
        no_goal=shlex.quote(f"{SCRIPT}: {lab.title} has no navigation goal to wait for"),
        goal_file=GOAL_FILE,
        pose_file=GOAL_POSE_FILE,
        daemon_file=DAEMON_FILE,
        robot_before=ROBOT_BEFORE_FILE,
        bag=BAG,
        record_bag=shlex.join([*_RECORD, *_without_images(ros)]),
        frames=None if frames is None else _frames(frames),
    )


def _without_images(ros: RosSpec) -> list[str]:
    """Return the options of `ros2 bag record` that leave the lab's images out."""
    images = [re.escape(each.name) for each in ros.topics.values() if each.type == _IMAGE]
    return ["--exclude", "|".join(images)] if images else []


def _goal(ros: RosSpec, goal: GoalSpec) -> dict[str, object]:
    """Return how a navigation goal is watched."""
    return {
        "status": _echo(ros, goal.status),
        "robot": _echo(ros, goal.robot),
        "pose": _echo(ros, goal.pose),
        "running": goal.running,
    }


def _frames(command: Command) -> dict[str, object]:
    """Return how the TF tree is drawn."""
    return {
        "file": command.file,
        "seconds": command.kind.seconds,
        "command": _quoted(command.line),
    }


def _line(command: Command) -> str:
    """Return the line of the script that runs one command."""
    if command.kind.name == "view_frames":
        return "record_frames"
    return f"record {shlex.quote(command.file)} {command.kind.seconds} {_quoted(command.line)}"


def _echo(ros: RosSpec, topic: str) -> str:
    return _quoted(ros.kinds["topic_echo"].run.format(of=topic, to=""))


def _quoted(line: str) -> str:
    return shlex.join(shlex.split(line))
