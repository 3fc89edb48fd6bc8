"""The page of a whole class: how the grades lie, what was hardest, and a line for each student."""

from __future__ import annotations

import statistics
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from msgspec import Struct

from lab3_usd.report.escape import visible
from lab3_usd.report.tool import NAME, tool_version

FOLDER = Path(__file__).resolve().parent / "templates"
STUDENTS, REPORT = "students", "report.html"
BIN = 10  # per cent
_HARDEST = 20
Row = Mapping[str, Any]


class Bar(Struct, frozen=True):
    """One bar of the distribution: from which per cent, how many, and how high (0 to 1)."""

    start: int
    count: int
    height: float


class Hard(Struct, frozen=True):
    """A requirement, the graph or part of the scene it belongs to, and how many lost it."""

    title: str
    group: str
    count: int


class ItemSummary(Struct, frozen=True):
    """How one item of the rubric went: the mean share of its points, and the counts by state."""

    title: str
    points: float
    mean: float | None
    states: Mapping[str, int]


def render_class(title: str, items: Sequence[Row], rows: Sequence[Row]) -> str:
    """Return the page for the rows of a gradebook; the order of the rows is kept.

    It needs no network, and no script for reading: the script only sorts and filters.
    """
    percents = [row["percent"] for row in rows if row["percent"] is not None]
    style, script = (_text(name) for name in ("class.css", "class.js"))
    return _environment().get_template("class.html.j2").render(
        title=title,
        rows=rows,
        items=items,
        bars=list(distribution(percents)),
        hardest=hardest(rows),
        summaries=[_summary(item, rows) for item in items],
        statuses=sorted(Counter(row["status"] for row in rows).items()),
        median=statistics.median(percents) if percents else None,
        mean=statistics.fmean(percents) if percents else None,
        report=lambda row: f"{STUDENTS}/{row['folder']}/{REPORT}",
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704
        policy=_policy(style, script),
        tool=f"{NAME} {tool_version()}",
    )  # fmt: skip


def distribution(percents: Sequence[float]) -> Iterator[Bar]:
    """Yield the bars of the histogram; 100 per cent and more count in the last."""
    last = 100 - BIN
    counts = Counter(min(int(percent // BIN) * BIN, last) for percent in percents)
    highest = max(counts.values(), default=1)
    for start in range(0, 100, BIN):
        yield Bar(start, counts[start], counts[start] / highest)


def hardest(rows: Sequence[Row]) -> list[Hard]:
    """Return the requirements that most students lost, the most frequent first.

    At which item a student lost one does not matter here.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        counts.update((lost["requirement"], lost["title"]) for lost in row["lost"])
    ordered = sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
    return [
        Hard(title, name.partition("/")[0] if "/" in name else "", count)
        for (name, title), count in ordered[:_HARDEST]
    ]


def _summary(item: Row, rows: Sequence[Row]) -> ItemSummary:
    found = [each for row in rows for each in row["items"] if each["id"] == item["id"]]
    shares = [each["earned"] / each["possible"] for each in found if each["possible"]]
    mean = statistics.fmean(shares) if shares else None
    states = Counter(each["state"] for each in found)
    return ItemSummary(item["title"], item["points"], mean, dict(sorted(states.items())))


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    """Return the templates; every value is escaped, for HTML and where it does not print."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER, encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_finalized,
    )


def _finalized(value: object) -> object:
    is_plain = isinstance(value, str) and not isinstance(value, Markup)
    return visible(str(value)) if is_plain else value


def _policy(style: str, script: str) -> str:
    """Return the content security policy: nothing from anywhere but our own style and script."""
    parts = ["default-src 'none'", "img-src data:", "base-uri 'none'", "form-action 'none'"]
    for kind, text in (("style", style), ("script", script)):
        digest = b64encode(sha256(text.encode()).digest()).decode()
        parts.append(f"{kind}-src 'sha256-{digest}'")
    return "; ".join(parts)
