"""JUnit XML: as the schema of Jenkins' xUnit plug-in has it, and counted right."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest
from report_examples import HOSTILE, REPORT, hostile

from lab3_usd.model.finding import Report, Requirement, StageResult
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


@pytest.mark.parametrize("text", HOSTILE)
def test_every_character_is_one_that_xml_allows(text: str) -> None:
    suite = suites_of(hostile(text))[0]
    messages = [failure.get("message") for failure in suite.iter("failure")]
    assert messages == [visible(f"not met: title {text}"), visible(f"found {text}")]


def test_a_requirement_that_was_not_judged_is_skipped() -> None:
    unknown = Requirement("Scene/mass/base", "Scene", "scene", "mass", met=True, judged=False)
    result = StageResult("a.usda", "05", requirements=(unknown,))
    (suite,) = suites_of(Report((result,)))
    assert suite.get("skipped") == "1"
    assert [case.get("name") for case in suite if case.find("skipped") is not None] == [unknown.id]
