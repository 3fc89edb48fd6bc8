"""The different faults of a block of stages, each with all the stages that have it."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.finding import SEVERITIES, Finding, SectionKey, section_key
from lab3_usd.report.blocks import Block, Stages, short_path

_NOT_OPENED = ("F03", "Z01", "Z02")
_NOT_FOUND = "F02"  # is about one prim, for which other files may do as well


class Fault(Struct, frozen=True):
    """A finding, and all the stages that have it.

    A fault that is carried along from file to file is one fault: `finding` is that of the first.
    `places` are the files with line and column, as editors take them. `is_cause` says that other
    faults follow from it: something that the stage refers to was not opened.
    """

    id: str
    finding: Finding
    stages: Stages
    places: tuple[str, ...]
    is_cause: bool = False


def faults(block: Block, *, graded: bool = False) -> list[Fault]:
    """Return the different faults of a block: by severity, then as the handout has its sections.

    Where they cost points, what was not opened comes before what is missing for it.
    """
    found: dict[Finding, list[tuple[int, Finding]]] = {}
    for index, finding in _findings(block):
        # Where it stands differs from file to file, and so does what else it concerns.
        key = replace(finding, layer=None, line=None, column=None, related=())
        found.setdefault(key, []).append((index, finding))
    causes = set(_causes(found)) if graded else set()
    order = sorted(found, key=lambda finding: (finding not in causes, *_order(finding)))
    return [
        _fault(f"{block.id}-f{n}", found[key], block, is_cause=key in causes)
        for n, key in enumerate(order, 1)
    ]


def _causes(found: Iterable[Finding]) -> Iterator[Finding]:
    """Yield what was not opened, as far as something is wrong where it belongs."""
    wrong = sorted(f"{each.prim}/" for each in found if each.severity == "error")
    for each in found:
        below = f"{each.prim}/"
        at = bisect_left(wrong, below)
        is_wrong = at < len(wrong) and wrong[at].startswith(below)
        if each.rule in _NOT_OPENED or (each.rule == _NOT_FOUND and is_wrong):
            yield each


def _fault(
    name: str, seen: Sequence[tuple[int, Finding]], block: Block, *, is_cause: bool
) -> Fault:
    stages = tuple(dict.fromkeys(index for index, _ in seen if index >= 0))
    places = dict.fromkeys(_place(finding, block) for _, finding in seen)
    first = seen[0][1]
    related = max((finding.related for _, finding in seen), key=len)
    shown = tuple(place for place in places if place not in {"", first.prim})
    return Fault(name, replace(first, related=related), stages, shown, is_cause)


def _findings(block: Block) -> Iterator[tuple[int, Finding]]:
    """Yield every finding with the number of its stage, -1 for those of the submission."""
    for stage in block.stages:
        yield from ((stage.index, finding) for finding in stage.result.findings)
    if block.submission is not None:
        yield from ((-1, finding) for finding in block.submission.findings)


def _place(finding: Finding, block: Block) -> str:
    if not finding.layer:
        return ""
    numbers = [finding.line, finding.column if finding.line else None]
    place = short_path(finding.layer, block.path)
    return ":".join([place, *(str(number) for number in numbers if number is not None)])


def _order(finding: Finding) -> tuple[int, SectionKey]:
    return SEVERITIES.index(finding.severity), section_key(finding.handout)
