"""Describes the TF tree that a stage publishes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.check.tf.frames import published_edges
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.graph_names import graph_frames, named_frames


def describe_frames(stage: StageModel, lab: Lab, section: str) -> dict[str, Any]:
    """Describe the tree; `lab` has the new graphs and scene."""
    edges = _edges(stage, lab)
    base = lab.scene["robot"]["base_frame"]
    data = {"handout": section, "edges": [f"{parent} -> {child}" for parent, child in edges]}
    is_known = any(base in edge for edge in edges)
    return data | ({"deeper_under": base} if is_known else {})


def _edges(stage: StageModel, lab: Lab) -> list[tuple[str, str]]:
    """Return the transforms: what the stage publishes, and what missing assets would add to it."""
    given = list(graph_frames(lab))
    known = {each.child for each in given}
    found = {
        edge.child: (edge.parent, edge.child)
        for edge in published_edges(stage, lab)
        if edge.child in known and edge.parent != edge.child
    }
    for each in given:
        if each.parent:
            found.setdefault(each.child, (each.parent, each.child))
    return list(found.values())


def frames_outside(frames: Mapping[str, Any], lab: Lab) -> Iterator[str]:
    """Yield the frames of messages that the described tree does not have, with their places."""
    tree = {name for edge in frames["edges"] for name in edge.split(" -> ")}
    for each in named_frames(lab):
        if tree and each.child not in tree:
            yield f"{each.place}: '{each.child}' is no frame of the tree that the stage publishes"
