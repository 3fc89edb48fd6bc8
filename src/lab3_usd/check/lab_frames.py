"""The frames that the lab requires beside those of a stage, and who reports them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.lab_topics import domain_name, role_specs
from lab3_usd.check.match.conformance import setting_matches, target_matches
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import frame_places
from lab3_usd.facts.domains import Domain
from lab3_usd.facts.execution_order import live_nodes, running_nodes, severity_if_uncertain
from lab3_usd.facts.frame_targets import (
    FRAME_APIS,
    Pair,
    UnresolvedFrames,
    computed_pairs,
    computes,
    expands,
    frame_of_prim,
    links_given_by,
    listed_targets,
    parent_prim,
    tf_ports,
    unknown_target,
)
from lab3_usd.facts.frames import (
    Edge,
    HeardTree,
    all_edges,
    edges_on,
    frames_in,
    trees_of,
    unknown_publishers,
    unresolved_frames,
)
from lab3_usd.facts.message_frames import MessageFrame, message_frames
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import STATIC
from lab3_usd.model.finding import Place, Problem
from lab3_usd.model.physics import BODY_API
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, listed_once, once_per_stage
from lab3_usd.spec.contradictions.names import transform_topics
from lab3_usd.spec.graph import NodeSpec, Target


class TfView(Struct, frozen=True, eq=False):
    """The transforms that the lab hears, beside the roles of the nodes that publish them.

    `children` are the edges by the frame that they place. `role_specs` maps the path of a node to
    the spec of the role it plays. `hidden` are the frames that only a missing asset could tell.
    `topics` are those on which the lab has these transforms, `elsewhere` the nodes of other trees.
    """

    subject: StageSubject
    edges: tuple[Edge, ...]
    children: dict[str, list[Edge]]
    live_nodes: dict[str, Node]
    running: dict[str, Node]
    role_specs: dict[str, NodeSpec]
    hidden: tuple[UnresolvedFrames, ...]
    topics: frozenset[str]
    elsewhere: frozenset[str] = frozenset()

    @property
    def stage(self) -> StageModel:
        """The stage."""
        return self.subject.stage

    @property
    def platform(self) -> Platform:
        """The release of Isaac Sim that the lab is for."""
        return self.subject.lab.platform

    def is_guarded(self, edge: Edge) -> bool:
        """Whether no stage may publish a transform: its frame has no place, or it is forbidden."""
        frames = self.subject.lab.frames
        return edge.child in frames.guarded or frames.is_forbidden((edge.parent, edge.child))

    @once_per_stage
    def trees(self) -> tuple[HeardTree, ...]:
        """Return the transforms, by listener, that no other rule finds fault with."""
        edges = (edge for edge in all_edges(self.stage) if edge.cause not in self.elsewhere)
        return trees_of(edge for edge in edges if _is_as_meant(edge, self))

    def is_asked(self, edge: Edge) -> bool:
        """Whether the lab asks for a transform, of the node that sends it."""
        is_required = (edge.parent, edge.child) in self.subject.lab.frames.edges
        return is_required and edge.cause in self.role_specs

    def is_beside(self, heard: HeardTree) -> bool:
        """Whether who listens to the lab's transforms never hears these."""
        sent_by_roles = any({e.cause, e.publisher} & {*self.role_specs} for e in heard.tree.edges)
        is_here = self.is_heard(heard.tree.edges[0].domain)
        return not sent_by_roles and not (is_here and heard.topic in self.topics)

    def is_heard(self, domain: Domain) -> bool:
        """Whether the lab listens in a domain: in its own, or in one that its nodes publish in."""
        return domain_name(domain, self.subject) in _heard_domains(self.subject)

    def tops(self, heard: HeardTree) -> tuple[str, ...]:
        """Return the frames at the top, in a tree that has all that the lab asks for.

        What localization adds counts once it runs.
        """
        frames = self.subject.lab.frames
        is_localized = frames.above and self.subject.checkpoint.localization
        tops = (frames.above, *frames.roots) if is_localized else frames.roots
        required = {child for _, child in frames.edges}
        return tops if required <= heard.tree.below(*tops) else ()

    def message_frames(self) -> Iterator[MessageFrame]:
        """Yield the frames of messages that no rule of nodes or settings finds fault with."""
        subject = self.subject
        if unknown_publishers(self.topics, self.stage):
            return
        extra = [node for roles in subject.roles.values() for node in roles.extra]
        for named in message_frames(self.stage):
            node, spec = named.endpoint.node, self.role_specs.get(named.endpoint.node.path)
            asked = {} if spec is None else {setting.port: setting for setting in spec.settings}
            is_right = named.port not in asked or setting_matches(
                node, asked[named.port], named.name
            )
            if node not in extra and is_right:
                yield named

    @once_per_stage
    def frames_in(self, domain: str) -> frozenset[str]:
        """Return the frames that are published in a domain, and those that the lab asks for."""
        required = {frame for edge in self.subject.lab.frames.joined.edges for frame in edge}
        return frames_in(self.stage, domain) | required

    def assumed(self, edges: Iterable[Edge]) -> tuple[Place, ...]:
        """Return the types of nodes without a role that send transforms: another may be meant."""
        paths = dict.fromkeys(path for edge in edges for path in (edge.cause, edge.publisher))
        return tuple((path, "node:type") for path in paths if path not in self.role_specs)

    def exchanged(self, edges: Iterable[Edge]) -> Iterator[Place]:
        """Yield the lists of prims with one that is not asked for in place of one that is.

        Which frame is missing there, T01 tells.
        """
        for path, target in dict.fromkeys((edge.cause, edge.target) for edge in edges):
            node, spec = self.live_nodes.get(path), self.role_specs.get(path)
            for asked in () if spec is None else spec.targets:
                listed = () if node is None else node.targets(asked.port)
                if target in listed and len(listed) <= len(asked.prims):
                    yield path, asked.port


@once_per_stage
def trees_of_nodes(view: TfView) -> Mapping[str, Sequence[HeardTree]]:
    """Map each node that makes or sends transforms to the trees that have some of its own."""
    sent: dict[str, list[HeardTree]] = {}
    for heard in view.trees():
        ends = ((edge.cause, edge.publisher) for edge in heard.tree.edges)
        for path in dict.fromkeys(path for pair in ends for path in pair):
            sent.setdefault(path, []).append(heard)
    return sent


def _is_as_meant(edge: Edge, view: TfView) -> bool:
    """Whether a transform is none that is forbidden, and of a role what that is to send.

    Another one changes the whole tree, and no problem of that could tell on which it rests. What is
    wrong with it is said at its settings, targets and wires.
    """
    if view.is_guarded(edge):
        return False
    if edge.parent == edge.child:
        return edge.target is None and edge.cause not in view.role_specs
    if edge.cause not in view.role_specs and edge.publisher not in view.role_specs:
        return True
    nodes = {edge.cause, edge.publisher} if view.subject.lab.frames.trees else {edge.cause}
    return not is_altered_by_wires(edge, view) and not any(
        differs_from_spec(view, n) for n in nodes
    )


@once_per_stage
def _heard_domains(subject: StageSubject) -> frozenset[str]:
    """Return the domains that the lab listens in: its own, and those its nodes publish in."""
    roles = role_specs(subject)
    edges = edges_on(transform_topics(subject.lab), subject.stage)
    by_roles = (edge.domain for edge in edges if edge.cause in roles or edge.publisher in roles)
    names = (domain_name(domain, subject) for domain in by_roles)
    return frozenset([str(subject.lab.ros.system.domain), *names])


@once_per_stage
def tf_views(subject: StageSubject) -> tuple[TfView, ...]:
    """Compute what the frame rules look at: the tree of the lab, or those in namespaces."""
    lab, stage, every = subject.lab, subject.stage, transform_topics(subject.lab)
    if not lab.frames.trees:
        return (_view(subject, every),)
    views = []
    for tree in lab.frames.trees:
        topics = frozenset((tree.topic, f"{tree.topic}{STATIC}"))
        own = replace(subject, lab=replace(lab, frames=lab.frames.on(tree.topic)))
        nodes = (edge.cause for edge in edges_on(every - topics, stage))
        views.append(replace(_view(own, topics), elsewhere=frozenset(nodes)))
    return tuple(views)


def _view(subject: StageSubject, topics: frozenset[str]) -> TfView:
    stage, children = subject.stage, dict[str, list[Edge]]()
    heard = _heard_domains(subject)
    edges = tuple(
        edge for edge in edges_on(topics, stage) if domain_name(edge.domain, subject) in heard
    )
    for edge in edges:
        children.setdefault(edge.child, []).append(edge)
    return TfView(
        subject,
        edges,
        children,
        live_nodes(stage),
        running_nodes(stage),
        role_specs(subject),
        unresolved_frames(topics, stage),
        topics,
    )


def is_altered_by_wires(edge: Edge, view: TfView) -> bool:
    """Whether wires made of the frames that a node computes something that it does not compute."""
    if edge.cause not in view.live_nodes or edge.cause == edge.publisher:
        return False
    computed = _computed_by(view.subject.stage, edge.cause)
    return (edge.parent, edge.child) not in computed


@once_per_stage
def _computed_by(stage: StageModel, path: str) -> frozenset[tuple[str, str]]:
    """Return the parents and children among the frames that a live node computes."""
    pairs = computed_pairs(live_nodes(stage)[path], stage)
    return frozenset((pair.parent, pair.child) for pair in pairs)


@once_per_stage
def differs_from_spec(view: TfView, path: str) -> bool:
    """Whether the frame names or the parent prim of a node differ from those of its role."""
    spec, node = view.role_specs.get(path), view.live_nodes.get(path)
    if spec is None or node is None:
        return False
    ports = tf_ports(node)
    telling = {*ports.names, *(spec.type.topics if view.subject.lab.frames.trees else ())}
    values = {s: effective_value(node, s.port, view.live_nodes) for s in spec.settings}
    if any(not setting_matches(node, s, v) for s, v in values.items() if s.port in telling):
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


@listed_once
def frame_sources(view: TfView) -> Iterator[FrameSource]:
    """Return the nodes whose target prims must become frames, where their frames are sent at all.

    A node that is missing, does not run or whose frames are not sent as they are is the business
    of other rules. One that computes nothing is not: then its targets are at fault.
    """
    sent = {edge.cause for edge in view.edges} | {hidden.cause for hidden in view.hidden}
    mangled = {edge.cause for edge in view.edges if is_altered_by_wires(edge, view)}
    for path, spec in view.role_specs.items():
        node = view.running.get(path)
        if node is None or not spec.frames_from or path in mangled:
            continue
        if path not in sent and computed_pairs(node, view.subject.stage):
            continue
        for target in spec.targets:
            if target.port in spec.frames_from:
                homes = _homes(node, target, view)
                yield FrameSource(node, target.port, target.prims, homes, target.handout)


def _homes(node: Node, target: Target, view: TfView) -> dict[str, str]:
    """Return the prims whose frames a target must give, by frame.

    The robot root represents its links: those that the lab names and those in the stage.
    """
    lab, homes = view.subject.lab, list[str]()
    links = {robot.path: robot.link_paths for robot in lab.scene.robots}
    for prim in target.prims:
        homes += links.get(prim, ())
        homes += links_given_by(prim, node, view.subject.stage)
    return {lab.frame_of(home): home for home in homes}


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
    pairs = computed_pairs(node, view.subject.stage)
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
    stage, lab = view.subject.stage, view.subject.lab
    listed = maker.node.targets(maker.port)
    robot = next((robot for robot in lab.scene.robots if listed == (robot.path,)), None)
    if robot is None:
        return False
    is_root = expands(robot.path, maker.node, stage) or unknown_target(robot.path, stage)
    links = {*map(lab.frame_of, robot.link_paths)}
    return bool(is_root) and links.isdisjoint(missing_frames(maker, view))


def frame_list_text(frames: list[str]) -> str:
    """Return the names of frames as a part of a sentence."""
    names = ", ".join(f"'{frame}'" for frame in frames)
    return f"the frame {names}" if len(frames) == 1 else f"the frames {names}"


def self_target_problems(view: TfView) -> Iterator[Problem]:
    """Yield where target prims make a frame its own parent.

    What a node of the lab would send is judged even where its wires are wrong.
    """
    judged = {path: node for path, node in view.live_nodes.items() if path in view.role_specs}
    for path, node in {**judged, **view.running}.items():
        if not listed_targets(node) or differs_from_spec(view, path):
            continue
        for problem in _own_parents(node, view):
            doubtful = severity_if_uncertain(view.stage, path)
            yield replace(problem, severity=doubtful or problem.severity)


def _own_parents(node: Node, view: TfView) -> Iterator[Problem]:
    parent = parent_prim(node)
    pairs = self_parent_pairs(node, view)
    around = next((pair.target for pair in pairs if pair.prim == parent), "")
    if lists_its_parent(node, view):
        what = f"{parent} is the parent prim and a target: its frame is its own parent"
        targets = [path for path in listed_targets(node) if path != parent]
        yield _self_problem(node, what, targets, view)
    elif around:
        what = (
            f"{around} stands for its bodies, the parent prim {parent} among them: "
            "its frame is its own parent"
        )
        if is_unasked_parent(node, view):
            yield _unasked_parent(node, what, view)
            return
        makers = [maker for maker in frame_sources(view) if maker.node.path == node.path]
        required = [home for maker in makers for home in maker.prims.values()]
        wanted = [*required, *(path for path in listed_targets(node) if path != around)]
        problem = _self_problem(node, what, wanted, view)
        yield replace(problem, severity="warning", hint=f"name the links, not {around}")
    else:
        yield from (_named_alike(node, pair, view) for pair in pairs)


def _unasked_parent(node: Node, what: str, view: TfView) -> Problem:
    """Say what is its own parent where the lab asks for no parent prim at all."""
    parent, frames = parent_prim(node), view.subject.lab.frames
    frame = frame_of_prim(parent, view.subject.stage)
    is_placed = any(edge.parent != frame for edge in view.children.get(frame, ()))
    is_lost = not is_placed and any(child == frame for _, child in frames.edges)
    return Problem(
        node.path,
        what,
        property=tf_ports(node).prims[0],
        expected="no prim",
        actual=parent,
        handout=frames.handout,
        severity=None if is_lost else "warning",
        hint="clear Parent Prim",
        covers=frame_places(frame) if is_lost else (),
    )


def _self_problem(node: Node, what: str, wanted: list[str], view: TfView) -> Problem:
    """Say what is its own parent, and which frames the targets do not give."""
    makers = [maker for maker in frame_sources(view) if maker.node.path == node.path]
    lost = {frame: m.prims[frame] for m in makers for frame in missing_frames(m, view)}
    losing = f", and nothing publishes {frame_list_text(list(lost))}" if lost else ""
    added = ", ".join(home for home in lost.values() if home not in listed_targets(node))
    return Problem(
        node.path,
        f"{what}{losing}",
        property=tf_ports(node).prims[1],
        expected=", ".join(dict.fromkeys([*wanted, *lost.values()])) or "the links as targets",
        actual=", ".join(listed_targets(node)),
        handout=view.subject.lab.frames.handout,
        hint=f"remove the parent prim from Target Prims, and add {added}" if added else None,
        covers=frame_places(*lost),
    )


def _named_alike(node: Node, pair: Pair, view: TfView) -> Problem:
    return Problem(
        node.path,
        f"{pair.prim} is named as the parent frame is: '{pair.child}' is its own parent",
        property=tf_ports(node).prims[1],
        expected="a frame of another name",
        actual=", ".join(listed_targets(node)),
        handout=view.subject.lab.frames.handout,
        hint=f"rename {pair.prim} or take it out of the target prims",
        covers=frame_places(pair.child),
    )
