"""Code frames: the right lines, the caret under the fault, no line too wide."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace
from report_examples import LAYER, MISSING_WIRE, STAGE_TEXT, write_stage

from lab3_usd.report.safe_text import Excerpt, excerpt_lines, read_excerpts


@pytest.fixture(autouse=True)
def _beside_the_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_stage(tmp_path)
    monkeypatch.chdir(tmp_path)


def marked(excerpt: Excerpt, line: int, column: int, width: int = 80) -> str:
    """Return the character of the marked line that stands over the caret."""
    result = excerpt_lines(excerpt, line, column, width)
    at = next(index for index, shown in enumerate(result) if shown.startswith(">"))
    assert result[at + 1].endswith("^")
    return result[at][len(result[at + 1]) - 1]


def test_an_excerpt_is_the_line_and_its_neighbours() -> None:
    found = read_excerpts([MISSING_WIRE])
    assert found == {(LAYER, 9): dict(enumerate(STAGE_TEXT.splitlines()[7:10], 8))}


@pytest.mark.parametrize(("line", "first", "count"), [(1, 1, 2), (13, 12, 2)])
def test_an_excerpt_ends_with_the_file(line: int, first: int, count: int) -> None:
    excerpt = read_excerpts([replace(MISSING_WIRE, line=line)])[LAYER, line]
    assert (min(excerpt), len(excerpt)) == (first, count)


@pytest.mark.parametrize("layer", ["gone.usda", "work", "a\0b", "x" * 5000, "", None])
def test_a_layer_that_cannot_be_read_has_no_excerpt(layer: str | None) -> None:
    assert read_excerpts([replace(MISSING_WIRE, layer=layer)]) == {}


def test_where_text_was_cut_short_the_line_behind_its_last_is_empty() -> None:
    end = len(STAGE_TEXT.splitlines()) + 1
    excerpt = read_excerpts([replace(MISSING_WIRE, line=end)])[LAYER, end]
    assert excerpt == {end - 1: STAGE_TEXT.splitlines()[-1], end: ""}


def test_a_line_beyond_the_end_has_no_excerpt() -> None:
    assert read_excerpts([replace(MISSING_WIRE, line=1000)]) == {}


def test_bytes_that_are_no_utf_8_are_shown_as_replaced(tmp_path: Path) -> None:
    (tmp_path / "x.usda").write_bytes(b"a\xffb\r\nnext\n")
    excerpt = read_excerpts([replace(MISSING_WIRE, layer="x.usda", line=1)])["x.usda", 1]
    assert tuple(excerpt.values()) == ("a\ufffdb", "next")


@pytest.mark.parametrize("width", [30, 50, 80])
@pytest.mark.parametrize("line", [8, 9, 10])
def test_the_caret_stands_under_the_fault(line: int, width: int) -> None:
    text = STAGE_TEXT.splitlines()[line - 1]
    excerpt = {line: text}
    for column in (text.index("c") + 1, text.index("i") + 1, text.index(":") + 1):
        assert marked(excerpt, line, column, width) == text[column - 1]


def test_tabs_and_escapes_move_the_caret() -> None:
    assert marked({3: "\ta\tb\x1bX"}, 3, 6) == "X"


@pytest.mark.parametrize(("text", "columns"), [("日本 x", 5), ("e\u0301e\u0301 x", 3)])
def test_the_caret_counts_columns_and_not_letters(text: str, columns: int) -> None:
    result = excerpt_lines({1: text}, 1, text.index("x") + 1, 80)
    assert result[1] == "    | " + " " * columns + "^"


@pytest.mark.parametrize("column", [1, 20, 60, 150, 400, 480])
@pytest.mark.parametrize("letter", ["x", "日", "\x1b"])
def test_no_line_is_wider_than_asked(column: int, letter: str) -> None:
    excerpt = {1: f"{letter * 100}:{letter * 399}"}
    columns = 2 if letter == "日" else 1
    for shown in excerpt_lines(excerpt, 1, column, 60):
        assert sum(columns if sign == letter else 1 for sign in shown) <= 60


def test_without_a_column_only_the_line_is_marked() -> None:
    assert excerpt_lines({1: "one", 2: "two"}, 2, None, 80) == ["  1 | one", "> 2 | two"]
