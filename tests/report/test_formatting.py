"""Values in messages are short, in one line, and as a person reads them."""

from __future__ import annotations

import pytest

from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import display, format_paths, node_title, short_source
from lab3_usd.model.stage import Node


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "not set"),
        (True, "True"),
        (0.22, "0.22"),
        (1.0, "1"),
        (7, "7"),
        ("scan", "'scan'"),
        ("", "''"),
        ((1.0, "a"), "[1, 'a']"),
        ((), "[]"),
        ("two\nlines", "'two\\nlines'"),
        ("\x1b[31m", "'\\x1b[31m'"),
    ],
)
def test_a_value_is_shown_in_one_line(value: Value | None, text: str) -> None:
    assert display(value) == text


def test_what_is_long_is_cut() -> None:
    assert display(tuple(range(4096))).endswith("11 and 4084 more]")
    assert len(display("x" * 5000)) < 250
    assert format_paths(tuple(f"/p{number}" for number in range(20))).endswith("/p11 and 8 more")


def test_what_just_fits_is_whole() -> None:
    assert display(tuple(range(12))) == "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"


def test_sources_are_told_without_the_graph() -> None:
    assert short_source("/World/ROS_Clock/tick.outputs:tick") == "tick.outputs:tick"
    assert short_source(None) == "nothing"


def test_a_node_without_a_type_is_called_so() -> None:
    assert node_title(Node("/a/b", "", None, None, {})) == "a node without a type"


def test_no_prims_are_said_as_such() -> None:
    assert format_paths(()) == "no prim"
