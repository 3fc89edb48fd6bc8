"""Escaping: what does not print is shown, the rest stays."""

from __future__ import annotations

import pytest

from lab3_usd.report.safe_text import visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/World/ROS_Clock", "/World/ROS_Clock"),
        ("Zürich 日本", "Zürich 日本"),
        ("\x1b[31m", r"\x1b[31m"),
        ("\x9b", r"\x9b"),
        ("a\nb\tc\r", r"a\nb\tc\r"),
        ("\u202e", r"\u202e"),
        ("\u2028", r"\u2028"),
        ("\udcff", r"\udcff"),
        ("\U000e0001", r"\U000e0001"),
        ("\x00", r"\x00"),
    ],
)
def test_what_does_not_print_is_written_out(text: str, shown: str) -> None:
    assert visible(text) == shown
