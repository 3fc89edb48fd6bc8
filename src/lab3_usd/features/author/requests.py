"""The options of requests for graphs, as `lab3 add` and `lab3 remove` take them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import click
from msgspec import Struct

from lab3_usd.author.request import Options, options_of
from lab3_usd.commands.shared.options import (
    Option,
    all_of,
    assets_option,
    given_words,
    isaac_option,
    made_of,
    text_or_json,
)
from lab3_usd.data import program
from lab3_usd.errors import UsageError
from lab3_usd.installation import command_line
from lab3_usd.model.finding import Finding

_ITEMS: Mapping[str, type] = {
    "joints": str, "targets": str, "publish": str, "metadata": str, "indices": int,
    "positions": float,
}  # fmt: skip
_FLAGS = ("with_tf", "commands", "keyboard")


def request_of(**words: Any) -> Options:
    """Return the options of a request out of those of the command line.

    Raises:
        UsageError: a list holds something else than numbers, or a mapping no names.
    """
    values: dict[str, Any] = {}
    for name, value in words.items():
        values[name] = value
        if name in _FLAGS:
            values[name] = value or None
        elif name in _ITEMS and value is not None:
            try:
                values[name] = tuple(map(_ITEMS[name], _items(value)))
            except ValueError as error:
                raise UsageError(f"--{name} {value}: expected numbers with commas") from error
    if values["topic"] is not None and "=" in values["topic"]:
        values["topic"] = _topics(values["topic"])
    return options_of(values, "the request")


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


_SUBJECT = {
    "--robot": "PRIM", "--prim": "PRIM", "--graph": "PATH", "--into": "GRAPH",
    "--topic": "NAME", "--namespace": "NAME", "--targets": "PRIMS",
}  # fmt: skip


def _subject(*texts: str) -> Option:
    """Return the options that say what a graph is about; a text for each says what it does."""
    return all_of(
        *(
            click.option(name, metavar=metavar, help=text)
            for (name, metavar), text in zip(_SUBJECT.items(), texts, strict=True)
        )
    )


def _values(*, hidden: bool) -> Option:
    """Return the options that say how a graph is made."""
    option = partial(click.option, hidden=hidden)
    return all_of(
        option("--command-topic", metavar="NAME", help="Of joints: the topic of commands."),
        option("--frame", metavar="NAME", help="The frame of the sensor, or of the base."),
        option("--domain", type=int, metavar="N", help="The ROS domain."),
        option("--joints", metavar="A,B", help="Joints by name: left, right; or those of an arm."),
        option("--indices", metavar="0,1", help="Joints by number instead."),
        option("--radius", type=float, metavar="M", help="Radius of the wheels in metres."),
        option("--distance", type=float, metavar="M", help="Between left and right, in metres."),
        option("--publish", metavar="A,B", help="Outputs of a sensor: rgb, depth, laser_scan..."),
        option("--width", type=int, metavar="PIXELS", help="Width of the picture."),
        option("--height", type=int, metavar="PIXELS", help="Height of the picture."),
        option("--metadata", metavar="A,B", help="Of a point cloud: Intensity, ObjectId..."),
        option("--with-tf", is_flag=True, help="Also send the frame of the sensor."),
        option("--robot-tf/--no-robot-tf", default=None, help="With odometry: the links' frames."),
        option("--parent", metavar="PRIM", help="The prim whose frame is their parent."),
        option("--node", metavar="NODE", help="Give --targets to this node of a graph."),
        option("--states/--no-states", default=None, help="Of joints: publish states."),
        option("--commands", is_flag=True, help="Of joints: subscribe to commands."),
        option("--move/--no-move", default=None, help="With --commands: move the joints."),
        option("--positions", metavar="A,B", help="Radians or metres; of velocity, a second."),
        option("--gripper", metavar="PRIM", help="The link that carries the fingers."),
        option("--open", type=float, metavar="M", help="Position of the open fingers."),
        option("--close", type=float, metavar="M", help="Position of the closed fingers."),
        option("--speed", type=float, metavar="M", help="Step of the fingers per update, metres."),
        option("--keyboard", is_flag=True, help="Keys move it: WASD; O, C, N of a gripper."),
        option("--kind", metavar="NAME", help="Of publisher: rtf, bool, int64, string."),
        made_of("request", Options.__struct_fields__, request_of),
    )


request_options: Option = all_of(
    _subject(
        "The robot, if the stage has several.",
        "The sensor, if there are several.",
        "Path of the new graph.",
        "Extend this graph, with its tick and context.",
        "The topic, or rgb=/a,depth=/b for each output.",
        "Namespace of the topics.",
        "The prims whose frames are sent.",
    ),
    _values(hidden=False),
)

# What a graph was made of does not choose it: the words that added it remove it.
removal_options: Option = all_of(
    _subject(
        "Of several graphs, the one of this robot.",
        "Of several graphs, the one of this sensor.",
        "The graph to remove.",
        "The graph that was extended: remove its new nodes.",
        "Of several graphs, the one with this topic.",
        "The namespace before --topic.",
        "Of several graphs, the one that names these prims.",
    ),
    _values(hidden=True),
)


class EditOptions(Struct, frozen=True):
    """How the stage that an edit leaves is checked, and how the edit is shown."""

    force: bool
    release: str | None
    form: str
    assets: tuple[str, ...]


edit_options: Option = all_of(
    click.option("--force", is_flag=True, help="Write in spite of findings; replace any file."),
    isaac_option,
    text_or_json,
    assets_option,
)


def finding_fields(finding: Finding) -> dict[str, str]:
    """Return what the JSON of an edit says of a finding."""
    return {
        "rule": finding.rule,
        "severity": finding.severity,
        "prim": finding.prim,
        "message": finding.message,
    }


def to_write() -> str:
    """Return the line that says how what is shown is written: the call with --in-place."""
    context = click.get_current_context()
    words = (str(context.command.name), *context.params["words"], *given_words(context))
    return f"to write: {command_line(program(), *words, '--in-place')}"


def kind_and_stage(words: tuple[str, ...], *, has_file: bool) -> tuple[str, Path]:
    """Return the kind, '' with a file of requests, and the stage out of the arguments.

    Raises:
        UsageError: there is one too few or too many.
    """
    if has_file:
        if len(words) != 1:
            raise UsageError("with --file, name the stage alone: lab3 add --file ros.yaml STAGE")
        return "", Path(words[0])
    kind, *stages = words or ("",)
    if len(stages) == 1 and Path(kind).suffix and not Path(stages[0]).suffix:
        command = click.get_current_context().command.name
        raise UsageError(f"the kind comes first: {program()} {command} {stages[0]} {kind}")
    if len(stages) != 1:
        raise UsageError(
            "name a kind and a stage: lab3 add KIND STAGE; lab3 add --help lists kinds"
        )
    return kind, Path(stages[0])
