"""Sections of the handout: those that no item names, and names that are no sections."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import to_builtins

from lab3_usd.spec.files import CHECKPOINTS, ROS, SCENE, SUBMISSION
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.lint.graph_names import file_of

_FORM = r"[A-Z]\d+"  # of sections of parts that the list lacks
_NUMBER = re.compile(r"\d+$")
_KEYS = ("handout", "rate")  # `rate` names the section that asks for one
_SECTIONS, _BY_HAND = "handout: sections", "handout: by_hand"
RULES = "handout: rules"


def section_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what the list of sections, where the lab has one, and the items do not agree about."""
    known = lab.handout.names
    if not known:
        return
    leads = lab.handout.leads
    form = re.compile(
        "|".join([*(rf"(?<!\w){re.escape(each)}\d+" for each in leads.values()), _FORM])
    )
    named: dict[str, tuple[str, str]] = {}
    for file, key, text in _references(lab):
        for section in form.findall(text):
            named.setdefault(section, (file, key))
    yield from _unknown(lab, named)
    for section in known:
        if section not in named:
            message = f"no item names section {section}"
            other = f"name it in {CHECKPOINTS}: {_BY_HAND} if nothing shows it"
            key = f"{_SECTIONS}: {_part_of(section, lab)}"
            yield LabFault(CHECKPOINTS, key, message, other, "warning")


def _part_of(section: str, lab: Lab) -> str:
    """Return the part of the handout that a section is in, of a part that it lacks the letter."""
    leads = lab.handout.leads.items()
    return next((part for part, lead in leads if _NUMBER.sub("", section) == lead), section[0])


def _unknown(lab: Lab, named: Mapping[str, tuple[str, str]]) -> Iterator[LabFault]:
    """Yield sections that the list does not have, and once each part that it does not have."""
    where, parts = f"{CHECKPOINTS}: {_SECTIONS}", set(lab.handout.sections)
    for section, (file, key) in named.items():
        part = _part_of(section, lab)
        if part not in parts:
            parts.add(part)
            message = f"the handout has no part {part}"
            yield LabFault(file, key, message, where, "warning")
        elif part in lab.handout.sections and section not in lab.handout.names:
            yield LabFault(file, key, f"the handout has no section {section}", where)


def _references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and text of everything that names sections."""
    for graph in lab.graphs.values():
        for key, text in _of_graph(graph):
            yield file_of(graph), key, text
    yield from ((CHECKPOINTS, _BY_HAND, section) for section in lab.handout.by_hand)
    for rule, section in lab.handout.rules.items():
        yield CHECKPOINTS, f"{RULES}: {rule}", section
    parts = {
        SCENE: to_builtins(lab.scene),
        ROS: to_builtins(lab.ros),
        SUBMISSION: to_builtins(lab.submission),
        CHECKPOINTS: {"frames": to_builtins(lab.frames), "policy": to_builtins(lab.policy)},
    }
    for file, data in parts.items():
        yield from ((file, key, text) for key, text in _inside(data, ""))


def _of_graph(graph: GraphSpec) -> Iterator[tuple[str, str]]:
    yield "handout", graph.handout
    for node in graph.nodes.values():
        yield f"{node.role}: handout", node.handout
        said = [(each.port, each.handout) for each in node.settings]
        said += [(each.port, each.handout) for each in node.targets]
        for port, section in (*said, *node.keep):
            yield f"{node.role}: {port.partition(':')[2]}", section
    for wire in (*graph.wires, *graph.optional_wires, *graph.forbidden_wires):
        yield f"wire '{wire}'", wire.handout


def _inside(data: Any, key: str) -> Iterator[tuple[str, str]]:  # noqa: ANN401 - whatever YAML holds
    if isinstance(data, Mapping):
        for name, value in data.items():
            place = f"{key}: {name}" if key else str(name)
            if name in _KEYS and isinstance(value, str):
                yield place, value
            else:
                yield from _inside(value, place)
    elif isinstance(data, (list, tuple)):
        for number, value in enumerate(data, start=1):
            yield from _inside(value, f"{key}: entry {number}")
