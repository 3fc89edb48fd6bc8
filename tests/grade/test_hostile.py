"""A class of hostile submissions: none stops the run, gets a pass, or writes outside."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hostile import INPUTS, Kit, make_kit, write_all
from msgspec.structs import replace
from other_labs import starter, submission

from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.stage.write.builder import build_checkpoint

pytestmark = [
    pytest.mark.timeout(300),  # the first test waits for the whole class
    pytest.mark.usefixtures("forked_workers"),
]
GOOD = "a_good_one"
# Few files are copied before their number is too large, also where the machine is busy.
LIMITS = Limits(seconds=20, files=900)
# What never comes to an end ends as early as one likes.
ENDLESS = ("an_instancing_bomb", "instances_of_instances")
SOON = replace(LIMITS, seconds=0.1)
STATUSES = {
    "a_cut_zip": "unreadable",
    "a_tar_bomb": "too large",
    "a_thousand_files": "too large",
    "a_zip_of_five_thousand_files": "too large",
    "a_zip_that_is_none": "unreadable",
    "an_empty_file": "unreadable",
    "an_instancing_bomb": "timeout",
    "instances_of_instances": "timeout",
}
EMPTY = {
    "a_file_beyond_the_limit",
    "a_link_in_a_circle",
    "a_link_then_a_file_through_it",
    "a_link_to_a_device",
    "a_pipe_as_stage",
    "a_pipe_called_zip",
    "a_tar_with_links_and_devices",
    "a_tar_with_names_that_lead_out",
    "a_zip_bomb",
    "a_zip_bomb_in_a_zip",
    "a_zip_with_a_link",
    "a_zip_with_a_password",
    "a_zip_with_damaged_contents",
    "an_archive_of_another_kind",
    "folders_in_folders",
    "the_solution_as_link",
    "the_solution_behind_a_folder_link",
    "the_solution_behind_two_links",
}


@dataclass(frozen=True)
class Run:
    """One run over all hostile submissions and one good one."""

    kit: Kit
    out: Path
    before: dict[str, bytes]
    rows: dict[str, dict[str, Any]]

    def reports(self, name: str) -> Path:
        """The folder of a student's reports."""
        book = "endless" if name in ENDLESS else "class"
        return self.out / book / "students" / self.rows[name]["folder"]


def contents(folder: Path) -> dict[str, bytes]:
    """Everything below a folder, with its bytes where it is a plain file."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else b""
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    place = tmp_path_factory.mktemp("hostile")
    kit = make_kit(place, lambda number, path: build_checkpoint(None, number, path))
    write_all(place / "class", kit)
    submission(place / "class" / GOOD)
    for name in ENDLESS:
        (place / "endless").mkdir(exist_ok=True)
        (place / "class" / name).rename(place / "endless" / name)
    before = contents(kit.outside)
    rows = []
    for book, limits in (("class", LIMITS), ("endless", SOON)):
        out = place / "out" / book
        rows += grade_class(ClassSettings(place / book, starter(), out, limits=limits))
    return Run(kit, place / "out", before, {row["student"]: row for row in rows})


def test_there_are_many_of_them() -> None:
    assert len(INPUTS) >= 60


def test_every_submission_has_a_row(run: Run) -> None:
    assert set(run.rows) == {*INPUTS, GOOD}
    table = set()
    for path in run.out.glob("*/grades.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            table |= {row["student"] for row in csv.DictReader(file)}
    assert table == {*INPUTS, GOOD}


def test_the_good_one_among_them_has_its_grade(run: Run) -> None:
    row = run.rows[GOOD]
    assert (row["status"], row["percent"]) == ("graded", 100.0)


@pytest.mark.parametrize("name", INPUTS)
def test_a_hostile_submission_is_answered_and_never_a_pass(run: Run, name: str) -> None:
    row = run.rows[name]
    expected = STATUSES.get(name, "empty" if name in EMPTY else "graded")
    assert row["status"] == expected
    assert "pass" not in row["verdicts"].values()
    assert row["crashes"] == []
    assert row["earned"] == 0


@pytest.mark.parametrize("name", INPUTS)
def test_a_hostile_submission_has_reports_that_say_why(run: Run, name: str) -> None:
    report = json.loads((run.reports(name) / "report.json").read_text())
    findings = [each for part in ("results", "submissions") for each in report[part]]
    assert any(
        found["severity"] == "error" for finding in findings for found in finding["findings"]
    )
    page = (run.reports(name) / "report.html").read_text()
    assert "<script>alert" not in page
    assert "\x1b" not in page


def test_the_reasons_for_what_ended_early_are_recorded(run: Run) -> None:
    for name in STATUSES:
        assert run.rows[name]["reason"], name


def test_nothing_is_written_outside(run: Run) -> None:
    assert contents(run.kit.outside) == run.before
    assert not (run.kit.outside / "executed").exists()
    assert not list(run.out.parent.rglob("written.usda"))


def test_no_report_names_a_temporary_folder(run: Run) -> None:
    files = {str(path): path.read_bytes() for path in run.out.rglob("*") if path.is_file()}
    assert [name for name, data in files.items() if b"lab3-grade-" in data] == []


def test_nothing_of_the_solution_is_shown(run: Run) -> None:
    solved = [
        name
        for name, row in run.rows.items()
        if name.startswith("the_solution") and any(item["earned"] for item in row["items"])
    ]
    assert solved == []


@pytest.mark.parametrize(
    "name",
    [
        "the_solution_as_relative_sublayer",
        "the_solution_by_expression",
        "the_solution_far_above",
        "the_solution_twice_in_two_arcs",
        "the_solution_with_arguments",
        "a_pipe_as_sublayer",
        "a_graph_on_a_server",
        "a_reference_to_a_system_file",
    ],
)
def test_reaching_out_is_an_error_of_its_own(run: Run, name: str) -> None:
    report = json.loads((run.reports(name) / "report.json").read_text())
    rules = {each["rule"] for result in report["results"] for each in result["findings"]}
    left_out = {each["rule"] for found in report["submissions"] for each in found["findings"]}
    assert {"Z01", "Z02"} & (rules | left_out)
