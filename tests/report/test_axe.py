"""What axe says of each kind of page: nothing, on a desk, on a phone, in the dark and on paper."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest
from breaking import correct_stage
from browser import DESKTOP, PHONE, Browser
from class_pages import ITEMS, page_of, row
from grade_files import grade
from html_pages import DRIVE, LAB, break_ten_times, judged, page, set_value, stages
from in_process import invoke
from linting import broken_robot
from report_examples import SUBMISSION

from lab3_usd.grade.gradebook import HTML, write_reports
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.model.finding import Report
from lab3_usd.pipeline.stage import lint_stage

# Packages that carry axe: the newer one is not for every Python.
CARRIERS = ("axe_selenium_python", "axe_core_python")


@pytest.fixture(scope="module")
def axe() -> str:
    """The script of axe-core."""
    for name in CARRIERS:
        carrier = find_spec(name)
        for folder in () if carrier is None else carrier.submodule_search_locations or ():
            return next(Path(folder).rglob("axe.min.js")).read_text(encoding="utf-8")
    return pytest.skip(f"none of {', '.join(CARRIERS)} is installed")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One page of each kind, in a folder."""
    folder = tmp_path_factory.mktemp("pages")
    wrong = judged(stages(folder / "work", break_ten_times, "00 02"), SUBMISSION)
    rubric = load_rubric(None, LAB)
    begun = judged(stages(folder / "begun", break_ten_times, "01"), SUBMISSION)
    points = grade(rubric, begun.results, SUBMISSION.checklist)
    robot = folder / "robot.usda"
    rover = broken_robot("rover", [{"deactivate": "/World/Clock"}])
    rover.GetRootLayer().Export(str(robot))
    rows = [row("ana"), row("ben", None, status="timeout", reason="ran out of time")]
    rows.append(row("eve", 50.0, lost=[{"item": "clock", "requirement": "a/b", "title": "c"}]))
    texts = {
        "clean": page(judged(stages(folder / "clean", None, "01"))),
        "checked": page(wrong),
        "graded": write_reports(begun, rubric, points, "Jane Doe")[HTML],
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


PASSED = {
    "desk": (DESKTOP, "light", ""),
    "dark phone": (PHONE, "dark", ""),
    "paper": ((794, 1123), "light", "print"),
}
# Text on a screen has tests of its contrast, with `CONTRASTS`.
RUN = """
const [media, done] = arguments;
const rules = { "color-contrast": { enabled: media === "print" } };
axe.run({ resultTypes: ["violations"], rules }).then(({ violations }) =>
  done(violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html}`))));
"""


# One kind of page is looked at in every way, and every kind in one at least.
LOOKS = {
    "checked": ["desk", "dark phone"],
    "played": ["dark phone"],
    "class": [*PASSED],
    "clean": ["desk"],
    "graded": ["dark phone"],
    "linted": ["paper"],
}


@pytest.mark.parametrize("name", LOOKS)
def test_axe_finds_nothing(chromium: Browser, pages: Path, axe: str, name: str) -> None:
    chromium.open(pages / f"{name}.html")
    chromium.run("for (const each of document.querySelectorAll('details')) each.open = true")
    chromium.driver.execute_script(axe)
    found = {}
    for look in LOOKS[name]:
        size, scheme, media = PASSED[look]
        chromium.resize(size)
        chromium.scheme(scheme, media)
        found[look] = chromium.driver.execute_async_script(RUN, media)
    assert found == {look: [] for look in LOOKS[name]}
