"""Strings from a stage made harmless: no control character of theirs reaches a terminal."""

from __future__ import annotations


def visible(text: str) -> str:
    r"""Return `text` with everything that does not print written as an escape (`\x1b`, `\u202e`).

    Covers the control characters that terminals obey, line ends, marks that turn the direction
    of writing, lone surrogates and every character that XML 1.0 forbids. The result is one line.
    """
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")
