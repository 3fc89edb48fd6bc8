"""How the commands that judge dry runs and recordings are asked, and what they write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.options import Option, wants_color, width
from lab3_usd.commands.shared.paths import OutputReport
from lab3_usd.errors import EXIT_FOUND, EXIT_USAGE, UsageError

if TYPE_CHECKING:
    from lab3_usd.model.finding import Finding
    from lab3_usd.sim.outcome import DryRun
    from lab3_usd.spec.lab import Lab

EXITS = {"ok": 0, "bad": EXIT_FOUND, "not judged": EXIT_FOUND, "unreadable": EXIT_USAGE}
page_option: Option = click.option(
    "--page", type=OutputReport(path_type=Path), help="Write an HTML page to this file."
)


def write_behaviour(
    run: DryRun, lab: Lab, form: str, page: Path | None, findings: Sequence[Finding] = ()
) -> int:
    """Write what was judged, with the findings that explain it, and return the exit code.

    Raises:
        UsageError: it could not be read, and no JSON is to say so.
    """
    from lab3_usd.report.behaviour import text

    behaviour = run.behaviour
    if page is not None:
        from lab3_usd.files import write_whole
        from lab3_usd.report.behaviour.page import render

        html = render(behaviour, run.replays, lab, findings)
        write_whole(page, html.encode("utf-8", "replace"), force=True)
    if form == "json":
        click.echo(text.render_json(behaviour, findings), nl=False)
    elif behaviour.verdict == "unreadable":
        name = behaviour.recording or behaviour.stage
        raise UsageError("; ".join(f"{name}: {part.reason}" for part in behaviour.not_simulated))
    else:
        shown = text.render(behaviour, width(), findings, color=wants_color())
        click.echo(shown, nl=False, color=True)
    return 0 if behaviour.is_early else EXITS[behaviour.verdict]
