"""Terminal colours of severities and verdicts, as ANSI escape sequences."""

from __future__ import annotations

# Select Graphic Rendition parameters of ECMA-48; the sixteen basic colours follow the user's theme.
STYLES = {
    "plain": "",
    "heading": "1",
    "dim": "2",
    "error": "1;31",
    "warning": "33",
    "note": "36",
    "pass": "32",
    "fail": "31",
    "unreadable": "1;31",
    "met": "32",
    "not met": "31",
    "not shown": "33",
    "person": "36",
}


def paint(text: str, style: str, *, color: bool) -> str:
    """Return `text` in a style, or as it is where there are no colours."""
    codes = STYLES[style]
    if not color or not codes or not text:
        return text
    return f"\x1b[{codes}m{text}\x1b[0m"
