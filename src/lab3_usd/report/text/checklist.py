"""The checklists of the handout as text, with the state of each item."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator
from itertools import groupby

from lab3_usd.model.finding import ChecklistItem
from lab3_usd.report.options import Options
from lab3_usd.report.safe_text import visible
from lab3_usd.report.text.ansi import paint

FEW = 3  # of one section, that are listed even where they are not refuted
STATES = {
    "met": "met",
    "not met": "not met",
    "not shown": "not shown",
    "person": "for a person to judge",
}


def checklist_lines(
    items: tuple[ChecklistItem, ...], options: Options, width: int
) -> Iterator[str]:
    """Yield a line that counts the items, and each by its section.

    Those met only when verbose, and many of one section that are not refuted as a count.
    """
    if not items:
        return
    yield ""
    yield f"checklist: {_counts(items)}"
    shown = [item for item in items if item.state != "met" or options.verbosity == "verbose"]
    for section, members in groupby(shown, key=lambda item: item.section):
        yield f"  {visible(section)}"
        yield from _section_lines(list(members), options, width)


def _section_lines(items: list[ChecklistItem], options: Options, width: int) -> Iterator[str]:
    others = [item for item in items if item.state != "not met"]
    is_short = len(others) > FEW and options.verbosity != "verbose"
    for item in items:
        if not is_short or item.state == "not met":
            yield from _item_lines(item, width, color=options.color)
    if is_short:
        yield f"    {_counts(others)}; --verbose lists them"


def _counts(items: Collection[ChecklistItem]) -> str:
    counts = [(sum(item.state == state for item in items), state) for state in STATES]
    return ", ".join(f"{count} {STATES[state]}" for count, state in counts if count)


def _item_lines(item: ChecklistItem, width: int, *, color: bool) -> Iterator[str]:
    because = f": {item.because}" if item.because else ""
    indent = " " * 15
    first, *more = textwrap.wrap(
        visible(f"{item.text}{because}"),
        width,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [indent]
    state = paint(f"{item.state:<9}", item.state, color=color)
    yield f"    {state}  {first[len(indent) :]}"
    yield from more
