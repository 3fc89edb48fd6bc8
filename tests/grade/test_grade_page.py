"""The page of a class: figures, what was hardest, a row for each student, nothing unsafe."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from typing import Any

import pytest
from class_pages import EVIL, ITEMS, page_of, row

from lab3_usd.report.html.class_page import class_page, distribution, hardest, losses, missing


class Page(HTMLParser):
    """What stands on a page: its tags with their attributes, and its text outside of scripts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self._inside = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        del tag
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside not in {"script", "style"}:
            self.text.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.mark.parametrize(
    ("percents", "counts"),
    [
        ([], [0] * 10),
        ([0.0, 9.99, 10.0], [2, 1, 0, 0, 0, 0, 0, 0, 0, 0]),
        ([99.9, 100.0, 105.0], [0, 0, 0, 0, 0, 0, 0, 0, 0, 3]),
    ],
)
def test_the_distribution_counts_steps_of_ten(percents: list[float], counts: list[int]) -> None:
    bars = list(distribution(percents))
    assert [bar.count for bar in bars] == counts
    assert max(bar.height for bar in bars) == (1 if percents else 0)


def test_the_points_of_an_item_are_drawn_from_most_to_none() -> None:
    earned = (0.0, 10.0, 5.0, 10.0)
    clocks = [{**row("a")["items"][0], "earned": points} for points in earned]
    text = page_of("A class", ITEMS, [row("a", items=[clock]) for clock in clocks])
    assert re.findall(r'<path d="(.*?)"', text) == ["M0 20V0H50V10H75V20H100V20Z"]


def test_the_hardest_requirements_come_first() -> None:
    rows = [
        row("a", lost=[{"item": "clock", "requirement": "ROS_Clock/wire/x", "title": "x"}]),
        row("b", lost=[{"item": "tree", "requirement": "ROS_Clock/wire/x", "title": "x"}]),
        row("c", lost=[{"item": "tree", "requirement": "ROS_Drive/wire/x", "title": "x"}]),
        row("d", lost=[{"item": "tree", "requirement": "checkpoint 05", "title": "missing"}]),
    ]
    lost = losses(rows)
    assert [(each.group, each.title, each.count) for each in hardest(lost)] == [
        ("ROS_Clock", "x", 2),
        ("ROS_Drive", "x", 1),
    ]
    assert [(each.group, each.count) for each in missing(lost)] == [("checkpoint 05", 1)]


def test_checkpoints_that_are_missing_stand_apart() -> None:
    lost = [
        {"item": "clock", "requirement": "checkpoint 05", "title": "checkpoint 05 is missing"},
        {"item": "tree", "requirement": "checkpoint 07", "title": "checkpoint 07 is unreadable"},
    ]
    page = Page(page_of("Lab 3", ITEMS, [row("a", lost=lost), row("b", lost=lost[:1])]))
    text = " ".join(" ".join(page.text).split())
    assert "2 did not hand in checkpoint 05" in text
    assert "1 handed in an unreadable checkpoint 07" in text
    assert "Lost by" not in text
    assert "Nobody" not in text


def test_the_rows_are_read_a_fixed_number_of_times() -> None:
    class Counted(list[dict[str, Any]]):
        times = 0

        def __iter__(self) -> Iterator[dict[str, Any]]:
            self.times += 1
            return super().__iter__()

    rows = Counted([row("a"), row("b")])
    page_of("Lab 3", ITEMS, rows)
    assert rows.times == 6


def test_a_long_name_is_clipped_and_can_be_read_in_full() -> None:
    page = Page(page_of("Lab 3", ITEMS, [row("a", name="N" * 250)]))
    clipped = [each.get("title") for each in page.all("span") if each.get("class") == "clip"]
    assert clipped == [None, "N" * 250]


def test_of_a_large_group_of_identical_work_some_are_named() -> None:
    students = [f"s{number:02}" for number in range(25)]
    group = {"students": students, "what": "the same files", "checkpoints": ["00"]}
    text = "".join(class_page("Lab 3", ITEMS, [row("a")], [group]))
    assert "s19 and 5 more: the same files (00)" in text


def test_every_student_has_a_line_with_a_link_to_the_report() -> None:
    page = Page(page_of("Lab 3", ITEMS, [row("jane"), row("ali", reports=[])]))
    links = [each["href"] for each in page.all("a") if not each["href"].startswith("#")]
    assert links == ["students/jane/report.html"]
    assert {"jane", "Name of ali"} <= {text.strip() for text in page.text}


def test_who_needs_the_grader_stands_first() -> None:
    rows = [
        row("a"),
        row("b", None, status="unreadable", reports=[]),
        row("c", late=True),
        row("d", items=[{**row("d")["items"][0], "state": "open"}]),
        row("e", attention=["not judged in part", "ambiguous"]),
        row("f", may_be=[{"name": "g", "ids": {}}]),
    ]
    text = " ".join(" ".join(Page(page_of("Lab 3", ITEMS, rows)).text).split())
    needing = text.partition("Needs you ")[2].partition(" Search")[0].partition("Needs you ")[2]
    assert needing == (
        "2 ambiguous Name of e , Name of f 1 not judged in part Name of e 1 unreadable Name of b "
        "1 late Name of c 1 to be judged by you Name of d Students"
    )
    assert "Needs you" not in page_of("Lab 3", ITEMS, [row("a")])


def test_a_row_has_the_reason_that_cost_most() -> None:
    title = "Differential Controller: wheelRadius = 0.025"
    line = {"item": "clock", "requirement": "Drive/x", "title": title, "points": 2.0}
    lost = [{**line, "points": 1.0, "title": "less"}, {**line, "found": "wheelRadius is 0.25"}]
    page = page_of("Lab 3", ITEMS, [row("a", lost=lost)])
    assert "Differential Controller: wheelRadius is 0.25" in page


def test_what_a_dry_run_measured_makes_no_further_hardest_requirement() -> None:
    line = {"item": "clock", "requirement": "dry run/follows", "points": 1.0}
    rows = [row(name, lost=[{**line, "title": f"went {name}"}]) for name in ("a", "b")]
    page = Page(page_of("Lab 3", ITEMS, rows))
    text = " ".join(" ".join(page.text).split())
    assert "2 of 2 dry run the check 'follows'" in text


def test_identical_work_is_named() -> None:
    group = {"students": ["a", "b"], "what": "the same files", "checkpoints": []}
    text = "".join(class_page("Lab 3", ITEMS, [row("a"), row("b", name="")], [group]))
    assert "Name of a (a), b: the same files" in text


def test_figures_and_states_can_be_read_without_a_script() -> None:
    rows = [row("a", 50.0), row("b", 100.0), row("c", None, status="timeout", reason="too slow")]
    page = Page(page_of("Lab 3", ITEMS, rows))
    text = " ".join(" ".join(page.text).split())
    assert "75.0 % median" in text
    assert "1 timeout" in text
    assert "too slow" in text
    assert "blocked" in text
    assert [each for each in page.all("form") if "hidden" in each]


def test_rows_have_the_status_by_which_they_are_filtered() -> None:
    page = Page(page_of("Lab 3", ITEMS, [row("a", 9.5), row("b", 100.0)]))
    assert [each["data-status"] for each in page.all("tr") if "data-status" in each] == [
        "graded",
        "graded",
    ]


def test_an_empty_class_has_a_page() -> None:
    assert "0 submissions" in page_of("Lab 3", ITEMS, [])


def test_nothing_that_a_student_wrote_is_markup() -> None:
    lost = [{"item": "clock", "requirement": "1", "title": EVIL}]
    changes: dict[str, Any] = {
        "name": EVIL,
        "reason": EVIL,
        "status": EVIL,
        "remarks": [EVIL],
        "because": [EVIL],
        "lost": lost,
    }
    html = page_of(EVIL, ITEMS, [row("a", **changes)])
    page = Page(html)
    assert len(page.all("script")) == 1
    assert not any("onmouseover" in attributes for _, attributes in page.tags)
    assert "\x1b" not in html
    assert "49" not in "".join(page.text)
    assert sum("<script>alert(1)</script>" in text for text in page.text) >= 5


def test_the_page_fetches_nothing_and_allows_only_its_own_style_and_script() -> None:
    html = page_of("Lab 3", ITEMS, [row("a")])
    page = Page(html)
    (policy,) = [each["content"] for each in page.all("meta") if "http-equiv" in each]
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    assert not any("style" in attributes for _, attributes in page.tags)
    assert not re.findall(r"(?:src|href)=\"https?:", html)
    assert not re.findall(r"\bon\w+=", html.partition("<body>")[2].partition("<script>")[0])


def test_every_control_has_a_name() -> None:
    page = Page(page_of("Lab 3", ITEMS, [row("a")]))
    assert len(page.all("label")) == len(page.all("input")) + len(page.all("select"))
    assert [each["lang"] for each in page.all("html")] == ["en"]


def test_names_have_a_column_where_they_say_more_than_the_submission() -> None:
    def headings(name: str) -> str:
        page = Page(page_of("Lab 3", ITEMS, [row("ana", name=name)]))
        return " ".join(" ".join(page.text).split())

    assert "Student Name Status" in headings("Ana Lee")
    assert "Student Status" in headings("ana")
