"""The topics and frames that the lab requires beside those of a stage, and who reports them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from msgspec import Struct

from lab3_usd.check.match.conformance import setting_matches, target_matches
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.facts.endpoints import TRANSFORMS, Endpoint, endpoints, resolve
from lab3_usd.facts.execution_order import effective_value, live_nodes, running_nodes
from lab3_usd.facts.frame_targets import (
    FRAME_APIS,
    Pair,
    UnresolvedFrames,
    computed_pairs,
    computes,
    expands,
    links_given_by,
    listed_targets,
    parent_prim,
    tf_ports,
    unknown_target,
)
from lab3_usd.facts.frames import Edge, published_edges, unresolved_frames
from lab3_usd.model.physics import BODY_API
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, once_per_stage
from lab3_usd.spec.graph import NodeSpec, Target
from lab3_usd.spec.lab import Checkpoint, Lab


@once_per_stage
def role_specs(subject: StageSubject) -> dict[str, NodeSpec]:
    """Map the path of each node that plays a role to the spec of the role."""
    return {
        path: subject.lab.graphs[name].nodes[role]
        for name, roles in subject.roles.items()
        for path, role in roles.role_of.items()
        if role in subject.lab.graphs[name].nodes
    }


def required_topic(spec: NodeSpec | None, port: str) -> str | None:
    """Return the topic that the lab wants at one input of a role, None where it wants none."""
    if spec is None:
        return None
    return next((resolve("", str(s.value)) for s in spec.settings if s.port == port), None)


@lru_cache(maxsize=16)
def required_topics(lab: Lab, checkpoint: Checkpoint) -> frozenset[str]:
    """Return the topics that the graphs of a checkpoint must publish or subscribe."""
    specs = (
        (node, port)
        for name in checkpoint.graphs
        for node in lab.graphs[name].nodes.values()
        for port in node.type.topics
    )
    topics = (required_topic(node, port) for node, port in specs)
    return frozenset(topic for topic in topics if topic)


def repeated_publishers(subject: StageSubject) -> Iterator[tuple[Endpoint, tuple[Endpoint, ...]]]:
    """Yield each publisher of a topic that has one already, with those others.

    Left out are transforms, a node whose setting differs from its role's (the rule of settings says
    so) and an extra node in a graph of the lab (the rule of extra nodes does).
    """
    played, tree = role_specs(subject), subject.lab.platform.ros.tree_topics
    required_by_lab = required_topics(subject.lab, subject.checkpoint)
    lab_graphs = {roles.graph.path for roles in subject.roles.values() if roles.graph}
    together: dict[str, list[Endpoint]] = {}
    for endpoint in endpoints(subject.stage, subject.lab.platform):
        if endpoint.topic and endpoint.runs and endpoint.direction == "publishes":
            required = required_topic(played.get(endpoint.node.path), endpoint.port)
            is_tree = endpoint.topic in tree or endpoint.type == TRANSFORMS
            if not is_tree and required in (None, endpoint.topic):
                together.setdefault(endpoint.topic, []).append(endpoint)
    for topic, group in together.items():
        owner = next((endpoint for endpoint in group if endpoint.node.path in played), group[0])
        for endpoint in group:
            is_lab_graph = _graph_of(endpoint) in lab_graphs and topic in required_by_lab
            if (
                endpoint is not owner
                and not is_lab_graph
                and endpoint.node.path not in subject.faulty_prims
            ):
                yield endpoint, tuple(rival for rival in group if rival is not endpoint)


def _graph_of(endpoint: Endpoint) -> str:
    return endpoint.node.path.rpartition("/")[0]


@once_per_stage
def repeating_graphs(subject: StageSubject) -> set[str]:
    """Return the paths of the graphs that publish a topic again."""
    return {_graph_of(again) for again, _ in repeated_publishers(subject)}


class TfView(Struct, frozen=True, eq=False):
    """The transforms of a stage beside the roles of the nodes that publish them.

    `children` are the edges by the frame that they place. `role_specs` maps the path of a node to
    the spec of the role it plays. `hidden` are the frames that only a missing asset could tell.
    """

    subject: StageSubject
    edges: tuple[Edge, ...]
    children: dict[str, list[Edge]]
    live_nodes: dict[str, Node]
    running: dict[str, Node]
    role_specs: dict[str, NodeSpec]
    hidden: tuple[UnresolvedFrames, ...] = ()

    @property
    def stage(self) -> StageModel:
        """The stage."""
        return self.subject.stage

    @property
    def odom(self) -> str:
        """The frame that no stage may place, '' for none."""
        return self.subject.lab.frames.unplaced


@once_per_stage
def tf_view(subject: StageSubject) -> TfView:
    """Compute what the frame rules look at."""
    stage, lab = subject.stage, subject.lab
    edges, children = published_edges(stage, lab.platform), dict[str, list[Edge]]()
    for edge in edges:
        children.setdefault(edge.child, []).append(edge)
    return TfView(
        subject,
        edges,
        children,
        live_nodes(stage, lab.platform),
        running_nodes(stage, lab.platform),
        role_specs(subject),
        unresolved_frames(stage, lab.platform),
    )


def is_reported_elsewhere(edge: Edge, view: TfView) -> bool:
    """Whether another rule already says what is wrong with this transform.

    Those are the rules of settings and targets for a node that plays a role, the rule of extra
    nodes for one that does not, and the rules of forbidden transforms.
    """
    if edge.child in {view.odom, edge.parent}:
        return True
    if edge.cause not in view.role_specs and edge.publisher not in view.role_specs:
        return bool({edge.cause, edge.publisher} & view.subject.faulty_prims)
    return is_altered_by_wires(edge, view) or differs_from_spec(edge.cause, view)


def is_altered_by_wires(edge: Edge, view: TfView) -> bool:
    """Whether wires made of the frames that a node computes something that it does not compute."""
    cause = view.live_nodes.get(edge.cause)
    if (
        cause is None
        or edge.cause == edge.publisher
        or edge.publisher not in view.subject.faulty_prims
    ):
        return False
    pairs = computed_pairs(cause, view.subject.stage, view.subject.lab.platform)
    return all((edge.parent, edge.child) != (pair.parent, pair.child) for pair in pairs)


def differs_from_spec(path: str, view: TfView) -> bool:
    """Whether the frame names or the parent prim of a node differ from those of its role."""
    spec, node = view.role_specs.get(path), view.live_nodes.get(path)
    if spec is None or node is None:
        return False
    ports = tf_ports(node)
    named = (setting for setting in spec.settings if setting.port in ports.names)
    if any(
        not setting_matches(node, s, effective_value(node, s.port, view.live_nodes)) for s in named
    ):
        return True
    return any(
        not target_matches(node, target)
        for target in spec.targets
        if target.port in ports.prims and target.port not in spec.frames_from
    )


class FrameSource(Struct, frozen=True):
    """A node that must give frames, the port that lists their prims, and the prim of each frame.

    `asked` are the prims that the lab wants to be listed, which may stand for others.
    """

    node: Node
    port: str
    asked: tuple[str, ...]
    prims: dict[str, str]
    handout: str


@once_per_stage
def frame_sources(view: TfView) -> tuple[FrameSource, ...]:
    """Return the nodes whose target prims must become frames, where their frames are sent at all.

    A node that is missing, does not run or whose frames are not sent as they are is the business
    of other rules. One that computes nothing is not: then its targets are at fault.
    """
    sources: list[FrameSource] = []
    sent = {edge.cause for edge in view.edges} | {hidden.cause for hidden in view.hidden}
    mangled = {edge.cause for edge in view.edges if is_altered_by_wires(edge, view)}
    for path, spec in view.role_specs.items():
        node = view.running.get(path)
        if node is None or not spec.frames_from or path in mangled:
            continue
        if path not in sent and computed_pairs(node, view.subject.stage, view.subject.lab.platform):
            continue
        for target in spec.targets:
            if target.port in spec.frames_from:
                homes = _homes(node, target, view)
                source = FrameSource(node, target.port, target.prims, homes, target.handout)
                sources.append(source)
    return tuple(sources)


def _homes(node: Node, target: Target, view: TfView) -> dict[str, str]:
    """Return the prims whose frames a target must give, by frame.

    The root of the robot stands for its links, those that the lab names and those that are there.
    """
    robot, homes = view.subject.lab.scene.robot, list[str]()
    for prim in target.prims:
        homes += robot.link_paths if prim == robot.path else ()
        homes += links_given_by(prim, node, view.subject.stage)
    return {home.rpartition("/")[2]: home for home in homes}


def missing_frames(maker: FrameSource, view: TfView) -> list[str]:
    """Return the required frames that are not published although their prims are in the scene.

    A prim that is not in the scene is the business of the scene's rules. One that an asset may
    hold which cannot be found counts as there: what names no target is not published.
    """
    stage, homes = view.subject.stage, maker.prims
    return [
        frame
        for frame in _unpublished_frames(maker, view)
        if not unknown_frame(frame, maker, view)
        and (stage.prim(homes[frame]) or stage.unknown(homes[frame]))
    ]


def frames_of_missing_assets(maker: FrameSource, view: TfView) -> dict[str, UnresolvedAsset]:
    """Return the required frames that a missing asset may have published, and the asset."""
    frames = _unpublished_frames(maker, view)
    assets = {frame: unknown_frame(frame, maker, view) for frame in frames}
    return {frame: asset for frame, asset in assets.items() if asset is not None}


def _unpublished_frames(maker: FrameSource, view: TfView) -> list[str]:
    required = (child for _, child in view.subject.lab.frames.edges)
    return [frame for frame in required if frame in maker.prims and frame not in view.children]


def unknown_frame(frame: str, maker: FrameSource, view: TfView) -> UnresolvedAsset | None:
    """Return the missing asset that could say whether a node gives a required frame."""
    home, stage = maker.prims[frame], view.subject.stage
    prim = stage.prim(home)
    is_link = prim is None or {BODY_API, *FRAME_APIS} & set(prim.apis)
    if not is_link and not unknown_target(home, stage):
        return None  # no target stands for a prim that is neither a body nor a link
    hidden = (frames for frames in view.hidden if frames.cause == maker.node.path)
    return stage.unknown(*(frames.prim for frames in hidden if frames.may_give(home)))


def self_parent_pairs(node: Node, view: TfView) -> list[Pair]:
    """Return the frames of a node that would be their own parents."""
    pairs = computed_pairs(node, view.subject.stage, view.subject.lab.platform)
    return [pair for pair in pairs if pair.parent == pair.child]


def lists_its_parent(node: Node, view: TfView) -> bool:
    """Whether the parent prim of a computing node is one of its targets: a frame below itself.

    That holds for a link in an asset that is missing, too. Only a robot root is never a frame of
    its own where it stands for its links.
    """
    parent = parent_prim(node)
    if not computes(node) or parent not in listed_targets(node):
        return False
    if view.subject.stage.prim(parent) is None:
        return unknown_target(parent, view.subject.stage) is not None
    return any(pair.target == parent == pair.prim for pair in self_parent_pairs(node, view))


def is_unasked_parent(node: Node, view: TfView) -> bool:
    """Whether a node has a parent prim where its role asks for none."""
    spec, ports = view.role_specs.get(node.path), tf_ports(node).prims
    is_asked = spec is not None and any(target.port == ports[0] for target in spec.targets)
    return spec is not None and not is_asked and bool(parent_prim(node))


def lacks_only_the_camera(maker: FrameSource, view: TfView) -> bool:
    """Whether nothing is missing but what the robot root as the only target cannot give.

    F9 allows that target, so it costs nothing.
    """
    robot = view.subject.lab.scene.robot
    stage = view.subject.stage
    if maker.node.targets(maker.port) != (robot.path,):
        return False
    is_root = expands(robot.path, maker.node, stage) or unknown_target(robot.path, stage)
    return bool(is_root) and not set(robot.links) & set(missing_frames(maker, view))


def waived_frames(view: TfView) -> set[str]:
    """Return the required frames whose absence is no fault.

    Those are the ones that a missing asset may hold, and those that F9 itself loses.
    """
    waived: set[str] = set()
    for maker in frame_sources(view):
        if not differs_from_spec(maker.node.path, view):
            given = (frame for frame in maker.prims if unknown_frame(frame, maker, view))
            waived.update(given)
            if lacks_only_the_camera(maker, view):
                waived.update(missing_frames(maker, view))
    return waived - set(view.children)


def frame_list_text(frames: list[str]) -> str:
    """Return the names of frames as a part of a sentence."""
    names = ", ".join(f"'{frame}'" for frame in frames)
    return f"the frame {names}" if len(frames) == 1 else f"the frames {names}"
