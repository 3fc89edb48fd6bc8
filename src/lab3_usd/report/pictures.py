"""Pictures of Action Graphs: what a spec asks for, or a stage's graph with its faults marked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain

from lab3_usd.check.finding import Finding, Severity
from lab3_usd.check.model import GraphModel
from lab3_usd.check.subject import Roles
from lab3_usd.report.drawing.cast import Cast, cast_of, reference_cast
from lab3_usd.report.drawing.faults import Faults, faults
from lab3_usd.report.drawing.framing import framed
from lab3_usd.report.drawing.ghosts import settled
from lab3_usd.report.drawing.graph_boxes import absent_box, ends, node_box
from lab3_usd.report.drawing.rows import Plan
from lab3_usd.report.drawing.saved_places import saved
from lab3_usd.report.drawing.text_width import clip_end
from lab3_usd.report.drawing.wires import judged_wires, spec_wires
from lab3_usd.report.layout import Placed, layered
from lab3_usd.report.picture_model import STATES, Box, Curve, End, Picture, Remark, State
from lab3_usd.spec.spec import GraphSpec

MOST_REMARKS = 4
MOST_LETTERS = 110
SHOWN: Mapping[Severity, State] = {"error": "wrong", "warning": "extra", "note": "ok"}


def spec_picture(spec: GraphSpec, *, every_port: bool = False) -> Picture:
    """Return the graph as the spec asks for it, to look at beside one's own."""
    cast = reference_cast(spec)
    curves = spec_wires(spec, cast)
    boxes = _role_boxes(spec, cast, curves, Faults(), every_port=every_port)
    placed = _placed(tuple(boxes), tuple(curves))
    return framed(Picture(spec.name, _counted(spec.path, boxes, curves), *placed, path=spec.path))


@lru_cache(maxsize=64)  # a graph that stays as it is from stage to stage is laid out once
def _placed(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> Placed:
    return saved(boxes, curves) or layered(boxes, curves)


def graph_picture(
    spec: GraphSpec | None,
    roles: Roles | None,
    graph: GraphModel | None,
    findings: Sequence[Finding],
    *,
    every_port: bool = False,
) -> Picture:
    """Return a stage's graph with its faults: missing parts as ghosts, wrong and extra ones marked.

    Without a spec the graph is drawn as it is. Without a graph everything the spec asks for is
    missing. `findings` are those of the stage; the ones that lie elsewhere are passed over.
    """
    found = faults(findings)
    cast = cast_of(spec, roles, graph)
    asked = spec_wires(spec, cast) if spec is not None and cast.keys else ()
    curves = judged_wires(asked, graph, cast, found)
    boxes = [] if spec is None else _role_boxes(spec, cast, curves, found, every_port=every_port)
    boxes += _other_boxes(boxes, cast, curves, found, every_port=every_port)
    boxes += _strangers(graph, boxes, curves)
    home = {} if spec is None else {key: spec.nodes[role].at for role, key in cast.keys.items()}
    boxes = list(settled(boxes, curves, home, frozenset(cast.own)))
    placed = _placed(tuple(boxes), tuple(curves))
    name, path = _name(spec, graph)
    remarks = tuple(_remarks(path, found))[:MOST_REMARKS]
    subtitle = _counted(clip_end(path, MOST_LETTERS), boxes, curves)
    return framed(
        Picture(
            clip_end(name, MOST_LETTERS),
            subtitle,
            *placed,
            path=path,
            judged=spec is not None or bool(findings),
            remarks=remarks,
        )
    )


def _name(spec: GraphSpec | None, graph: GraphModel | None) -> tuple[str, str]:
    if graph is None:
        return ("", "") if spec is None else (spec.name, spec.path)
    return (graph.name if spec is None else spec.name, graph.path)


def _role_boxes(
    spec: GraphSpec, cast: Cast, curves: Sequence[Curve], found: Faults, *, every_port: bool
) -> list[Box]:
    arriving, leaving = ends(curves)
    boxes = []
    for role, key in cast.keys.items():
        plan = Plan(
            key,
            spec.nodes[role],
            cast.own.get(key),
            _of(arriving, key),
            _of(leaving, key),
            found,
            every_port,
        )
        boxes.append(node_box(plan, _role_state(plan, cast)))
    return boxes


def _role_state(plan: Plan, cast: Cast) -> State:
    if plan.key in cast.ghosts:
        return "missing"
    if plan.node is not None and plan.spec is not None and plan.node.type is not plan.spec.type:
        return "wrong"
    return plan.found.state(plan.key)


def _other_boxes(
    boxes: Sequence[Box], cast: Cast, curves: Sequence[Curve], found: Faults, *, every_port: bool
) -> list[Box]:
    """Return the boxes of nodes that play no role."""
    arriving, leaving = ends(curves)
    drawn = {box.key for box in boxes}
    others = []
    for key, node in cast.own.items():
        if key in drawn:
            continue
        plan = Plan(key, None, node, _of(arriving, key), _of(leaving, key), found, every_port)
        state = found.state(key)
        unused = cast.keys and key in cast.idle and state == "ok"
        others.append(node_box(plan, "extra" if unused else state))
    return others


def _of(all_ends: Mapping[End, State], key: str) -> dict[str, State]:
    return {end.port: state for end, state in all_ends.items() if end.key == key}


def _strangers(
    graph: GraphModel | None, boxes: Sequence[Box], curves: Sequence[Curve]
) -> Iterator[Box]:
    """Yield a box for each place outside the graph that a wire comes from."""
    drawn = {box.key for box in boxes}
    absent = {} if graph is None else {gone.path: gone.reason for gone in graph.absent}
    for key in dict.fromkeys(curve.source.key for curve in curves):
        if key not in drawn:
            away = [curve for curve in curves if curve.source.key == key]
            ports = tuple(dict.fromkeys(curve.source.port for curve in away))
            yield absent_box(key, ports, absent.get(key, "not in this graph"), away[0].state)


def _remarks(path: str, found: Faults) -> Iterator[Remark]:
    """Yield a line per finding on the graph itself; missing nodes are drawn instead."""
    at_graph = (found.at[site] for site in found.at if site[0] == path)
    for finding in chain.from_iterable(at_graph):
        if finding.actual is not None:
            yield Remark(SHOWN[finding.severity], clip_end(finding.message, MOST_LETTERS))


def _counted(path: str, boxes: Sequence[Box], curves: Sequence[Curve]) -> str:
    """Return path, number of nodes and wires, and how many of both and of the ports are faulty."""
    states = Counter(box.state for box in boxes)
    states.update(curve.state for curve in curves)
    states.update(row.state for box in boxes if box.state == "ok" for row in box.settings)
    here = sum(box.state != "missing" and box.family != "absent" for box in boxes)
    wires = sum(curve.state != "missing" for curve in curves)
    parts = [f"{here} node{'s' * (here != 1)}, {wires} wire{'s' * (wires != 1)}"]
    parts += [f"{states[state]} {state}" for state in STATES if state != "ok" and states[state]]
    return "  ·  ".join([path, *parts])
