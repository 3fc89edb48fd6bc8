"""JUnit XML: as the schema of Jenkins' xUnit plug-in has it, and counted right."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest
from report_examples import CRASHED, FAILED, HOSTILE, PASSED, REPORT, hostile

from lab3_usd.model.finding import Report, Requirement, Score, StageResult
from lab3_usd.report.formats.registry import render
from lab3_usd.report.safe_text import visible

# Element: required attributes, optional attributes, children; as junit-10.xsd has them.
SCHEMA = {
    "testsuites": (set(), {"name", "time", "tests", "failures", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests", "failures", "errors"},
        {"time", "skipped", "timestamp", "hostname", "id", "package", "file", "group"},
        {"testcase", "properties", "system-out", "system-err"},
    ),
    "testcase": (
        {"name"},
        {"time", "classname", "group"},
        {"skipped", "error", "failure", "system-out", "system-err"},
    ),
    "failure": (set(), {"type", "message"}, set()),
    "error": (set(), {"type", "message"}, set()),
    "skipped": (set(), {"type", "message"}, set()),
    "system-out": (set(), set(), set()),
}


def suites_of(report: Report) -> ET.Element:
    root = ET.fromstring(render("junit", report))  # noqa: S314 - our own output
    for element in root.iter():
        required, optional, children = SCHEMA[element.tag]
        assert required <= set(element.attrib) <= required | optional
        assert {child.tag for child in element} <= children
    return root


def test_it_is_as_the_schema_says() -> None:
    assert suites_of(REPORT).tag == "testsuites"


def test_each_file_is_a_suite() -> None:
    names = [suite.get("name") for suite in suites_of(REPORT)]
    assert names == [*(result.path for result in REPORT.results), "work"]


def test_each_requirement_is_a_case() -> None:
    suite = suites_of(Report((FAILED,)))[0]
    cases = {case.get("name"): case.find("failure") is not None for case in suite}
    assert [(found.id, not found.met) for found in FAILED.requirements] == list(cases.items())[:4]


def test_an_error_fails_its_rule_and_a_warning_does_not() -> None:
    suite = suites_of(Report((FAILED,)))[0]
    failed = [case.get("name") for case in suite if case.find("failure") is not None]
    told = [case.get("name") for case in suite if case.find("system-out") is not None]
    assert failed == ["ROS_Drive/wire/make_array.input0", "W01 missing-wire"]
    assert told == ["N07 old-node-type", "F05 not-verifiable"]


def test_class_names_are_packages_of_files() -> None:
    suite = suites_of(Report((FAILED,)))[0]
    assert suite[0].get("classname") == "work.Lab3_05_ODOM_TF.ROS_Clock"


def test_the_counts_are_right() -> None:
    root = suites_of(Report((PASSED, FAILED, CRASHED)))
    counts = [tuple(suite.get(key) for key in ("tests", "failures", "errors")) for suite in root]
    assert counts == [("1", "0", "0"), ("7", "2", "0"), ("1", "0", "1")]
    assert [root.get(key) for key in ("tests", "failures", "errors")] == ["9", "2", "1"]


@pytest.mark.parametrize("text", HOSTILE)
def test_every_character_is_one_that_xml_allows(text: str) -> None:
    suite = suites_of(hostile(text))[0]
    messages = [failure.get("message") for failure in suite.iter("failure")]
    assert messages == [visible(f"not met: title {text}"), visible(f"found {text}")]


def test_a_requirement_that_was_not_judged_is_skipped() -> None:
    unknown = Requirement("Scene/mass/base", "Scene", "scene", "mass", met=True, judged=False)
    result = StageResult("a.usda", "05", "not judged", Score(1, 1, 1), requirements=(unknown,))
    (suite,) = suites_of(Report((result,)))
    assert suite.get("skipped") == "1"
    assert [case.get("name") for case in suite if case.find("skipped") is not None] == [unknown.id]
