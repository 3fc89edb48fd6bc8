"""Compares two stage files: graphs, scene, topics and frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from lab3_usd.check.ros.topics import Endpoint, endpoints
from lab3_usd.check.tf.frames import published_edges
from lab3_usd.diff.graphs import graph_changes
from lab3_usd.diff.pairs import StagePairs, pair_stages
from lab3_usd.model.changes import EDITS, PARTS, StageChange, StageDiff
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.compare.scenes import scene_changes
from lab3_usd.stage.read.opening import open_stage, stage_errors
from lab3_usd.stage.read.reader import read_model


class Comparison(Struct, frozen=True):
    """What differs between two stages, and which graph of one is which of the other."""

    diff: StageDiff
    pairs: StagePairs


def compare_stages(before: Path, after: Path, lab: Lab) -> Comparison:
    """Compare two stages as they are composed, payloads loaded.

    Raises:
        StageError: one of the files cannot be opened.
    """
    stages = [open_stage(path) for path in (before, after)]
    was, now = (
        read_model(stage, lab, str(path))
        for stage, path in zip(stages, (before, after), strict=True)
    )
    pairs = pair_stages(was, now)
    with stage_errors(f"{before} or {after}"):
        scene = tuple(scene_changes(stages[0], stages[1], lab, pairs.path))
    changes = [
        *graph_changes(pairs, lab.catalog.graph),
        *_stage_changes(was, now),
        *scene,
        *_topic_changes(was, now, lab, pairs),
        *_frame_changes(was, now, lab),
    ]
    ordered = tuple(sorted(changes, key=_order))
    return Comparison(StageDiff(str(before), str(after), ordered), pairs)


def _order(change: StageChange) -> tuple[int, str, str, int]:
    return (
        PARTS.index(change.part), change.path, change.property, EDITS.index(change.edit),
    )  # fmt: skip


def _stage_changes(before: StageModel, after: StageModel) -> Iterator[StageChange]:
    """Yield what differs of the stages as wholes: units, assets that are not found, animation."""
    for name in ("up_axis", "meters_per_unit", "kilograms_per_unit"):
        was, now = getattr(before, name), getattr(after, name)
        if was != now:
            yield StageChange("scene", "changed", "/", name, str(was), str(now))
    absent = [{(each.prim, each.asset) for each in stage.unresolved} for stage in (before, after)]
    for prim, asset in absent[0] - absent[1]:
        yield StageChange("scene", "removed", prim, "asset not found", was=asset)
    for prim, asset in absent[1] - absent[0]:
        yield StageChange("scene", "added", prim, "asset not found", now=asset)
    moves = [{(each.prim, each.property): each for each in s.moving} for s in (before, after)]
    for key in moves[0].keys() | moves[1].keys():
        told = [each[key].then if key in each else "" for each in moves]
        if told[0] != told[1]:
            yield StageChange("scene", "changed", key[0], f"{key[1]} (animated)", *told)


def _topic_changes(
    before: StageModel, after: StageModel, lab: Lab, pairs: StagePairs
) -> Iterator[StageChange]:
    """Yield the topics that came, went or are not what they were."""
    ours = {(pairs.path(each.node.path), each.port): each for each in endpoints(before, lab)}
    theirs = {(each.node.path, each.port): each for each in endpoints(after, lab)}
    for place, was in ours.items():
        if place not in theirs:
            yield StageChange("topic", "removed", _name(was), was=_words(was))
            continue
        now, old = _facts(theirs[place]), _facts(was)
        for fact in old:
            if old[fact] != now[fact]:
                name = _name(theirs[place])
                yield StageChange("topic", "changed", name, fact, old[fact], now[fact])
    for place, endpoint in theirs.items():
        if place not in ours:
            yield StageChange("topic", "added", _name(endpoint), now=_words(endpoint))


def _name(endpoint: Endpoint) -> str:
    return endpoint.topic or endpoint.written


def _words(endpoint: Endpoint) -> str:
    return f"{endpoint.node.path} {endpoint.direction} {endpoint.type or 'an unknown type'}"


def _facts(endpoint: Endpoint) -> dict[str, str]:
    return {
        "name": _name(endpoint),
        "type": endpoint.type or "unknown",
        "frames": ", ".join(endpoint.frames) or "none",
        "qos": "unknown" if endpoint.qos is None else str(endpoint.qos),
        "rate": endpoint.rate if endpoint.runs else "never",
    }


def _frame_changes(before: StageModel, after: StageModel, lab: Lab) -> Iterator[StageChange]:
    """Yield the transforms that came or went, as often as they did."""
    ours, theirs = _transforms(before, lab), _transforms(after, lab)
    for child, words in (ours - theirs).elements():
        yield StageChange("frame", "removed", child, was=words)
    for child, words in (theirs - ours).elements():
        yield StageChange("frame", "added", child, now=words)


def _transforms(stage: StageModel, lab: Lab) -> Counter[tuple[str, str]]:
    edges = published_edges(stage, lab)
    return Counter((each.child, f"{each.parent} -> {each.child} on {each.topic}") for each in edges)
