"""Every picture of one stage: its graphs, with their faults, and its TF tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec.structs import replace

from lab3_usd.check.match.merging import match_all
from lab3_usd.check.match.result import Roles
from lab3_usd.check.relocation import relocated_lab, relocated_spec
from lab3_usd.check.scene.robot_location import robot_relocations
from lab3_usd.check.scene.sensor_location import sensor_relocations
from lab3_usd.check.tf.frames import published_edges, unresolved_frames
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import GraphModel, StageModel
from lab3_usd.report.picture import Picture
from lab3_usd.report.pictures.graph_picture import graph_picture
from lab3_usd.report.pictures.tf_picture import frames_picture
from lab3_usd.spec.lab import Checkpoint, Lab


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
    lab = relocated_lab(lab, robot_relocations(lab, stage))
    relocations = sensor_relocations(lab, stage)
    specs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    matched = {} if checkpoint is None else match_all(specs, stage, lab.catalog.scripts)
    asked = () if checkpoint is None else checkpoint.graphs
    for name, roles in matched.items():
        if name in asked or roles.graph is not None:
            part = _part_of(roles, matched)
            yield graph_picture(specs[name], roles, part, findings, every_port=every_port)
    known = {roles.graph.path for roles in matched.values() if roles.graph is not None}
    for graph in stage.graphs:
        if graph.active and graph.path not in known:
            yield graph_picture(None, None, graph, findings, every_port=every_port)
    yield from _tree(lab, checkpoint, stage)


def _part_of(roles: Roles, matched: Mapping[str, Roles]) -> GraphModel | None:
    """Return the graph without the nodes that play roles of other graphs built in it."""
    if roles.graph is None or not roles.merged_graphs:
        return roles.graph
    others = {path for name in roles.merged_graphs for path in matched[name].role_of}
    others |= {node.path for name in roles.merged_graphs for node in matched[name].extra}
    own = {*roles.role_of, *(node.path for node in (*roles.extra, *roles.retyped.values()))}
    kept = (node for node in roles.graph.nodes if node.path in own or node.path not in others)
    return replace(roles.graph, nodes=tuple(kept))


def _tree(lab: Lab, checkpoint: Checkpoint | None, stage: StageModel) -> Iterator[Picture]:
    edges, hidden = published_edges(stage, lab), unresolved_frames(stage, lab)
    required = checkpoint is not None and checkpoint.frames
    localized = checkpoint is not None and checkpoint.localization
    if edges or hidden or required:
        yield frames_picture(lab.frames, edges, hidden, required=required, localized=localized)
