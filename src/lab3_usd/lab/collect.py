"""Writes the bash script that saves the output of every diagnostic command."""

from __future__ import annotations

import shlex

from lab3_usd.errors import SpecError
from lab3_usd.lab.evidence import MANIFEST
from lab3_usd.lab.fill import fill_template
from lab3_usd.spec.ros_spec import Command, RosSpec

SCRIPT = "collect.sh"
RESULTS = "results"
GOAL_FILE = "goal.txt"
GOAL_POSE_FILE = "goal_pose.txt"
DAEMON_FILE = "daemon.txt"
ROBOT_BEFORE_FILE = "goal_robot_before.txt"


def collect_script(ros: RosSpec) -> str:
    """Return the script for the commands of `ros.yaml` (B7 to J7), each with its time limit.

    Raises:
        SpecError: `ros.yaml` names no command that draws the TF tree.
    """
    frames = [command for command in ros.commands if command.kind.name == "view_frames"]
    if not frames:
        message = "ros.yaml: commands: there is none of the kind 'view_frames'"
        raise SpecError(message)
    return fill_template(
        "collect.sh.j2",
        script=SCRIPT,
        results=RESULTS,
        manifest=MANIFEST,
        setup=shlex.quote(ros.system.setup),
        domain=ros.system.domain,
        distribution=ros.system.distribution,
        commands=[_line(command) for command in ros.commands],
        status_command=_echo(ros, ros.goal.status),
        robot_command=_echo(ros, ros.goal.robot),
        pose_command=_echo(ros, ros.goal.pose),
        running=ros.goal.running,
        goal_file=GOAL_FILE,
        pose_file=GOAL_POSE_FILE,
        daemon_file=DAEMON_FILE,
        robot_before=ROBOT_BEFORE_FILE,
        frames_file=frames[0].file,
        frames_seconds=frames[0].kind.seconds,
        frames_command=_quoted(frames[0].line),
    )


def _line(command: Command) -> str:
    """Return the line of the script that runs one command."""
    if command.kind.name == "view_frames":
        return "record_frames"
    return f"record {shlex.quote(command.file)} {command.kind.seconds} {_quoted(command.line)}"


def _echo(ros: RosSpec, topic: str) -> str:
    return _quoted(ros.kinds["topic_echo"].run.format(of=topic, to=""))


def _quoted(line: str) -> str:
    return shlex.join(shlex.split(line))
