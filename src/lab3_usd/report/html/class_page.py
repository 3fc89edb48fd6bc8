"""The page of a class: the distribution of grades, the hardest items, a row per student."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from typing import Any, Protocol

from markupsafe import Markup
from msgspec import Struct

from lab3_usd.report.html.templates import content_policy, environment, text_of
from lab3_usd.report.options import NAME, tool_version

STUDENTS, SHARED, REPORT = "students", "reports", "report.html"
BIN = 10  # per cent
_HARDEST = 20
_NAMED = 20  # students of a group that handed in the same
_MOST = 500  # rows that are shown at first
_PIECES = 500  # pieces of text that make a part of the page
Row = Mapping[str, Any]
Losses = Counter[tuple[str, str]]


class Bar(Struct, frozen=True):
    """One bar of the distribution: from which per cent, how many, and how high (0 to 1)."""

    start: int
    count: int
    height: float


class Hard(Struct, frozen=True):
    """A lost requirement, its graph, part of the scene or checkpoint, and how many lost it."""

    title: str
    group: str
    count: int


class ItemSummary(Struct, frozen=True):
    """How one item of the rubric went: the mean share of its points, and the counts by state."""

    title: str
    points: float
    mean: float | None
    states: Mapping[str, int]


class Rows(Sized, Iterable[Row], Protocol):
    """The rows of a gradebook: sized, and iterable more than once."""


def class_page(
    title: str, items: Sequence[Row], rows: Rows, alike: Sequence[Row] = ()
) -> Iterator[str]:
    """Yield the parts of the page for the rows of a gradebook, whose order is kept.

    It needs no network, and no script for reading: the script only sorts and filters.
    """
    lost = losses(rows)
    percents = [row["percent"] for row in rows if row["percent"] is not None]
    style, script = (text_of(name) for name in ("class.css", "class.js"))
    page = environment().get_template("class.html.j2").stream(
        title=title,
        rows=rows,
        items=items,
        bars=list(distribution(percents)),
        hardest=hardest(lost),
        missing=missing(lost),
        alike=alike,
        named=_NAMED,
        most=_MOST,
        summaries=summaries(items, rows),
        statuses=sorted(Counter(row["status"] for row in rows).items()),
        median=statistics.median(percents) if percents else None,
        mean=statistics.fmean(percents) if percents else None,
        report=_report_of,
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704
        policy=content_policy(style, script),
        tool=f"{NAME} {tool_version()}",
    )  # fmt: skip
    page.enable_buffering(_PIECES)
    yield from page


def _report_of(row: Row) -> str:
    """Return where the report of a student is: in a large class several may have the same."""
    folder = f"{SHARED}/{row['shared']}" if row.get("shared") else f"{STUDENTS}/{row['folder']}"
    return f"{folder}/{REPORT}"


def distribution(percents: Sequence[float]) -> Iterator[Bar]:
    """Yield the bars of the histogram; 100 per cent and more count in the last."""
    last = 100 - BIN
    counts = Counter(min(int(percent // BIN) * BIN, last) for percent in percents)
    highest = max(counts.values(), default=1)
    for start in range(0, 100, BIN):
        yield Bar(start, counts[start], counts[start] / highest)


def losses(rows: Iterable[Row]) -> Losses:
    """Count how many students lost each requirement, by its id and title.

    At which item a student lost one does not matter here.
    """
    counts: Losses = Counter()
    for row in rows:
        counts.update(
            {(lost["requirement"], lost["title"]) for lost in row["lost"] if lost["requirement"]}
        )
    return counts


def hardest(lost: Losses) -> list[Hard]:
    """Return the requirements that most students lost, the most frequent first."""
    requirements = [(name, count) for name, count in lost.items() if "/" in name[0]]
    ordered = sorted(requirements, key=lambda pair: (-pair[1], pair[0]))
    return [
        Hard(title, name.partition("/")[0], count) for (name, title), count in ordered[:_HARDEST]
    ]


def missing(lost: Losses) -> list[Hard]:
    """Return the checkpoints that students lost as a whole, and how (see `scoring.Lost`)."""
    files = sorted((name, count) for name, count in lost.items() if "/" not in name[0])
    return [Hard(title, name, count) for (name, title), count in files]


def summaries(items: Sequence[Row], rows: Iterable[Row]) -> list[ItemSummary]:
    """Return how each item of the rubric went."""
    shares: dict[str, list[float]] = {item["id"]: [] for item in items}
    states: dict[str, Counter[str]] = {item["id"]: Counter() for item in items}
    for row in rows:
        for item in row["items"]:
            states[item["id"]][item["state"]] += 1
            if item["possible"]:
                shares[item["id"]].append(item["earned"] / item["possible"])
    return [
        ItemSummary(
            item["title"],
            item["points"],
            statistics.fmean(shares[item["id"]]) if shares[item["id"]] else None,
            dict(sorted(states[item["id"]].items())),
        )
        for item in items
    ]
