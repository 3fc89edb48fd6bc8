"""The order in which findings are told: the worst first, then as the handout has its sections."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lab3_usd.model.finding import SEVERITIES, Finding

_SECTION = re.compile(r"(?:([A-Z])(?=\d|$))?(\d+)?(?:\.(\d+))?")
_NUMBER, _DIGITS = re.compile(r"\d+"), 6
SectionKey = tuple[int, str, int, int, str]


def section_key(name: str | None) -> SectionKey:
    """Return what sorts sections as the handout has them: 4.4, Parts A to J, 6.1, 8.11, none.

    Sections of another form, as `Ex 9` and `Ex 10`, are sorted by their words and numbers.
    """
    found = _SECTION.match(name or "")
    letter, number, below = found.groups() if found else (None, None, None)
    before_the_parts = 5
    if letter:
        place = 1
    elif number:
        place = 0 if int(number) <= before_the_parts else 2
    else:
        place = 3 if name else 4
    words = _NUMBER.sub(lambda each: each[0].zfill(_DIGITS), name or "")
    return place, letter or "", int(number or 0), int(below or 0), words


def ordered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort findings by severity, section of the handout, place and rule.

    No run and no hash seed changes the order.
    """
    return tuple(sorted(findings, key=_key))


def _key(finding: Finding) -> tuple[int, SectionKey, str, str, str, str]:
    return (
        SEVERITIES.index(finding.severity),
        section_key(finding.handout),
        finding.prim,
        finding.property or "",
        finding.rule,
        finding.message,
    )
