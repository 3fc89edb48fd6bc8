"""The wires of a picture and the state of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.model.stage import GraphModel
from lab3_usd.report.picture import Curve, End, State
from lab3_usd.report.pictures.node_roles import NodeRoles
from lab3_usd.report.pictures.site_findings import SiteFindings
from lab3_usd.spec.graph import GraphSpec, PortRef


def spec_wires(spec: GraphSpec, node_roles: NodeRoles) -> tuple[Curve, ...]:
    """Return the wires that the spec asks for."""
    return tuple(
        Curve(
            node_roles.end(wire.source),
            node_roles.end(wire.target),
            dashed=_signal(spec, wire.target),
        )
        for wire in spec.wires
    )


def _signal(spec: GraphSpec, target: PortRef) -> bool:
    port = spec.nodes[target.role].type.port(target.port)
    return port is not None and port.is_execution


def judged_wires(
    asked: tuple[Curve, ...], graph: GraphModel | None, node_roles: NodeRoles, found: SiteFindings
) -> tuple[Curve, ...]:
    """Return the wires of the stage and, as missing, those that are asked for and not there."""
    sources = {curve.target: curve.source for curve in asked}
    real = {} if graph is None else dict(_real(graph, sources, node_roles))
    wanted = {(curve.source, curve.target) for curve in asked}
    curves = [
        _marked(curve, "missing", found)
        for curve in asked
        if (curve.source, curve.target) not in real
        and _has_ends(curve, node_roles)
        and _is_missed(curve, real, node_roles, found)
    ]
    for (source, target), dashed in real.items():
        curve = Curve(source, target, dashed)
        if (source, target) in wanted:
            curves.append(curve)
        else:
            curves.append(_marked(curve, _state(curve, node_roles, found), found))
    return tuple(curves)


def _real(
    graph: GraphModel, sources: Mapping[End, End], node_roles: NodeRoles
) -> Iterator[tuple[tuple[End, End], bool]]:
    """Yield the ends of each wire in the file, and whether it carries execution."""
    for node in graph.nodes:
        for name, state in node.ports.items():
            port = None if node.type is None else node.type.port(name)
            target = End(node.path, name)
            for path in state.sources:
                prim, _, prop = path.rpartition(".")
                source = End(prim, prop)
                asked = sources.get(target)
                if (
                    asked is not None
                    and asked.key in node_roles.missing
                    and prim not in node_roles.nodes
                ):
                    continue  # the dead source is the missing node, whose wires are missing
                yield (source, target), port is not None and port.is_execution


def _has_ends(curve: Curve, node_roles: NodeRoles) -> bool:
    """Whether the wire could be drawn: a node of another type may lack the port."""
    ends = ((node_roles.nodes.get(end.key), end.port) for end in (curve.source, curve.target))
    return all(node is None or node.has_port(port) for node, port in ends)


def _is_missed(
    curve: Curve, real: Mapping[tuple[End, End], bool], node_roles: NodeRoles, found: SiteFindings
) -> bool:
    """Whether the wire is missing, rather than replaced by one that nobody finds fault with."""
    if curve.source.key in node_roles.missing or curve.target.key in node_roles.missing:
        return True
    if found.state(curve.target.key, curve.target.port) == "wrong":
        return True
    return all(target != curve.target for _, target in real)


def _state(curve: Curve, node_roles: NodeRoles, found: SiteFindings) -> State:
    state = found.state(curve.target.key, curve.target.port)
    if state == "ok" and (
        curve.source.key in node_roles.unassigned or curve.target.key in node_roles.unassigned
    ):
        return "extra"
    return state


def _marked(curve: Curve, state: State, found: SiteFindings) -> Curve:
    note = found.note(curve.target.key, curve.target.port)
    return Curve(curve.source, curve.target, curve.dashed, state, note)
