"""Which wires a picture holds, and how each is judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.model import GraphModel
from lab3_usd.report.drawing.cast import Cast
from lab3_usd.report.drawing.faults import Faults
from lab3_usd.report.picture_model import Curve, End, State
from lab3_usd.spec.spec import GraphSpec, PortRef


def spec_wires(spec: GraphSpec, cast: Cast) -> tuple[Curve, ...]:
    """Return the wires that the spec asks for."""
    return tuple(
        Curve(cast.end(wire.source), cast.end(wire.target), dashed=_signal(spec, wire.target))
        for wire in spec.wires
    )


def _signal(spec: GraphSpec, target: PortRef) -> bool:
    port = spec.nodes[target.role].type.port(target.port)
    return port is not None and port.is_execution


def judged_wires(
    asked: tuple[Curve, ...], graph: GraphModel | None, cast: Cast, found: Faults
) -> tuple[Curve, ...]:
    """Return the wires of the stage and, as missing, those that are asked for and not there."""
    sources = {curve.target: curve.source for curve in asked}
    real = {} if graph is None else dict(_real(graph, sources, cast))
    wanted = {(curve.source, curve.target) for curve in asked}
    curves = [
        _marked(curve, "missing", found)
        for curve in asked
        if (curve.source, curve.target) not in real
        and _has_ends(curve, cast)
        and _is_missed(curve, real, cast, found)
    ]
    for (source, target), dashed in real.items():
        curve = Curve(source, target, dashed)
        if (source, target) in wanted:
            curves.append(curve)
        else:
            curves.append(_marked(curve, _state(curve, cast, found), found))
    return tuple(curves)


def _real(
    graph: GraphModel, sources: Mapping[End, End], cast: Cast
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
                if asked is not None and asked.key in cast.ghosts and prim not in cast.own:
                    continue  # the dead source is the missing node, whose wires are missing
                yield (source, target), port is not None and port.is_execution


def _has_ends(curve: Curve, cast: Cast) -> bool:
    """Whether the wire could be drawn: a node of another type may lack the port."""
    ends = ((cast.own.get(end.key), end.port) for end in (curve.source, curve.target))
    return all(node is None or node.has_port(port) for node, port in ends)


def _is_missed(
    curve: Curve, real: Mapping[tuple[End, End], bool], cast: Cast, found: Faults
) -> bool:
    """Whether the wire is missing, rather than replaced by one that nobody finds fault with."""
    if curve.source.key in cast.ghosts or curve.target.key in cast.ghosts:
        return True
    if found.state(curve.target.key, curve.target.port) == "wrong":
        return True
    return all(target != curve.target for _, target in real)


def _state(curve: Curve, cast: Cast, found: Faults) -> State:
    state = found.state(curve.target.key, curve.target.port)
    if state == "ok" and (curve.source.key in cast.idle or curve.target.key in cast.idle):
        return "extra"
    return state


def _marked(curve: Curve, state: State, found: Faults) -> Curve:
    note = found.note(curve.target.key, curve.target.port)
    return Curve(curve.source, curve.target, curve.dashed, state, note)
