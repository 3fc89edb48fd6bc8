"""Every picture of one stage: its graphs, with their faults, and its TF tree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.check.candidates import find_graphs, relocated
from lab3_usd.check.finding import Finding
from lab3_usd.check.frames import published_edges
from lab3_usd.check.matcher import match
from lab3_usd.check.model import StageModel
from lab3_usd.check.robot_place import lab_at, robot_homes
from lab3_usd.check.sensor_place import sensor_homes
from lab3_usd.report.frames_picture import frames_picture
from lab3_usd.report.picture_model import Picture
from lab3_usd.report.pictures import graph_picture
from lab3_usd.spec.spec import Checkpoint, Lab


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
    lab = lab_at(lab, robot_homes(lab, stage))
    homes = sensor_homes(lab, stage)
    specs = {name: relocated(spec, homes) for name, spec in lab.graphs.items()}
    graphs = {} if checkpoint is None else find_graphs(specs, stage)
    asked = () if checkpoint is None else checkpoint.graphs
    for name, graph in graphs.items():
        if name in asked or graph is not None:
            spec = specs[name]
            yield graph_picture(spec, match(spec, graph), graph, findings, every_port=every_port)
    known = {graph.path for graph in graphs.values() if graph is not None}
    for graph in stage.graphs:
        if graph.active and graph.path not in known:
            yield graph_picture(None, None, graph, findings, every_port=every_port)
    yield from _tree(lab, checkpoint, stage)


def _tree(lab: Lab, checkpoint: Checkpoint | None, stage: StageModel) -> Iterator[Picture]:
    edges = published_edges(stage, lab)
    required = checkpoint is not None and checkpoint.frames
    localized = checkpoint is not None and checkpoint.localization
    if edges or required:
        yield frames_picture(lab.frames, edges, required=required, localized=localized)
