"""What a checkpoint asks for, item by item, and which items a stage meets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.candidates import moved
from lab3_usd.check.finding import Finding, Requirement, Score
from lab3_usd.check.frames import published_edges
from lab3_usd.check.met import setting_met, setting_value, source_path, target_met
from lab3_usd.check.model import Node
from lab3_usd.check.say import shown, titled
from lab3_usd.check.scene_item import is_met
from lab3_usd.check.scene_items import scene_items
from lab3_usd.check.subject import GraphSubject, StageSubject
from lab3_usd.check.tf_view import tf_view, waived_frames
from lab3_usd.spec.spec import Lab, NodeSpec, Setting, Target, Wire


def graph_requirements(subject: GraphSubject) -> Iterator[Requirement]:
    """Yield every node, setting, target and wire of one graph, met or not."""
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        yield _item(subject, "node", role, titled(spec), node is not None, spec.handout)
        for setting in spec.settings:
            yield _setting(subject, spec, setting, node)
        for target in spec.targets:
            if target.port not in spec.frames_from:
                yield _target(subject, spec, target, node)
    for wire in subject.spec.wires:
        yield _wire(subject, wire)


def _item(  # noqa: PLR0913, PLR0917 - one field of the requirement each
    subject: GraphSubject,
    kind: str,
    name: str,
    title: str,
    met: bool,  # noqa: FBT001
    handout: str,
) -> Requirement:
    group = subject.spec.name
    return Requirement(f"{group}/{kind}/{name}", group, kind, title, met, handout)


def _setting(
    subject: GraphSubject, spec: NodeSpec, setting: Setting, node: Node | None
) -> Requirement:
    short = setting.port.partition(":")[2]
    met = node is not None and setting_met(
        node, setting, setting_value(subject.live, node, setting.port)
    )
    title = f"{titled(spec)}: {short} = {shown(setting.value)}"
    return _item(subject, "setting", f"{spec.role}.{short}", title, met, setting.handout)


def _target(
    subject: GraphSubject, spec: NodeSpec, target: Target, node: Node | None
) -> Requirement:
    short = target.port.partition(":")[2]
    met = node is not None and target_met(node, target)
    title = f"{titled(spec)}: {short} = {', '.join(target.prims)}"
    return _item(subject, "target", f"{spec.role}.{short}", title, met, target.handout)


def _wire(subject: GraphSubject, wire: Wire) -> Requirement:
    source = subject.roles.node_of[wire.source.role]
    target = subject.roles.node_of[wire.target.role]
    met = source is not None and target is not None and _fed(subject, wire, source, target)
    return _item(subject, "wire", wire.target.short, str(wire), met, wire.handout)


def _fed(subject: GraphSubject, wire: Wire, source: Node, target: Node) -> bool:
    paths = [source_path(source, wire)]
    paths += [
        f"{path}.{wire.source.port}"
        for path, role in subject.roles.stand_ins.items()
        if role == wire.source.role
    ]
    return any(path in target.sources(wire.target.port) for path in paths)


def scene_requirements(
    subject: StageSubject, findings: Iterable[Finding], lab: Lab
) -> Iterator[Requirement]:
    """Yield every scene item; one is met when no error names its site.

    The items read as in `lab`, whose prims are looked up where they really stand.
    """
    told = [each for each in findings if each.severity == "error"]
    robot = lab.scene["robot"]["path"]
    for item in scene_items(lab, subject.checkpoint):
        met = is_met(replace(item, prim=_stands(item.prim, robot, subject.homes)), told)
        yield Requirement(item.id, item.group, "scene", item.title, met, item.handout)


def _stands(path: str, robot: str, homes: Mapping[str, str]) -> str:
    """Return where a prim of the lab stands; a link that stands elsewhere is where it is missed."""
    for expected, home in homes.items():
        if path == expected != robot:
            return path
        path = moved(path, {expected: home})
    return path


def frame_requirements(subject: StageSubject) -> Iterator[Requirement]:
    """Yield every TF edge that the checkpoint asks the stage to publish.

    One that a missing asset may hold, or that the handout's own way does not give, costs nothing.
    """
    if not subject.checkpoint.frames:
        return
    spec = subject.lab.frames
    waived = waived_frames(tf_view(subject))
    published = {(edge.parent, edge.child) for edge in published_edges(subject.stage, subject.lab)}
    parents = {child: parent for parent, child in sorted(published)}
    for parent, child in spec.edges:
        met = (parent, child) in published or (
            parent == spec.deeper_under and _is_below(child, parent, parents)
        )
        met = met or child in waived
        title = f"{parent} -> {child} is published"
        yield Requirement(f"TF/frame/{child}", "TF", "frame", title, met, spec.handout)


def _is_below(child: str, ancestor: str, parents: Mapping[str, str]) -> bool:
    """Whether a frame hangs, however deep, under another one."""
    seen: set[str] = set()
    while child in parents and child not in seen:
        seen.add(child)
        child = parents[child]
        if child == ancestor:
            return True
    return False


def score(requirements: Iterable[Requirement]) -> Score:
    """Count the requirements met and asked."""
    asked = list(requirements)
    return Score(float(sum(each.met for each in asked)), float(len(asked)))
