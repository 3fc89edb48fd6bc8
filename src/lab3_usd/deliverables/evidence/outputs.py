"""Reads the outputs of single diagnostic commands of ROS 2 Humble into plain facts.

None wherever a text says nothing: neither what the command prints nor how it says that it
failed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import dropwhile, takewhile
from typing import Any

from lab3_usd.deliverables.plain_yaml import NOT_YAML, load_plain
from lab3_usd.model.folder import (
    ABOVE_ZERO,
    SHOWN,
    Edge,
    ListedEndpoint,
    Lookup,
    Message,
    Run,
    Scalar,
)

_SCALARS = (str, int, float, bool, type(None))
# What rclcpp and ros2cli print between messages: log lines, and the notice of a lost message.
_NOISE = re.compile(r"^(\[(INFO|WARN|ERROR|DEBUG)\]|WARNING:|A message was lost|\ttotal count)")
_ELEMENT = re.compile(r"^ *- (-?[\d.]\S*|\.nan|'\.\.\.')\s*$")
_FIELD = re.compile(r"(?P<indent> *)(?:- )?(?P<name>[A-Za-z_]\w*):(?: +(?P<value>.*))?$")
_SEPARATOR = re.compile(r"^-{3,}[ \t]*$", re.MULTILINE)
_MOST_MESSAGES = 20
_LONGEST_MESSAGE = 20_000  # characters, arrays left out; YAML is slow to read


def parse_messages(text: str) -> list[Message]:
    """Return the messages of an output, fields by dotted path; empty when none was printed.

    Of very many, those in the middle are left out. Of arrays of numbers only counts are kept: how
    many numbers are shown, and how many of them are above 0. A message that is no longer YAML,
    because somebody shortened it, is read line by line as far as its lines say `name: value`.
    """
    lines = [line for line in text.splitlines() if not _NOISE.match(line)]
    documents = [document for document in _SEPARATOR.split("\n".join(lines)) if document.strip()]
    if len(documents) > _MOST_MESSAGES:
        documents = documents[: _MOST_MESSAGES // 2] + documents[-_MOST_MESSAGES // 2 :]
    return [message for document in documents if (message := _parse(document))]


def _parse(document: str) -> Message:
    lines = document.splitlines()
    counts, document = _counts(lines), "\n".join(ln for ln in lines if not _ELEMENT.match(ln))
    try:
        data = load_plain(document) if len(document) <= _LONGEST_MESSAGE else None
        if isinstance(data, dict):
            return {**dict(_flat(data, "", set())), **counts}
    except NOT_YAML:
        pass
    return {**dict(_by_line(document)), **counts}


def _counts(lines: list[str]) -> dict[str, Scalar]:
    """Return of each array of numbers how many are shown, and how many of them are above 0."""
    numbers: dict[str, list[float]] = {}
    name = ""
    for line in lines:
        element, field = _ELEMENT.match(line), _FIELD.match(line.rstrip())
        if field is not None:
            name = field["name"]
            if field["value"] in {"[]", "''"}:
                numbers[name] = []
        elif element is not None and name:
            number = parsed_number(element[1].replace(".inf", "inf"))
            if not math.isnan(number):  # as what stands for those left out
                numbers.setdefault(name, []).append(number)
    counts: dict[str, Scalar] = {}
    for name, shown in numbers.items():
        counts[f"{name}.{SHOWN}"] = len(shown)
        counts[f"{name}.{ABOVE_ZERO}"] = sum(0 < number < math.inf for number in shown)
    return counts


def _flat(value: Any, path: str, seen: set[int]) -> Iterator[tuple[str, Scalar]]:
    """Yield the scalars below a value; a part that YAML repeats by an alias is entered once."""
    if isinstance(value, _SCALARS):
        yield path, value
        return
    if id(value) in seen or not isinstance(value, (dict, list)):
        return
    seen.add(id(value))
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for name, inner in inside:
        # Arrays of numbers are left out, arrays of messages are not.
        if isinstance(value, dict) or isinstance(inner, dict):
            yield from _flat(inner, f"{path}.{name}" if path else str(name), seen)


def _by_line(document: str) -> Iterator[tuple[str, Scalar]]:
    outer: list[tuple[int, str]] = []
    for line in document[:_LONGEST_MESSAGE].splitlines():
        field = _FIELD.match(line.rstrip())
        if field is None:
            continue
        indent = len(field["indent"])
        while outer and outer[-1][0] >= indent:
            outer.pop()
        if field["value"]:
            yield ".".join([*(name for _, name in outer), field["name"]]), _scalar(field["value"])
        else:
            outer.append((indent, field["name"]))


def _scalar(text: str) -> Scalar:
    try:
        value = load_plain(text)
    except NOT_YAML:
        return text
    return value if isinstance(value, _SCALARS) else text


# A shell or `ros2 run` that could not start the command: the output shows nothing.
_NOT_RUN = re.compile(
    r"command not found|No such file or directory|Package '[^'\n]*' not found|No executable found"
)
NAME = re.compile(r"^(/[\w/]+)(\s+\[.*\])?$")
_PACKAGE = re.compile(r"[a-z]\w*")
_TYPE = re.compile(r"^\w+(/(msg|srv|action))?/\w+$")
_RATE = re.compile(r"average rate:[ \t]*([\d.eE+-]+|inf|nan)")
_STATE = re.compile(r"^(?:(?P<node>/\S+): )?(?P<state>\w+ \[\d+\])$")
# How the commands say that nothing came (ros2topic/api, verb/echo.py and info.py; get.py of
# ros2lifecycle; tf2_echo.cpp).
_UNPUBLISHED = re.compile(r"does not appear to be published yet|Could not determine the type for ")
_UNKNOWN = "Unknown topic "
_NO_MORE = "no new messages"
_LISTED_TYPE = re.compile(r"^(/[\w/]+)\s+\[(\w+/msg/\w+)\]\s*$", re.MULTILINE)
_INFO_TYPE = re.compile(r"^Type:\s*(\w+/msg/\w+)\s*$", re.MULTILINE)
_HEARERS = re.compile(r"^Subscription count:\s*(\d{1,3})\b", re.MULTILINE)
_NO_STATE = ("Node not found", "Exception while calling service of node")
_NO_TRANSFORM = re.compile(r"Waiting for transform |Failure at |Exception thrown:")
_TRANSLATION = re.compile(r"Translation:[ \t]*\[([^\[\]\n]*)\]")
_DOT_EDGE = re.compile(r'"([^"\n]+)"\s*->\s*"([^"\n]+)"')
_YAML_EDGE = re.compile(
    r"^[ \t]*'?([^\s':]+)'?:[ \t]*\n[ \t]+parent:[ \t]*'?([^'\n]+)", re.MULTILINE
)
_NODE_NAME = re.compile(r"^[ \t]*Node name:", re.MULTILINE | re.IGNORECASE)
_FIELDS = 5


def was_run(text: str) -> bool:
    """Whether the command behind an output could be started."""
    return not _NOT_RUN.search(text)


def parse_names(text: str) -> tuple[str, ...] | None:
    """Read `ros2 topic list` or `ros2 node list` (ros2topic and ros2node, verb/list.py)."""
    matches = [NAME.match(line) for line in _run_of(NAME, text)]
    return tuple(dict.fromkeys(match[1] for match in matches if match)) or None


def _run_of(pattern: re.Pattern[str], text: str) -> Iterator[str]:
    """Yield the first lines that follow one another and fit, blank ones left out."""
    lines = (line.strip() for line in text.splitlines() if line.strip())
    return takewhile(pattern.fullmatch, dropwhile(lambda line: not pattern.fullmatch(line), lines))


def parse_topic_types(text: str) -> tuple[str, ...] | None:
    """Read `ros2 topic type` (ros2topic/verb/type.py), which says nothing of an unknown topic."""
    lines = (line.strip() for line in text.splitlines())
    return tuple(dict.fromkeys(line for line in lines if _TYPE.match(line))) or None


def parse_listed_types(text: str) -> dict[str, str]:
    """Read the types of `ros2 topic list -t` (ros2topic/verb/list.py)."""
    return dict(_LISTED_TYPE.findall(text))


def parse_info_type(text: str) -> str | None:
    """Read the type that `ros2 topic info` prints first (ros2topic/verb/info.py)."""
    match = _INFO_TYPE.search(text)
    return None if match is None else match[1]


def parse_hearers(text: str) -> int | None:
    """Read how many subscriptions `ros2 topic info` counts (ros2topic/verb/info.py)."""
    match = _HEARERS.search(text)
    return None if match is None else int(match[1])


def parse_rate(text: str) -> float | None:
    """Read `ros2 topic hz` (ros2topic/verb/hz.py): the last average in hertz.

    It is 0 when none came, and when nothing came any more at the end.
    """
    rates = [parsed_number(digits) for digits in _RATE.findall(text)]
    if text.rfind(_NO_MORE) > max(text.rfind("average rate:"), -1):
        return 0.0
    finite = [rate for rate in rates if math.isfinite(rate)]
    if finite:
        return finite[-1]
    return 0.0 if rates or _UNPUBLISHED.search(text) else None


def parse_message(text: str) -> Message | None:
    """Read `ros2 topic echo` (ros2topic/verb/echo.py): the first message, empty when none came."""
    message = next(iter(parse_messages(text)), None)
    if message is None and _UNPUBLISHED.search(text):
        return {}
    return message


def parse_endpoints(text: str) -> tuple[ListedEndpoint, ...] | None:
    """Read `ros2 topic info` (ros2topic/verb/info.py, rclpy/topic_endpoint_info.py).

    Without `--verbose` the publishers have neither names nor policies, but are counted.
    """
    described = tuple(_endpoints(text))
    if described:
        return described
    count = re.search(r"Publisher count:\s*(\d{1,3})\b", text)
    if count:
        return tuple(ListedEndpoint(node="", publishes=True) for _ in range(int(count[1])))
    return () if _UNKNOWN in text else None


def _endpoints(text: str) -> Iterator[ListedEndpoint]:
    for part in _NODE_NAME.split(text)[1:]:
        name, *rest = part.split("\n")
        fields = (line.partition(":") for line in rest)
        fields_shown = {key.strip(): value.strip() for key, _, value in fields if value.strip()}
        namespace = fields_shown.get("Node namespace", "/").strip("/")
        yield ListedEndpoint(
            node=f"/{namespace}/{name.strip()}".replace("//", "/"),
            publishes=fields_shown.get("Endpoint type", "PUBLISHER") != "SUBSCRIPTION",
            type=fields_shown.get("Topic type", ""),
            reliability=fields_shown.get("Reliability", "").lower(),
            durability=fields_shown.get("Durability", "").lower(),
        )


def parse_state(text: str) -> str | None:
    """Read `ros2 lifecycle get` (ros2lifecycle/verb/get.py): `active [3]`, or its message."""
    lines = [line.strip() for line in text.splitlines()]
    states = [match["state"] for line in lines if (match := _STATE.match(line))]
    return states[-1] if states else next((x for x in lines if x.startswith(_NO_STATE)), None)


def parse_states(text: str) -> dict[str, str]:
    """Read `ros2 lifecycle get` without a node, which names the node in every line."""
    matches = (_STATE.match(line.strip()) for line in text.splitlines())
    return {match["node"]: match["state"] for match in matches if match and match["node"]}


def parse_lookup(text: str) -> Lookup | None:
    """Read `tf2_echo` (tf2_ros/src/tf2_echo.cpp): the last translation in metres, if any came."""
    translations = _TRANSLATION.findall(text)
    if not translations:
        return Lookup(found=False) if _NO_TRANSFORM.search(text) else None
    numbers = [parsed_number(digits) for digits in translations[-1].split(",")]
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
    edges_read = _YAML_EDGE.findall(opened)
    edges = tuple(dict.fromkeys((parent.strip(), child) for child, parent in edges_read))
    return edges if edges or "frame_yaml=" in text else None


def parse_packages(text: str) -> tuple[str, ...] | None:
    """Read `ros2 pkg list` (ros2pkg/verb/list.py)."""
    return tuple(_run_of(_PACKAGE, text)) or None


def parse_manifest(text: str) -> Iterator[Run]:
    """Read the manifest of the collecting script: columns apart by tabs, a line a command."""
    for line in text.splitlines():
        columns = line.split("\t")
        if len(columns) == _FIELDS and re.fullmatch(r"\d{1,3}", columns[1]):
            file, status, start, seconds, command = columns
            yield Run(file, int(status), start, parsed_number(seconds), command)


def parsed_number(text: str) -> float:
    """Return the number that a text is, nan when it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
