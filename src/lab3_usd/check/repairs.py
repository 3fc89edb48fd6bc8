"""Repairs that rules share: what makes a property of a node right, and what ends its harm."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.check.match.conformance import setting_matches, source_path
from lab3_usd.check.match.subject import GraphSubject, StageSubject
from lab3_usd.check.robot.poses import ORDER
from lab3_usd.check.robot.wheels import base_side, wheel_joints
from lab3_usd.check.ros.topics import likely_name
from lab3_usd.model.changes import (
    Activate,
    ApplySchema,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemovePrim,
    RemoveSchema,
    RenameProperty,
    Restore,
    Retarget,
    SetValue,
    repair_by,
)
from lab3_usd.model.finding import Finding, Severity
from lab3_usd.model.physics import FIXED, JOINT_ENABLED
from lab3_usd.model.stage import Node, PortState
from lab3_usd.spec.catalog import Catalog, NodeType, Port
from lab3_usd.spec.graph import NodeSpec

TYPE, VERSION = "node:type", "node:typeVersion"


def edits_at(subject: GraphSubject, *properties: str) -> tuple[Edit, ...]:
    """Return what makes properties right, given by their paths, of nodes that play a role."""
    return tuple(edit for path in properties for edit in _site_edits(subject, path))


def _site_edits(subject: GraphSubject, path: str) -> Iterator[Edit]:
    prim, _, name = path.partition(".")
    role, node = subject.roles.role_of.get(prim), subject.live_nodes.get(prim)
    if role is None:
        retyped = subject.roles.retyped.items()
        role = next((role for role, stand_in in retyped if stand_in.path == prim), None)
    if role is not None and node is not None:
        yield from _property_edits(subject, role, node, name)


def edits_in_stage(whole: StageSubject, prim: str, name: str | None) -> tuple[Edit, ...]:
    """Return what makes a property of a node right by every graph in which it plays a role."""
    graphs = whole.graphs if name else ()
    return tuple(edit for subject in graphs for edit in edits_at(subject, f"{prim}.{name}"))


def edits_of_harm(
    whole: StageSubject, prim: str, name: str | None = None, severity: Severity | None = None
) -> tuple[Edit, ...]:
    """Return what ends the harm that a node does: one without a role is removed if it is sure."""
    extra = (node.path for roles in whole.roles.values() for node in roles.extra)
    is_removed = severity in {None, "error"} and prim in extra
    return (RemovePrim(prim),) if is_removed else edits_in_stage(whole, prim, name)


def _property_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
    """Yield what makes one property of a node right; nothing where it is."""
    spec = subject.spec.nodes[role]
    port = spec.type.port(name)
    if name in {TYPE, VERSION}:
        yield from _type_edits(spec, node)
    elif port is None:
        yield from _unknown_port_edits(subject, role, node, name)
    elif port.is_target:
        yield from _target_edits(spec, node, name)
    else:
        yield from _renaming(spec, node, name)
        yield from _wire_edits(subject, role, node, port)
        yield from _value_edits(subject, role, node, port)


def _type_edits(spec: NodeSpec, node: Node) -> Iterator[Edit]:
    if node.type_name != spec.type.type:
        yield SetValue(node.path, TYPE, "token", spec.type.type)
    if node.version != spec.type.version:
        yield SetValue(node.path, VERSION, "int", spec.type.version)


def modern_types(nodes: Iterable[Node], catalog: Catalog) -> Iterator[Edit]:
    """Yield the names that the types of nodes have now, where they are of an earlier release."""
    for node in nodes:
        now = catalog.modern(node.type_name)
        if now != node.type_name:
            yield SetValue(node.path, TYPE, "token", now)


def _unknown_port_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
    """Yield what makes a port right that the type does not have: its name, else no connection."""
    kind = subject.spec.nodes[role].type
    likely = likely_name(name, [*kind.ports])
    if likely is not None and _misspelt(kind, node, likely) == name:
        yield from _property_edits(subject, role, node, likely)
    elif node.sources(name):
        yield Connect(node.path, name, "token")


def _renaming(spec: NodeSpec, node: Node, name: str) -> Iterator[Edit]:
    written = _misspelt(spec.type, node, name)
    if written is not None:
        yield RenameProperty(node.path, written, name)


def _misspelt(kind: NodeType, node: Node, name: str) -> str | None:
    """Return the property that was likely meant to be a port which the node does not have."""
    unknown = [port for port in node.ports if kind.port(port) is None]
    written = likely_name(name, unknown) if name not in node.ports else None
    return written if written and likely_name(written, [*kind.ports]) == name else None


def _target_edits(spec: NodeSpec, node: Node, name: str) -> Iterator[Edit]:
    asked = next((target.prims for target in spec.targets if target.port == name), ())
    if node.targets(name) != asked:
        yield Retarget(node.path, name, asked)


def _wire_edits(subject: GraphSubject, role: str, node: Node, port: Port) -> Iterator[Edit]:
    actual = node.sources(port.name)
    asked = tuple(_sources(subject, role, node, port.name))
    if actual != asked:
        yield Connect(node.path, port.name, port.usd_type, asked)


def _sources(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[str]:
    """Yield what an input should be connected to; an optional connection stays."""
    for wire in (*subject.spec.wires, *subject.spec.optional_wires):
        source = subject.roles.node_of[wire.source.role]
        if (wire.target.role, wire.target.port) == (role, name) and source is not None:
            path = source_path(source, wire)
            if wire in subject.spec.wires or path in node.sources(name):
                yield path


def _value_edits(subject: GraphSubject, role: str, node: Node, port: Port) -> Iterator[Edit]:
    spec, state = subject.spec.nodes[role], node.state(port.name)
    setting = next((each for each in spec.settings if each.port == port.name), None)
    if setting is not None:
        is_typed = state is None or state.usd_type in {"", port.usd_type}
        if not is_typed or not setting_matches(node, setting, node.value(port.name)):
            yield SetValue(node.path, port.name, port.usd_type, setting.value)
    elif state is not None and not _is_left_alone(subject, role, state, port):
        yield ClearValue(node.path, port.name)


def _is_left_alone(subject: GraphSubject, role: str, state: PortState, port: Port) -> bool:
    """Whether an input that the handout does not set has no value of its own, or is connected."""
    is_connected = any(wire.target.port == port.name for wire in subject.spec.wires_into(role))
    return is_connected or state.value is None or state.value == port.default


_SCHEMA = r"[A-Z]\w+API(:\w+)?"
_UNWANTED = ("S21", "S23", "L07")
_EARLY = ("S18", "L08", "C09", "D07")
_MISSING_PRIM = "S01"
_MOVED = (_MISSING_PRIM, "S07", "L02", "C02")
_ARTICULATION = "S11"
_WHEEL_SHAPE = "S06"
_LOOSE_LINK = "S12"
_NOT_AT_REST = "S19"
_OTHER_ASSET = "L11"  # a reference to an asset that is not here
_FRAMES = "physics:local"
_SCENE = ("S", "L", "C")


def with_repairs(findings: Iterable[Finding], whole: StageSubject) -> Iterator[Finding]:
    """Yield the findings, those that have one right repair together with it."""
    for finding in findings:
        is_open = finding.severity != "note" and finding.fix is None
        edits = tuple(_edits(finding, whole)) if is_open else ()
        yield replace(finding, fix=repair_by(edits)) if edits else finding


def _edits(finding: Finding, whole: StageSubject) -> Iterator[Edit]:
    if finding.rule in (*_UNWANTED, *_EARLY):
        yield RemovePrim(finding.prim)
    elif finding.rule in _MOVED and finding.expected in finding.related:
        yield from _move(finding)
    elif finding.rule[0] in _SCENE:
        yield from _scene_edits(finding, whole)


def _move(finding: Finding) -> Iterator[Edit]:
    if finding.expected is not None and finding.expected != finding.prim:
        yield MovePrim(finding.prim, finding.expected)


def _sites(finding: Finding) -> Iterator[tuple[str, str]]:
    """Yield the properties that a finding names."""
    if finding.property:
        yield finding.prim, finding.property
    for each in finding.related:
        prim, dot, name = each.partition(".")
        if dot:
            yield prim, name


def _scene_edits(finding: Finding, whole: StageSubject) -> Iterator[Edit]:
    schema = finding.expected if re.fullmatch(_SCHEMA, finding.expected or "") else None
    if finding.rule == _ARTICULATION:
        yield from _articulation_edits(finding, whole, is_there=schema is None)
    elif schema is not None and finding.rule != _WHEEL_SHAPE:
        yield ApplySchema(finding.prim, schema)
    elif schema is None and re.fullmatch(_SCHEMA, finding.actual or ""):
        yield RemoveSchema(finding.prim, finding.actual or "")
    elif finding.rule == _WHEEL_SHAPE and len(off := _deactivated(finding, whole)) == 1:
        yield Activate(off[0])
    elif schema is not None:
        yield Restore(finding.prim)
    else:
        yield from _restores(finding, whole)


def _restores(finding: Finding, whole: StageSubject) -> Iterator[Edit]:
    """Yield how to restore the properties that a finding names, else its prims."""
    if finding.property:
        sites = () if _is_turned_round(finding, whole) else _sites(finding)
        yield from (Restore(*site) for site in sites)
    elif finding.rule == _MISSING_PRIM and finding.related:  # where the prim seems to be
        if len(finding.related) == 1:
            yield MovePrim(finding.related[0], finding.prim)
    elif finding.expected == FIXED:  # a joint of another type
        yield Restore(finding.prim)
    elif finding.rule == _LOOSE_LINK and finding.related:  # joints that are switched off
        yield from (Restore(each, JOINT_ENABLED) for each in finding.related)
    elif not _is_out_of_reach(finding, whole):
        yield from map(Restore, (finding.prim, *finding.related))


def _is_out_of_reach(finding: Finding, whole: StageSubject) -> bool:
    """Whether a fault is in what a prim refers to, or in a prim above the one that is named."""
    if finding.rule == _NOT_AT_REST and finding.prim == whole.lab.scene.robot.path:
        grounds = map(whole.stage.prim, finding.related)
        return not any(ORDER in ground.attributes for ground in grounds if ground)
    return finding.rule == _OTHER_ASSET


def _is_turned_round(finding: Finding, whole: StageSubject) -> bool:
    """Whether it is about the frame of a joint whose bodies are the other way round."""
    return (finding.property or "").startswith(_FRAMES) and any(
        joint.site == finding.prim and base_side(joint) == 1 for joint in wheel_joints(whole)
    )


def _deactivated(finding: Finding, whole: StageSubject) -> list[str]:
    """Return what is deactivated at and below the link that a finding is about."""
    link = next(iter(finding.related), finding.prim)
    return [prim.path for prim in whole.stage.below(link) if not prim.active]


def _articulation_edits(finding: Finding, whole: StageSubject, *, is_there: bool) -> Iterator[Edit]:
    """Yield how to have one articulation root, switched on, on the prim that the lab names."""
    asked = whole.lab.scene.robot.articulation
    if is_there:
        yield RemoveSchema(finding.prim, asked.api)
        yield ApplySchema(asked.target, asked.api)
    else:
        yield ApplySchema(finding.prim, asked.api)
        yield ClearValue(finding.prim, asked.switch)


_MISSING, _STARTER_SCHEMA, _PLACE, _ADDED = "U01", "U03", "U05", "U07"
_ABSENT = "missing"
_POSE = "xformOpOrder"


def with_starter_repairs(
    findings: Iterable[Finding], is_supplied: Callable[[str], bool]
) -> Iterator[Finding]:
    """Yield the findings, those that have one right repair together with it.

    What stands elsewhere than in the starter has none: nothing is supplied at its path.
    Of several differences of a prim the first is repaired; the next one is found after that.
    """
    for finding in findings:
        is_there = finding.rule == _ADDED or is_supplied(finding.prim)
        edits = tuple(_starter_edits(finding)) if is_there else ()
        yield (
            replace(finding, fix=repair_by(edits))
            if edits and finding.severity != "note"
            else finding
        )


def _starter_edits(finding: Finding) -> Iterator[Edit]:
    if finding.rule == _MISSING and finding.actual != _ABSENT:
        yield Activate(finding.prim)
    elif finding.rule == _STARTER_SCHEMA and finding.expected:
        yield ApplySchema(finding.prim, finding.expected)
    elif finding.property or finding.rule == _PLACE:
        yield Restore(finding.prim, finding.property or _POSE)
    elif finding.rule != _ADDED:
        yield Restore(finding.prim)
