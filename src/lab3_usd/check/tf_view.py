"""What the frame rules ask of a stage: its transforms, and which of them are judged elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from msgspec import Struct

from lab3_usd.check.computed_frames import computed_pairs, expands, tf_ports
from lab3_usd.check.frames import Edge, published_edges
from lab3_usd.check.met import setting_met, setting_value, target_met
from lab3_usd.check.model import Node
from lab3_usd.check.running import live_nodes, running_nodes
from lab3_usd.check.subject import StageSubject
from lab3_usd.spec.spec import NodeSpec


class TfView(Struct, frozen=True):
    """The transforms of a stage beside the roles of the nodes that publish them.

    `played` maps the path of a node to the spec of the role it plays.
    """

    subject: StageSubject
    edges: tuple[Edge, ...]
    live: dict[str, Node]
    running: dict[str, Node]
    played: dict[str, NodeSpec]

    @property
    def children(self) -> dict[str, list[Edge]]:
        """The edges by the frame that they place."""
        found: dict[str, list[Edge]] = {}
        for edge in self.edges:
            found.setdefault(edge.child, []).append(edge)
        return found

    @property
    def odom(self) -> str:
        """The frame that localization places, and the stage must not."""
        return self.subject.lab.frames.forbidden_edge[1]


@lru_cache(maxsize=1)  # every rule of one stage asks for the same
def tf_view(subject: StageSubject) -> TfView:
    """Compute what the frame rules look at."""
    stage, lab = subject.stage, subject.lab
    played = {
        path: lab.graphs[name].nodes[role]
        for name, roles in subject.roles.items()
        for path, role in roles.role_of.items()
        if role in lab.graphs[name].nodes
    }
    return TfView(
        subject,
        published_edges(stage, lab),
        live_nodes(stage, lab),
        running_nodes(stage, lab),
        played,
    )


def judged_elsewhere(edge: Edge, view: TfView) -> bool:
    """Whether another rule already says what is wrong with this transform.

    Those are the rules of settings and targets for a node that plays a role, the rule of extra
    nodes for one that does not, and the rules of transforms that nobody may publish.
    """
    if edge.child in {view.odom, edge.parent}:
        return True
    if edge.cause not in view.played and edge.publisher not in view.played:
        return bool({edge.cause, edge.publisher} & view.subject.blamed)
    return is_mangled(edge, view) or differs_from_spec(edge.cause, view)


def is_mangled(edge: Edge, view: TfView) -> bool:
    """Whether wires made of the frames that a node computes something that it does not compute."""
    cause = view.live.get(edge.cause)
    if cause is None or edge.cause == edge.publisher or edge.publisher not in view.subject.blamed:
        return False
    pairs = computed_pairs(cause, view.subject.stage, view.subject.lab)
    return all((edge.parent, edge.child) != (pair.parent, pair.child) for pair in pairs)


def differs_from_spec(path: str, view: TfView) -> bool:
    """Whether the frame names or the parent prim of a node differ from those of its role."""
    spec, node = view.played.get(path), view.live.get(path)
    if spec is None or node is None:
        return False
    ports = tf_ports(node)
    named = (setting for setting in spec.settings if setting.port in ports.names)
    if any(not setting_met(node, s, setting_value(view.live, node, s.port)) for s in named):
        return True
    return any(
        not target_met(node, target)
        for target in spec.targets
        if target.port in ports.prims and target.port not in spec.frames_from
    )


class Maker(Struct, frozen=True):
    """A node that must give frames, the port that lists their prims, and the prim of each frame."""

    node: Node
    port: str
    homes: dict[str, str]
    handout: str


def frame_makers(view: TfView) -> Iterator[Maker]:
    """Yield the nodes whose target prims must become frames, where their frames are sent at all.

    A node that is missing, does not run or whose frames nobody sends as they are is the business
    of other rules. One that computes nothing is not: then its targets are at fault.
    """
    sent = {edge.cause for edge in view.edges}
    mangled = {edge.cause for edge in view.edges if is_mangled(edge, view)}
    for path, spec in view.played.items():
        node = view.running.get(path)
        if node is None or not spec.frames_from or path in mangled:
            continue
        if path not in sent and computed_pairs(node, view.subject.stage, view.subject.lab):
            continue
        for target in spec.targets:
            if target.port in spec.frames_from:
                homes = {prim.rpartition("/")[2]: prim for prim in target.prims}
                yield Maker(node, target.port, homes, target.handout)


def missing_frames(maker: Maker, view: TfView) -> list[str]:
    """Return the required frames that nobody publishes although their prims are in the scene.

    A prim that is not in the scene is the business of the scene's rules, and one that an asset
    may hold which cannot be found is nobody's.
    """
    children = view.children
    stage = view.subject.stage
    required = [child for _, child in view.subject.lab.frames.edges]
    if any(_may_expand(target, view) for target in maker.node.targets(maker.port)):
        return []
    return [
        frame
        for frame in required
        if frame in maker.homes
        and frame not in children
        and stage.prim(maker.homes[frame]) is not None
    ]


def _may_expand(target: str, view: TfView) -> bool:
    """Whether a missing asset hides what this target stands for."""
    stage = view.subject.stage
    hidden = stage.prim(target) is not None and stage.unresolved_above(target) is not None
    return hidden and not expands(target, stage)


def own_parents(maker: Node, view: TfView) -> list[str]:
    """Return the targets of a node that are its parent prim and stand for themselves."""
    if not tf_ports(maker).prims:
        return []
    parent_port, target_port = tf_ports(maker).prims
    parents = maker.targets(parent_port)[:1]
    return [
        target
        for target in maker.targets(target_port)
        if target in parents and not expands(target, view.subject.stage)
    ]


def is_robot_alone(maker: Maker, view: TfView) -> bool:
    """Whether the robot is the only target and stands for its links, as F9 allows."""
    robot = view.subject.lab.scene["robot"]["path"]
    return maker.node.targets(maker.port) == (robot,) and expands(robot, view.subject.stage)
