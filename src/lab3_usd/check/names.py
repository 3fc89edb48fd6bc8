"""Names as ROS 2 resolves them."""

from __future__ import annotations

import re
from functools import lru_cache

_ENDS = re.compile(r"^[^A-Za-z0-9]+|[^A-Za-z0-9]+$")


@lru_cache(maxsize=64)  # the lab has a dozen topics, and every rule about them asks
def resolved_topic(name: str, namespace: str = "") -> str:
    """Return the topic that Isaac Sim publishes for a topic name and namespace.

    Everything that is no letter or digit is trimmed off both ends, then namespace and a slash are
    put before (isaac facts: semantics, section 2). An empty name stays empty.
    """
    trimmed = _ENDS.sub("", name)
    inside = _ENDS.sub("", namespace)
    if not trimmed:
        return ""
    return f"/{inside}/{trimmed}" if inside else f"/{trimmed}"
