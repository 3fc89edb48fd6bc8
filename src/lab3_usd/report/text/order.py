"""What to repair first in a folder of stages, and in which of its stages a fault is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from lab3_usd.report.blocks import Block, Stage, Stages
from lab3_usd.report.entries import site
from lab3_usd.report.faults import Fault, faults
from lab3_usd.report.text.ansi import paint
from lab3_usd.report.text.findings import INDENT, Page, finding_blocks, wrapped

MOST = 3
_NUMBERED = "   "


def fault_lines(block: Block, page: Page) -> Iterator[str]:
    """Yield what to repair first, and each fault once with the stages that have it."""
    found = faults(block)
    yield from _repair_order(found, block, page)
    blamed = ((fault.finding, _where_found(fault.stages, block)) for fault in found)
    yield from finding_blocks(blamed, page)


def _repair_order(found: Sequence[Fault], block: Block, page: Page) -> Iterator[str]:
    """Yield the few errors whose repair wins most checkpoints, and then most points.

    Where there are hardly more errors than that, nothing is said.
    """
    errors = [each for each in found if each.finding.severity == "error" and each.stages]
    if len(errors) <= MOST:
        return
    points = page.options.points
    first = sorted(errors, key=lambda each: _gain(each, block, points), reverse=True)[:MOST]
    yield ""
    yield paint("Repair these first", "heading", color=page.color)
    for number, each in enumerate(first, 1):
        told = f"{each.finding.rule} {site(each.finding)}"
        stands = f"in {_plural_checkpoints(each.stages, block)}: {each.finding.message}"
        start = f"{number}. "
        yield from wrapped(start + told, INDENT, page.width, INDENT + _NUMBERED)
        yield from wrapped(stands, INDENT + _NUMBERED, page.width)


def _gain(fault: Fault, block: Block, points: Mapping[str, float]) -> tuple[int, float]:
    held = [stage.result.checkpoint for stage in block.stages if stage.index in fault.stages]
    return len(held), sum(points.get(checkpoint or "", 0.0) for checkpoint in held)


def _plural_checkpoints(stages: Stages, block: Block) -> str:
    """Name the checkpoints of some stages: `checkpoint 03`, `checkpoints 03 to 08`."""
    names = _spans([stage for stage in block.stages if stage.index in stages], block)
    return f"checkpoint{'s' if len(stages) > 1 else ''} {names}"


def _where_found(stages: Stages, block: Block) -> str:
    """Say which stages of a folder have a fault, and which no longer has it.

    `since 01, also in 02 to 08`; `in 03`; `since 02, also in 03 to 07, repaired in 08`. Empty for
    what is no stage's.
    """
    having = [stage for stage in block.stages if stage.index in stages]
    if not having:
        return ""
    first, *others = having
    told = f"since {first.label}, also in {_spans(others, block)}" if others else ""
    later = block.stages[block.stages.index(having[-1]) + 1 :]
    repaired = next((each for each in later if each.result.verdict != "unreadable"), None)
    last = f", repaired in {repaired.label}" if repaired is not None else ""
    return (told or f"in {first.label}") + last


def _spans(stages: Sequence[Stage], block: Block) -> str:
    """Name stages in short: `03`, `03, 04`, `02 to 05, 08`."""
    order = {stage.index: place for place, stage in enumerate(block.stages)}
    runs = groupby(enumerate(stages), key=lambda pair: order[pair[1].index] - pair[0])
    return ", ".join(_span([stage for _, stage in run]) for _, run in runs)


def _span(run: Sequence[Stage]) -> str:
    few = 2
    if len(run) <= few:
        return ", ".join(stage.label for stage in run)
    return f"{run[0].label} to {run[-1].label}"
