"""Describes the checkpoints of a new lab, what is handed in, its points, and the running system."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.robot.sensors import sensor_group
from lab3_usd.data import data_folder
from lab3_usd.errors import UsageError
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.releases import BASE
from lab3_usd.new_lab.yaml_text import document
from lab3_usd.spec.contradictions.names import (
    FRAME_FIELDS,
    GraphTopic,
    graph_topics,
    spec_value,
    transform_topics,
)
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CHECKPOINTS, Lab
from lab3_usd.spec.load.checkpoints import FORMAT, is_checkpoint_id
from lab3_usd.spec.scene import SCENE_GROUP
from lab3_usd.spec.submission import TEAM

FIRST = "start"
TREE_GROUP, KEPT = "TF", "transient_local"
_NUMBER = re.compile(r"(?<![A-Za-z0-9])\d+(?![A-Za-z0-9])")
_NUMBERED = re.compile(r"(\d+)(?:([_ -]+)(.+))?")
_WORD = re.compile(r"[A-Za-z0-9]+")
_TEAM_PART = re.compile(rf"(?i)(?<![a-z])(team|group)[_-]?(\d+|{re.escape(TEAM)})")


class FileNames(Struct, frozen=True):
    """The pattern of the stages' names, id and name of each checkpoint, and what all names share.

    The file of the last one has the name of the stage.
    """

    pattern: str
    ids: tuple[str, ...]
    names: tuple[str, ...]
    shared: str = ""


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


def names_of_stages(stems: Sequence[str]) -> FileNames:
    """Return names by which each checkpoint has one of these stages.

    The id is the number that tells the names apart, else all that differs in them.

    Raises:
        UsageError: two stages have one name, or a name differs in what can be no id.
    """
    stems = _with_teams(stems)
    twice = next((stem for stem, count in Counter(stems).items() if count > 1), None)
    if twice is not None:
        raise UsageError(f"two stages have the name '{twice}'; each checkpoint needs its own")
    lead = _shared_start(stems)
    tail = _shared_start([stem[len(lead) :][::-1] for stem in stems])[::-1]
    parts = [stem[len(lead) : len(stem) - len(tail)] for stem in stems]
    if not all(parts):
        lead, tail, parts = "", "", list(stems)
    shared = " ".join(re.findall(r"[^\W\d_]+|\d+", _TEAM_PART.sub("", lead)))
    numbered = [match for part in parts if (match := _NUMBERED.fullmatch(part))]
    gaps = {match[2] for match in numbered}
    if len({match[1] for match in numbered}) == len(stems) and len(gaps) == 1:
        gap, rests = next(iter(gaps)), [match[3] or "" for match in numbered]
        same = _shared_start(rests)
        if gap is not None and all(len(rest) > len(same) for rest in rests):
            gap, rests = f"{gap}{same}", [rest[len(same) :] for rest in rests]
        pattern = f"{lead}{{id}}{tail}" if gap is None else f"{lead}{{id}}{gap}{{name}}{tail}"
        ids = tuple(match[1] for match in numbered)
        named = (rest or id_ for rest, id_ in zip(rests, ids, strict=True))
        return FileNames(pattern, ids, tuple(named), shared)
    for stem, part in zip(stems, parts, strict=True):
        if not is_checkpoint_id(part):
            raise UsageError(
                f"'{stem}': '{part}' cannot be the id of a checkpoint: letters, digits, _ and -; "
                "rename the stages"
            )
    return FileNames(f"{lead}{{id}}{tail}", tuple(parts), tuple(parts), shared)


def _with_teams(stems: Sequence[str]) -> Sequence[str]:
    """Return names with a placeholder for a number of the team that all of them have."""
    teams = {match[0] if (match := _TEAM_PART.search(stem)) else "" for stem in stems}
    team = teams.pop() if len(teams) == 1 else ""
    if not team:
        return stems
    word = team.rstrip("0123456789")
    return [stem.replace(team, f"{word}{TEAM}") for stem in stems]


def _shared_start(names: Sequence[str]) -> str:
    """Return what all names begin with, up to where a word or number ends."""
    same = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    start = "".join(letters[0] for letters in same)
    for kind in (str.isdigit, str.isalpha):
        if start and kind(start[-1]) and any(kind(name[len(start) :][:1]) for name in names):
            while start and kind(start[-1]):
                start = start[:-1]
    return start


class Step(Struct, frozen=True):
    """One checkpoint: its name, its title, its part of the handout, and what it adds."""

    id: str
    name: str
    title: str
    part: str
    graphs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    frames: bool = False
    topics: bool = False
    optional: bool = False
    removes: tuple[str, ...] = ()
    joins: bool = False  # the TF tree, with frames of its own

    @property
    def is_new(self) -> bool:
        """Whether the stage holds more than the one before."""
        return bool(self.graphs or self.sensors or self.frames or self.removes)

    @property
    def data(self) -> dict[str, Any]:
        """The checkpoint in the form of its file."""
        adds = {
            "sensors": [*self.sensors],
            "graphs": [*self.graphs],
            "frames": self.frames,
            "topics": self.topics,
        }
        return {
            "name": self.name,
            "title": self.title,
            "part": self.part,
            **({"optional": True} if self.optional else {}),
            "adds": {key: value for key, value in adds.items() if value},
            **({"removes": [*self.removes]} if self.removes else {}),
        }


def describe_steps(
    names: FileNames,
    graphs: Mapping[str, GraphSpec],
    sensors: Mapping[str, Sequence[str]],
    *,
    frames: bool,
) -> tuple[Step, ...]:
    """Return the checkpoints: `sensors` are the names of the sensors by graph, '' for none."""
    first = tuple(sensors.get("", ()))
    steps = [Step(names.ids[0], names.names[0], _STARTER, part_letter(0), sensors=first)]
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


def steps_of_stages(
    names: FileNames,
    graphs: Sequence[Sequence[str]],
    sensors: Sequence[Sequence[str]],
    trees: Sequence[Collection[tuple[str, str]]],
    optional: Collection[int] = (),
    *,
    removed: Mapping[int, tuple[str, ...]],
    speaks: bool = True,
) -> tuple[Step, ...]:
    """Return a checkpoint for each stage: `graphs` and `sensors` are those that it holds by name.

    `removed` are the paths of supplied prims that it has no more, by its number.

    The TF tree is asked for from the first stage on that has a part of it (`trees`). A stage that
    is like the one before is handed in to show the topics of the running system, which it `speaks`
    on. On the stages whose numbers are `optional` no later one builds.
    """
    steps: list[Step] = []
    before = 0
    for number, (id_, name) in enumerate(zip(names.ids, names.names, strict=True)):
        new = tuple(g for g in graphs[number] if not number or g not in graphs[before])
        added = tuple(s for s in sensors[number] if not number or s not in sensors[before])
        is_asked = any(step.frames and not step.optional for step in steps)
        has_frames = bool(trees[number]) and not is_asked
        title = _title(name) if not name.isdigit() else ", ".join(map(_title, new)) or _STARTER
        step = Step(id_, name, title, part_letter(number), new, added, has_frames)
        joins = bool(number) and not {*trees[number]} <= {*trees[before]}
        step = replace(step, removes=removed.get(number, ()), joins=joins)
        is_shown = any(earlier.topics for earlier in steps)
        has_topics = speaks and bool(number) and not step.is_new and not is_shown
        steps.append(replace(step, topics=has_topics, optional=number in optional))
        before = before if number in optional else number
    return tuple(steps)


_STARTER = "Starter scene"


def part_letter(number: int) -> str:
    """Return the letter of a part of the handout; those beyond Z share it."""
    return chr(ord("A") + min(number, 25))


def _title(name: str) -> str:
    words = " ".join(re.split(r"[\W_]+", name))
    return words[:1].upper() + words[1:]


def checkpoints_text(
    names: FileNames, title: str, steps: Sequence[Step], frames: Mapping[str, Any], lab: Lab
) -> str:
    """Return `checkpoints.yaml`; `lab` is the new one without its checkpoints."""
    release = {} if lab.platform.release == BASE else {"isaac": lab.platform.release}
    head = document(
        "The checkpoints: the additions of each, and the rules for all of them.\n"
        "Parts and sections of the handout are placeholders, here and in the graphs: write yours.",
        {"format": FORMAT, "title": title, "files": names.pattern, **release},
        {"files": "Names of the stages, without extension."},
    )
    # The type of the nodes that start most executions of the graphs.
    events = Counter(
        node.type.type
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        if node.type.type in lab.platform.events
    )
    tick = events.most_common(1)[0][0] if events else lab.policy.tick
    policy = _policy().replace(lab.policy.tick, tick)
    joined = ("edges", "deeper_under") if "trees" in frames else ()  # as the trees have them
    written = {key: value for key, value in frames.items() if key not in joined}
    tree = {"frames": written} if frames["edges"] else {}
    data = {**tree, "checkpoints": {step.id: step.data for step in steps}}
    notes = {
        "frames": "The TF tree of the stage; a checkpoint asks for it with `frames: true`.",
        "checkpoints": "The additions of each; move graphs and sensors between them.\n"
        "To rename one, change its name or title, or give it an `id`; other files have its key.\n"
        "One that need not be handed in is `optional: true`.",
    }
    return f"{head}\n{policy}\n{document('', data, notes)}"


_ACCEPTED = "  accepts:"


def _policy() -> str:
    """Return what the bundled lab says of every graph, with its comments.

    What it accepts is true of its own robot alone.
    """
    text = (data_folder("graphs") / CHECKPOINTS).read_text(encoding="utf-8")
    part = text[text.index("\npolicy:") + 1 :]
    lines = [line for line in part.splitlines() if not line.startswith(_ACCEPTED)]
    end = next(number for number, line in enumerate(lines) if not line)
    text = "\n".join(lines[:end]).replace(", see decisions", "")
    return text.replace('handout: "decisions"', "handout: A1") + "\n"


_HEAD = """\
What a submission holds: folders and files. Add what else is handed in (`deliverables`) and the
checklists of your handout (`checklist`)."""
_DIFFER = "No two files of the checkpoints in `differ` may be the same."
_POINTS = 10


def submission_text(steps: Sequence[Step]) -> str:
    """Return `submission.yaml`."""
    data = {
        "folders": {
            "handout": "A1",
            "stages": "stages",
            "starter": "supplied",
            "shown": ["output"],
        },
        "stages": {
            "handout": "A1",
            "endings": [".usda", ".usd"],
            "openable": [".usdc", ".usdz"],
            "slips": [".uda"],
            "differ": [step.id for step in steps if step is steps[0] or step.is_new],
        },
    }
    return document(_HEAD, data, {"stages": _DIFFER})


def rubric_text(title: str, steps: Sequence[Step], furnished: Collection[str], lab: Lab) -> str:
    """Return `rubric.yaml`: the same points for each checkpoint, and what a changed robot costs.

    `furnished` are the checkpoints with which things of the scene come.
    """
    items: dict[str, Any] = {}
    supplied = [robot.group for robot in lab.scene.robots]
    robots = "robots" if supplied[1:] else "robot"
    things = [robots, "scene"] if supplied else ["scene"]
    for step in steps:
        groups = [*step.graphs, *(sensor_group(lab, name) for name in step.sensors)]
        groups += [TREE_GROUP] if step.frames or step.joins else []
        is_of_scene = step.removes or step.id in furnished
        groups += [SCENE_GROUP] if groups and is_of_scene and step is not steps[0] else []
        if step is steps[0]:
            items[_SUPPLIED] = {
                "title": f"The supplied {' and '.join(things)}",
                "checkpoint": step.id,
                "groups": list(dict.fromkeys([SCENE_GROUP, *supplied])),
                "points": _POINTS,
            }
            if not groups:
                continue
        items[f"part {step.part}" if f"part {step.part}" not in items else step.id] = {
            "checkpoint": step.id,
            "groups": groups or ["*"],
            "points": _POINTS,
        }
    is_all_supplied = bool(supplied) and not any(step.removes for step in steps)
    cap = {
        "rules": ["S", "U"] if is_all_supplied else ["U"],  # else S also judges what students do
        "items": [_SUPPLIED],
        "checkpoints": ["*"],
        "at_most": 0,
        "because": f"the supplied {' or '.join(things)} was changed",
    }
    head = "The points of each part of the lab. `groups` are graphs, sensors, Scene and TF."
    notes = {
        "caps": "Further limits of an item: errors of the rules, in the stages of checkpoints."
    }
    return document(head, {"title": title, "items": items, "caps": [cap]}, notes)


_SUPPLIED = "scene"
_RUNNING_HEAD = """\
The topics of the playing stage, and the commands that show them.
`handout` names the section each fact comes from; `from` the checkpoint from which it holds."""
_TOPICS = "Add the section that asks for a rate (`rate`), and `durability`."
_SOURCE = "press Play; the topic exists while the node that subscribes to it runs"


def ros_text(lab: Lab, steps: Sequence[Step]) -> str:
    """Return `ros.yaml` of a lab with new graphs."""
    topics = dict(_topics(lab, steps))
    domains = (
        setting.value
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        for setting in node.settings
        if setting.port == f"{INPUT}{lab.platform.ros.domain}"
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
            "packages": {},
        },
        "topics": topics,
        "commands": list(_commands(topics)),
    }
    packages = "The ROS packages that your course needs, with their usual names: {rviz2: RViz2}."
    notes = {"system.packages": packages, "topics": _TOPICS, "commands": ""}
    return document(_RUNNING_HEAD, data, notes)


def _topics(lab: Lab, steps: Sequence[Step]) -> Iterator[tuple[str, dict[str, Any]]]:
    ids = {graph: step.id for step in steps for graph in step.graphs}
    order = [step.id for step in steps]
    by_name: dict[str, list[GraphTopic]] = {}
    for graph_topic in graph_topics(lab):
        if graph_topic.type is not None:
            by_name.setdefault(graph_topic.name, []).append(graph_topic)
    for name, same in by_name.items():
        publishers = sum(not topic.is_subscribed for topic in same)
        first = min(same, key=lambda topic: order.index(ids[topic.graph]))
        sending = [lab.graphs[t.graph].nodes[t.role] for t in same if not t.is_subscribed]
        entry: dict[str, Any] = {"type": first.type, "from": ids[first.graph]}
        entry["handout"] = lab.graphs[first.graph].handout
        if not publishers:
            entry |= {"subscribed": True, "source": _SOURCE}
        elif name not in transform_topics(lab):
            entry["publishers"] = publishers
            frames = {topic.frames for topic in same if not topic.is_subscribed}
            fields = dict(zip(FRAME_FIELDS, frames.pop() if len(frames) == 1 else (), strict=False))
            if any(fields.values()):
                entry["fields"] = {field: frame for field, frame in fields.items() if frame}
        elif all(
            (tf := node.type.tf) is not None and tf.static and spec_value(node, tf.static) is True
            for node in sending  # once, for those who come late as well
        ):
            entry["durability"] = KEPT
        yield name, entry


def _commands(topics: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the commands that show every topic, and a message of each that is published."""
    yield {"kind": "node_list", "handout": "A1"}
    yield {"kind": "topic_list", "handout": "A1"}
    for name, entry in topics.items():
        command = {"of": name, "from": entry["from"], "handout": entry["handout"]}
        yield {"kind": "topic_type", **command}
        if not entry.get("subscribed"):
            if entry.get("durability") != KEPT:  # what comes once has no rate
                yield {"kind": "topic_hz", **command}
            yield {"kind": "topic_echo", **command}
