"""Reads a folder of saved diagnostics, of the collecting script or saved by hand."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from lab3_usd.deliverables.evidence import outputs
from lab3_usd.deliverables.evidence.commands import CommandOutput, split_outputs
from lab3_usd.deliverables.evidence.outputs import parse_messages
from lab3_usd.files import first_bytes
from lab3_usd.model.folder import Evidence, GoalRun, Lookup, Observation
from lab3_usd.spec.ros import GoalSpec, RosSpec

MANIFEST = "manifest.tsv"
_ENDINGS = {"", ".txt", ".log", ".out", ".md", ".gv", ".dot", ".yaml", ".yml"}
_MOST_BYTES = 1_000_000  # of a file; the header of a message stands before its many numbers
_MOST_OF_ALL = 4_000_000
_MOST_FILES = 2_000
_PARSERS: Mapping[str, Callable[[str], object]] = {
    "topic_list": outputs.parse_names,
    "node_list": outputs.parse_names,
    "topic_type": outputs.parse_topic_types,
    "topic_hz": outputs.parse_rate,
    "topic_echo": outputs.parse_message,
    "topic_info": outputs.parse_endpoints,
    "lifecycle": outputs.parse_state,
    "tf2_echo": outputs.parse_lookup,
    "view_frames": outputs.parse_tree,
    "packages": outputs.parse_packages,
}
# What it means that a command, known to have run, printed nothing.
_SILENCE: Mapping[str, object] = {
    "topic_type": (),
    "topic_hz": 0.0,
    "topic_echo": {},
    "topic_info": (),
    "lifecycle": "no answer",
    "tf2_echo": Lookup(found=False),
}
_NEVER_RAN = {126, 127}  # exit statuses of a shell
_MEASURED = re.compile(r"(?m)^goal status:\s*(\d)(?:\s*\ngoal seconds:\s*([\d.]+))?")
_RESULT = re.compile(r"(?m)^Goal finished with status:\s*(\w+)")
# by kind of output, then by what it is about
_Found = dict[str, dict[str, list[Observation[Any]]]]


def read_listed(
    root: Path, usable: Sequence[str], folders: Sequence[str], ros: RosSpec
) -> Evidence:
    """Read everything that the texts of a submission show, `usable` being what may be opened.

    Of those, texts in `folders` and below are read.
    """
    files = {
        path: root / path for folder in folders for path in usable if path.startswith(f"{folder}/")
    }
    return read_texts(files, folders[0], ros)


def read_texts(files: Mapping[str, Path], folder: str, ros: RosSpec) -> Evidence:
    """Read all saved output, by the names of its files.

    Texts of no known form are left out. Where the collecting script saved an output, its file
    speaks for that command alone, and its silence says something.
    """
    observations: _Found = {
        kind: {} for kind in (*_PARSERS, "listed_type", "topic_hearers", "goals")
    }
    texts = _texts(files)
    runs = {
        (PurePosixPath(name).parent / run.file).as_posix(): run
        for name in texts
        if PurePosixPath(name).name == MANIFEST
        for run in outputs.parse_manifest(texts[name])
    }
    for file, text in texts.items():
        name = PurePosixPath(file).name
        if name == MANIFEST:
            continue
        ran = file in runs and runs[file].exit not in _NEVER_RAN
        for kind, target, fact in _facts(text, name, ros, ran=ran):
            observations[kind].setdefault(target, []).append(Observation(fact, file))
    kept: dict[str, Any] = {kind: _preferred(of, set(runs)) for kind, of in observations.items()}
    return Evidence(folder=folder, runs=tuple(runs.values()), **kept)


def _texts(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the texts among files by their names, the collecting script's list first.

    Of a long one its beginning is read, and no more than so much of all of them together.
    """
    room = _MOST_OF_ALL
    texts: dict[str, str] = {}
    names = [
        name
        for name, path in zip(files, map(PurePosixPath, files), strict=True)
        if path.name == MANIFEST or path.suffix.lower() in _ENDINGS
    ]
    for name in sorted(names, key=lambda name: PurePosixPath(name).name != MANIFEST)[:_MOST_FILES]:
        data = first_bytes(files[name], min(_MOST_BYTES, room))
        room -= len(data)
        wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
        texts[name] = data.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    return texts


def _facts(text: str, name: str, ros: RosSpec, *, ran: bool) -> Iterator[tuple[str, str, object]]:
    """Yield kind, target and fact of everything that a text shows; `ran`: it is an output."""
    for block in split_outputs(text, name, ros):
        if not outputs.was_run(block.text):
            continue
        if block.kind == "lifecycle" and not block.target:
            states = outputs.parse_states(block.text)
            yield from (("lifecycle", node, state) for node, state in states.items())
            continue
        fact = _PARSERS[block.kind](block.text)
        if fact is None and ran:
            fact = _SILENCE.get(block.kind)
        if fact is not None:
            yield block.kind, block.target, fact
        if block.kind == "topic_list":
            for topic, kind in outputs.parse_listed_types(block.text).items():
                yield "listed_type", topic, (kind,)
        if block.kind == "topic_info":
            listed, hearers = outputs.parse_info_type(block.text), outputs.parse_hearers(block.text)
            if listed is not None:
                yield "listed_type", block.target, (listed,)
            if hearers is not None:
                yield "topic_hearers", block.target, hearers
        if ros.goal is not None and block.target == ros.goal.status:
            yield from (("goals", "", goal) for goal in _goal_by_status(block))
    words = () if ros.goal is None else _goal_by_words(text, ros.goal)
    yield from (("goals", "", goal) for goal in words)


def _goal_by_status(block: CommandOutput) -> Iterator[GoalRun]:
    """Read the last goal of the last `action_msgs/msg/GoalStatusArray` that was echoed."""
    for message in parse_messages(block.text)[-1:]:
        statuses = [value for path, value in message.items() if path.endswith("status")]
        if statuses and isinstance(statuses[-1], int):
            yield GoalRun(statuses[-1])


def _goal_by_words(text: str, goal: GoalSpec) -> Iterator[GoalRun]:
    """Read what the collecting script, `ros2 action send_goal` or Nav2's log say of a goal."""
    measured = _MEASURED.search(text)
    if measured:
        yield GoalRun(int(measured[1]), outputs.parsed_number(measured[2]) if measured[2] else None)
    numbers = {name: number for number, name in enumerate(goal.names)}
    results = [word.lower() for word in _RESULT.findall(text)]
    # The log of a node, where its name stands in brackets before what it says.
    logged = {text.rfind(f"]: {words}"): name for name, words in goal.log.items()}
    last = logged[max(logged)] if max(logged) >= 0 else ""
    for word in [*results[-1:], last]:
        if word in numbers:
            yield GoalRun(numbers[word])


def _preferred(
    outputs_of: dict[str, list[Observation[Any]]], recorded: set[str]
) -> dict[str, tuple[Observation[Any], ...]]:
    kept: dict[str, tuple[Observation[Any], ...]] = {}
    for target, shown in outputs_of.items():
        own = [record for record in shown if record.file in recorded]
        kept[target] = tuple(own or shown)
    return kept
