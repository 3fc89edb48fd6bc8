"""Which of the repairs of a stage are made together, so that none of them does harm."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path

from msgspec import Struct

from lab3_usd.model.finding import Finding, Site, site_of
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.repair import MovePrim, Repair

WORSE = "would make the stage worse"
USELESS = "does not help"


class Attempt(Struct, frozen=True):
    """What came of some repairs: the findings afterwards, and the new bytes of each file.

    `error` says why the result cannot be used; '' where it can.
    """

    after: tuple[Finding, ...]
    repairs: tuple[Repair, ...] = ()
    files: dict[Path, bytes] = {}
    error: str = ""


class Chosen(Struct, frozen=True):
    """The repairs that were made, and why each of the others was left out."""

    attempt: Attempt
    left_out: dict[Site, str]


def weight(findings: Iterable[Finding]) -> tuple[int, int]:
    """Count errors and warnings."""
    severities = [each.severity for each in findings]
    return severities.count("error"), severities.count("warning")


def most_helpful(sites: Sequence[Site], attempt: Callable[[frozenset[Site]], Attempt]) -> Chosen:
    """Repair as many of these findings as do no harm.

    All are tried at once. Where that brings something new to find, leaves one of them as it was,
    or cannot be written, each half is tried by itself, and so on down to a single repair.
    """
    kept: frozenset[Site] = frozenset()
    best, left_out = attempt(kept), {}
    waiting = [tuple(sites)] if sites else []
    while waiting:
        some = waiting.pop(0)
        tried = attempt(kept.union(some))
        useless = any(_said(each, tried) == _said(each, best) != [] for each in some)
        is_right = _helps(tried, best) or (len(some) == 1 and _is_harmless(tried, best, some[0]))
        if is_right and not useless:
            kept, best = kept.union(some), tried
        elif len(some) == 1:
            left_out[some[0]] = tried.error or (USELESS if is_right else WORSE)
        else:
            half = len(some) // 2
            waiting[:0] = [some[:half], some[half:]]
    return Chosen(best, left_out)


def _said(site: Site, attempt: Attempt) -> list[str]:
    """Return what is said at a site of which there is a repair."""
    return [each.message for each in attempt.after if each.fix and site_of(each) == site]


def _helps(tried: Attempt, best: Attempt) -> bool:
    """Whether something is repaired, and nothing is found that was not found before."""
    known = {site_of(each) for each in best.after}
    is_new = any(site_of(each) not in known for each in tried.after if each.severity != "note")
    return not (tried.error or is_new) and weight(tried.after) < weight(best.after)


def _is_harmless(tried: Attempt, best: Attempt, site: Site) -> bool:
    """Whether no more is found than before, and no error away from what was repaired.

    An error there may have been hidden behind the repaired one; elsewhere the repair brought it.
    """
    if tried.error or weight(tried.after) > weight(best.after):
        return False
    known = {site_of(each) for each in best.after if each.severity == "error"}
    repaired = {*_repaired(each for each in best.after if site_of(each) == site)}
    return all(
        site_of(each) in known or _is_among(each, repaired)
        for each in tried.after
        if each.severity == "error"
    )


def _repaired(findings: Iterable[Finding]) -> Iterable[str]:
    """Yield the prims that findings are about, and those which their repairs edit."""
    for finding in findings:
        yield finding.prim
        for edit in finding.fix.edits if finding.fix else ():
            yield edit.to if isinstance(edit, MovePrim) else edit.prim


def _is_among(finding: Finding, prims: Collection[str]) -> bool:
    """Whether a finding, with all that it relates to, is about these prims or some below them."""
    paths = (finding.prim, *(each.partition(".")[0] for each in finding.related))
    return all(any(is_at_or_below(path, each) for each in prims) for path in paths)
