"""What rules are given: the spec, the stage, which prim plays which role, and faulty wires."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Literal, Protocol

from msgspec import Struct, field

from lab3_usd.facts.domains import Domain, are_surely_one
from lab3_usd.facts.execution_order import live_nodes, run_states, unevaluated_by
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.frames import (
    Edge,
    HeardTree,
    frames_in,
    heard_trees,
    is_tree_known,
    robots_shown,
    shared_tf_topics,
)
from lab3_usd.facts.message_frames import MessageFrame, message_frames
from lab3_usd.facts.reaching_values import Nodes
from lab3_usd.facts.stalled_nodes import is_needed
from lab3_usd.facts.stuck_nodes import is_module
from lab3_usd.facts.wires import connections, find_cycles
from lab3_usd.isaac.graph_form import GraphAttribute
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.finding import Finding, Place, Problem, Requirement
from lab3_usd.model.stage import GraphModel, Node, StageModel, UnresolvedAsset, once_per_stage

if TYPE_CHECKING:
    from lab3_usd.check.registry import Parameter, Parameters
    from lab3_usd.spec.graph import GraphSpec, NodeSpec, Wire
    from lab3_usd.spec.lab import Checkpoint, Lab
    from lab3_usd.spec.scene import RobotSpec

Kind = Literal[
    "missing", "moved", "wrong", "bypass", "foreign", "forbidden", "dead", "swapped",
    "second", "leftover", "unasked", "cycle", "incompatible",
]  # fmt: skip


class Roles(Struct, frozen=True):
    """Which node of a stage plays which role of a graph spec.

    `graph` is None when the stage holds nothing that could be the graph. `equivalents` maps a node
    that does the work of another (a second context with the same settings) to the role it may stand
    in for; `retyped` holds, for a role without a node, the node of another type that stands in its
    place; `extra` are the nodes that play no role. `merged_graphs` names the graphs of the lab that
    one graph of the stage holds, where it holds several.
    """

    graph: GraphModel | None
    node_of: Mapping[str, Node | None]
    role_of: Mapping[str, str]
    equivalents: Mapping[str, str] = field(default_factory=dict)
    extra: tuple[Node, ...] = ()
    retyped: Mapping[str, Node] = field(default_factory=dict)
    merged_graphs: tuple[str, ...] = ()


class WireFault(Struct, frozen=True):
    """One faulty wire at the input where it ends.

    `expected` and `actual` are property paths; `wire` the wire of the spec that is not met, None
    where nothing is asked for; `elsewhere` a second input that belongs to the same mistake.
    """

    kind: Kind
    node: Node
    port: str
    expected: str | None = None
    actual: str | None = None
    wire: Wire | None = None
    elsewhere: str | None = None


class ModelSubject(Protocol):
    """A stage, with or without a spec."""

    @property
    def stage(self) -> StageModel:
        """The stage."""

    @property
    def platform(self) -> Platform:
        """The release of Isaac Sim by which it is judged."""


class GraphsSubject(ModelSubject, Protocol):
    """The graphs of a stage that are judged: all of them, or the one that a spec describes."""

    def graphs(self) -> Iterator[GraphModel]:
        """Yield the graphs, in the scene or not."""

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes of the scene that are judged: all of them, or those with a role."""

    def judges_value(self, node: Node, port: str) -> bool:
        """Whether the value of an input is judged: any, or one that the spec sets."""

    def judged_targets(self, node: Node) -> Iterator[tuple[str, str]]:
        """Yield the targets that should exist, by port: all, or those that the spec leaves open."""

    def accepts_form(self, graph: GraphModel, attribute: GraphAttribute) -> bool:
        """Whether an attribute lets the graph be evaluated, or is as the spec asks."""

    def newest_version(self, node: Node) -> int | None:
        """Return the newest version of a node's type that is known, None where none is."""

    @property
    def wire_faults(self) -> tuple[WireFault, ...]:
        """What is wrong with the wires: by themselves, or beside those of the spec."""


class TransformsSubject(ModelSubject, Protocol):
    """The transforms of a stage that are judged, beside the tree that a spec asks for, if any."""

    def trees(self) -> tuple[HeardTree, ...]:
        """Return the transforms, by listener, that no other rule finds fault with."""

    def is_asked(self, edge: Edge) -> bool:
        """Whether a spec asks for a transform, of the node that sends it."""

    def are_one(self, domains: Iterable[Domain]) -> bool:
        """Whether domains of one name are one in every environment that counts."""

    def tops(self, heard: HeardTree) -> tuple[str, ...]:
        """Return the frames that all others are to hang together with; none where it is unknown."""

    def self_targets(self) -> Iterator[Problem]:
        """Yield where a role's own settings make a frame its own parent."""

    def message_frames(self) -> Iterator[MessageFrame]:
        """Yield the frames of messages that no other rule finds fault with."""

    def frames_in(self, domain: str) -> Collection[str]:
        """Return the frames that are published in a domain; none where this is unknown."""

    def frames_left_open(self) -> UnresolvedAsset | None:
        """Return the missing asset that may hold further frames."""

    def is_required(self, node: Node) -> bool:
        """Whether a spec asks for a node."""

    def assumed(self, edges: Iterable[Edge]) -> tuple[Place, ...]:
        """Return the nodes that a problem of transforms rests on."""


class GraphSubject(Struct, frozen=True, eq=False):
    """One graph of the spec beside its graph in the stage.

    `live_nodes` holds the live nodes of the whole stage by path, `matched` the nodes that play a
    role, each with the spec of the role, `wire_faults` what is wrong with the wires of this graph.
    """

    lab: Lab
    checkpoint: Checkpoint
    spec: GraphSpec
    roles: Roles
    stage: StageModel
    live_nodes: Mapping[str, Node]
    matched: tuple[tuple[Node, NodeSpec], ...] = ()
    wire_faults: tuple[WireFault, ...] = ()

    @property
    def platform(self) -> Platform:
        """The release of Isaac Sim that the lab is for."""
        return self.lab.platform

    def graphs(self) -> Iterator[GraphModel]:
        """Yield the graph of the stage, nothing where it has none."""
        if self.roles.graph is not None:
            yield self.roles.graph

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes that play a role."""
        return (node for node, _ in self.matched)

    def judges_value(self, node: Node, port: str) -> bool:
        """Whether the spec sets the value of an input."""
        role = self.roles.role_of.get(node.path)
        settings = () if role is None else self.spec.nodes[role].settings
        return any(setting.port == port for setting in settings)

    def judged_targets(self, node: Node) -> Iterator[tuple[str, str]]:
        """Yield the targets beside those that the spec asks for, where a list may have more."""
        spec = self.spec.nodes[self.roles.role_of[node.path]]
        for port in spec.frames_from:
            asked = {path for target in spec.targets for path in target.prims}
            yield from ((port, path) for path in node.targets(port) if path not in asked)

    def accepts_form(self, graph: GraphModel, attribute: GraphAttribute) -> bool:
        """Whether an attribute has a value of an Action Graph."""
        value = graph.attributes.get(attribute.name, attribute.unwritten)
        return not attribute.required or value in attribute.accepted

    def newest_version(self, node: Node) -> int | None:
        """Return the version that the type of a node has in the release of the lab."""
        return self.spec.nodes[self.roles.role_of[node.path]].type.version


class StageSubject(Struct, frozen=True, eq=False):
    """The whole stage at one checkpoint.

    `relocations` maps where the handout has the robot and its links to where they stand instead;
    `lab` reads as if they belonged there. `graphs` are those of the checkpoint, each as its own
    rules see it.
    """

    lab: Lab
    checkpoint: Checkpoint
    stage: StageModel
    roles: Mapping[str, Roles]
    relocations: Mapping[str, str] = field(default_factory=dict)
    graphs: tuple[GraphSubject, ...] = ()

    @property
    def platform(self) -> Platform:
        """The release of Isaac Sim that the lab is for."""
        return self.lab.platform

    @property
    def robots(self) -> tuple[RobotSubject, ...]:
        """Return the stage for each of its robots."""
        return _of_robots(self)

    @property
    def without_robot(self) -> RobotSubject:
        """Return the stage for the robot of a scene that has none."""
        from lab3_usd.spec.scene import NO_ROBOT

        return _seen_by(self, NO_ROBOT)

    def robot_of(self, path: str) -> RobotSubject | None:
        """Return the stage for the robot to which a path belongs, None where it belongs to none."""
        robot = self.lab.scene.robot_of(path)
        return next((subject for subject in self.robots if subject.robot is robot), None)


class RobotSubject(StageSubject, frozen=True, eq=False, kw_only=True):
    """The whole stage, for one of the lab's robots."""

    robot: RobotSpec


@once_per_stage
def _of_robots(subject: StageSubject) -> tuple[RobotSubject, ...]:
    return tuple(_seen_by(subject, robot) for robot in subject.lab.scene.robots)


def _seen_by(subject: StageSubject, robot: RobotSpec) -> RobotSubject:
    given = {name: getattr(subject, name) for name in StageSubject.__struct_fields__}
    return RobotSubject(**given, robot=robot)


class JudgedStage(Struct, frozen=True, eq=False):
    """A judged stage: its requirements and all findings."""

    subject: StageSubject
    requirements: tuple[Requirement, ...]
    findings: tuple[Finding, ...]


class LintSubject(Struct, frozen=True, eq=False):
    """A stage without a spec, and the release that it comes from, where that counts.

    That is `is_guessed` where nobody named it. `parameters` are the numbers of rules that a
    configuration sets.
    """

    stage: StageModel
    moved_from: Platform | None = None
    is_guessed: bool = False
    parameters: Parameters = ()

    def value(self, parameter: Parameter) -> float:
        """Return the value of a parameter: the configured one, else its default."""
        return dict(self.parameters).get((parameter.rule, parameter.name), parameter.default)

    @property
    def platform(self) -> Platform:
        """The release of Isaac Sim by which the stage is judged."""
        return self.stage.platform

    @property
    def live(self) -> Nodes:
        """The nodes of all active graphs by path."""
        return live_nodes(self.stage)

    def runs(self, path: str) -> bool:
        """Whether a node runs, or may run, while the timeline plays."""
        return path in run_states(self.stage)

    @property
    def is_module(self) -> bool:
        """Whether the stage holds graphs and neither robot nor sensor, for others to refer to."""
        return is_module(self.stage)

    def graphs(self) -> Iterator[GraphModel]:
        """Yield the graphs that no application made for itself, in the scene or not."""
        ignores = self.platform.graph.ignores
        return (graph for graph in self.stage.graphs if not ignores(graph.path))

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes of all active graphs."""
        return iter(self.live.values())

    def judges_value(self, node: Node, port: str) -> bool:  # noqa: ARG002 - see GraphsSubject
        """Every value is judged."""
        return True

    def judged_targets(self, node: Node) -> Iterator[tuple[str, str]]:
        """Yield all targets."""
        return ((port, path) for port, state in node.ports.items() for path in state.targets)

    def accepts_form(self, graph: GraphModel, attribute: GraphAttribute) -> bool:
        """Whether an attribute does not keep the nodes of a graph from being evaluated."""
        is_judged = graph.active and bool(graph.nodes)
        return not is_judged or attribute.name != unevaluated_by(graph, self.stage)

    def newest_version(self, node: Node) -> int | None:
        """Return the newest version in any release, None where a type may have more of them."""
        if node.type is None or node.type.may_have_more:
            return None
        return self.platform.newest_version(node.type)

    @property
    def wire_faults(self) -> tuple[WireFault, ...]:
        """What is wrong with the wires by themselves."""
        return _wire_faults(self.stage)

    def trees(self) -> tuple[HeardTree, ...]:
        """Return the transforms by listener."""
        return heard_trees(self.stage)

    def is_asked(self, _edge: Edge) -> bool:
        """Whether a spec asks for a transform, which no stage without a lab has."""
        return False

    def are_one(self, domains: Iterable[Domain]) -> bool:
        """Whether domains of one name are one in every environment."""
        return are_surely_one(domains)

    def tops(self, heard: HeardTree) -> tuple[str, ...]:
        """Return the top of the largest tree, and of those of other robots, where all are known."""
        if not is_tree_known(self.stage):
            return ()
        tops, shown = list[str](), set[str]()
        for edges, frames in heard.tree.parts:
            robots = robots_shown(edges, self.stage)
            if not tops or (robots and shown.isdisjoint(robots)):
                tops += [top for top in heard.tree.roots if top in frames][:1]
                shown |= robots
        return tuple(tops)

    def self_targets(self) -> Iterator[Problem]:
        """Yield where a role's own settings make a frame its own parent: there are no roles."""
        yield from ()

    def message_frames(self) -> Iterator[MessageFrame]:
        """Yield the frames of messages."""
        yield from message_frames(self.stage)

    def frames_in(self, domain: str) -> Collection[str]:
        """Return the frames that are published in a domain, where all transforms are known."""
        is_known = is_tree_known(self.stage)
        return frames_in(self.stage, domain) if is_known else ()

    def frames_left_open(self) -> UnresolvedAsset | None:
        """Return the missing asset that may hold further frames: then no frame is judged."""
        return None

    def is_required(self, _node: Node) -> bool:
        """Whether a spec asks for a node: without one, all count alike."""
        return True

    def assumed(self, edges: Iterable[Edge]) -> tuple[Place, ...]:
        """Return the names and the namespaces that a problem of transforms rests on."""
        edges = tuple(edges)
        publishers = {edge.publisher for edge in edges}
        named = (self.live[path] for path in dict.fromkeys(edge.cause for edge in edges))
        return (
            *((node.path, port) for node in named for port in tf_ports(node).names),
            *(
                (shared.prim, self.platform.ros.namespace_attribute)
                for shared in shared_tf_topics(self.stage)
                if any(publishers & {*paths} for paths in shared.publishers.values())
            ),
        )

    def title(self, node: Node) -> str:
        """Return what a node is called in the graph editor."""
        return node.type.ui_name if node.type is not None else node.type_name or "a node"


@once_per_stage
def _wire_faults(stage: StageModel) -> tuple[WireFault, ...]:
    """Return what is wrong with the wires of a stage, whatever they are for."""
    faults = []
    fed: dict[tuple[str, str], str] = {}
    for wire in connections(stage):
        if not wire.has_source:
            is_dead = is_needed(wire.node, wire.port, stage)
            kind: Kind = "dead" if is_dead else "leftover"
            faults.append(WireFault(kind, wire.node, wire.port, None, wire.path))
        elif wire.is_live and not wire.is_compatible:
            faults.append(WireFault("incompatible", wire.node, wire.port, None, wire.path))
        elif wire.is_live and wire.brings_data:
            first = fed.setdefault((wire.node.path, wire.port), wire.path)
            if first != wire.path:
                faults.append(WireFault("second", wire.node, wire.port, first, wire.path))
    faults += [
        WireFault("cycle", wire.node, wire.port, None, wire.path) for wire in find_cycles(stage)
    ]
    return tuple(faults)
