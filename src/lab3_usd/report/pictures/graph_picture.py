"""Pictures of Action Graphs, of a spec or of a stage, with its faults marked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache

from msgspec.structs import replace

from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.check.robot.location import relocated_lab, relocated_spec, robot_relocations
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.facts.frames import all_edges, all_unresolved_frames, edges_on, unresolved_frames
from lab3_usd.model.finding import Finding, Severity
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import GraphModel, StageModel
from lab3_usd.report.picture.canvas import at_editor_positions, on_canvas, position_missing
from lab3_usd.report.picture.layered import Placed, layered
from lab3_usd.report.picture.model import (
    STATES,
    Box,
    Curve,
    End,
    Kind,
    Picture,
    Point,
    Remark,
    State,
    clip_end,
    state_word,
)
from lab3_usd.report.pictures.node_boxes import (
    BoxSubject,
    NodeRoles,
    SiteFindings,
    absent_box,
    assigned_roles,
    findings_by_site,
    node_box,
    wire_ends,
    wires_into,
)
from lab3_usd.report.pictures.tf_picture import frames_picture, published_frames_picture
from lab3_usd.report.tf_tree import TreeReport
from lab3_usd.spec.contradictions.names import transform_topics
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Checkpoint, Lab


def spec_wires(spec: GraphSpec, node_roles: NodeRoles) -> tuple[Curve, ...]:
    """Return the wires that the spec asks for."""
    curves = []
    for wire in spec.wires:
        port = spec.nodes[wire.target.role].type.port(wire.target.port)
        is_execution = port is not None and port.is_execution
        ends = (node_roles.end(wire.source), node_roles.end(wire.target))
        curves.append(Curve(*ends, dashed=is_execution))
    return tuple(curves)


def judged_wires(
    required: tuple[Curve, ...],
    graph: GraphModel | None,
    node_roles: NodeRoles,
    findings: SiteFindings,
) -> tuple[Curve, ...]:
    """Return the wires of the stage and, as missing, those that are asked for and not there."""
    sources = {curve.target: curve.source for curve in required}
    real = {} if graph is None else dict(_real_wires(graph, sources, node_roles))
    wanted = {(curve.source, curve.target) for curve in required}
    curves = [
        _marked(curve, "missing", findings)
        for curve in required
        if (curve.source, curve.target) not in real
        and _is_missing(curve, real, node_roles, findings)
    ]
    for (source, target), dashed in real.items():
        curve = Curve(source, target, dashed)
        if (source, target) in wanted:
            curves.append(curve)
            continue
        state = findings.state(target.key, target.port)
        is_unasked = not node_roles.unassigned.isdisjoint((source.key, target.key))
        if (state == "ok" and is_unasked) or (state == "warned" and required):
            state = "extra"
        curves.append(_marked(curve, state, findings))
    return tuple(curves)


def _real_wires(
    graph: GraphModel, sources: Mapping[End, End], node_roles: NodeRoles
) -> Iterator[tuple[tuple[End, End], bool]]:
    """Yield the ends of each wire in the file, and whether it carries execution.

    A dead source that stands for a missing node is left out: its wires are missing.
    """
    for source, target, is_execution in wires_into(graph.nodes):
        expected = sources.get(target)
        is_dead = expected is not None and expected.key in node_roles.missing
        if not is_dead or source.key in node_roles.nodes:
            yield (source, target), is_execution


def _is_missing(
    curve: Curve,
    real: Mapping[tuple[End, End], bool],
    node_roles: NodeRoles,
    findings: SiteFindings,
) -> bool:
    """Whether the wire is missing, rather than replaced by one without a fault.

    One that could not be drawn does not count: a node of another type may lack the port.
    """
    for end in (curve.source, curve.target):
        node = node_roles.nodes.get(end.key)
        if node is not None and not node.has_port(end.port):
            return False
    if curve.source.key in node_roles.missing or curve.target.key in node_roles.missing:
        return True
    if findings.state(curve.target.key, curve.target.port) == "wrong":
        return True
    return all(target != curve.target for _, target in real)


def _marked(curve: Curve, state: State, findings: SiteFindings) -> Curve:
    note = findings.note(curve.target.key, curve.target.port)
    return Curve(curve.source, curve.target, curve.dashed, state, note)


MOST_REMARKS = 4
MOST_LETTERS = 110
STATE_WORDS: Mapping[State, str] = {state: state_word(state) for state in STATES if state != "ok"}
LINT_WORDS: Mapping[State, str] = {"wrong": "with an error", "warned": "with a warning"}
STATE_OF: Mapping[Severity, State] = {"error": "wrong", "warning": "warned", "note": "ok"}


def spec_picture(spec: GraphSpec, *, every_port: bool = False) -> Picture:
    """Return the graph that the spec requires."""
    node_roles = NodeRoles({role: f"{spec.path}/{role}" for role in spec.nodes})
    curves = spec_wires(spec, node_roles)
    boxes = [*_node_boxes(spec, node_roles, curves, SiteFindings(), every_port=every_port)]
    placed = laid_out(tuple(boxes), tuple(curves))
    return on_canvas(
        Picture(spec.name, _counts_text(spec.path, boxes, curves), *placed, path=spec.path)
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
    kind: Kind = "graph",
) -> Picture:
    """Return a stage's graph with its faults: missing, wrong and extra parts marked.

    Without a spec the graph is drawn as it is. Without a graph everything the spec asks for is
    missing. The `kind` decides what faults are called. `findings` are those of the stage; the ones
    that lie elsewhere are passed over.
    """
    by_site = findings_by_site(findings)
    node_roles = assigned_roles(spec, roles, graph)
    required = spec_wires(spec, node_roles) if spec is not None and node_roles.box_keys else ()
    curves = judged_wires(required, graph, node_roles, by_site)
    boxes = [*_node_boxes(spec, node_roles, curves, by_site, every_port=every_port, kind=kind)]
    spec_positions: dict[str, Point] = {}
    name = path = ""
    if spec is not None:
        name, path = spec.name, spec.path
        spec_positions = {key: spec.nodes[role].at for role, key in node_roles.box_keys.items()}
    if graph is not None:
        name, path = name or graph.name, graph.path
    boxes += outside_boxes(graph, boxes, curves)
    boxes = list(position_missing(boxes, curves, spec_positions, frozenset(node_roles.nodes)))
    placed = laid_out(tuple(boxes), tuple(curves))
    is_linted = kind == "lint"
    subtitle = _counts_text(path, boxes, curves, LINT_WORDS if is_linted else STATE_WORDS)
    # A line per finding on the graph itself; missing nodes are drawn instead.
    remarks = [
        Remark(STATE_OF[finding.severity], clip_end(finding.message, MOST_LETTERS))
        for members in by_site.at.get(path, {}).values()
        for finding in members
        if finding.actual is not None
    ]
    return on_canvas(
        Picture(
            clip_end(name, MOST_LETTERS),
            subtitle,
            *placed,
            path=path,
            judged=is_linted or spec is not None or bool(findings),
            kind=kind,
            remarks=tuple(remarks[:MOST_REMARKS]),
        )
    )


def _node_boxes(
    spec: GraphSpec | None,
    node_roles: NodeRoles,
    curves: Sequence[Curve],
    findings: SiteFindings,
    *,
    every_port: bool,
    kind: Kind = "graph",
) -> Iterator[Box]:
    """Yield the boxes of roles in the order of the spec, then those of nodes without a role."""
    arriving, leaving = wire_ends(curves)
    roles = {key: role for role, key in node_roles.box_keys.items()}
    for key in dict.fromkeys((*roles, *node_roles.nodes)):
        node_spec = spec.nodes[roles[key]] if spec is not None and key in roles else None
        node, state = node_roles.nodes.get(key), findings.state(key)
        if key in node_roles.missing:
            state = "missing"
        elif node is not None and node_spec is not None and node.type is not node_spec.type:
            state = "wrong"
        elif roles and key in node_roles.unassigned and state != "wrong":
            state = "extra"
        ports = (arriving.get(key, {}), leaving.get(key, {}))
        yield node_box(BoxSubject(key, node_spec, node, *ports, findings, every_port, kind), state)


def outside_boxes(
    graph: GraphModel | None, boxes: Sequence[Box], curves: Sequence[Curve]
) -> Iterator[Box]:
    """Yield a box for each source of a wire that is outside the graph."""
    drawn = {box.key for box in boxes}
    absent = {} if graph is None else {source.path: source.reason for source in graph.absent}
    for key in dict.fromkeys(curve.source.key for curve in curves):
        if key not in drawn:
            away = [curve for curve in curves if curve.source.key == key]
            ports = tuple(dict.fromkeys(curve.source.port for curve in away))
            yield absent_box(key, ports, absent.get(key, "not in this graph"), away[0].state)


def _counts_text(
    path: str,
    boxes: Sequence[Box],
    curves: Sequence[Curve],
    words: Mapping[State, str] = STATE_WORDS,
) -> str:
    """Return path, number of nodes and wires, and how many of both and of the ports are faulty."""
    states = Counter(box.state for box in boxes)
    states.update(curve.state for curve in curves)
    states.update(
        row.state for box in boxes for row in box.rows if row in box.settings or not row.wired
    )
    nodes = sum(box.state != "missing" and box.family != "absent" for box in boxes)
    wires = sum(curve.state != "missing" for curve in curves)
    parts = [f"{nodes} node{'s' * (nodes != 1)}, {wires} wire{'s' * (wires != 1)}"]
    parts += [f"{states[state]} {word}" for state, word in words.items() if states[state]]
    return "  ·  ".join([clip_end(path, MOST_LETTERS), *parts])


def stage_pictures(
    lab: Lab,
    checkpoint: Checkpoint | None,
    stage: StageModel,
    findings: Sequence[Finding] = (),
    *,
    every_port: bool = False,
) -> Iterator[Picture]:
    """Yield the graphs that the checkpoint asks for, the stage's other graphs, and the TF tree.

    The tree is left out where neither the checkpoint asks for one nor the stage publishes any.
    Without a checkpoint every graph is drawn as it is.
    """
    lab = lab if checkpoint is None else lab.at(checkpoint.id)
    lab = relocated_lab(lab, robot_relocations(lab, stage))
    relocations = sensor_relocations(lab, stage)
    specs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    matched = {} if checkpoint is None else match_all(specs, stage, lab.platform.scripts)
    required = () if checkpoint is None else checkpoint.graphs
    for name, roles in matched.items():
        if name in required or roles.graph is not None:
            part = _part_of(roles, matched)
            yield graph_picture(specs[name], roles, part, findings, every_port=every_port)
    drawn = {roles.graph.path for roles in matched.values() if roles.graph is not None}
    inside = _by_prim_above(findings)
    for graph in stage.graphs:
        if graph.active and graph.path not in drawn:
            here = inside.get(graph.path, ())
            yield graph_picture(None, None, graph, here, every_port=every_port)
    if checkpoint is None:
        yield from _published_trees(stage)
        return
    topics = transform_topics(lab)
    edges, hidden = edges_on(topics, stage), unresolved_frames(topics, stage)
    has_tree, localized = checkpoint.frames, checkpoint.localization
    if edges or hidden or has_tree:
        yield frames_picture(lab.frames, edges, hidden, required=has_tree, localized=localized)


def _by_prim_above(findings: Iterable[Finding]) -> Mapping[str, Sequence[Finding]]:
    """Map each prim to the findings at and below it."""
    below: dict[str, list[Finding]] = {}
    for finding in findings:
        for path in upwards(finding.prim):
            below.setdefault(path, []).append(finding)
    return below


def linted_pictures(
    stage: StageModel, findings: Sequence[Finding], *, every_port: bool = False
) -> Iterator[Picture]:
    """Yield the graphs of a stage that no lab asks for, and its TF tree, with faults marked."""
    inside = _by_prim_above(findings)
    for graph in stage.graphs:
        if graph.active and not stage.platform.graph.ignores(graph.path):
            here = inside.get(graph.path, ())
            yield graph_picture(None, None, graph, here, every_port=every_port, kind="lint")
    yield from _published_trees(stage)


def _published_trees(stage: StageModel) -> Iterator[Picture]:
    """Yield the picture of the trees of a stage that no lab asks for, if it publishes any."""
    tree = TreeReport("", all_edges(stage), hidden=all_unresolved_frames(stage))
    if tree.edges or tree.hidden:
        yield published_frames_picture(tree)


def _part_of(roles: Roles, matched: Mapping[str, Roles]) -> GraphModel | None:
    """Return the graph without the nodes that play roles of other graphs built in it."""
    if roles.graph is None or not roles.merged_graphs:
        return roles.graph
    merged = {path for name in roles.merged_graphs for path in matched[name].role_of}
    merged |= {node.path for name in roles.merged_graphs for node in matched[name].extra}
    own = {*roles.role_of, *(node.path for node in (*roles.extra, *roles.retyped.values()))}
    kept = (node for node in roles.graph.nodes if node.path in own or node.path not in merged)
    return replace(roles.graph, nodes=tuple(kept))
