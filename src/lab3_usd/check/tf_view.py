"""What the frame rules ask of a stage: its transforms, and which of them are judged elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.absence import is_hidden
from lab3_usd.check.computed_frames import (
    Pair,
    computed_pairs,
    computes,
    expands,
    listed_targets,
    parent_prim,
    tf_ports,
)
from lab3_usd.check.derived import once_per_stage
from lab3_usd.check.frames import Edge, hidden_frames, published_edges
from lab3_usd.check.hidden_frames import Hidden, is_unknown
from lab3_usd.check.link_tree import FRAME_APIS
from lab3_usd.check.met import setting_met, setting_value, target_met
from lab3_usd.check.model import Node
from lab3_usd.check.physics import BODY_API
from lab3_usd.check.running import live_nodes, running_nodes
from lab3_usd.check.subject import StageSubject
from lab3_usd.spec.spec import NodeSpec


class TfView(Struct, frozen=True):
    """The transforms of a stage beside the roles of the nodes that publish them.

    `played` maps the path of a node to the spec of the role it plays. `hidden` are the frames
    that only a missing asset could tell.
    """

    subject: StageSubject
    edges: tuple[Edge, ...]
    live: dict[str, Node]
    running: dict[str, Node]
    played: dict[str, NodeSpec]
    hidden: tuple[Hidden, ...] = ()

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


@once_per_stage
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
        hidden_frames(stage, lab),
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
    sent = {edge.cause for edge in view.edges} | {hidden.cause for hidden in view.hidden}
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

    A prim that is not in the scene is the business of the scene's rules. One that an asset may
    hold which cannot be found counts as there: what names no target is not published.
    """
    children = view.children
    stage = view.subject.stage
    required = [child for _, child in view.subject.lab.frames.edges]
    return [
        frame
        for frame in required
        if frame in maker.homes
        and frame not in children
        and not may_be_given(frame, maker, view)
        and (stage.prim(maker.homes[frame]) or is_hidden(stage, maker.homes[frame]))
    ]


def may_be_given(frame: str, maker: Maker, view: TfView) -> bool:
    """Whether a required frame may be one of those that only a missing asset could tell."""
    home, stage = maker.homes[frame], view.subject.stage
    prim = stage.prim(home)
    is_told = prim is not None and not is_unknown(home, stage)
    if is_told and prim is not None and not {BODY_API, *FRAME_APIS} & set(prim.apis):
        return False  # no target stands for a prim that is neither a body nor a link
    return any(each.cause == maker.node.path and each.may_give(home) for each in view.hidden)


def self_pairs(node: Node, view: TfView) -> list[Pair]:
    """Return the frames of a node that would be their own parents."""
    pairs = computed_pairs(node, view.subject.stage, view.subject.lab)
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
        return is_unknown(parent, view.subject.stage)
    return any(pair.target == parent == pair.prim for pair in self_pairs(node, view))


def lacks_the_camera_only(maker: Maker, view: TfView) -> bool:
    """Whether nothing is missing but what the robot root as the only target cannot give.

    F9 allows that target, so it costs nothing.
    """
    robot = view.subject.lab.scene["robot"]
    stage = view.subject.stage
    if maker.node.targets(maker.port) != (robot["path"],):
        return False
    stands_for_links = expands(robot["path"], maker.node, stage) or is_unknown(robot["path"], stage)
    return stands_for_links and not set(robot["links"]) & set(missing_frames(maker, view))


def waived_frames(view: TfView) -> set[str]:
    """Return the required frames whose absence is nobody's fault.

    Those are the ones that a missing asset may hold, and those that F9 itself loses.
    """
    waived: set[str] = set()
    for maker in frame_makers(view):
        if not differs_from_spec(maker.node.path, view):
            given = (frame for frame in maker.homes if may_be_given(frame, maker, view))
            waived.update(given)
            if lacks_the_camera_only(maker, view):
                waived.update(missing_frames(maker, view))
    return waived - set(view.children)


def frames_in_words(frames: list[str]) -> str:
    """Return the names of frames as a part of a sentence."""
    names = ", ".join(f"'{frame}'" for frame in frames)
    return f"the frame {names}" if len(frames) == 1 else f"the frames {names}"
