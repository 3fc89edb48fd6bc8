"""Where findings are to be repaired: the layer, line and column of each."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from lab3_usd.check.finding import Finding


def located(findings: Collection[Finding], path: Path | str, stage: Any) -> Iterator[Finding]:  # noqa: ANN401 - pxr has no types
    """Yield findings of an open stage with their layer, line and column."""
    if not findings:
        return
    from lab3_usd.stage.lines import locate  # noqa: PLC0415 - only when there is something to place

    places = locate(stage, str(path), [(each.prim, each.property) for each in findings])
    for each in findings:
        place = places[each.prim, each.property]
        yield replace(each, layer=place.layer or None, line=place.line, column=place.column)
