"""The results of a Gradescope autograder: the points of a grade, and what was found."""

from __future__ import annotations

import json
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from report_examples import BROKEN, DRIVE, FAILED, HOSTILE, REPORT, hostile

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report, Requirement, StageResult
from lab3_usd.model.grade import GradeItem, GradeSummary, LostPoints
from lab3_usd.report.formats.gradescope import VISIBILITIES
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options

VISIBLE = {"enum": ["hidden", "after_due_date", "after_published", "visible"]}
FORMAT = {"enum": ["text", "html", "simple_format", "md", "ansi"]}
# As Gradescope documents results.json; `score` must be there or in every test.
SPECIFICATION = {
    "type": "object",
    "additionalProperties": False,
    "required": ["score", "tests"],
    "properties": {
        "score": {"type": "number"},
        "output": {"type": "string"},
        "output_format": FORMAT,
        "test_output_format": FORMAT,
        "test_name_format": FORMAT,
        "visibility": VISIBLE,
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["name", "output"],
                "properties": {
                    "name": {"type": "string", "minLength": 1},
                    "score": {"type": "number", "minimum": 0},
                    "max_score": {"type": "number", "minimum": 0},
                    "status": {"enum": ["passed", "failed"]},
                    "output": {"type": "string"},
                    "visibility": VISIBLE,
                },
            },
        },
    },
}


GRADE = GradeSummary(
    "Lab",
    "",
    "",
    earned=14.0,
    possible=25.0,
    percent=56.0,
    items=(
        GradeItem("the clock", "full", 10.0, 10.0, 10.0, groups=("Checkpoint 05: ROS_Clock",)),
        GradeItem(
            "the drive",
            "part",
            4.0,
            15.0,
            15.0,
            lost=(LostPoints(11.0, "a wire is missing", "W01", "a.usda:7"),),
            groups=("Checkpoint 05: ROS_Drive",),
            visibility="hidden",
        ),
    ),
)


def results_of(report: Report, options: Options | None = None) -> dict[str, Any]:
    asked = options or Options(grade=GRADE)
    results: dict[str, Any] = json.loads(render("gradescope", report, None, asked))
    Draft202012Validator(SPECIFICATION).validate(results)
    return results


def outputs_of(report: Report) -> dict[str, str]:
    return {test["name"]: test["output"] for test in results_of(report)["tests"]}


def test_each_item_of_the_rubric_is_a_test_with_its_points() -> None:
    results = results_of(Report((FAILED,)))
    points = [(test["score"], test["max_score"], test["status"]) for test in results["tests"][:2]]
    assert results["score"] == 14.0
    assert points == [(10.0, 10.0, "passed"), (4.0, 15.0, "failed")]
    assert results["tests"][1]["visibility"] == "hidden"


def test_what_was_found_elsewhere_has_no_points() -> None:
    (other,) = results_of(Report((FAILED,)))["tests"][2:]
    assert other["name"] == "Checkpoint 05: everything else"
    assert "max_score" not in other


def test_without_a_grade_there_are_no_points() -> None:
    results = results_of(Report((FAILED,)), Options())
    assert results["score"] == 0.0
    assert all("score" not in test for test in results["tests"])


def test_an_item_shows_what_it_lost_and_what_lies_in_its_groups() -> None:
    output = outputs_of(Report((FAILED,)))["the drive"]
    assert output.startswith(r"- \-11\.00 a wire is missing \(W01 a\.usda\:7\)")
    assert f"`{DRIVE}/make_array.inputs:input0`" in output
    assert r"make\_array\.input0 is wired" in output


def test_a_file_without_requirements_shows_its_findings() -> None:
    assert BROKEN.findings[0].rule in outputs_of(Report((BROKEN,)))["Checkpoint 06"]


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_the_course_says_when_results_are_shown(visibility: str) -> None:
    options = Options(visibility=visibility, grade=GRADE)
    assert results_of(REPORT, options)["visibility"] == visibility


def test_an_unknown_visibility_names_those_there_are() -> None:
    with pytest.raises(UsageError, match="after_due_date"):
        render("gradescope", REPORT, None, Options(visibility="never", grade=GRADE))


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_strings_are_rendered(text: str) -> None:
    assert results_of(hostile(text))["tests"]


def test_a_group_says_how_much_of_it_was_not_judged() -> None:
    unknown = Requirement("Scene/mass/base", "Scene", "scene", "mass", met=True, judged=False)
    result = StageResult("a.usda", "05", requirements=(unknown,))
    assert outputs_of(Report((result,)))["Checkpoint 05: Scene"] == "1 of 1 not judged"
