"""The results of a Gradescope autograder: points for each group of requirements."""

from __future__ import annotations

import json
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from msgspec.structs import replace
from report_examples import BROKEN, DRIVE, FAILED, HOSTILE, MISSING_WIRE, REPORT, hostile

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report, Requirement, Score, StageResult
from lab3_usd.report.formats.gradescope import VISIBILITIES
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options

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
        "visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["name", "score", "max_score"],
                "properties": {
                    "name": {"type": "string", "minLength": 1},
                    "score": {"type": "number", "minimum": 0},
                    "max_score": {"type": "number", "minimum": 0},
                    "status": {"enum": ["passed", "failed"]},
                    "output": {"type": "string"},
                },
            },
        },
    },
}


def results_of(report: Report, options: Options | None = None) -> dict[str, Any]:
    results: dict[str, Any] = json.loads(render("gradescope", report, None, options))
    Draft202012Validator(SPECIFICATION).validate(results)
    return results


def scores_of(report: Report) -> list[tuple[str, float, float, str]]:
    tests = results_of(report)["tests"]
    return [(test["name"], test["score"], test["max_score"], test["status"]) for test in tests]


def test_each_group_of_requirements_is_a_test() -> None:
    assert scores_of(Report((FAILED,))) == [
        ("Checkpoint 05: ROS_Clock", 2.0, 2.0, "passed"),
        ("Checkpoint 05: ROS_Drive", 1.0, 2.0, "failed"),
        ("Checkpoint 05: everything else", 0.0, 0.0, "passed"),
    ]


def test_the_total_is_the_sum() -> None:
    results = results_of(REPORT)
    assert results["score"] == sum(test["score"] for test in results["tests"]) == 15.0


def test_a_file_without_requirements_keeps_its_score() -> None:
    assert scores_of(Report((BROKEN,))) == [("Checkpoint 06", 0.0, 40.0, "failed")]


def test_a_group_shows_what_lies_in_it() -> None:
    output = results_of(Report((FAILED,)))["tests"][1]["output"]
    assert f"`{DRIVE}/make_array.inputs:input0`" in output
    assert r"make\_array\.input0 is wired" in output


def test_an_error_in_a_group_with_all_points_fails_the_test() -> None:
    met = tuple(replace(found, met=True) for found in FAILED.requirements)
    report = Report((replace(FAILED, findings=(MISSING_WIRE,), requirements=met),))
    assert scores_of(report)[1] == ("Checkpoint 05: ROS_Drive", 2.0, 2.0, "failed")


def test_a_requirement_that_is_not_met_fails_its_group_without_a_finding() -> None:
    report = Report((replace(FAILED, findings=()),))
    assert scores_of(report)[1] == ("Checkpoint 05: ROS_Drive", 1.0, 2.0, "failed")


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_the_course_says_when_results_are_shown(visibility: str) -> None:
    assert results_of(REPORT, Options(visibility=visibility))["visibility"] == visibility


def test_an_unknown_visibility_names_those_there_are() -> None:
    with pytest.raises(UsageError, match="after_due_date"):
        render("gradescope", REPORT, None, Options(visibility="never"))


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_strings_are_rendered(text: str) -> None:
    assert results_of(hostile(text))["tests"][0]["status"] == "failed"


def test_a_group_says_how_much_of_it_was_not_judged() -> None:
    unknown = Requirement("Scene/mass/base", "Scene", "scene", "mass", met=True, judged=False)
    result = StageResult("a.usda", "05", "not judged", Score(1, 1, 1), requirements=(unknown,))
    (test,) = results_of(Report((result,)))["tests"]
    assert test["output"] == "1 of 1 not judged"
