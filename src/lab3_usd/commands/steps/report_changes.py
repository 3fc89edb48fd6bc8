"""What a save changed: which findings are new, which are repaired, which say something else."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.model.finding import Finding, Report
from lab3_usd.report.entries import Entry, entries, site
from lab3_usd.report.safe_text import printable

_Place = tuple[str, str, str, str | None]


class ReportChanges(Struct, frozen=True):
    """The findings that a save changed."""

    new: tuple[Finding, ...]
    changed: tuple[Finding, ...]
    repaired: tuple[Finding, ...]


def changes_between(before: Report, after: Report) -> ReportChanges:
    """Compare two reports; what moved to another line is no news.

    A finding of one rule at one place that says something else now is changed.
    """
    old, new = list(entries(before)), list(entries(after))
    known = Counter(map(_said, old))
    known.subtract(map(_said, new))
    added = list(_surplus(new, -known))
    repaired = list(_surplus(old, +known))
    changed = []
    for each in list(added):
        twin = next((other for other in repaired if _place(other) == _place(each)), None)
        if twin is not None:
            added.remove(each)
            repaired.remove(twin)
            changed.append(each)
    return ReportChanges(
        tuple(each.finding for each in added),
        tuple(each.finding for each in changed),
        tuple(each.finding for each in repaired),
    )


def _place(entry: Entry) -> _Place:
    finding = entry.finding
    return entry.path, finding.rule, finding.prim, finding.property


def _said(entry: Entry) -> tuple[_Place, str]:
    return _place(entry), entry.finding.message


def _surplus(told: list[Entry], more: Counter[tuple[_Place, str]]) -> Iterator[Entry]:
    """Yield as many entries as one report has more than the other."""
    left = Counter(more)
    for each in told:
        if left[_said(each)] > 0:
            left[_said(each)] -= 1
            yield each


def change_lines(saved: str, news: ReportChanges, after: Report) -> Iterator[str]:
    """Yield when which file was saved and what that changed in figures; then finding by finding."""
    left = Counter(each.finding.severity for each in entries(after))
    figures = [f"{count} {name}{'s' * (count != 1)}" for name, count in left.items()]
    changed = f", {len(news.changed)} changed" if news.changed else ""
    told = f"{len(news.repaired)} repaired, {len(news.new)} new{changed}"
    yield printable(f"{clock()}  {saved}: {told}; {', '.join(figures) or 'nothing'} left")
    for word, findings in (("new", news.new), ("changed", news.changed)):
        for each in findings:
            yield printable(f"  {word:<9} {each.severity} {each.rule} {site(each)}: {each.message}")
    for each in news.repaired:
        yield printable(f"  repaired  {each.severity} {each.rule} {site(each)}: {each.message}")


def clock() -> str:
    """Return the time of day."""
    return time.strftime("%H:%M:%S")
