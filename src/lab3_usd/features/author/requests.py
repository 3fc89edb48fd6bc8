"""The options of requests for graphs, as `lab3 add` and `lab3 remove` take them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lab3_usd.author.request import Options, options_of
from lab3_usd.commands.shared.options import Option, all_of, made_of
from lab3_usd.errors import UsageError

_LISTS = ("joints", "targets", "publish", "metadata")
_NUMBERS = {"indices": int, "positions": float}
_FLAGS = ("with_tf", "commands", "keyboard")


def request_of(**words: Any) -> Options:
    """Return the options of a request out of those of the command line.

    Raises:
        UsageError: a list holds something else than numbers, or a mapping no names.
    """
    values: dict[str, Any] = {}
    for name, value in words.items():
        if name in _FLAGS:
            values[name] = True if value else None
        elif name in _LISTS and value is not None:
            values[name] = _items(value)
        elif name in _NUMBERS and value is not None:
            try:
                values[name] = tuple(_NUMBERS[name](item) for item in _items(value))
            except ValueError as error:
                raise UsageError(f"--{name} {value}: expected numbers with commas") from error
        else:
            values[name] = value
    if values["topic"] is not None and "=" in values["topic"]:
        values["topic"] = _topics(values["topic"])
    return options_of(values, "options")


def _items(text: str) -> tuple[str, ...]:
    return tuple(item for part in text.split(",") if (item := part.strip()))


def _topics(text: str) -> dict[str, str]:
    topics = {}
    for item in _items(text):
        name, sign, topic = item.partition("=")
        if not sign or not topic:
            raise UsageError(f"--topic {text}: expected OUTPUT=NAME with commas")
        topics[name.strip()] = topic.strip()
    return topics


request_options: Option = all_of(
    click.option("--robot", metavar="PRIM", help="The robot, if the stage has several."),
    click.option("--prim", metavar="PRIM", help="The sensor, if there are several."),
    click.option("--graph", metavar="PATH", help="Where the new graph stands."),
    click.option("--into", metavar="GRAPH", help="Extend this graph, with its tick and context."),
    click.option("--topic", metavar="NAME", help="The topic, or rgb=/a,depth=/b for each output."),
    click.option("--command-topic", metavar="NAME", help="Of joints: the topic of commands."),
    click.option("--namespace", metavar="NAME", help="Before the topics."),
    click.option("--frame", metavar="NAME", help="The frame of the sensor, or of the base."),
    click.option("--domain", type=int, metavar="N", help="The ROS domain."),
    click.option(
        "--joints", metavar="A,B", help="Joints by name: left, right; or those of an arm."
    ),
    click.option("--indices", metavar="0,1", help="Joints by number instead."),
    click.option("--radius", type=float, metavar="M", help="Radius of the wheels in metres."),
    click.option("--distance", type=float, metavar="M", help="Between left and right, in metres."),
    click.option("--publish", metavar="A,B", help="Outputs of a sensor: rgb, depth, laser_scan..."),
    click.option("--width", type=int, metavar="PIXELS", help="Width of the picture."),
    click.option("--height", type=int, metavar="PIXELS", help="Height of the picture."),
    click.option("--metadata", metavar="A,B", help="Of a point cloud: Intensity, ObjectId..."),
    click.option("--with-tf", is_flag=True, help="Also send the frame of the sensor."),
    click.option(
        "--robot-tf/--no-robot-tf", default=None, help="With odometry: the links' frames."
    ),
    click.option("--targets", metavar="PRIMS", help="The prims whose frames are sent."),
    click.option("--parent", metavar="PRIM", help="The prim below whose frame they hang."),
    click.option("--node", metavar="NODE", help="Give --targets to this node of a graph."),
    click.option("--states/--no-states", default=None, help="Of joints: publish states."),
    click.option("--commands", is_flag=True, help="Of joints: take commands."),
    click.option("--move/--no-move", default=None, help="With --commands: move the joints."),
    click.option("--positions", metavar="A,B", help="Radians or metres; of velocity, a second."),
    click.option("--gripper", metavar="PRIM", help="The link that carries the fingers."),
    click.option("--open", type=float, metavar="M", help="Position of the open fingers."),
    click.option("--close", type=float, metavar="M", help="Position of the closed fingers."),
    click.option("--speed", type=float, metavar="M", help="Way of the fingers in a frame."),
    click.option("--keyboard", is_flag=True, help="Keys move it: WASD; O, C, N of a gripper."),
    click.option("--kind", metavar="NAME", help="Of publisher: rtf, bool, int64, string."),
    made_of("request", Options.__struct_fields__, request_of),
)


def kind_and_stage(words: tuple[str, ...], *, has_file: bool) -> tuple[str, Path]:
    """Return the kind, '' with a file of requests, and the stage out of the arguments.

    Raises:
        UsageError: there is one too few or too many.
    """
    if has_file:
        if len(words) != 1:
            raise UsageError("with --file, name the stage alone: lab3 add --file ros.yaml STAGE")
        return "", Path(words[0])
    if len(words) != len(("KIND", "STAGE")):
        raise UsageError(
            "name a kind and a stage: lab3 add KIND STAGE; lab3 add --help lists kinds"
        )
    return words[0], Path(words[1])
