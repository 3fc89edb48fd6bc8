"""Describes the running system of a stage: its topics and the commands that show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lab3_usd.describe.checkpoints import Step
from lab3_usd.describe.yaml_text import document
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.graph_names import GraphTopic, graph_topics

_HEAD = """\
What the running system shows once the stage plays: its topics, and the commands that show them.
`handout` names the section each fact comes from; `from` the checkpoint from which it holds."""
_TOPICS = (
    "Say also which section asks for a rate (`rate`), `durability`, and `fields` of a message."
)
_DOMAIN = "inputs:domain_id"
_SOURCE = "press Play; the topic exists while the node that subscribes to it runs"


def ros_text(lab: Lab, steps: Sequence[Step]) -> str:
    """Return `ros.yaml` of a lab with new graphs."""
    topics = dict(_topics(lab, steps))
    data = {"system": _system(lab), "topics": topics, "commands": list(_commands(topics))}
    return document(_HEAD, data, {"topics": _TOPICS, "commands": ""})


def _topics(lab: Lab, steps: Sequence[Step]) -> Iterator[tuple[str, dict[str, Any]]]:
    ids = {graph: step.id for step in steps for graph in step.graphs}
    by_name: dict[str, list[GraphTopic]] = {}
    for each in graph_topics(lab):
        if each.type is not None:
            by_name.setdefault(each.name, []).append(each)
    for name, same in by_name.items():
        publishers = sum(not each.is_subscribed for each in same)
        first = same[0]
        said: dict[str, Any] = {"type": first.type, "from": ids[first.graph]}
        said["handout"] = f"{lab.graphs[first.graph].handout[0]}3"
        if not publishers:
            said |= {"subscribed": True, "source": _SOURCE}
        elif name not in lab.policy.tree_topics:
            said["publishers"] = publishers
        yield name, said


def _commands(topics: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the commands that show every topic, and a message of each that is published."""
    yield {"kind": "node_list", "handout": "A1"}
    yield {"kind": "topic_list", "handout": "A1"}
    for name, said in topics.items():
        where = {"of": name, "from": said["from"], "handout": said["handout"]}
        yield {"kind": "topic_type", **where}
        if not said.get("subscribed"):
            yield {"kind": "topic_hz", **where}
            yield {"kind": "topic_echo", **where}


def _system(lab: Lab) -> dict[str, Any]:
    system = lab.ros.system
    return {
        "handout": "A1",
        "distribution": system.distribution,
        "setup": system.setup,
        "domain": next(iter(_domains(lab)), system.domain),
        "folder": "~/lab",
        "topics": list(system.topics),
        "packages": dict(system.packages),
    }


def _domains(lab: Lab) -> Iterator[Value]:
    """Yield the ROS domains that graphs set."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            yield from (each.value for each in node.settings if each.port == _DOMAIN)
