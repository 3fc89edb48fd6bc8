"""The JSON report: as its schema says, complete, and the same on every run."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from msgspec.structs import replace
from report_examples import (
    CRASHED,
    EMPTY,
    FAILED,
    HOSTILE,
    REPORT,
    assert_valid,
    hostile,
    problems_of,
    validator,
)

from lab3_usd.model.finding import Report, Requirement, StageResult
from lab3_usd.report.formats.json_report import error_report, report_json
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.report.safe_text import json_text


def test_the_schema_is_a_schema() -> None:
    Draft202012Validator.check_schema(validator().schema)


def test_a_report_is_as_the_schema_says() -> None:
    assert_valid(render("json", REPORT))


def test_an_empty_report_is_valid() -> None:
    assert assert_valid(render("json", EMPTY))["results"] == []


@pytest.mark.parametrize("kind", ["usage", "crash"])
def test_a_run_that_failed_is_a_report_too(kind: Any) -> None:
    report = assert_valid(json_text(error_report("no such file: x.usda", kind), 2))
    assert report["error"] == {"kind": kind, "message": "no such file: x.usda"}


def test_what_was_not_judged_is_counted_and_told_apart() -> None:
    unknown = Requirement("Scene/mass/base", "Scene", "scene", "mass", met=True, judged=False)
    known = replace(unknown, id="Scene/body/base", judged=True)
    result = StageResult("a.usda", "05", requirements=(unknown, known))
    document = report_json(Report((result,)), requirements=True)
    assert_valid(document)
    (entry,) = document["results"]
    assert entry["score"] == {"earned": 1.0, "possible": 2.0, "not_judged": 1.0}
    assert [item.get("judged") for item in entry["requirements"]] == [False, None]


def test_requirements_are_listed_when_verbose() -> None:
    brief = assert_valid(render("json", Report((FAILED,))))["results"][0]
    full = assert_valid(render("json", Report((FAILED,)), None, Options(verbosity="verbose")))
    assert "requirements" not in brief
    assert full["results"][0]["requirements"][2]["met"] is False


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_strings_come_back_as_they_were(text: str) -> None:
    rendered = render("json", hostile(text))
    assert rendered.isascii()
    assert assert_valid(rendered)["results"][0]["path"] == f"{text}.usda"


def every_object(value: Any) -> list[dict[str, Any]]:
    """List every JSON object in a document, itself included."""
    if isinstance(value, list):
        return [found for item in value for found in every_object(item)]
    if not isinstance(value, dict):
        return []
    return [value, *(found for item in value.values() for found in every_object(item))]


def full_document() -> dict[str, Any]:
    document = report_json(
        Report((*REPORT.results, CRASHED), REPORT.submissions), requirements=True
    )
    document["error"] = {"kind": "crash", "message": "x"}
    return document


def test_the_schema_refuses_unknown_keys_at_every_level() -> None:
    document = full_document()
    for each in every_object(document):
        each["surprise"] = 1
        assert problems_of(document), each
        del each["surprise"]
    assert not problems_of(document)


def test_the_schema_refuses_missing_keys_at_every_level() -> None:
    optional = {"submissions", "error", "requirements", "crashes"}
    document = full_document()
    for found in every_object(document):
        for key, value in [*found.items()]:
            del found[key]
            may_be_missing = key in optional and not isinstance(value, str)
            assert validator().is_valid(document) == may_be_missing, (key, found)
            found[key] = value
    assert not problems_of(document)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("severity", "fatal"),
        ("prim", "make_array"),
        ("rule", "missing-wire"),
        ("line", 0),
        ("line", "9"),
        ("related", None),
        ("message", ""),
    ],
)
def test_the_schema_refuses_a_wrong_value(key: str, value: object) -> None:
    document = report_json(Report((FAILED,)))
    document["results"][0]["findings"][0][key] = value
    assert len(problems_of(document)) == 1


def test_json_imports_nothing_heavy() -> None:
    code = (
        "import sys, lab3_usd.report.formats.json_report;"
        "print([m for m in ('pxr', 'yaml', 'jinja2', 'click', 'importlib.metadata',"
        " 'email', 'hashlib', 'xml', 'lab3_usd.report.formats.text_report') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
