"""The TF frames that a stage publishes, computed as Isaac Sim 6.0.1 would, and cycles of frames.

Prims become frames in two ways: a node computes them and a publisher sends the arrays it is
given, or a publisher (as before 6.0) looks at prims of its own.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.arrays import list_at, listed_names
from lab3_usd.facts.domains import Domain, domain_of
from lab3_usd.facts.endpoints import full_topic, message_type, moving_prims
from lab3_usd.facts.execution_order import live_nodes, signal_inputs
from lab3_usd.facts.frame_targets import (
    Pair,
    UnresolvedFrames,
    computed_pairs,
    listed_targets,
    parent_frame,
    tf_ports,
    unknown_target,
    unresolved_frames_of,
)
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.facts.stuck_nodes import working_nodes, working_states
from lab3_usd.facts.tree import Tree, tree_of
from lab3_usd.isaac.node_types import TfPorts
from lab3_usd.isaac.topics import STATIC
from lab3_usd.model.stage import Node, StageModel, once_per_stage


class Edge(Struct, frozen=True):
    """One transform that a stage publishes.

    `publisher` sends it, `cause` is the node whose settings name it (the same one, or the node
    that computes the frames). `target` is the target prim it comes from, None for a transform
    between named frames; `expanded` where the target stands for all links of a robot, and `prim`
    is the prim whose frame the child is. `sure` tells whether the nodes run for certain, `domain`
    who hears of it.
    """

    parent: str
    child: str
    publisher: str
    cause: str
    topic: str
    static: bool = False
    target: str | None = None
    prim: str | None = None
    expanded: bool = False
    sure: bool = True
    domain: Domain = Domain()


def tf2_name(written: str) -> str:
    """Return the name of a frame as tf2 takes it from a transform: without a slash before it.

    Source: ros2/geometry2 (humble), tf2/src/buffer_core.cpp, `setTransformImpl`.
    """
    return written.removeprefix("/")


class PublishedTransforms(Struct, frozen=True):
    """What one publisher of transforms sends on a topic.

    `edges` is None where the names of its frames are unknown; `hidden` are the frames that an
    asset could tell which cannot be found.
    """

    publisher: Node
    topic: str
    edges: tuple[Edge, ...] | None = ()
    hidden: tuple[UnresolvedFrames, ...] = ()


@once_per_stage
def published_transforms(stage: StageModel) -> tuple[PublishedTransforms, ...]:
    """Return what each publisher of transforms sends: to the topics of tf2 first, then to others.

    All graphs count. A node publishes when an event reaches it over execution wires; the order
    is that of the nodes and their targets.
    """
    own = stage.platform.ros.tree_topics
    senders = sorted(_transform_publishers(stage), key=lambda sender: sender[1] not in own)
    return tuple(_published_by(node, topic, stage) for node, topic in senders)


@once_per_stage
def all_edges(stage: StageModel) -> tuple[Edge, ...]:
    """Return every transform that the stage publishes, on whatever topic."""
    return tuple(edge for sent in published_transforms(stage) for edge in sent.edges or ())


@once_per_stage
def published_edges(stage: StageModel) -> tuple[Edge, ...]:
    """Return the transforms on the topics that tf2 listens to by itself."""
    return edges_on(stage.platform.ros.tree_topics, stage)


def edges_on(topics: Container[str], stage: StageModel) -> tuple[Edge, ...]:
    """Return the transforms on some topics."""
    return tuple(edge for edge in all_edges(stage) if edge.topic in topics)


def unknown_publishers(topics: Container[str], stage: StageModel) -> tuple[str, ...]:
    """Return the nodes that publish, on some topics, frames that no stage defines."""
    return tuple(
        sent.publisher.path
        for sent in published_transforms(stage)
        if sent.edges is None and sent.topic in topics
    )


def all_unresolved_frames(stage: StageModel) -> tuple[UnresolvedFrames, ...]:
    """Return the frames that only a missing asset could tell, as `all_edges`."""
    return tuple(hidden for sent in published_transforms(stage) for hidden in sent.hidden)


def unresolved_frames(topics: Container[str], stage: StageModel) -> tuple[UnresolvedFrames, ...]:
    """Return the frames on some topics that only a missing asset could tell."""
    hidden = all_unresolved_frames(stage)
    return tuple(frames for frames in hidden if frames.topic in topics)


def certain_edges(edges: Iterable[Edge]) -> list[Edge]:
    """Return the transforms that are sent for certain, not only perhaps."""
    return [edge for edge in edges if edge.sure]


class HeardTree(Struct, frozen=True):
    """The transforms that one listener of tf2 hears: in one domain, on one topic and its twin.

    `domain` is the name of the domain, `topic` that of the moving transforms (`/tf`, or
    `/robot1/tf` for a robot in a namespace). `tree` is what tf2 makes of them.
    """

    domain: str
    topic: str
    tree: Tree[Edge]

    @property
    def number(self) -> int | None:
        """The number of the domain where the environment names none, None where it is unknown."""
        return self.tree.edges[0].domain.number


@once_per_stage
def heard_trees(stage: StageModel) -> tuple[HeardTree, ...]:
    """Return the trees that a stage publishes, as `trees_of`."""
    return trees_of(all_edges(stage))


def robots_shown(edges: Iterable[Edge], stage: StageModel) -> set[str]:
    """Return the robots of joined bodies whose prims transforms place, by their first bodies."""
    bodies = joined_bodies(stage)
    robots = {bodies.owner(edge.prim) for edge in edges if edge.prim} - {""}
    return {robot for robot in robots if bodies.sizes[robot] > 1}


def known_tops(heard: HeardTree, stage: StageModel) -> tuple[str, ...]:
    """Return the top of the largest tree, and of those of other robots, where all are known."""
    if not is_tree_known(stage):
        return ()
    tops, shown = list[str](), set[str]()
    for edges, frames in heard.tree.parts:
        robots = robots_shown(edges, stage)
        if not tops or (robots and shown.isdisjoint(robots)):
            tops += [top for top in heard.tree.roots if top in frames][:1]
            shown |= robots
    return tuple(tops)


@once_per_stage
def frames_in(stage: StageModel, domain: str) -> frozenset[str]:
    """Return the frames that are published in a domain, on whatever topic."""
    trees = (heard.tree for heard in heard_trees(stage) if heard.domain == domain)
    edges = (edge for heard in trees for edge in heard.edges)
    return frozenset(name for edge in edges for name in (edge.parent, edge.child))


def trees_of(edges: Iterable[Edge]) -> tuple[HeardTree, ...]:
    """Return the trees that transforms form, by domain and topic, in the order of transforms.

    Transforms of different domains, or on different topics, never meet.
    """
    heard: dict[tuple[str, str], list[Edge]] = {}
    for edge in edges:
        topic = edge.topic.removesuffix(STATIC)
        heard.setdefault((edge.domain.name, topic), []).append(edge)
    return tuple(HeardTree(*key, tree_of(sent)) for key, sent in heard.items())


class SharedTopic(Struct, frozen=True, eq=False):
    """A topic on which a namespace above several robots puts the transforms of all of them.

    `prim` carries the namespace, `publishers` are the nodes by the namespaces that their other
    topics would have. It `clashes` where robots have frames of one name.
    """

    topic: str
    prim: str
    publishers: Mapping[str, tuple[str, ...]]
    clashes: bool


@once_per_stage
def shared_tf_topics(stage: StageModel) -> tuple[SharedTopic, ...]:
    """Return the topics that a common namespace gives to the transforms of several robots.

    Of several namespaces above a TF publisher only the outermost counts (Ros2Node.h:227-275).
    """
    live = live_nodes(stage)
    spaces_of: dict[tuple[str, str, str], dict[str, list[str]]] = {}
    for heard in heard_trees(stage):
        for path in dict.fromkeys(edge.publisher for edge in heard.tree.edges):
            node = live[path]
            prims = moving_prims(node, stage, live)
            if prims and len(node.namespaces) > 1:
                key = (heard.domain, heard.topic, prims[0][0])
                spaces_of.setdefault(key, {}).setdefault("/".join(node.namespaces), []).append(path)
    return tuple(
        _shared(stage, key, spaces) for key, spaces in spaces_of.items() if len(spaces) > 1
    )


def _shared(
    stage: StageModel, key: tuple[str, str, str], spaces: dict[str, list[str]]
) -> SharedTopic:
    domain, topic, prim = key
    space_of = {path: space for space, paths in spaces.items() for path in paths}
    senders: dict[str, set[str]] = {}
    for heard in heard_trees(stage):
        for edge in heard.tree.edges if (heard.domain, heard.topic) == (domain, topic) else ():
            if edge.publisher in space_of:
                senders.setdefault(edge.child, set()).add(space_of[edge.publisher])
    clashes = any(len(several) > 1 for several in senders.values())
    return SharedTopic(
        topic, prim, {space: tuple(spaces[space]) for space in sorted(spaces)}, clashes
    )


@once_per_stage
def is_tree_known(stage: StageModel) -> bool:
    """Whether all frames are known: no node and no asset hides some, and every publisher works.

    The fault of a publisher that sends nothing is reported at that publisher.
    """
    sending = {edge.publisher for edge in all_edges(stage)}
    idle = [
        node
        for node in live_nodes(stage).values()
        if node.type is not None and node.type.tf is not None and node.type.role
        if node.path not in sending
    ]
    sent = published_transforms(stage)
    return not (idle or any(transforms.edges is None or transforms.hidden for transforms in sent))


def _transform_publishers(stage: StageModel) -> Iterator[tuple[Node, str]]:
    """Yield the running nodes that publish transforms, with the topic they publish on."""
    live = live_nodes(stage)
    for node in working_nodes(stage).values():
        kind = node.type
        if kind is None or kind.role != "publisher":
            continue
        message = message_type(node, kind, kind.topics[0], live)
        if kind.tf is None and message not in stage.platform.transform_messages:
            continue
        topic = full_topic(node, kind.topics[0], stage, live)
        if topic is not None:
            yield node, topic


def _published_by(node: Node, topic: str, stage: StageModel) -> PublishedTransforms:
    ports, live = tf_ports(node), live_nodes(stage)
    static = ports.static is not None and effective_value(node, ports.static, live) is True
    domain = domain_of(node, live, stage.platform)
    written = _written_frames(node, ports, live)
    if written is not None:
        is_sure = _is_sure(stage, node)
        named = (
            Edge(*frames, node.path, node.path, topic, static, sure=is_sure, domain=domain)
            for frames in written
        )
        return PublishedTransforms(node, topic, tuple(named))
    arrays = _arrays(node, ports, stage) if ports.prims else None
    if arrays is None:
        return PublishedTransforms(node, topic, None)
    maker = arrays.maker
    is_sure = _is_sure(stage, node, maker)
    edges = []
    for pair in arrays.pairs:
        parent, child = ((pair.parent, pair.child)[place] for place in arrays.order)
        edge = Edge(
            parent, child, node.path, maker.path, topic, static, pair.target, pair.prim,
            expanded=pair.expanded, sure=is_sure, domain=domain,
        )  # fmt: skip
        edges.append(edge)
    top = parent_frame(maker, stage)
    hidden = tuple(
        replace(frames, parent=top, publisher=node.path, cause=maker.path, topic=topic)
        for frames in (unresolved_frames_of(maker, stage) if arrays.is_filled else ())
    )
    return PublishedTransforms(node, topic, tuple(edges), hidden)


def _written_frames(node: Node, ports: TfPorts, live: Nodes) -> list[tuple[str, str]] | None:
    """Return the frames that a node names: two, or arrays that are written or made of texts.

    None where they are unknown, or not given by name. There are none where arrays differ in length,
    for then nothing is sent.
    """
    if ports.names:
        frames = [effective_value(node, port, live) for port in ports.names]
        parent, child = (tf2_name(name) if isinstance(name, str) else None for name in frames)
        return None if parent is None or child is None else [(parent, child)]
    names = [listed_names(node, port, live) for port in ports.arrays]
    if not names or not all(names):
        return None
    inputs = () if node.type is None else node.type.ports.values()
    lists = (port.name for port in inputs if port.usd_type.endswith("[]"))
    arrays = [list_at(node, port, live) for port in lists]
    if len({len(array) for array in arrays if array is not None}) > 1:
        return []
    parents, children = ([tf2_name(name) for name in array or ()] for array in names)
    return [*zip(parents, children, strict=True)]


def _is_sure(stage: StageModel, *nodes: Node) -> bool:
    states = working_states(stage)
    # A node that is only read has no state.
    return not any(states.get(node.path) == "may run" for node in nodes)


class _Arrays(Struct, frozen=True):
    """The frames in the arrays of a publisher and who makes them: itself, or another node.

    `order` says which of a pair is sent as parent and which as child, for wires may be crossed.
    """

    maker: Node
    pairs: Sequence[Pair] = ()
    order: tuple[int, ...] = (0, 1)
    is_filled: bool = True


def _arrays(node: Node, ports: TfPorts, stage: StageModel) -> _Arrays | None:
    """Return what fills the arrays of a publisher, None where it is unknown.

    All of them must be as long as its array of parents: an array that is left alone is empty, and
    then nothing is sent. Without parents it looks at its own targets, and sends nothing at all if
    one of them does not exist.
    """
    live, running = live_nodes(stage), working_nodes(stage)
    inputs = {} if node.type is None else node.type.ports
    # A node that waits for a signal that never comes leaves the arrays that it feeds empty.
    makers = {
        port.name: [
            (source, out)
            for source, out in live_sources(node, port.name, live)
            if source.path in running or not any(signal_inputs(source))
        ]
        for port in inputs.values()
        if port.usd_type.endswith("[]")
    }
    first = makers.get(ports.arrays[0]) if ports.arrays else []
    if not first:
        targets = listed_targets(node)
        if any(not stage.prim(path) and not unknown_target(path, stage) for path in targets):
            return _Arrays(node, is_filled=False)
        return _Arrays(node, computed_pairs(node, stage))
    if not all(makers.values()):
        return _Arrays(node, is_filled=False)
    maker = first[0][0]
    gives = tf_ports(maker).gives
    sources = [makers[port][0] for port in ports.arrays]
    if not gives or any(source.path != maker.path or out not in gives for source, out in sources):
        return None
    pairs = computed_pairs(maker, stage)
    return _Arrays(maker, pairs, tuple(gives.index(out) for _, out in sources))
