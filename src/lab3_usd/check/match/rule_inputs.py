"""What rules are given: the spec, the stage, which prim plays which role, and faulty wires."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from msgspec import Struct, field

from lab3_usd.facts.execution_order import live_nodes, run_states
from lab3_usd.facts.reaching_values import Nodes
from lab3_usd.facts.stuck_nodes import is_module
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.finding import Finding, Requirement
from lab3_usd.model.stage import GraphModel, Node, StageModel, once_per_stage

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

    def spec_of(self, node: Node) -> NodeSpec:
        """Return what is asked of a node that plays a role."""
        return self.spec.nodes[self.roles.role_of[node.path]]


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
    @once_per_stage
    def robots(self) -> tuple[RobotSubject, ...]:
        """Return the stage for each of its robots."""
        return tuple(_seen_by(self, robot) for robot in self.lab.scene.robots)

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


def _seen_by(subject: StageSubject, robot: RobotSpec) -> RobotSubject:
    given = {name: getattr(subject, name) for name in StageSubject.__struct_fields__}
    return RobotSubject(**given, robot=robot)


class JudgedStage(Struct, frozen=True, eq=False):
    """A judged stage: its requirements and all findings."""

    subject: StageSubject
    requirements: tuple[Requirement, ...]
    findings: tuple[Finding, ...]


class LintSubject(Struct, frozen=True, eq=False, dict=True):
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

    @cached_property
    def platform(self) -> Platform:
        """The release of Isaac Sim by which the stage is judged."""
        return self.stage.platform

    @cached_property
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
        """Yield the graphs, also deactivated ones, except those that Isaac Sim makes itself."""
        ignores = self.platform.graph.ignores
        return (graph for graph in self.stage.graphs if not ignores(graph.path))

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes of all active graphs."""
        return iter(self.live.values())

    def title(self, node: Node) -> str:
        """Return what a node is called in the graph editor."""
        return node.type.ui_name if node.type is not None else node.type_name or "a node"


# With and without a lab: a whole stage, and its graphs.
ModelSubject = LintSubject | StageSubject
GraphsSubject = LintSubject | GraphSubject
