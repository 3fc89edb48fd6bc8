"""The part of a report that shows a dry run: two maps, the drive, and the checks that failed."""

from __future__ import annotations

from markupsafe import Markup
from msgspec import Struct

from lab3_usd.model.dry_run.behaviour import Behaviour, Check, Replay
from lab3_usd.report.behaviour.maps import near_svg, room_svg
from lab3_usd.report.behaviour.words import leg_text, sum_text


class DryRunSummary(Struct, frozen=True):
    """What a report shows of the dry run of one stage; the maps are markup of our own."""

    summary: str
    legs: tuple[str, ...]
    wrong: tuple[Check, ...]
    room: Markup
    near: Markup


def dry_run_summary(found: Behaviour, seen: Replay | None) -> DryRunSummary | None:
    """Return what a report shows, None where nothing was played."""
    if seen is None or not seen.moments:
        return None
    return DryRunSummary(
        sum_text(found),
        tuple(map(leg_text, found.legs)),
        tuple(each for each in found.checks if each.verdict != "ok"),
        Markup(room_svg(seen, still=True)),  # noqa: S704 - no name of the stage is in it
        Markup(near_svg(seen, still=True)),  # noqa: S704
    )
