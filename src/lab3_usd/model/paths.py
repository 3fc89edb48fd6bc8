"""Paths of prims as text."""

from __future__ import annotations


def is_at_or_below(path: str, top: str) -> bool:
    """Whether `path` is the prim `top` or one below it; everything is below '/'."""
    if not path.startswith(top):
        return False
    rest = path[len(top) :]
    return not rest or rest[0] == "/" or top.endswith("/")
