"""Graphs, frames and topics of the stages of a report, which are read again for the page."""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct

from lab3_usd.check.ros.topics import endpoints
from lab3_usd.check.tf.frames import published_edges, unknown_publishers, unresolved_frames
from lab3_usd.errors import Lab3Error, StageError
from lab3_usd.model.finding import StageResult
from lab3_usd.model.stage import StageModel
from lab3_usd.report.picture import Picture
from lab3_usd.report.pictures.stage_pictures import stage_pictures
from lab3_usd.report.tf_tree import TreeReport, as_text
from lab3_usd.report.topic_table import TopicReport, cells
from lab3_usd.spec.lab import Lab


class StageContent(Struct, frozen=True):
    """Pictures, TF tree as text, and topics as table cells of one stage."""

    pictures: tuple[Picture, ...] = ()
    tree: tuple[str, ...] = ()
    topics: tuple[tuple[str, ...], ...] = ()


def read_content(result: StageResult, lab: Lab) -> StageContent | None:
    """Return the content of the stage of a result, None if it cannot be read."""
    model = _read(result, lab)
    try:
        return None if model is None else _content(result, model, lab)
    except StageError:  # it is damaged where no rule has looked
        return None


def _read(result: StageResult, lab: Lab) -> StageModel | None:
    if result.verdict == "unreadable":
        return None
    from lab3_usd.stage.read.reader import read_stage  # noqa: PLC0415 - pxr, only for pages

    try:
        return read_stage(Path(result.path), lab)
    except (Lab3Error, OSError, ValueError):
        return None


def _content(result: StageResult, model: StageModel, lab: Lab) -> StageContent:
    checkpoint = lab.checkpoints.get(result.checkpoint or "")
    edges, hidden = published_edges(model, lab), unresolved_frames(model, lab)
    tree = TreeReport(
        result.path, edges, unknown_publishers(model, lab), lab.frames.reserved, hidden
    )
    topics = TopicReport(result.path, endpoints(model, lab), edges, hidden)
    return StageContent(
        pictures=tuple(stage_pictures(lab, checkpoint, model, result.findings)),
        tree=tuple(as_text(tree)),
        topics=tuple(tuple(cells(each, topics)) for each in topics.endpoints),
    )
