"""The unified diff of a file: long ones are matched piece by piece."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher, unified_diff
from itertools import pairwise
from typing import Any

Match = tuple[int, int]  # the numbers of a line before and after
Code = tuple[str, int, int, int, int]
_CONTEXT = 3
_LONG = 5000  # lines, up to which a file is matched as a whole


def patch(before: Sequence[str], after: Sequence[str], old: str, new: str) -> Iterator[str]:
    """Yield the lines of a patch; long files are matched between lines that stand once in both.

    A match of whole files takes time in proportion to lines times changes.
    """
    if len(before) <= _LONG:
        yield from unified_diff(before, after, old, new)
        return
    anchors = [(-1, -1), *_anchors(before, after), (len(before), len(after))]
    codes: list[Code] = []
    for (first, start), (last, stop) in pairwise(anchors):
        old_lines, new_lines = before[first + 1 : last], after[start + 1 : stop]
        if old_lines == new_lines:
            pieces = [("equal", 0, len(old_lines), 0, len(new_lines))]
        else:
            pieces = [*SequenceMatcher(None, old_lines, new_lines).get_opcodes()]
        pieces.append(
            ("equal", len(old_lines), len(old_lines) + 1, len(new_lines), len(new_lines) + 1)
        )
        for kind, *numbers in pieces:
            a, b, c, d = numbers
            if codes and codes[-1][0] == kind == "equal":
                codes[-1] = ("equal", codes[-1][1], first + 1 + b, codes[-1][3], start + 1 + d)
            else:
                codes.append((kind, first + 1 + a, first + 1 + b, start + 1 + c, start + 1 + d))
    kind, a, b, c, d = codes[-1]  # which ends with what stands behind the last lines
    codes[-1] = (kind, a, b - 1, c, d - 1)
    matcher: Any = SequenceMatcher(None, "", "")  # which groups what it has been told
    matcher.opcodes = [code for code in codes if code[2] > code[1] or code[4] > code[3]]
    yield from _written(before, after, matcher, old, new)


def _written(
    before: Sequence[str], after: Sequence[str], matcher: Any, old: str, new: str
) -> Iterator[str]:
    is_first = True
    for group in matcher.get_grouped_opcodes(_CONTEXT):
        if is_first:
            yield from (f"--- {old}\n", f"+++ {new}\n")
            is_first = False
        was, now = _range(group[0][1], group[-1][2]), _range(group[0][3], group[-1][4])
        yield f"@@ -{was} +{now} @@\n"
        for kind, first, last, start, stop in group:
            if kind == "equal":
                yield from (f" {line}" for line in before[first:last])
                continue
            yield from (f"-{line}" for line in before[first:last])
            yield from (f"+{line}" for line in after[start:stop])


def _range(start: int, stop: int) -> str:
    """Return the lines of a hunk as patches number them."""
    count = stop - start
    if count == 1:
        return str(start + 1)
    return f"{start + 1 if count else start},{count}"


def _anchors(before: Sequence[str], after: Sequence[str]) -> list[Match]:
    """Return the lines that stand once in both, as many as have the same order in both."""
    counts = Counter(before), Counter(after)
    places = {line: place for place, line in enumerate(after) if counts[1][line] == 1}
    ends: list[int] = []  # of the longest runs: the least line after, by their length
    last: list[tuple[Match, int]] = []  # each match, and the one before it in its run
    tops: list[int] = []
    for place, line in enumerate(before):
        if counts[0][line] == 1 and line in places:
            length = bisect_left(ends, places[line])
            ends[length : length + 1] = [places[line]]
            tops[length : length + 1] = [len(last)]
            last.append(((place, places[line]), tops[length - 1] if length else -1))
    run: list[Match] = []
    at = tops[-1] if tops else -1
    while at >= 0:
        match, at = last[at]
        run.append(match)
    return run[::-1]
