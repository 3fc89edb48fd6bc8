"""Reads the outputs of single diagnostic commands of ROS 2 Humble into plain facts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from lab3_usd.check.subjects_lab import Edge, Endpoint, Lookup, Message, Names, Run
from lab3_usd.lab.evidence_message import parse_messages

# A shell or `ros2 run` that could not start the command: the output shows nothing.
_NOT_RUN = re.compile(
    r"command not found|No such file or directory|Package '.*' not found|No executable found"
)
_NAME = re.compile(r"^(/[\w/]+)(\s+\[.*\])?$")
_TYPE = re.compile(r"^\w+(/(msg|srv|action))?/\w+$")
_RATE = re.compile(r"average rate:\s*([\d.eE+-]+|inf|nan)")
_STATE = re.compile(r"^(?:/\S+:\s*)?(\w+ \[\d+\])\s*$")
_TRANSLATION = re.compile(r"Translation:\s*\[([^\]]*)\]")
_DOT_EDGE = re.compile(r'"([^"\n]+)"\s*->\s*"([^"\n]+)"')
_YAML_EDGE = re.compile(
    r"^[ \t]*'?([^\s':]+)'?:[ \t]*\n[ \t]+parent:[ \t]*'?([^'\n]+?)'?[ \t]*$", re.MULTILINE
)
_FIELDS = 5


def was_run(text: str) -> bool:
    """Whether the command behind an output could be started at all."""
    return not _NOT_RUN.search(text)


def parse_names(text: str) -> Names | None:
    """Read `ros2 topic list` or `ros2 node list` (ros2topic and ros2node, verb/list.py)."""
    found = (_NAME.match(line.strip()) for line in text.splitlines())
    names = tuple(dict.fromkeys(match[1] for match in found if match))
    return Names(names, whole=True) if names else None


def parse_types(text: str) -> tuple[str, ...]:
    """Read `ros2 topic type` (ros2topic/verb/type.py); empty when there is no such topic."""
    lines = (line.strip() for line in text.splitlines())
    return tuple(dict.fromkeys(line for line in lines if _TYPE.match(line)))


def parse_rate(text: str) -> float:
    """Read `ros2 topic hz` (ros2topic/verb/hz.py): the last average in hertz, 0 when none came."""
    rates = [number(found) for found in _RATE.findall(text)]
    known = [rate for rate in rates if math.isfinite(rate)]
    return known[-1] if known else 0.0


def parse_message(text: str) -> Message:
    """Read `ros2 topic echo` (ros2topic/verb/echo.py): the first message, empty when none came."""
    return next(iter(parse_messages(text)), {})


def parse_endpoints(text: str) -> tuple[Endpoint, ...]:
    """Read `ros2 topic info` (ros2topic/verb/info.py, rclpy/topic_endpoint_info.py).

    Without `--verbose` the publishers have neither names nor policies, but are counted.
    """
    described = tuple(_endpoints(text))
    if described:
        return described
    count = re.search(r"Publisher count:\s*(\d{1,3})\b", text)
    return tuple(Endpoint(node="", publishes=True) for _ in range(int(count[1]) if count else 0))


def _endpoints(text: str) -> Iterator[Endpoint]:
    for part in re.split(r"(?mi)^\s*Node name:", text)[1:]:
        name, _, rest = part.partition("\n")
        said = dict(re.findall(r"(?m)^[ \t]*([A-Z][\w ]*?)[ \t]*:[ \t]*(\S.*?)[ \t]*$", rest))
        yield Endpoint(
            node=_full_name(said.get("Node namespace", "/"), name.strip()),
            publishes=said.get("Endpoint type", "PUBLISHER") != "SUBSCRIPTION",
            type=said.get("Topic type", ""),
            reliability=said.get("Reliability", "").lower(),
            durability=said.get("Durability", "").lower(),
        )


def _full_name(namespace: str, name: str) -> str:
    return f"/{namespace.strip('/')}/{name}".replace("//", "/")


def parse_state(text: str) -> str:
    """Read `ros2 lifecycle get` (ros2lifecycle/verb/get.py): `active [3]`, or what it said."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    states = [match[1] for line in lines if (match := _STATE.match(line))]
    return states[-1] if states else next(iter(lines), "no answer")


def parse_lookup(text: str) -> Lookup:
    """Read `tf2_echo` (tf2_ros/src/tf2_echo.cpp): the last translation in metres, if any came."""
    found = _TRANSLATION.findall(text)
    if not found:
        return Lookup(found=False)
    numbers = [number(each) for each in found[-1].split(",")]
    if len(numbers) != 3:  # noqa: PLR2004 - x, y, z
        return Lookup(found=True)
    return Lookup(found=True, translation=(numbers[0], numbers[1], numbers[2]))


def parse_tree(text: str) -> tuple[Edge, ...] | None:
    """Read what `view_frames` printed or saved (tf2_tools/view_frames.py, tf2/buffer_core.cpp).

    Its .gv file holds `"parent" -> "child"`, the line `Result:` the frames as YAML, each with its
    parent. None when the text is neither.
    """
    if "digraph" in text:
        return tuple(dict.fromkeys((p, c) for p, c in _DOT_EDGE.findall(text)))
    plain = text.replace("\\n", "\n")
    opened = re.sub(r"frame_yaml=[\"']", "\n", plain)
    edges = tuple(dict.fromkeys((parent, child) for child, parent in _YAML_EDGE.findall(opened)))
    return edges if edges or "frame_yaml=" in text else None


def parse_packages(text: str) -> tuple[str, ...] | None:
    """Read `ros2 pkg list` (ros2pkg/verb/list.py)."""
    names = tuple(
        line.strip() for line in text.splitlines() if re.fullmatch(r"\s*[a-z]\w*\s*", line)
    )
    return names or None


def parse_manifest(text: str) -> Iterator[Run]:
    """Read the manifest of the collecting script: columns apart by tabs, a line a command."""
    for line in text.splitlines():
        columns = line.split("\t")
        if len(columns) == _FIELDS and re.fullmatch(r"\d{1,3}", columns[1]):
            file, status, start, seconds, command = columns
            yield Run(file, int(status), start, number(seconds), command)


def number(text: str) -> float:
    """Return the number that a text is, nan when it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
