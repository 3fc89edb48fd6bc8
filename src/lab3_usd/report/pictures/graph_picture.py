"""Pictures of Action Graphs: of a spec, or of a stage with its faults marked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain

from lab3_usd.check.match.result import Roles
from lab3_usd.model.finding import Finding, Severity
from lab3_usd.model.stage import GraphModel
from lab3_usd.report.layout.canvas import on_canvas
from lab3_usd.report.layout.editor_positions import at_editor_positions
from lab3_usd.report.layout.layered import Placed, layered
from lab3_usd.report.layout.missing_positions import position_missing
from lab3_usd.report.layout.text_width import clip_end
from lab3_usd.report.picture import STATES, Box, Curve, End, Picture, Remark, State
from lab3_usd.report.pictures.node_boxes import absent_box, ends, node_box
from lab3_usd.report.pictures.node_roles import NodeRoles, assigned_roles, reference_roles
from lab3_usd.report.pictures.port_rows import BoxSubject
from lab3_usd.report.pictures.site_findings import SiteFindings, findings_by_site
from lab3_usd.report.pictures.wires import judged_wires, spec_wires
from lab3_usd.spec.graph import GraphSpec

MOST_REMARKS = 4
MOST_LETTERS = 110
STATE_OF: Mapping[Severity, State] = {"error": "wrong", "warning": "extra", "note": "ok"}


def spec_picture(spec: GraphSpec, *, every_port: bool = False) -> Picture:
    """Return the graph that the spec requires."""
    node_roles = reference_roles(spec)
    curves = spec_wires(spec, node_roles)
    boxes = _role_boxes(spec, node_roles, curves, SiteFindings(), every_port=every_port)
    placed = laid_out(tuple(boxes), tuple(curves))
    return on_canvas(
        Picture(spec.name, _counted(spec.path, boxes, curves), *placed, path=spec.path)
    )


@lru_cache(maxsize=64)  # a graph that stays as it is from stage to stage is laid out once
def laid_out(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> Placed:
    """Return boxes and curves at the positions of the editor, else in layers."""
    return at_editor_positions(boxes, curves) or layered(boxes, curves)


def graph_picture(
    spec: GraphSpec | None,
    roles: Roles | None,
    graph: GraphModel | None,
    findings: Sequence[Finding],
    *,
    every_port: bool = False,
) -> Picture:
    """Return a stage's graph with its faults: missing, wrong and extra parts marked.

    Without a spec the graph is drawn as it is. Without a graph everything the spec asks for is
    missing. `findings` are those of the stage; the ones that lie elsewhere are passed over.
    """
    found = findings_by_site(findings)
    node_roles = assigned_roles(spec, roles, graph)
    asked = spec_wires(spec, node_roles) if spec is not None and node_roles.box_keys else ()
    curves = judged_wires(asked, graph, node_roles, found)
    boxes = (
        [] if spec is None else _role_boxes(spec, node_roles, curves, found, every_port=every_port)
    )
    boxes += _other_boxes(boxes, node_roles, curves, found, every_port=every_port)
    boxes += _outside_boxes(graph, boxes, curves)
    spec_positions = (
        {}
        if spec is None
        else {key: spec.nodes[role].at for role, key in node_roles.box_keys.items()}
    )
    boxes = list(position_missing(boxes, curves, spec_positions, frozenset(node_roles.nodes)))
    placed = laid_out(tuple(boxes), tuple(curves))
    name, path = _name(spec, graph)
    remarks = tuple(_remarks(path, found))[:MOST_REMARKS]
    subtitle = _counted(clip_end(path, MOST_LETTERS), boxes, curves)
    return on_canvas(
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
    spec: GraphSpec,
    node_roles: NodeRoles,
    curves: Sequence[Curve],
    found: SiteFindings,
    *,
    every_port: bool,
) -> list[Box]:
    arriving, leaving = ends(curves)
    boxes = []
    for role, key in node_roles.box_keys.items():
        subject = BoxSubject(
            key,
            spec.nodes[role],
            node_roles.nodes.get(key),
            _of(arriving, key),
            _of(leaving, key),
            found,
            every_port,
        )
        boxes.append(node_box(subject, _role_state(subject, node_roles)))
    return boxes


def _role_state(subject: BoxSubject, node_roles: NodeRoles) -> State:
    if subject.key in node_roles.missing:
        return "missing"
    if (
        subject.node is not None
        and subject.spec is not None
        and subject.node.type is not subject.spec.type
    ):
        return "wrong"
    return subject.found.state(subject.key)


def _other_boxes(
    boxes: Sequence[Box],
    node_roles: NodeRoles,
    curves: Sequence[Curve],
    found: SiteFindings,
    *,
    every_port: bool,
) -> list[Box]:
    """Return the boxes of nodes without a role."""
    arriving, leaving = ends(curves)
    drawn = {box.key for box in boxes}
    others = []
    for key, node in node_roles.nodes.items():
        if key in drawn:
            continue
        subject = BoxSubject(
            key, None, node, _of(arriving, key), _of(leaving, key), found, every_port
        )
        state = found.state(key)
        unused = node_roles.box_keys and key in node_roles.unassigned and state == "ok"
        others.append(node_box(subject, "extra" if unused else state))
    return others


def _of(all_ends: Mapping[End, State], key: str) -> dict[str, State]:
    return {end.port: state for end, state in all_ends.items() if end.key == key}


def _outside_boxes(
    graph: GraphModel | None, boxes: Sequence[Box], curves: Sequence[Curve]
) -> Iterator[Box]:
    """Yield a box for each source of a wire that is outside the graph."""
    drawn = {box.key for box in boxes}
    absent = {} if graph is None else {gone.path: gone.reason for gone in graph.absent}
    for key in dict.fromkeys(curve.source.key for curve in curves):
        if key not in drawn:
            away = [curve for curve in curves if curve.source.key == key]
            ports = tuple(dict.fromkeys(curve.source.port for curve in away))
            yield absent_box(key, ports, absent.get(key, "not in this graph"), away[0].state)


def _remarks(path: str, found: SiteFindings) -> Iterator[Remark]:
    """Yield a line per finding on the graph itself; missing nodes are drawn instead."""
    at_graph = (found.at[site] for site in found.at if site[0] == path)
    for finding in chain.from_iterable(at_graph):
        if finding.actual is not None:
            yield Remark(STATE_OF[finding.severity], clip_end(finding.message, MOST_LETTERS))


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
