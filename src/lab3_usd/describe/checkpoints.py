"""Describes the checkpoints of a new lab: a starter, then one for each graph of the stage."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.describe.yaml_text import document
from lab3_usd.errors import UsageError
from lab3_usd.spec.files import CHECKPOINTS
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab

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
    found = _NUMBER.search(stem) or next(iter([*_WORD.finditer(stem)][::-1]), None)
    if found is None:
        message = f"'{stem}' has no letter from A to Z and no digit; give the stage another name"
        raise UsageError(message)
    lead, last, rest = stem[: found.start()], found[0], stem[found.end() :]
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
        found = f"{first + step:0{len(last)}}" if first >= 0 else letters
        while found in taken:
            found += "x"
        taken.add(found)
        yield found


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
    policy = _policy().replace(lab.policy.tick, _tick(lab))
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
    said = "\n".join(lines[:end]).replace(", see decisions", "")
    return said.replace('handout: "decisions"', "handout: A1") + "\n"


def _tick(lab: Lab) -> str:
    """Return the type of the nodes that start most executions of the graphs."""
    events = Counter(
        node.type.type
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        if node.type.type in lab.catalog.events
    )
    return events.most_common(1)[0][0] if events else lab.policy.tick
