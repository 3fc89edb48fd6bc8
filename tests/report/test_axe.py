"""What axe says of each kind of page: nothing, on a desk, on a phone, in the dark and on paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from breaking import correct_stage
from browser import DESKTOP, PHONE, Browser
from class_pages import ITEMS, page_of, row
from html_pages import DRIVE, LAB, break_ten_times, judged, page, set_value, stages
from invoking import invoke
from linting import broken_robot
from report_examples import SUBMISSION

from lab3_usd.grade.gradebook import HTML, write_reports
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.grade.scoring import grade
from lab3_usd.judge.lint import lint_stage
from lab3_usd.model.finding import Report

axe = pytest.importorskip("axe_selenium_python", reason="axe-selenium-python is not installed")

PAGES = ("clean", "checked", "graded", "linted", "played", "class")
PAPER = (794, 1123)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One page of each kind, in a folder."""
    folder = tmp_path_factory.mktemp("pages")
    wrong = judged(stages(folder / "work", break_ten_times, "00 02"), SUBMISSION)
    rubric = load_rubric(None, LAB)
    points = grade(rubric, wrong.results, SUBMISSION.checklist)
    robot = folder / "robot.usda"
    rover = broken_robot("rover", [{"deactivate": "/World/Clock"}])
    rover.GetRootLayer().Export(str(robot))
    rows = [row("ana"), row("ben", None, status="timeout", reason="ran out of time")]
    rows.append(row("eve", 50.0, lost=[{"item": "clock", "requirement": "a/b", "title": "c"}]))
    texts = {
        "clean": page(judged(stages(folder / "clean", None, "01"))),
        "checked": page(wrong),
        "graded": write_reports(wrong, rubric, points, "Jane Doe")[HTML],
        "linted": page(Report((lint_stage(robot),))),
        "class": page_of("A class", ITEMS, rows),
    }
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    played = folder / "Lab3_05.usda"
    stage = correct_stage("05")
    set_value(stage, f"{DRIVE}/differential_controller.inputs:wheelRadius", 0.033)
    stage.GetRootLayer().Export(str(played))
    invoke("sim", played, "--page", folder / "played.html")
    return folder


CONTRAST = "color-contrast"


RUN = "const done = arguments[2]; axe.run(arguments[0], arguments[1]).then(done)"


def violations(chromium: Browser, without: str, options: dict[str, Any]) -> list[str]:
    """What axe says with these options, outside of what a selector names."""
    axe.Axe(chromium.driver).inject()
    context = {"exclude": [[without]]} if without else {"include": [["html"]]}
    found = chromium.driver.execute_async_script(
        RUN, context, {"resultTypes": ["violations"], **options}
    )
    return [
        f"{violation['id']}: {node['html']}"
        for violation in found["violations"]
        for node in violation["nodes"]
    ]


def open_all(chromium: Browser, path: Path, size: tuple[int, int], scheme: str) -> None:
    chromium.open(path, size)
    chromium.scheme("light" if scheme == "print" else scheme, "print" * (scheme == "print"))
    chromium.run("for (const each of document.querySelectorAll('details')) each.open = true")


@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing_in_how_a_page_is_built(
    chromium: Browser, pages: Path, name: str
) -> None:
    for size in (DESKTOP, PHONE):
        open_all(chromium, pages / f"{name}.html", size, "light")
        assert violations(chromium, "", {"rules": {CONTRAST: {"enabled": False}}}) == []


@pytest.mark.parametrize(
    ("scheme", "size"), [("light", DESKTOP), ("dark", PHONE), ("print", PAPER)]
)
@pytest.mark.parametrize("name", PAGES)
def test_axe_can_read_every_text(
    chromium: Browser, pages: Path, name: str, scheme: str, size: tuple[int, int]
) -> None:
    """The pictures have a test of their own."""
    open_all(chromium, pages / f"{name}.html", size, scheme)
    assert violations(chromium, ".picture svg", {"runOnly": [CONTRAST]}) == []
    chromium.scheme("light")
