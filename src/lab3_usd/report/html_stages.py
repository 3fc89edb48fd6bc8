"""The stages of a report read again, for what a finding does not hold: graphs, frames, topics."""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct

from lab3_usd.check.finding import StageResult
from lab3_usd.check.frames import hidden_frames, published_edges, unknown_publishers
from lab3_usd.check.model import StageModel
from lab3_usd.check.topics import endpoints
from lab3_usd.errors import Lab3Error, StageError
from lab3_usd.report.picture_model import Picture
from lab3_usd.report.stage_pictures import stage_pictures
from lab3_usd.report.topic_table import TopicReport, cells
from lab3_usd.report.tree import TreeReport, as_text
from lab3_usd.spec.spec import Lab


class Seen(Struct, frozen=True):
    """What one stage holds: its pictures, its TF tree as text, its topics as cells of a table."""

    pictures: tuple[Picture, ...] = ()
    tree: tuple[str, ...] = ()
    topics: tuple[tuple[str, ...], ...] = ()


def look(result: StageResult, lab: Lab) -> Seen | None:
    """Return what the stage of a result holds, None where it cannot be read."""
    model = _read(result, lab)
    try:
        return None if model is None else _seen(result, model, lab)
    except StageError:  # it is damaged where no rule has looked
        return None


def _read(result: StageResult, lab: Lab) -> StageModel | None:
    if result.verdict == "unreadable":
        return None
    from lab3_usd.stage.reader import read_stage  # noqa: PLC0415 - pxr, only for pages

    try:
        return read_stage(Path(result.path), lab)
    except (Lab3Error, OSError, ValueError):
        return None


def _seen(result: StageResult, model: StageModel, lab: Lab) -> Seen:
    checkpoint = lab.checkpoints.get(result.checkpoint)
    edges, hidden = published_edges(model, lab), hidden_frames(model, lab)
    reserved = {lab.frames.localization_edge[1]: lab.frames.localization_by}
    tree = TreeReport(result.path, edges, unknown_publishers(model, lab), reserved, hidden)
    topics = TopicReport(result.path, endpoints(model, lab), edges, hidden)
    return Seen(
        pictures=tuple(stage_pictures(lab, checkpoint, model, result.findings)),
        tree=tuple(as_text(tree)),
        topics=tuple(tuple(cells(each, topics)) for each in topics.endpoints),
    )
