"""Describes the checkpoints of a new lab, what is handed in, its points, and the running system."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.describe.yaml_text import document
from lab3_usd.errors import UsageError
from lab3_usd.spec.contradictions.names import GraphTopic, graph_topics
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CHECKPOINTS, Lab
from lab3_usd.spec.scene import SensorSpec
from lab3_usd.spec.submission import FolderNames

FIRST = "start"
_NUMBER = re.compile(r"(?<![A-Za-z0-9])\d+(?![A-Za-z0-9])")
_WORD = re.compile(r"[A-Za-z0-9]+")


class FileNames(Struct, frozen=True):
    """The pattern of the stages' names, and id and name of each checkpoint.

    The file of the last one has the name of the stage.
    """

    pattern: str
    ids: tuple[str, ...]
    names: tuple[str, ...]

    @property
    def first_file(self) -> str:
        """The name of the first stage, without ending."""
        return self.pattern.replace("{id}", self.ids[0]).replace("{name}", self.names[0])


def file_names(stem: str, graphs: Iterable[str]) -> FileNames:
    """Return names by which the last checkpoint has a stage of this name.

    A number in the name is the id: the others count down from it. Else the last word is, and the
    others go by their graphs.

    Raises:
        UsageError: the name has no word that could be an id.
    """
    words = [FIRST, *(re.sub(r"\W+", "_", graph).lower() for graph in graphs)]
    match = _NUMBER.search(stem) or next(iter([*_WORD.finditer(stem)][::-1]), None)
    if match is None:
        raise UsageError(
            f"'{stem}' has no letter from A to Z and no digit; give the stage another name"
        )
    lead, last, rest = stem[: match.start()], match[0], stem[match.end() :]
    ids = (*_ids_before(last, words[:-1]), last)
    name = rest.lstrip("_- ")
    if not name or not last.isdigit():
        return FileNames(f"{lead}{{id}}{rest}", ids, tuple(words))
    gap = rest[: len(rest) - len(name)]
    return FileNames(f"{lead}{{id}}{gap}{{name}}", ids, (*words[:-1], name))


def _ids_before(last: str, words: Sequence[str]) -> Iterator[str]:
    """Yield an id for each word: numbers where there are enough, else the letters of the words."""
    first = int(last) - len(words) if last.isdigit() else -1
    taken = {last}
    for step, word in enumerate(words):
        letters = re.sub(r"[^A-Za-z0-9]", "", word)
        id_ = f"{first + step:0{len(last)}}" if first >= 0 else letters
        while id_ in taken:
            id_ += "x"
        taken.add(id_)
        yield id_


class Step(Struct, frozen=True):
    """One checkpoint: its name, its title, its part of the handout, and what it adds."""

    id: str
    name: str
    title: str
    part: str
    graphs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    frames: bool = False

    @property
    def data(self) -> dict[str, Any]:
        """The checkpoint in the form of its file."""
        adds: dict[str, Any] = {}
        if self.sensors:
            adds["sensors"] = list(self.sensors)
        if self.graphs:
            adds["graphs"] = list(self.graphs)
        if self.frames:
            adds["frames"] = True
        return {"name": self.name, "title": self.title, "part": self.part, "adds": adds}


def describe_steps(
    names: FileNames,
    graphs: Mapping[str, GraphSpec],
    sensors: Mapping[str, Sequence[str]],
    *,
    frames: bool,
) -> tuple[Step, ...]:
    """Return the checkpoints: `sensors` are the names of the sensors by graph."""
    steps = [Step(names.ids[0], names.names[0], "Starter scene", "A")]
    for number, (name, graph) in enumerate(graphs.items(), start=1):
        steps.append(
            Step(
                id=names.ids[number],
                name=names.names[number],
                title=name.replace("_", " "),
                part=graph.handout[0],
                graphs=(name,),
                sensors=tuple(sensors.get(name, ())),
                frames=frames and number == len(graphs),
            )
        )
    return tuple(steps)


def checkpoints_text(
    names: FileNames, title: str, steps: Sequence[Step], frames: Mapping[str, Any], lab: Lab
) -> str:
    """Return `checkpoints.yaml`; `lab` is the new one without its checkpoints."""
    head = document(
        "The checkpoints: what each adds to the one before, and what holds for all of them.\n"
        "Parts and sections of the handout are placeholders, here and in the graphs: write yours.",
        {"title": title, "files": names.pattern},
        {"files": "What the stages are called, without ending."},
    )
    # The type of the nodes that start most executions of the graphs.
    events = Counter(
        node.type.type
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        if node.type.type in lab.catalog.events
    )
    tick = events.most_common(1)[0][0] if events else lab.policy.tick
    policy = _policy().replace(lab.policy.tick, tick)
    data = {"frames": frames, "checkpoints": {step.id: step.data for step in steps}}
    notes = {
        "frames": "The TF tree of the stage; a checkpoint asks for it with `frames: true`.",
        "checkpoints": "One for each graph: put together what your course builds in one part.",
    }
    return f"{head}\n{policy}\n{document('', data, notes)}"


def _policy() -> str:
    """Return what the bundled lab says of every graph, with its comments."""
    text = (data_folder("graphs") / CHECKPOINTS).read_text(encoding="utf-8")
    part = text[text.index("\npolicy:") + 1 :]
    lines = part.splitlines()
    end = next(number for number, line in enumerate(lines) if not line)
    text = "\n".join(lines[:end]).replace(", see decisions", "")
    return text.replace('handout: "decisions"', "handout: A1") + "\n"


_HEAD = """\
What a submission holds: folders and files. Add what else is handed in (`deliverables`) and the
checklists of your handout (`checklist`)."""
_DIFFER = "No two files of the checkpoints in `differ` may be the same."
_POINTS = 10


def submission_text(names: FileNames, steps: Sequence[Step], folders: FolderNames) -> str:
    """Return `submission.yaml`; `folders` are those of the bundled lab."""
    data = {
        "folders": {
            "handout": "A1",
            "stages": folders.stages,
            "starter": folders.starter,
            "shown": list(folders.shown),
        },
        "stages": {
            "handout": "A1",
            "endings": [".usda", ".usd"],
            "openable": [".usdc", ".usdz"],
            "slips": [".uda"],
            "differ": [step.id for step in steps],
            "starter": names.first_file,
        },
    }
    return document(_HEAD, data, {"stages": _DIFFER})


def rubric_text(
    title: str, steps: Sequence[Step], sensors: Mapping[str, SensorSpec], *, frames: bool
) -> str:
    """Return `rubric.yaml`: the same points for each checkpoint."""
    items: dict[str, Any] = {}
    for step in steps:
        groups = [*step.graphs, *(sensors[name].name for name in step.sensors)]
        items[f"part {step.part}" if f"part {step.part}" not in items else step.name] = {
            "title": step.title,
            "checkpoint": step.id,
            "groups": groups or ["Scene"],
            "points": _POINTS,
        }
    if frames:
        tree = {"title": "The TF tree", "checkpoint": steps[-1].id, "groups": ["TF"]}
        items["tree"] = {**tree, "points": _POINTS}
    head = "Points: what each part of the lab is worth. `groups` are graphs, sensors, Scene and TF."
    return document(head, {"title": title, "items": items})


_RUNNING_HEAD = """\
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
    domains = (
        setting.value
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        for setting in node.settings
        if setting.port == _DOMAIN
    )
    system = lab.ros.system
    data = {
        "system": {
            "handout": "A1",
            "distribution": system.distribution,
            "setup": system.setup,
            "domain": next(domains, system.domain),
            "folder": "~/lab",
            "topics": list(system.topics),
            "packages": dict(system.packages),
        },
        "topics": topics,
        "commands": list(_commands(topics)),
    }
    return document(_RUNNING_HEAD, data, {"topics": _TOPICS, "commands": ""})


def _topics(lab: Lab, steps: Sequence[Step]) -> Iterator[tuple[str, dict[str, Any]]]:
    ids = {graph: step.id for step in steps for graph in step.graphs}
    by_name: dict[str, list[GraphTopic]] = {}
    for graph_topic in graph_topics(lab):
        if graph_topic.type is not None:
            by_name.setdefault(graph_topic.name, []).append(graph_topic)
    for name, same in by_name.items():
        publishers = sum(not topic.is_subscribed for topic in same)
        first = same[0]
        entry: dict[str, Any] = {"type": first.type, "from": ids[first.graph]}
        entry["handout"] = f"{lab.graphs[first.graph].handout[0]}3"
        if not publishers:
            entry |= {"subscribed": True, "source": _SOURCE}
        elif name not in lab.policy.tree_topics:
            entry["publishers"] = publishers
        yield name, entry


def _commands(topics: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the commands that show every topic, and a message of each that is published."""
    yield {"kind": "node_list", "handout": "A1"}
    yield {"kind": "topic_list", "handout": "A1"}
    for name, entry in topics.items():
        command = {"of": name, "from": entry["from"], "handout": entry["handout"]}
        yield {"kind": "topic_type", **command}
        if not entry.get("subscribed"):
            yield {"kind": "topic_hz", **command}
            yield {"kind": "topic_echo", **command}
