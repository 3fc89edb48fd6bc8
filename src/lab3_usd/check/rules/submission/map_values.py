"""Values of a map file as map_server reads them (nav2_map_server/src/map_io.cpp, map_mode.cpp)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

REFUSED = "map_server cannot load it"
_TRUE = {"y", "yes", "true", "on"}
_FALSE = {"n", "no", "false", "off"}
_WHOLE = re.compile(r"[-+]?[0-9]{1,9}")


def number(value: object) -> float | None:
    """Read a length or a threshold; YAML 1.1 takes `5e-2`, without a point, for text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return float(value)
    except ValueError:
        return None


def _switch(value: object) -> int | None:
    """Read a whole number or a truth value."""
    if not isinstance(value, str):
        return int(value) if isinstance(value, int) else None
    text = value.strip().lower()
    if text in _TRUE | _FALSE:
        return int(text in _TRUE)
    return int(text) if _WHOLE.fullmatch(text) else None


def _mode(value: object) -> str | None:
    text = str(value).lower()
    return text if text in {"trinary", "scale", "raw"} else None


# Each gives None where map_server does not load the map.
READ: Mapping[str, Callable[[object], object]] = {
    "mode": _mode,
    "resolution": number,
    "negate": _switch,
    "occupied_thresh": number,
    "free_thresh": number,
}
