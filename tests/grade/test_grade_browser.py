"""The page of a class in a browser: it sorts, filters, needs no script for reading, and is seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from browser import CONTRASTS, DESKTOP, PHONE, Browser
from class_pages import EVIL, ITEMS, page_of, row
from grade_files import grade
from msgspec import to_builtins

from lab3_usd.grade.rubric import load_rubric
from lab3_usd.report.html.class_page import class_page
from lab3_usd.spec.load.loader import load_lab

ROWS = [
    row("ana", 9.5),
    row("ben", 100.0),
    row("eve", 50.0, name=EVIL, reason="<img src=x onerror='window.attacked=1'>", late=True),
    row("gus", None, status="timeout", reason="ran out of time (20 s)"),
    row("zoe", 50.0, lost=[{"item": "clock", "requirement": "ROS_Clock/wire/x", "title": EVIL}]),
]

ALIKE = [{"students": ["ana_" * 30, "ben"], "what": "the same files", "checkpoints": ["01"]}]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("class") / "index.html"
    path.write_text(page_of("Lab 3", ITEMS, ROWS, ALIKE), encoding="utf-8")
    return path


def students(chromium: Browser) -> list[str]:
    """The students whose rows are shown, from top to bottom."""
    return chromium.texts("table.students tbody th")


def press(chromium: Browser, heading: str) -> None:
    (button,) = [each for each in chromium.all("thead button") if each.text.startswith(heading)]
    button.click()


def test_it_loads_without_a_complaint_and_asks_for_nothing(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    assert chromium.logs() == []
    assert [
        request for request in chromium.requests() if request.startswith(("http:", "https:"))
    ] == []
    assert chromium.run("return window.attacked") is None


def test_links_lead_to_the_reports(chromium: Browser, page: Path) -> None:
    chromium.look_at(page)
    links = [link.get_attribute("href") for link in chromium.shown("table.students a")]
    assert links[0] == (page.parent / "students" / "ana" / "report.html").as_uri()


def test_columns_sort_by_number_both_ways_and_keep_the_order_of_equals(
    chromium: Browser, page: Path
) -> None:
    chromium.open(page)
    assert students(chromium) == ["ana", "ben", "eve", "gus", "zoe"]
    press(chromium, "Per cent")
    assert students(chromium) == ["gus", "ana", "eve", "zoe", "ben"]
    press(chromium, "Per cent")
    assert students(chromium) == ["ben", "eve", "zoe", "ana", "gus"]
    assert chromium.one("th[aria-sort]").text.startswith("Per cent")
    press(chromium, "Student")
    assert students(chromium) == ["ana", "ben", "eve", "gus", "zoe"]
    assert len(chromium.all("th[aria-sort]")) == 1


def test_the_table_is_filtered_by_text_and_status(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    field = chromium.one(".filter input")
    field.send_keys("Name of")
    assert students(chromium) == ["ana", "ben", "gus", "zoe"]
    assert chromium.one(".filter output").text == "4 of 5"
    chromium.one(".filter select option:nth-child(3)").click()
    assert students(chromium) == ["gus"]


def test_everything_can_be_read_without_a_script(chromium: Browser, page: Path) -> None:
    chromium.scripts(on=False)
    try:
        chromium.open(page)
        assert len(chromium.shown("table.students tbody tr")) == len(ROWS)
        assert chromium.shown(".filter") == []
        assert chromium.all("thead button") == []
    finally:
        chromium.scripts(on=True)


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """The page of a class of which three rows are shown at first."""
    path = tmp_path / "index.html"
    path.write_text("".join(class_page("Lab 3", ITEMS, ROWS, most=3)), encoding="utf-8")
    return path


def test_of_a_large_class_the_first_rows_are_shown_and_all_are_found(
    chromium: Browser, large: Path
) -> None:
    chromium.open(large)
    assert students(chromium) == ["ana", "ben", "eve"]
    assert chromium.one(".filter output").text == "5 of 5, the first 3 shown"
    press(chromium, "Per cent")
    assert students(chromium) == ["gus", "ana", "eve"]
    field = chromium.one(".filter input")
    field.send_keys("zoe")
    assert students(chromium) == ["zoe"]
    assert chromium.shown(".filter button") == []
    field.clear()
    field.send_keys(" ")
    chromium.one(".filter button").click()
    assert students(chromium) == ["gus", "ana", "eve", "zoe", "ben"]
    assert chromium.one(".filter output").text == "5 of 5"


def test_all_rows_of_a_large_class_are_read_without_a_script_and_printed(
    chromium: Browser, large: Path
) -> None:
    chromium.scripts(on=False)
    try:
        chromium.open(large)
        assert len(chromium.shown("table.students tbody tr")) == len(ROWS)
    finally:
        chromium.scripts(on=True)
    chromium.open(large)
    chromium.scheme("light", media="print")
    assert len(chromium.shown("table.students tbody tr")) == len(ROWS)


BESIDE_A_SCROLL_BAR = (DESKTOP[0] - 15, DESKTOP[1])


@pytest.fixture
def wide_class(tmp_path: Path) -> Path:
    """The page of a class where the texts are long and every state of an item occurs."""
    rubric = load_rubric(None, load_lab())
    points = to_builtins(grade(rubric, ()))
    items = [{"id": each.id, "title": each.title, "points": each.points} for each in rubric.items]

    def of(state: str, earned: float) -> dict[str, Any]:
        judged = [{**item, "state": state, "earned": earned} for item in points["items"]]
        return {**points, "items": judged, "percent": 97.24, "earned": 97.24, "possible": 100.25}

    rows = [
        row("123456789012", name="N" * 250, late=True) | of("part", 14.59),
        row("blocked") | of("blocked", 0.0),
        row("open") | of("open", 0.0),
        row("dev", status="empty", reason=f"{'x' * 90}: a link") | points | {"percent": 0.0},
    ]
    path = tmp_path / "index.html"
    path.write_text(page_of("Lab 3", items, rows), encoding="utf-8")
    return path


def test_a_class_of_ten_items_fits_a_window_whatever_the_names_and_states(
    chromium: Browser, wide_class: Path
) -> None:
    chromium.open(wide_class)
    tables = "return [...document.querySelectorAll('.scroll')]"
    for size in (DESKTOP, BESIDE_A_SCROLL_BAR, (1100, 900)):
        chromium.resize(size)
        wide = chromium.run(f"{tables}.map((each) => each.scrollWidth - each.clientWidth)")
        assert (size, set(wide)) == (size, {0})
        assert "a link" in chromium.texts("td.remarks")[3]
        height = chromium.run("return document.querySelector('.students tbody th a').offsetHeight")
        assert height < 30


def test_on_a_phone_a_student_is_a_card_with_the_points(chromium: Browser, page: Path) -> None:
    chromium.open(page, PHONE)
    assert len(chromium.shown("td.percent")) == len(chromium.shown("td.earned")) == len(ROWS)
    right = chromium.run(
        "return Math.max(...[...document.querySelectorAll('.students :is(td, th)')]"
        ".map((cell) => cell.getBoundingClientRect().right))"
    )
    assert right <= PHONE[0]
    assert chromium.shown("td.item") == []
    press(chromium, "Per cent")
    assert students(chromium)[0] == "gus"


def test_text_stands_out_from_its_ground(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    for scheme in ("light", "dark"):
        chromium.scheme(scheme)
        found = chromium.run(CONTRASTS)
        assert len(found) > 50
        assert [(scheme, kind) for ratio, kind in found if ratio < 4.5] == []


def test_no_width_needs_sideways_scrolling(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    widths = []
    for size in (DESKTOP, PHONE):
        chromium.resize(size)
        widths.append(chromium.run("return document.documentElement.scrollWidth"))
    assert widths == [1280, 390]
