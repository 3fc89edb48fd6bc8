"""The maximum width of a text in common sans-serif fonts."""

from __future__ import annotations

import unicodedata
from functools import lru_cache

from lab3_usd.report.safe_text import visible

# Widths in ems, by the letters of that width, rounded up from the widest of the usual fonts.
GROUPS = {
    0.30: "ijlIJ'",
    0.35: " .,:;/|!\\`",
    0.41: "frt-()[]{}",
    0.54: 'sz_"*^',
    0.60: "ckvxyFLP?$",
    0.64: "abdeghnopquESTY0123456789",
    0.71: "ABCKRVXZ",
    0.80: "DGHNOQU&",
    0.87: "Mw+<>=#~",
    1.00: "mW@%…→",
}
WIDTHS = {char: width for width, chars in GROUPS.items() for char in chars}
BOLD = 0.12  # a bold letter is at most this much wider
WIDE = 1.1
OTHER = 0.85
ELLIPSIS = "…"


@lru_cache(maxsize=1024)  # types and ports come again in every picture
def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Return the most pixels that `text` takes up at this font size."""
    extra = BOLD if bold else 0.0
    return sum(_em(char) + extra for char in text) * size


def _em(char: str) -> float:
    if char in WIDTHS:
        return WIDTHS[char]
    if unicodedata.combining(char):
        return 0.0
    return WIDE if unicodedata.east_asian_width(char) in "WF" else OTHER


def clip_end(text: str, most: int) -> str:
    """Return the text escaped where it does not print, and cut after `most` characters."""
    flat = visible(text)
    return flat if len(flat) <= most else flat[: most - 1] + ELLIPSIS


def clip_path(text: str, most: int) -> str:
    """Return the path escaped where it does not print, with the last names of `most` characters."""
    flat = visible(text)
    if len(flat) <= most:
        return flat
    end = flat[len(flat) - most + 1 :]
    slash = end.find("/")
    return ELLIPSIS + (end if slash < 0 else end[slash:])
