"""Which box of a picture has which role of the spec."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct, field

from lab3_usd.check.match.result import Roles
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.report.picture import End
from lab3_usd.spec.graph import GraphSpec, PortRef


class NodeRoles(Struct, frozen=True):
    """The key of each role's box; `missing` are the keys of the roles that no node has.

    `nodes` are the nodes of the file by path. `unassigned` are the paths of those that have no
    role and stand in for none.
    """

    box_keys: Mapping[str, str] = field(default_factory=dict)
    missing: frozenset[str] = frozenset()
    nodes: Mapping[str, Node] = field(default_factory=dict)
    unassigned: frozenset[str] = frozenset()

    def end(self, port: PortRef) -> End:
        """Return the end of a wire of the spec."""
        return End(self.box_keys[port.role], port.port)


def reference_roles(spec: GraphSpec) -> NodeRoles:
    """Return the roles of a spec that is drawn without a stage."""
    return NodeRoles({role: f"{spec.path}/{role}" for role in spec.nodes})


def assigned_roles(
    spec: GraphSpec | None, roles: Roles | None, graph: GraphModel | None
) -> NodeRoles:
    """Return the roles of a stage's graph; without roles or spec none is assigned or missing."""
    nodes = {} if graph is None else {node.path: node for node in graph.nodes}
    if spec is None or (roles is None and graph is not None):
        return NodeRoles(nodes=nodes)
    folder = spec.path if graph is None else graph.path
    players = {role: None if roles is None else _node_of(roles, role) for role in spec.nodes}
    box_keys: dict[str, str] = {}
    missing = []
    for role, node in players.items():
        if node is not None and node.path in nodes:
            box_keys[role] = node.path
            continue
        box_keys[role] = _unused(f"{folder}/{role}", nodes)
        missing.append(box_keys[role])
    playing = set(box_keys.values())
    stand_ins = {} if roles is None else roles.equivalents
    unassigned = frozenset(path for path in nodes if path not in playing and path not in stand_ins)
    return NodeRoles(box_keys, frozenset(missing), nodes, unassigned)


def _node_of(roles: Roles, role: str) -> Node | None:
    """Return the node that has a role; one of another type in its place is drawn as wrong."""
    return roles.node_of.get(role) or roles.retyped.get(role)


def _unused(path: str, nodes: Mapping[str, Node]) -> str:
    """Return a path for a missing node: a node of another type may have the name already."""
    while path in nodes:
        path += "_missing"
    return path
