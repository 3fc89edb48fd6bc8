"""Which box of a picture plays which role of the spec."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct, field

from lab3_usd.check.model import GraphModel, Node
from lab3_usd.check.subject import Roles
from lab3_usd.report.picture_model import End
from lab3_usd.spec.spec import GraphSpec, PortRef


class Cast(Struct, frozen=True):
    """The key of each role's box, and which roles nobody plays (the keys in `ghosts`).

    `own` are the live nodes by path; `idle` the paths of those that play no role and stand in
    for none.
    """

    keys: Mapping[str, str] = field(default_factory=dict)
    ghosts: frozenset[str] = frozenset()
    own: Mapping[str, Node] = field(default_factory=dict)
    idle: frozenset[str] = frozenset()

    def end(self, port: PortRef) -> End:
        """Return the end of a wire of the spec."""
        return End(self.keys[port.role], port.port)


def reference_cast(spec: GraphSpec) -> Cast:
    """Return the cast of a spec that is drawn by itself: every role plays itself."""
    return Cast({role: f"{spec.path}/{role}" for role in spec.nodes})


def cast_of(spec: GraphSpec | None, roles: Roles | None, graph: GraphModel | None) -> Cast:
    """Return the cast of a stage's graph; without roles or spec nobody plays or misses a role."""
    own = {} if graph is None else {node.path: node for node in graph.nodes}
    if spec is None or (roles is None and graph is not None):
        return Cast(own=own)
    folder = spec.path if graph is None else graph.path
    players = {role: None if roles is None else _player(roles, role) for role in spec.nodes}
    keys: dict[str, str] = {}
    ghosts = []
    for role, node in players.items():
        if node is not None and node.path in own:
            keys[role] = node.path
            continue
        keys[role] = _unused(f"{folder}/{role}", own)
        ghosts.append(keys[role])
    playing = set(keys.values())
    stand_ins = {} if roles is None else roles.stand_ins
    idle = frozenset(path for path in own if path not in playing and path not in stand_ins)
    return Cast(keys, frozenset(ghosts), own, idle)


def _player(roles: Roles, role: str) -> Node | None:
    """Return who plays a role; a node of another type in its place is drawn there, as wrong."""
    return roles.node_of.get(role) or roles.retyped.get(role)


def _unused(path: str, own: Mapping[str, Node]) -> str:
    """Return a path for a missing node: a node of another type may have the name already."""
    while path in own:
        path += "_missing"
    return path
