"""What a lab refers to and does not have: checkpoints, sections, variables, trees, files."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from msgspec import to_builtins

from lab3_usd.data import program
from lab3_usd.errors import SpecError
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.spec.contradictions.names import (
    LabFault,
    file_of,
    frame_contradictions,
    likely,
    misspelled,
    spec_value,
    topic_faults,
    transform_topics,
)
from lab3_usd.spec.contradictions.scene import (
    KnownScene,
    known_scenes,
    prop_faults,
    scene_faults,
)
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, STARTER, SUBMISSION, Lab
from lab3_usd.spec.positions import written_place
from lab3_usd.spec.ros import FROM_THE_FIRST
from lab3_usd.spec.submission import TEAM, ChecklistSpec, has_teams
from lab3_usd.yaml_file import read_yaml

_ANY_STAGES = ("", "all", "last")
_GOALS = "goals"  # saved output that is read from a topic and from a log


def checkpoint_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield each reference to a checkpoint that the lab does not have."""
    ids = ", ".join(lab.ids)
    for file, key, checkpoint in _references(lab):
        if checkpoint != FROM_THE_FIRST and checkpoint not in lab.checkpoints:
            message = f"there is no checkpoint '{checkpoint}'"
            yield LabFault(file, key, message, f"{CHECKPOINTS} has {ids}")


def _references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and checkpoint of everything that names one."""
    for robot in lab.scene.robots:
        yield SCENE, f"{robot.key}: pose_is_error_until", robot.pose_is_error_until
    for name, prop in lab.scene.props.items():
        yield from ((SCENE, f"props: {name}: until", key) for key in prop.until)
    for graph in lab.graphs.values():
        for role, node in graph.nodes.items():
            yield file_of(graph), f"{role}: from", node.since
            yield from ((file_of(graph), f"{role}: until", key) for key in node.until)
    for name in lab.submission.stages.differ:
        yield SUBMISSION, "stages: differ", name
    for line in lab.submission.checklist:
        if line.stages not in _ANY_STAGES:
            yield SUBMISSION, _line_key(line, "stages"), line.stages
    for file, data in _plain(lab).items():
        yield from ((file, key, name) for key, name in _inside(data, "", ("from",)))


def _line_key(line: ChecklistSpec, key: str) -> str:
    return f"checklist: {line.section}: '{line.text}': {key}"


def ending_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield endings of files that are none."""
    stages = lab.submission.stages
    every = {"endings": stages.endings, "openable": stages.openable, "slips": stages.slips}
    for key, endings in every.items():
        for ending in endings:
            if not ending.startswith("."):
                message = f"'{ending}' is not an ending, '.{ending}' is"
                yield LabFault(SUBMISSION, f"stages: {key}", message)


def policy_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield names in the rules for all graphs that are none, and nodes before their graph."""
    policy, types = lab.policy, lab.platform.types
    if policy.tick not in types:
        hint = likely(policy.tick, lab.platform.events)
        yield LabFault(CHECKPOINTS, "policy: tick", f"'{policy.tick}' is not a node type{hint}")
    named = {"keep_default": policy.keep_default, "stamp_reset: ports": policy.stamp_reset.ports}
    named["stamp_reset: with"] = (policy.stamp_reset.agree,)
    inputs = {port.partition(":")[2] for kind in types.values() for port in kind.ports}
    for key, names in named.items():
        for name in names:
            if name not in inputs:
                message = f"'{name}' is not an input{likely(name, inputs)}"
                yield LabFault(CHECKPOINTS, f"policy: {key}", message)
    comes = {name: point for point in lab.checkpoints.values() for name in point.new}
    for name, graph in lab.graphs.items():
        for role, node in graph.nodes.items():
            first = comes.get(name)
            if first is None or node.since not in lab.checkpoints:
                continue
            if not lab.is_after(node.since, first.id):
                message = f"the graph comes with checkpoint {lab.key_of(first.id)}"
                yield LabFault(
                    file_of(graph), f"{role}: from", message, f"{CHECKPOINTS}: checkpoints"
                )


def checklist_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield names in the checklists that are neither handed in nor saved."""
    saved = {(command.kind.name, command.target) for command in lab.ros.commands} | {(_GOALS, "")}
    for line in lab.submission.checklist:
        for name in line.deliverables:
            if name not in lab.submission.deliverables:
                message = f"there is no deliverable '{name}'"
                yield LabFault(
                    SUBMISSION,
                    _line_key(line, "deliverables"),
                    message,
                    _known("deliverables", lab.submission.deliverables),
                )
        for shown in line.shown:
            kind, _, target = shown.partition(" ")
            if (kind, target) not in saved:
                message = f"no command of {ROS} saves '{shown}'"
                targets = [what for name, what in saved if name == kind]
                where = f"{ROS}: commands"
                other = _known(f"{where} with kind {kind}", sorted(targets)) if targets else where
                yield LabFault(SUBMISSION, _line_key(line, "shown"), message, other)


def _known(where: str, names: Collection[str]) -> str:
    return f"{where}: {', '.join(names)}"


def rubric_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what the lab's own rubric leaves out or contradicts.

    Other faults of a rubric are reported when points are given (`grade/scoring/`).

    Raises:
        SpecError: the file is no YAML.
    """
    if not (lab.folder / RUBRIC).is_file():
        return
    items = _items(read_yaml(lab.folder / RUBRIC))
    asked = set()
    for name, item in items.items():
        key = str(item.get("checkpoint", ""))
        checkpoint = lab.ids.get(key, key)
        asked.add(checkpoint)
        if checkpoint and checkpoint not in lab.checkpoints:
            message = f"there is no checkpoint '{checkpoint}'"
            other = f"{CHECKPOINTS} has {', '.join(lab.ids)}"
            yield LabFault(RUBRIC, f"items: {name}: checkpoint", message, other)
        title = str(item.get("title", ""))
        yield from misspelled(lab, title, RUBRIC, f"items: {name}: title")
    for checkpoint in lab.checkpoints:
        if checkpoint not in asked:
            message = "no item of the rubric gives points for it"
            key = f"checkpoints: '{lab.key_of(checkpoint)}'"
            yield LabFault(CHECKPOINTS, key, message, f"{RUBRIC}: items", "warning")


def _items(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    items = data.get("items")
    if not isinstance(items, dict):
        return {}
    return {name: item for name, item in items.items() if isinstance(item, dict)}


_FORM = r"[A-Z]\d+"  # of sections of parts that the list lacks
_NUMBER = re.compile(r"\d+$")
_KEYS = ("handout", "rate")  # `rate` names the section that asks for one
_SECTIONS, _BY_HAND = "handout: sections", "handout: by_hand"
RULES = "handout: rules"


def section_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what the list of sections, where the lab has one, and the items do not agree about."""
    sections = lab.handout.names
    if not sections:
        return
    leads = lab.handout.leads
    form = re.compile(
        "|".join([*(rf"(?<!\w){re.escape(lead)}\d+" for lead in leads.values()), _FORM])
    )
    named: dict[str, tuple[str, str]] = {}
    for file, key, text in _section_references(lab):
        for section in form.findall(text):
            named.setdefault(section, (file, key))
    yield from _unknown(lab, named, {*sections}, leads)
    for section in sections:
        if section not in named:
            message = f"no item names section {section}"
            other = f"name it in {CHECKPOINTS}: {_BY_HAND} if nothing shows it"
            key = f"{_SECTIONS}: {_part_of(section, leads)}"
            yield LabFault(CHECKPOINTS, key, message, other, "warning")


def _part_of(section: str, leads: Mapping[str, str]) -> str:
    """Return the part of the handout that a section is in, of a part that it lacks the letter."""
    lead = _NUMBER.sub("", section)
    return next((part for part, own_lead in leads.items() if own_lead == lead), section[0])


def _unknown(
    lab: Lab,
    named: Mapping[str, tuple[str, str]],
    sections: Collection[str],
    leads: Mapping[str, str],
) -> Iterator[LabFault]:
    """Yield sections that the list does not have, and once each part that it does not have."""
    where, parts = f"{CHECKPOINTS}: {_SECTIONS}", set(lab.handout.sections)
    for section, (file, key) in named.items():
        part = _part_of(section, leads)
        if part not in parts:
            parts.add(part)
            message = f"the handout has no part {part}"
            yield LabFault(file, key, message, where, "warning")
        elif part in lab.handout.sections and section not in sections:
            yield LabFault(file, key, f"the handout has no section {section}", where)


def _section_references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and text of everything that names sections."""
    for graph in lab.graphs.values():
        for key, text in _of_graph(graph):
            yield file_of(graph), key, text
    yield from ((CHECKPOINTS, _BY_HAND, section) for section in lab.handout.by_hand)
    for rule, section in lab.handout.rules.items():
        yield CHECKPOINTS, f"{RULES}: {rule}", section
    for point in lab.checkpoints.values():
        key = f"checkpoints: '{lab.key_of(point.id)}': removes"
        yield from ((CHECKPOINTS, key, gone.handout) for gone in point.removals if gone.handout)
    for file, data in _plain(lab).items():
        yield from ((file, key, text) for key, text in _inside(data, "", _KEYS))


def _plain(lab: Lab) -> dict[str, Any]:
    """Return what the files of a lab say beside graphs and checkpoints, as plain data."""
    return {
        SCENE: to_builtins(lab.scene),
        ROS: to_builtins(lab.ros),
        SUBMISSION: to_builtins(lab.submission),
        CHECKPOINTS: {"frames": to_builtins(lab.frames), "policy": to_builtins(lab.policy)},
    }


def _of_graph(graph: GraphSpec) -> Iterator[tuple[str, str]]:
    yield "handout", graph.handout
    for node in graph.nodes.values():
        yield f"{node.role}: handout", node.handout
        sections = [(setting.port, setting.handout) for setting in node.settings]
        sections += [(target.port, target.handout) for target in node.targets]
        for port, section in (*sections, *node.keep):
            yield f"{node.role}: {port.partition(':')[2]}", section
    for wire in (*graph.wires, *graph.optional_wires, *graph.forbidden_wires):
        yield f"wire '{wire}'", wire.handout


def _inside(data: Any, place: str, names: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield the texts that plain data have at keys of these names, each with the keys before."""
    if isinstance(data, dict):
        for name, value in data.items():
            inner = f"{place}: {name}" if place else str(name)
            if name in names and isinstance(value, str):
                yield inner, value
            else:
                yield from _inside(value, inner, names)
    elif isinstance(data, (list, tuple)):
        for number, value in enumerate(data, start=1):
            yield from _inside(value, f"{place}: entry {number}", names)


def domain_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield domains of graphs that are not one, and a domain of the system that none of them is."""
    places: dict[object, str] = {}
    ros = lab.platform.ros
    port, switch = f"{INPUT}{ros.domain}", f"{INPUT}{ros.domain_by_environment}"
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            if port in node.type.ports and spec_value(node, switch) is False:
                domain = spec_value(node, port)
                places.setdefault(domain, f"{file_of(graph)}: {node.role}: {ros.domain}")
        yield from _without_context(graph, places)
    system = lab.ros.system.domain
    (first, place), *more = [*places.items()] or [(system, "")]
    for second, other in more:
        file, _, key = other.partition(": ")
        message = f"the domain is {second}, in another graph {first}: no listener receives both"
        yield LabFault(file, key, message, place, "warning")
    if places and system not in places:
        message = f"{system} is the domain of no graph, {first} is"
        yield LabFault(ROS, "system: domain", message, place)


_CONTEXT = "context"


def _without_context(graph: GraphSpec, places: Mapping[object, str]) -> Iterator[LabFault]:
    """Yield nodes without a context, whose domain is that of the environment, beside others."""
    port = f"{INPUT}{_CONTEXT}"
    for node in graph.nodes.values() if places else ():
        is_wired = (node.role, port) in graph.wired_inputs
        if node.type.role and port in node.type.ports and not is_wired:
            message = "it is not connected: the domain is that of ROS_DOMAIN_ID"
            place = next(iter(places.values()))
            yield LabFault(file_of(graph), f"{node.role}: {_CONTEXT}", message, place, "warning")


def team_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield values by team where no name of a file says which team it is."""
    if lab.by_team and not has_teams(lab.files):
        message = f"no {TEAM}, so that only --team and folders as team_7 say whose values count"
        yield LabFault(CHECKPOINTS, "files", message, lab.by_team[0], "warning")


def tree_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield trees on topics on which no graph sends transforms."""
    sent = sorted(transform_topics(lab))
    for tree in lab.frames.trees:
        if tree.topic not in sent:
            hint = likely(tree.topic, sent)
            message = f"'{tree.topic}' is not a topic of the graphs' transforms{hint}"
            yield LabFault(CHECKPOINTS, f"frames: trees: {tree.topic}", message)


def variable_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield the nodes that name a variable which their graph does not have."""
    for graph in lab.graphs.values():
        variables = [variable.name for variable in graph.variables]
        for node in graph.nodes.values():
            port = next(iter(node.type.variable), "")
            if not port or (node.role, port) in graph.wired_inputs:
                continue
            name = spec_value(node, port)
            if name not in variables:
                hint = likely(str(name), variables)
                message = f"'{name}' is not a variable of the graph{hint}"
                key = f"{node.role}: {port.partition(':')[2]}"
                yield LabFault(file_of(graph), key, message, "variables", "warning")


_FIXED = (CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, STARTER, SUBMISSION)


def lab_faults(lab: Lab, stages: Sequence[KnownScene] = ()) -> Iterator[LabFault]:
    """Yield what contradicts itself in the description of a lab, and what is left out, each once.

    `stages` are stages of the lab, where some are given.

    Raises:
        SpecError: the rubric or the description of the starter is no YAML.
    """
    yield from dict.fromkeys(_all_faults(lab, stages))


def _all_faults(lab: Lab, stages: Sequence[KnownScene]) -> Iterator[LabFault]:
    yield from checkpoint_faults(lab)
    yield from policy_faults(lab)
    yield from ending_faults(lab)
    yield from checklist_faults(lab)
    yield from frame_contradictions(lab)
    yield from topic_faults(lab)
    yield from variable_faults(lab)
    yield from team_faults(lab)
    yield from tree_faults(lab)
    yield from domain_faults(lab)
    yield from rubric_faults(lab)
    yield from section_faults(lab)
    scenes = known_scenes(lab, stages)
    yield from scene_faults(lab, scenes)
    yield from prop_faults(lab, scenes)
    yield from _unused_files(lab)


def refuse_faulty(lab: Lab) -> None:
    """Refuse a lab that contradicts itself.

    Raises:
        SpecError: it does; the line names file, key and both places of the first contradiction.
    """
    errors = [fault for fault in lab_faults(lab) if fault.severity == "error"]
    if errors:
        more = f"; and {len(errors) - 1} more, see {program()} lab check" if len(errors) > 1 else ""
        place = written_place(lab.folder, errors[0].place)
        raise SpecError(f"{errors[0]}, at {place}{more}")


def _unused_files(lab: Lab) -> Iterator[LabFault]:
    """Yield the YAML files that no checkpoint asks for."""
    used = {*_FIXED, *(file_of(graph) for graph in lab.graphs.values())}
    for path in sorted(lab.folder.glob("*.yaml")):
        if path.name not in used:
            message = "no checkpoint adds this graph"
            yield LabFault(path.name, "graph", message, f"{CHECKPOINTS}: checkpoints", "warning")
