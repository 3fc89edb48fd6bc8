"""The page of a class: who needs the grader, a row per student, then how the class did."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from itertools import groupby
from typing import Any, Protocol

from msgspec import Struct

from lab3_usd.model.grade import ADJUSTED, REMARK
from lab3_usd.report.html.templates import jinja_environment, page_values

STUDENTS, SHARED, REPORT = "students", "reports", "report.html"
BIN = 10  # per cent
_HARDEST = 20
_NAMED = 20  # students of a group that handed in the same
MOST = 500  # rows that are shown at first
_AMBIGUOUS, _LATE, _TO_JUDGE = "ambiguous", "late", "to be judged by you"
_DRY_RUN = "dry run/"  # what the ids of requirements begin with that a dry run shows to be unmet
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


class Needing(Struct, frozen=True):
    """What a grader has to look at, of how many students, and the rows of the first of them."""

    what: str
    count: int
    first: tuple[Row, ...]


class ItemSummary(Struct, frozen=True):
    """How one item of the rubric went: the mean share of its points, and the counts by state.

    `path` outlines the points of all students, '' where nobody could earn any.
    """

    title: str
    points: float
    mean: float | None
    states: Mapping[str, int]
    path: str


class Rows(Sized, Iterable[Row], Protocol):
    """The rows of a gradebook: sized, and iterable more than once."""


def class_page(
    title: str, items: Sequence[Row], rows: Rows, alike: Sequence[Row] = (), most: int = MOST
) -> Iterator[str]:
    """Yield the parts of the page for the rows of a gradebook, whose order is kept.

    The first `most` rows are shown at first.

    It needs no network, and no script for reading: the script only sorts and filters.
    """
    lost = losses(rows)
    students = [(row["percent"], row["name"] not in {"", row["student"]}) for row in rows]
    percents = [percent for percent, _ in students if percent is not None]
    page = jinja_environment().get_template("class.html.j2").stream(
        title=title,
        rows=rows,
        items=items,
        bars=list(distribution(percents)),
        hardest=hardest(lost),
        missing=missing(lost),
        needing=list(needing(rows)),
        alike=list(_with_names(alike, rows)),
        named=_NAMED,
        top_reason=top_reason,
        by_hand=by_hand,
        has_names=any(is_named for _, is_named in students),
        most=most,
        summaries=summaries(items, rows),
        statuses=sorted(Counter(row["status"] for row in rows).items()),
        median=statistics.median(percents) if percents else None,
        mean=statistics.fmean(percents) if percents else None,
        report=_report_of,
        **page_values("class.css", "class.js"),
    )  # fmt: skip
    page.enable_buffering(_PIECES)
    yield from page


def _report_of(row: Row) -> str:
    """Return where the report of a student is: in a large class several may have the same."""
    folder = f"{SHARED}/{row['shared']}" if row.get("shared") else f"{STUDENTS}/{row['folder']}"
    return f"{folder}/{REPORT}"


def needing(rows: Rows) -> Iterator[Needing]:
    """Yield the rows that a grader has to look at.

    These are by status, with more than one way to read names or folders, with stages that were not
    judged, late by unknown days, or with an open item.
    """
    counts: Counter[str] = Counter()
    first: dict[str, list[Row]] = {}
    for row in rows:
        reasons = {
            row["status"]: row["status"] != "graded",
            **dict.fromkeys(row.get("attention", ()), True),
            **({_AMBIGUOUS: True} if row.get("may_be") else {}),
            _LATE: row["late"] and row.get("days_late") is None,
            _TO_JUDGE: any(item["state"] == "open" for item in row["items"]),
        }
        for what in (what for what, is_so in reasons.items() if is_so):
            counts[what] += 1
            first.setdefault(what, [])
            first[what] += [row] if counts[what] <= _NAMED else []
    for what in sorted(counts, key=lambda what: (what in {_LATE, _TO_JUDGE}, what)):
        yield Needing(what, counts[what], tuple(first[what]))


def top_reason(row: Row) -> str:
    """Return why a student lost most points at once, in words of the fault; '' for nothing."""
    texts = (ADJUSTED, REMARK)
    costly = [
        line for line in row["lost"] if line.get("points") and not line["title"].startswith(texts)
    ]
    if not costly:
        return ""
    line = max(costly, key=lambda line: float(line["points"]))
    reason, part = line.get("found") or "", line["title"].partition(": ")
    if not reason:
        return str(line["title"])
    return f"{part[0]}: {reason}" if part[1] and part[0] not in reason else str(reason)


def by_hand(row: Row) -> Iterator[str]:
    """Yield what a grader wrote about the items of a student."""
    for line in row["lost"]:
        if line["title"].startswith((ADJUSTED, REMARK)):
            yield f"{line['item']}: {line['title']}"


def _with_names(alike: Sequence[Row], rows: Rows) -> Iterator[Row]:
    """Yield groups of students with the names beside the numbers."""
    names = {row["student"]: row["name"] for row in rows} if alike else {}
    for group in alike:
        named = [
            f"{names[student]} ({student})"
            if names.get(student) not in {None, "", student}
            else student
            for student in group["students"][:_NAMED]
        ]
        yield {**group, "named": named}


def distribution(percents: Sequence[float]) -> Iterator[Bar]:
    """Yield the bars of the histogram; 100 per cent and more count in the last."""
    last = 100 - BIN
    counts = Counter(min(int(percent // BIN) * BIN, last) for percent in percents)
    highest = max(counts.values(), default=1)
    for start in range(0, 100, BIN):
        yield Bar(start, counts[start], counts[start] / highest)


def losses(rows: Iterable[Row]) -> Losses:
    """Count how many students lost each requirement, by its id and title.

    At which item a student lost one does not matter here, nor what a dry run measured.
    """
    counts: Losses = Counter()
    for row in rows:
        lost = ((line["requirement"], line["title"]) for line in row["lost"])
        counts.update({(name, _title(name, title)) for name, title in lost if name})
    return counts


def _title(requirement: str, title: str) -> str:
    if not requirement.startswith(_DRY_RUN):
        return title
    name = requirement.removeprefix(_DRY_RUN)
    return f"{name} is received as the lab asks" if "/" in name else f"the check '{name}'"


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
            _points_path(shares[item["id"]]),
        )
        for item in items
    ]


def _points_path(shares: Sequence[float]) -> str:
    """Return the outline of the points of a class, from most to none, in a box of 100 by 20."""
    steps, end = "", 0
    for share, group in groupby(sorted((round(share, 2) for share in shares), reverse=True)):
        end += len([*group])
        steps += f"V{20 - 20 * share:.4g}H{100 * end / len(shares):.4g}"
    return f"M0 20{steps}V20Z" if steps else ""
