"""The manual of a rule as Markdown, for an editor to show."""

from __future__ import annotations

from functools import lru_cache

from lab3_usd.check.manual import rules_in
from lab3_usd.spec.load.loader import load_lab


@lru_cache(maxsize=64)
def manual_of(rule: str) -> str:
    """Return the manual of a rule, '' for one that does not exist."""
    known = rules_in(load_lab()).get(rule)
    if known is None:
        return ""
    return f"**{known.id} {known.name}** ({known.severity})\n\n{known.manual}"
