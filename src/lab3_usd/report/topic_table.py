"""The topics of a stage as an aligned table, as JSON and as CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from functools import cached_property

from msgspec import Struct
from msgspec.structs import asdict

from lab3_usd.facts.endpoints import PROFILE, Endpoint
from lab3_usd.facts.frame_targets import UnresolvedFrames
from lab3_usd.facts.frames import Edge
from lab3_usd.report.safe_text import folded, printable, safe_cell, truncated_values

COLUMNS = ("topic", "type", "direction", "node", "frames", "queue", "qos", "rate")
_FIRST = COLUMNS[:4]  # whoever asks for topics asks for these
WIDTH = 80
NOTHING = "-"
_MOST_FRAMES = 2
_REFUSED = "not valid: the node does not work"
_UNKNOWN = "not known: it comes over a wire"


class TopicReport(Struct, frozen=True, dict=True):
    """The topics of a stage, and the transforms that tell the frames of its TF publishers.

    `hidden` are the frames of theirs that only an asset could tell which cannot be found.
    """

    path: str
    endpoints: tuple[Endpoint, ...]
    edges: tuple[Edge, ...]
    hidden: tuple[UnresolvedFrames, ...] = ()

    def frames(self, endpoint: Endpoint) -> tuple[str, ...]:
        """Return the frames that an endpoint names, by its settings or its transforms."""
        return endpoint.frames or tuple(self._sent.get(endpoint.node.path, ()))

    @cached_property
    def _sent(self) -> dict[str, dict[str, None]]:
        """The frames of the transforms that each node sends, each once."""
        sent: dict[str, dict[str, None]] = {}
        for edge in self.edges:
            sent.setdefault(edge.publisher, {}).update({edge.parent: None, edge.child: None})
        return sent

    def unknown(self, endpoint: Endpoint) -> tuple[str, ...]:
        """Return what cannot be known of the frames of an endpoint, in words."""
        sent = (frames for frames in self.hidden if frames.publisher == endpoint.node.path)
        return tuple(message.what for message in sent)


def as_table(report: TopicReport, width: int = 80, *, verbose: bool = False) -> Iterator[str]:
    """Yield the lines of the table, columns aligned: name, type, direction and node.

    A node that does not fit stands in a line of its own. The verbose table has all columns; where
    they do not fit, what is beyond the direction stands below it.
    """
    if not report.endpoints:
        yield "no topics are published or subscribed"
        return
    rows = [
        [name.upper() for name in COLUMNS],
        *(list(cells(endpoint, report)) for endpoint in report.endpoints),
    ]
    shown = [row if verbose else row[: len(_FIRST)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    is_broken = sum(widths) + 2 * len(widths[1:]) > width
    for row in shown:
        cut = row[: len(_FIRST) - 1] if is_broken else row
        yield "  ".join(cell.ljust(wide) for cell, wide in zip(cut, widths, strict=False)).rstrip()
        if is_broken:
            yield f"    {row[len(_FIRST) - 1]}"
        if is_broken and verbose:
            yield from folded("; ".join(_details(row)), width, "    ", "      ")
    for endpoint in report.endpoints:
        if endpoint.silence:
            verb = "published" if endpoint.direction == "publishes" else "received"
            text = f"nothing is {verb} by {endpoint.node.path}: {endpoint.silence}"
            yield from folded(printable(text), width, rest="    ")


def _details(row: Sequence[str]) -> Iterator[str]:
    """Yield what the columns behind the node say, each with its name; the heading says it all."""
    for name, cell in zip(COLUMNS[len(_FIRST) :], row[len(_FIRST) :], strict=True):
        if cell == name.upper():
            yield cell
        elif cell != NOTHING:
            yield cell if name == "qos" else f"{name} {cell}"


def as_csv(report: TopicReport) -> str:
    """Return the table as RFC 4180 has it, safe to open in a spreadsheet."""
    table = io.StringIO(newline="")
    writer = csv.writer(table)
    writer.writerow(COLUMNS)
    for endpoint in report.endpoints:
        row = cells(endpoint, report)
        writer.writerow(["" if cell == NOTHING else safe_cell(cell) for cell in row])
    return table.getvalue()


def as_json(report: TopicReport) -> str:
    """Return every topic with its settings and its whole QoS profile, as one JSON object."""
    topics = [
        {
            "topic": endpoint.topic,
            "written": endpoint.written,
            "type": endpoint.type,
            "domain": endpoint.domain.number,
            "direction": endpoint.direction,
            "node": endpoint.node.path,
            "node_type": endpoint.node.type_name,
            "port": endpoint.port,
            "frames": list(report.frames(endpoint)),
            "unknown_frames": list(report.unknown(endpoint)),
            "queue": endpoint.queue,
            "qos": None if endpoint.qos is None else asdict(endpoint.qos),
            "rate": endpoint.rate if endpoint.runs else "never",
            "runs": endpoint.runs,
            "sure": endpoint.sure,
            "silence": endpoint.silence,
        }
        for endpoint in report.endpoints
    ]
    return json.dumps(truncated_values({"file": report.path, "topics": topics}), indent=2)


def cells(endpoint: Endpoint, report: TopicReport) -> Iterator[str]:
    """Yield what each of `COLUMNS` says of an endpoint."""
    is_unknown = not endpoint.written and bool(endpoint.node.sources(endpoint.port))
    unnamed = "? (a wire brings it)" if is_unknown else f"{endpoint.written!r} (no valid name)"
    if endpoint.node.is_unknown(endpoint.port):
        unnamed = endpoint.written
    yield printable(endpoint.topic or unnamed)
    yield printable(endpoint.type or NOTHING)
    yield endpoint.direction
    yield printable(endpoint.node.path)
    yield printable(_frames_text(report.frames(endpoint), report.unknown(endpoint)))
    yield NOTHING if endpoint.queue is None else str(endpoint.queue)
    if endpoint.qos is not None:
        yield str(endpoint.qos)
    else:
        yield _UNKNOWN if endpoint.node.sources(PROFILE) else _REFUSED
    yield printable(endpoint.rate if endpoint.runs else "never")


def _frames_text(frames: Sequence[str], unknown: Sequence[str]) -> str:
    parts = list(frames) if len(frames) <= _MOST_FRAMES else [f"{len(frames)} frames"]
    if unknown:
        many = len(unknown) > 1
        parts.append(f"{f'{len(unknown)} frames' if many else unknown[0]}: asset not found")
    return ", ".join(parts) or NOTHING
