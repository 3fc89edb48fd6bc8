"""Annotations: parsed as the runner of GitHub Actions parses workflow commands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from msgspec.structs import replace
from report_examples import FAILED, HOSTILE, LAYER, MISSING_WIRE, REPORT, hostile

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import relative_path
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.report.safe_text import visible

UNESCAPE_DATA = {"%0D": "\r", "%0A": "\n", "%25": "%"}
UNESCAPE_PROPERTY = {**UNESCAPE_DATA, "%3A": ":", "%2C": ","}


def unescape(text: str, table: dict[str, str]) -> str:
    return re.sub("%[0-9A-F]{2}", lambda found: table[found[0]], text)


def parse(line: str) -> tuple[str, dict[str, str], str]:
    """Split a command as the runner does: up to the first space, properties, `::`, message."""
    assert line.startswith("::")
    head, end, message = line[2:].partition("::")
    assert end
    name, _, listed = head.partition(" ")
    pairs = [item.partition("=")[::2] for item in listed.split(",")]
    properties = {key: unescape(value, UNESCAPE_PROPERTY) for key, value in pairs}
    return name, properties, unescape(message, UNESCAPE_DATA)


def test_a_column_may_be_unknown() -> None:
    report = Report((replace(FAILED, findings=(replace(MISSING_WIRE, column=None),)),))
    properties = parse(render("github", report).splitlines()[0])[1]
    assert sorted(properties) == ["file", "line", "title"]


@pytest.mark.parametrize("text", HOSTILE)
def test_no_string_breaks_out_of_its_command(text: str) -> None:
    lines = render("github", hostile(text)).splitlines()
    assert [parse(line)[0] for line in lines] == ["error"] * 4
    _, properties, message = parse(lines[0])
    assert sorted(properties) == ["col", "file", "line", "title"]
    assert properties["file"] == visible(relative_path(f"{text}.usda", None))
    assert message.split("\n")[1] == visible(f"found {text}")


def test_paths_are_relative_to_the_root_of_the_repository(tmp_path: Path) -> None:
    options = Options(root=str(Path.cwd().parent))
    properties = parse(render("github", REPORT, None, options).splitlines()[0])[1]
    assert properties["file"] == f"{Path.cwd().name}/{LAYER}"
    elsewhere = parse(render("github", REPORT, None, Options(root=str(tmp_path))).splitlines()[0])
    assert elsewhere[1]["file"] == (Path.cwd() / LAYER).as_posix()
