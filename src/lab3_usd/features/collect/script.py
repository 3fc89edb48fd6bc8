"""The script that saves what the diagnostic commands of a lab print."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from lab3_usd.deliverables.evidence.saved_outputs import MANIFEST
from lab3_usd.deliverables.nav2_templates import fill_template
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import RosSpec

# The topics of goals are hidden ones; images are large, and their info says when they came.
_RECORD = ("ros2", "bag", "record", "--all", "--include-hidden-topics")
_IMAGE = "sensor_msgs/msg/Image"


def collect_script(lab: Lab) -> str:
    """Return the script for the commands of `ros.yaml`, each with its time limit."""
    ros = lab.ros
    frames = next((command for command in ros.commands if command.kind.name == "view_frames"), None)
    images = [re.escape(topic.name) for topic in ros.topics.values() if topic.type == _IMAGE]
    without_images = ["--exclude", "|".join(images)] if images else []
    lines = [
        "record_frames"
        if command.kind.name == "view_frames"
        else f"record {shlex.quote(command.file)} {command.kind.seconds} {_quoted(command.line)}"
        for command in ros.commands
    ]
    goal = ros.goal and {
        "status": _echo(ros, ros.goal.status),
        "robot": _echo(ros, ros.goal.robot),
        "pose": _echo(ros, ros.goal.pose),
        "running": ros.goal.running,
    }
    return fill_template(
        Path(__file__).with_name("collect.sh.j2"),
        lab=lab.title,
        results=next(iter(lab.submission.folders.shown), "results"),
        navigation=ros.navigation is not None,
        manifest=MANIFEST,
        setup=shlex.quote(ros.system.setup),
        domain=ros.system.domain,
        distribution=ros.system.distribution,
        commands=lines,
        moves=any(topic.subscribed for topic in ros.topics.values()) or ros.navigation is not None,
        goal=goal,
        no_goal=shlex.quote(f"collect.sh: {lab.title} has no navigation goal to wait for"),
        record_bag=shlex.join([*_RECORD, *without_images]),
        frames=frames
        and {
            "file": frames.file,
            "seconds": frames.kind.seconds,
            "command": _quoted(frames.line),
        },
    )


def _echo(ros: RosSpec, topic: str) -> str:
    return _quoted(ros.kinds["topic_echo"].run.format(of=topic, to=""))


def _quoted(line: str) -> str:
    return shlex.join(shlex.split(line))
