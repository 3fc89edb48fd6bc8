"""What a correct Action Graph is: its nodes by role, their values, targets, wires and topics."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.graph import Graph, Node
from lab3_usd.isaac.graph import Variable as GraphVariable
from lab3_usd.isaac.graph import Wire as Connection
from lab3_usd.isaac.node_types import NodeType, Port
from lab3_usd.isaac.values import Value


class Setting(Struct, frozen=True):
    """A value that the handout asks for at one input."""

    port: str
    value: Value
    handout: str


class Target(Struct, frozen=True):
    """The prims that one relationship of a node must name, in the order of the handout.

    `handout_prims` are those of the handout where they do not work in a stage and `prims` do. The
    `optional` ones may be named as well: sensors of a checkpoint that may be left out.
    """

    port: str
    prims: tuple[str, ...]
    handout: str
    handout_prims: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()


class Variable(GraphVariable, frozen=True):
    """A variable that the handout asks for."""

    handout: str


class EarlierValues(Struct, frozen=True):
    """What a node has up to a checkpoint where a later one changes it; no prims: no target."""

    settings: tuple[Setting, ...] = ()
    targets: tuple[Target, ...] = ()


class NodeSpec(Struct, frozen=True):
    """One node of a graph. `role` names it in the spec; prims may be named otherwise.

    `keep` are the inputs the handout says to leave alone, `grown` the dynamic inputs it adds,
    `frames_from` the relationships that are judged by the TF frames they give. `at` is the
    position in the graph editor, in its own units; `since` the checkpoint that adds the node to its
    graph, '' for that of the graph. `until` holds what it has up to checkpoints, in their order.
    What a `literal` one holds may be typed where its wires end.
    """

    role: str
    type: NodeType
    at: tuple[float, float]
    handout: str
    settings: tuple[Setting, ...] = ()
    targets: tuple[Target, ...] = ()
    keep: tuple[tuple[str, str], ...] = ()
    grown: tuple[str, ...] = ()
    frames_from: tuple[str, ...] = ()
    since: str = ""
    until: Mapping[str, EarlierValues] = {}
    literal: bool = False

    @property
    def node(self) -> Node:
        """The node itself, apart from what the handout demands of it."""
        values = {setting.port: setting.value for setting in self.settings}
        targets = {target.port: target.prims for target in self.targets}
        return Node(self.role, self.type, values, targets, self.grown, self.at)

    def with_values(self, earlier: EarlierValues) -> NodeSpec:
        """Return the node with other values of some of its inputs."""
        changed = {setting.port for setting in earlier.settings}
        aimed = {target.port for target in earlier.targets}
        targets = (target for target in self.targets if target.port not in aimed)
        return replace(
            self,
            settings=(*(s for s in self.settings if s.port not in changed), *earlier.settings),
            targets=(*targets, *(target for target in earlier.targets if target.prims)),
            until={},
        )


class Wire(Connection, frozen=True):
    """A wire that the handout asks for."""

    handout: str


class GraphSpec(Struct, frozen=True, dict=True):
    """One Action Graph: its path, its nodes by role, its wires in the order of the handout.

    One that may stand `anywhere` also has any name.
    """

    name: str
    path: str
    handout: str
    nodes: Mapping[str, NodeSpec]
    wires: tuple[Wire, ...]
    optional_wires: tuple[Wire, ...] = ()
    forbidden_wires: tuple[Wire, ...] = ()
    variables: tuple[Variable, ...] = ()
    anywhere: bool = False

    @property
    def graph(self) -> Graph:
        """The graph itself, apart from what the handout demands of it."""
        nodes = {role: spec.node for role, spec in self.nodes.items()}
        return Graph(self.path, nodes, self.wires, self.variables)

    @cached_property
    def telling_types(self) -> frozenset[str]:
        """The node types that are fed and have a part in ROS; without ROS, all that are fed."""
        fed = {wire.target.role for wire in self.wires}
        nodes = [node for role, node in self.nodes.items() if role in fed]
        of_ros = frozenset(node.type.type for node in nodes if node.type.role)
        return of_ros or frozenset(node.type.type for node in nodes)

    @cached_property
    def wired_inputs(self) -> frozenset[tuple[str, str]]:
        """The inputs that wires end at, as role and port."""
        return frozenset((wire.target.role, wire.target.port) for wire in self.wires)

    @cached_property
    def roles_by_type(self) -> Mapping[str, tuple[str, ...]]:
        """The roles by the type of their nodes."""
        roles: dict[str, tuple[str, ...]] = {}
        for role, spec in self.nodes.items():
            roles[spec.type.type] = (*roles.get(spec.type.type, ()), role)
        return roles

    @cached_property
    def free_inputs(self) -> Mapping[str, tuple[Port, ...]]:
        """By role the inputs for values, without those that a setting or a wire is asked of."""
        free: dict[str, tuple[Port, ...]] = {}
        for role, spec in self.nodes.items():
            required = {setting.port for setting in spec.settings}
            required |= {wire.target.port for wire in self.wires_into(role)}
            free[role] = tuple(
                port
                for port in spec.type.ports.values()
                if not (port.is_source or port.is_execution or port.is_target or port.is_union)
                and port.name not in required
            )
        return free

    @cached_property
    def free_targets(self) -> Mapping[str, tuple[Port, ...]]:
        """By role the relationships, without those that a target is asked of."""
        return {
            role: tuple(
                port
                for port in spec.type.ports.values()
                if port.is_target and port.name not in {target.port for target in spec.targets}
            )
            for role, spec in self.nodes.items()
        }

    def without(self, roles: Collection[str]) -> GraphSpec:
        """Return the graph as it is before some of its nodes are added."""

        def there(wires: tuple[Wire, ...]) -> tuple[Wire, ...]:
            ends = ((wire, {wire.source.role, wire.target.role}) for wire in wires)
            return tuple(wire for wire, both in ends if both.isdisjoint(roles))

        return replace(
            self,
            nodes={role: node for role, node in self.nodes.items() if role not in roles},
            wires=there(self.wires),
            optional_wires=there(self.optional_wires),
            forbidden_wires=there(self.forbidden_wires),
        )

    def with_literals(self, roles: Collection[str]) -> GraphSpec:
        """Return the graph with the values of some nodes where their wires end, in their place."""
        nodes = dict(self.without(roles).nodes)
        for wire in self.wires:
            if wire.source.role in roles:
                given = self.nodes[wire.source.role].settings
                value = next(s.value for s in given if s.port == wire.source.port)
                fed = nodes[wire.target.role]
                typed = Setting(wire.target.port, value, wire.handout)
                nodes[wire.target.role] = replace(fed, settings=(*fed.settings, typed))
        return replace(self.without(roles), nodes=nodes)

    def behind(self, role: str) -> set[str]:
        """Return a role with those from which wires lead to it, over others as well."""
        roles = {role}
        for _ in self.nodes:
            roles |= {wire.source.role for wire in self.wires if wire.target.role in roles}
        return roles

    def named_prims(self, roles: Iterable[str]) -> set[str]:
        """Return the prims that nodes refer to."""
        targets = (target for role in roles for target in self.nodes[role].targets)
        return {prim for target in targets for prim in target.prims}

    def wires_into(self, role: str) -> Iterator[Wire]:
        """Yield the wires that end at `role`."""
        return (wire for wire in self.wires if wire.target.role == role)
