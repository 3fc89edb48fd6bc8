"""The grade on a student's page: the points, and of each item what was lost and why."""

from __future__ import annotations

from html_pages import Element, read
from msgspec.structs import replace
from report_examples import FAILED, HOSTILE, OLD_NAME, PASSED, SUBMISSION

from lab3_usd.check.registry import all_rules
from lab3_usd.grade.gradebook import HTML, MOST_LOST, grade_sheet, write_reports
from lab3_usd.grade.rubric import Cap, Item, Rubric
from lab3_usd.grade.scoring import Deduction, Grade, ItemGrade
from lab3_usd.grade.workers.submission_grading import ungraded_record
from lab3_usd.grade.workers.worker_messages import Task, decoded_message, encode
from lab3_usd.model.finding import Finding, Report, Requirement
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options

WIRE = Requirement("ROS_Clock/wire/tick", "ROS_Clock", "wire", "tick reaches the clock", met=False)
RUBRIC = Rubric(
    title="Lab 3",
    digest="",
    weights={"wire": 1.0},
    items=(
        Item("clock", 10, "/clock is publishing", checkpoint="05"),
        Item("tree", 10, "The TF tree is connected", checkpoint="05", needs=("clock",)),
        Item("nav2", 5, "It is there for navigation", checkpoint="08"),
        Item("film", 5, "The robot drives", checklist="the robot drives on the film"),
    ),
    caps=(Cap(("T07",), 0.5, "the handout forbids it", ("tree",)),),
    asked={"clock": (WIRE,), "tree": (WIRE,), "nav2": (WIRE,), "film": ()},
)
GRADE = Grade(
    items=(
        ItemGrade("clock", "part", 7.5, 10.0),
        ItemGrade("tree", "none", 0.0, 10.0),
        ItemGrade("nav2", "missing", 0.0, 5.0),
        ItemGrade("film", "open", 0.0, 0.0, because="for a person to judge"),
    ),
    lost=(
        Deduction("clock", WIRE.id, WIRE.title, 2.5, "W01", "work/clock.usda:7"),
        Deduction("tree", "", "stands on clock, which earned nothing", 10.0),
        Deduction("nav2", "checkpoint 08", "checkpoint 08 is missing", 5.0),
    ),
    earned=7.5,
    possible=25.0,
    percent=30.0,
    because=("late: at most 50%",),
)
LEFT_OUT = Finding(
    "Z02", "reference-left-out", "error", "/", "x is not opened", handout="6.1", unopened="file"
)
MISSING = replace(LEFT_OUT, rule="G01", prim="/World/ROS_Clock", handout="B2", unopened="")


def report(*findings: Finding) -> Report:
    about = replace(SUBMISSION, path="1234567", findings=())
    return Report((PASSED, replace(FAILED, findings=findings)), (about,))


def shown(about: Report | None = None, grade: Grade = GRADE, name: str = "Jane Doe") -> Element:
    return read(write_reports(about or report(OLD_NAME), RUBRIC, grade, name)[HTML])


def test_the_page_opens_with_the_student_and_the_points() -> None:
    tree = shown()
    hero = tree.one("header", "hero")
    assert tree.one("h1").text == "Jane Doe"
    assert tree.one("title").text == "Jane Doe: 7.5 of 25 points"
    said = " ".join(hero.one("p", "points").text.split())
    assert said == "7.5 of 25 points 30 % late: at most 50%"
    assert "1234567" in hero.text


def test_without_a_name_the_number_stands_for_the_student() -> None:
    tree = shown(name="")
    assert tree.one("h1").text == "1234567"
    assert tree.one("header", "hero").text.count("1234567") == 1


def test_every_item_has_its_points_its_state_and_its_reasons() -> None:
    rows = list(shown().one("table", "grade").one("tbody").all("tr"))
    found = [[" ".join(cell.text.split()) for cell in row.inside] for row in rows]
    assert [cells[1:3] for cells in found] == [
        ["7.5 of 10", "part"],
        ["0 of 10", "none"],
        ["0 of 5", "missing"],
        ["\N{EN DASH}", "open"],
    ]
    assert [cells[3] for cells in found] == [
        "\N{MINUS SIGN}2.50 tick reaches the clock W01 work/clock.usda:7",
        "\N{MINUS SIGN}10.00 stands on clock, which earned nothing",
        "\N{MINUS SIGN}5.00 checkpoint 08 is missing",
        "for a person to judge: the robot drives on the film",
    ]


def test_extra_points_and_all_or_nothing_are_said() -> None:
    first = replace(RUBRIC.items[0], optional=True, partial=False)
    rubric = replace(RUBRIC, items=(first, *RUBRIC.items[1:]))
    items = (ItemGrade("clock", "none", 0.0, 10.0), *GRADE.items[1:])
    sheet = grade_sheet(rubric, replace(GRADE, items=items), "1", "")
    assert sheet.items[0].why == (
        "extra points: nothing is lost without them",
        "all or nothing",
    )


def test_not_every_fault_that_costs_nothing_more_is_named() -> None:
    lost = tuple(Deduction("clock", f"ROS_Clock/{n}", str(n)) for n in range(MOST_LOST + 3))
    item = grade_sheet(RUBRIC, replace(GRADE, lost=lost), "1", "").items[0]
    assert len(item.lost) == MOST_LOST
    assert item.more == 3


def test_every_deduction_is_named_however_many() -> None:
    lost = tuple(Deduction("clock", f"ROS_Clock/{n}", str(n), 0.1) for n in range(MOST_LOST + 3))
    item = grade_sheet(RUBRIC, replace(GRADE, lost=lost), "1", "").items[0]
    assert len(item.lost) == MOST_LOST + 3


def test_one_submission_is_one_block_whose_counts_agree() -> None:
    tree = shown(report(OLD_NAME, LEFT_OUT))
    assert len(list(tree.all("section", "block"))) == 1
    hero = [each.text for each in tree.one("header", "hero").all("span", "count")]
    bar = [each.one("span").text for each in tree.one("form", "tools").all("label", "toggle")]
    assert hero == ["1 error", "1 warning"]
    assert bar == ["Errors", "Warnings"]


def test_what_was_not_opened_comes_before_what_is_missing_for_it() -> None:
    tree = shown(report(replace(MISSING, message="the clock is missing"), LEFT_OUT))
    assert [each.one("h6").text for each in tree.all("article", "card")] == [
        "x is not opened",
        "the clock is missing",
    ]
    assert tree.one("section", "chapter").one("h4").text == "Not opened"


def test_a_reference_that_cannot_be_found_comes_before_what_is_missing_below_it() -> None:
    lost = replace(
        LEFT_OUT, rule="F02", prim="/World", severity="note", handout=None, unopened="asset"
    )
    elsewhere = replace(lost, prim="/World2")
    tree = shown(report(MISSING, lost, elsewhere))
    sites = [each.one("p", "site").text for each in tree.all("article", "card")]
    assert sites == ["/World", "/World/ROS_Clock", "/World2"]
    unchanged = read(render("html", report(MISSING, lost, elsewhere), all_rules(), Options()))
    sites = [each.one("p", "site").text for each in unchanged.all("article", "card")]
    assert sites == ["/World/ROS_Clock", "/World", "/World2"]


def test_errors_come_before_notes_whatever_the_section() -> None:
    note = replace(OLD_NAME, severity="note", handout="4.2")
    error = replace(OLD_NAME, severity="error", handout="6.1")
    tree = shown(report(note, error))
    severities = [each.attributes["data-severity"] for each in tree.all("article", "card")]
    assert severities == ["error", "note"]


def test_nothing_that_can_be_judged_has_no_per_cent() -> None:
    tree = shown(grade=replace(GRADE, earned=0.0, possible=0.0, percent=None, because=()))
    assert tree.one("svg", "ring").text == "\N{EN DASH}"
    assert "%" not in tree.one("p", "points").text


def test_a_check_without_a_grade_shows_none() -> None:
    tree = read(render("html", report(OLD_NAME), all_rules(), Options()))
    assert not list(tree.all("table", "grade"))
    assert not list(tree.all("p", "points"))


def test_neither_a_name_nor_a_title_becomes_markup() -> None:
    for text in HOSTILE:
        rubric = replace(RUBRIC, title=text)
        html = write_reports(report(OLD_NAME), rubric, GRADE, text)[HTML]
        tree = read(html)
        assert len(list(tree.all("script"))) == 1
        assert len(list(tree.all("h1"))) == 1
        assert {letter for letter in html if not letter.isprintable()} == {"\n"}


def test_the_name_travels_with_the_task_and_onto_the_page() -> None:
    task = Task("1234567", "1234567", (), name="Jane Doe", broken={})
    assert decoded_message(encode(task), Task) == task
    record = ungraded_record(RUBRIC, task.student, "unreadable", "it is damaged", task.name)
    assert read(record["reports"][HTML]).one("h1").text == "Jane Doe"


def test_a_student_of_whom_nothing_was_judged_is_told_so() -> None:
    tree = read(ungraded_record(RUBRIC, "1234567", "unreadable", "it is damaged")["reports"][HTML])
    hero = " ".join(tree.one("header", "hero").text.split())
    assert "no stage was judged: this file is left out: it is damaged" in hero
