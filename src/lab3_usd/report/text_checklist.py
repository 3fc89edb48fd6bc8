"""The handout's checklists as text: what is met, what is not, what a person has to judge."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from lab3_usd.check.finding import ChecklistItem
from lab3_usd.report.escape import visible
from lab3_usd.report.formats import Options
from lab3_usd.report.paint import paint

STATES = {
    "met": "met",
    "not met": "not met",
    "not shown": "not shown",
    "person": "for a person to judge",
}


def checklist_lines(
    items: tuple[ChecklistItem, ...], options: Options, width: int
) -> Iterator[str]:
    """Yield a line that counts the items and one for each; those met only when verbose."""
    if not items:
        return
    counts = [(sum(item.state == state for item in items), state) for state in STATES]
    yield ""
    yield "checklist: " + ", ".join(f"{count} {STATES[state]}" for count, state in counts if count)
    for item in items:
        if item.state != "met" or options.verbosity == "verbose":
            yield from _item_lines(item, width, color=options.color)


def _item_lines(item: ChecklistItem, width: int, *, color: bool) -> Iterator[str]:
    because = f": {item.because}" if item.because else ""
    indent = " " * 13
    first, *more = textwrap.wrap(
        visible(f"{item.section} {item.text}{because}"),
        width,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [indent]
    state = paint(f"{item.state:<9}", item.state, color=color)
    yield f"  {state}  {first[len(indent) :]}"
    yield from more
