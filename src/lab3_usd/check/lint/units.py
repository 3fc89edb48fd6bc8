"""The unit of length in which a value comes into a node."""

from __future__ import annotations

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import effective_value, live_sources
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, OUTPUT, can_connect
from lab3_usd.spec.isaac import UnitOf


def unit_of(node: Node, port: str, subject: LintSubject, depth: int = 8) -> float | None:
    """Return how many metres are 1 in what comes into an input, None where nothing tells it."""
    sources = list(live_sources(node, port, subject.live)) if depth else []
    if len(sources) != 1 or not _is_taken(sources[0], node, port):
        return None
    source, out = sources[0]
    said = None if source.type is None else subject.types.units.get(source.type.type)
    if said is None or out.removeprefix(OUTPUT) in said.metres:
        return None if said is None else 1.0
    unit = unit_of(source, INPUT + said.passes, subject, depth - 1) if said.passes else None
    factor = _factor(source, said, subject)
    return None if unit is None or factor is None else unit * factor


def _is_taken(end: tuple[Node, str], node: Node, port: str) -> bool:
    """Whether OmniGraph takes a wire: it refuses one between types that do not go together."""
    source, out = end
    left = None if source.type is None else source.type.port(out)
    enters = None if node.type is None else node.type.port(port)
    return left is None or enters is None or can_connect(left, enters)


def _factor(node: Node, said: UnitOf, subject: LintSubject) -> float | None:
    """Return by how much a node makes the unit larger, None where it gives nothing."""
    if not said.by:
        return 1.0
    unit = subject.stage.meters_per_unit or 1.0
    factors = {said.to_stage: unit, said.to_metres: 1.0 / unit}
    return factors.get(str(effective_value(node, INPUT + said.by, subject.live)))
