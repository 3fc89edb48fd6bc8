"""Reports made by hand, the rules they name, and what holds a report against its schema."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from functools import cache
from inspect import getdoc
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from lab3_usd.check.registry import Rule
from lab3_usd.data import data_folder
from lab3_usd.model.finding import (
    ChecklistItem,
    Crash,
    Finding,
    NodeCoverage,
    NotJudged,
    Problem,
    Report,
    Requirement,
    StageResult,
    Submission,
)

ORDER = ["version", "tool", "results", "submissions", "summary", "error"]
RESULT_ORDER = [
    "path",
    "checkpoint",
    "verdict",
    "score",
    "findings",
    "requirements",
    "gaps",
    "hidden",
    "nodes",
    "not_judged",
    "crashes",
]


@cache
def validator(name: str = "report-2") -> Draft202012Validator:
    text = (data_folder("schema") / f"{name}.json").read_text(encoding="utf-8")
    return Draft202012Validator(json.loads(text))


def dry_run_of(text: str) -> dict[str, Any]:
    """Return what is said of a dry run or a recording, which is as `schema/sim-2.json` says."""
    document: dict[str, Any] = json.loads(text)
    assert [error.message for error in validator("sim-2").iter_errors(document)] == []
    return document


def problems_of(report: Any) -> list[str]:
    """Name what the schema finds wrong, each with its place."""
    errors = sorted(validator().iter_errors(report), key=lambda error: list(map(str, error.path)))
    return [f"{error.json_path}: {error.message}" for error in errors]


def assert_valid(report_json: str | bytes | dict[str, Any]) -> dict[str, Any]:
    """Assert that a report is as `schema/report-2.json` says, and return it parsed.

    Also: keys in their order, the summary counts what is there, no more points than possible, a
    column only with its line.
    """
    report: dict[str, Any] = (
        report_json if isinstance(report_json, dict) else json.loads(report_json)
    )
    assert problems_of(report) == []
    assert list(report) == [key for key in ORDER if key in report]
    for result in report["results"]:
        assert list(result) == [key for key in RESULT_ORDER if key in result]
        score = result["score"]
        assert score["earned"] + score.get("not_judged", 0) <= score["possible"]
    parts = [*report["results"], *report.get("submissions", [])]
    findings = [finding for part in parts for finding in part["findings"]]
    assert all(finding["line"] or not finding["column"] for finding in findings)
    hidden: Counter[str] = sum((Counter(part.get("hidden", {})) for part in parts), Counter())
    assert report["summary"] == ({"hidden": hidden} if hidden else {}) | {
        "files": len(report["results"]),
        "passed": sum(result["verdict"] == "pass" for result in report["results"]),
        "not_judged": sum(result["verdict"] == "not judged" for result in report["results"]),
        "errors": sum(finding["severity"] == "error" for finding in findings),
        "warnings": sum(finding["severity"] == "warning" for finding in findings),
        "notes": sum(finding["severity"] == "note" for finding in findings),
    }
    return report


LAYER = "work/Lab3_05_ODOM_TF.usda"
DRIVE = "/turtlebot3_burger/ROS_Drive"

STAGE_TEXT = """\
#usda 1.0
def Xform "turtlebot3_burger"
{
    def OmniGraph "ROS_Drive"
    {
        def OmniGraphNode "make_array"
        {
            custom token inputs:arrayType = "token[]"
            custom token inputs:input0
            custom token inputs:input1 = "wheel_right_joint"
        }
    }
}
"""

MISSING_WIRE = Finding(
    rule="W01",
    name="missing-wire",
    severity="error",
    prim=f"{DRIVE}/make_array",
    message="inputs:input0 has no wire, expected one from the left joint token",
    property="inputs:input0",
    expected=f"{DRIVE}/constant_left_joint.inputs:value",
    actual="nothing",
    layer=LAYER,
    line=9,
    column=26,
    handout="C9",
    hint="open ROS_Drive and connect the Constant Token that holds wheel_left_joint to input0 of "
    "Make Array",
    related=(f"{DRIVE}/constant_left_joint",),
)
OLD_NAME = Finding(
    rule="N07",
    name="old-node-type",
    severity="warning",
    prim=DRIVE,
    message="3 nodes have type names from before 4.5",
    hint="add the nodes again from the menu of 6.0.1",
    related=(f"{DRIVE}/make_array",),
)
UNRESOLVED = Finding(
    rule="F05",
    name="not-verifiable",
    severity="note",
    prim="/World/environment",
    message="not verifiable: turtlebot3_world.usd cannot be found from here",
    layer=LAYER,
)
UNREADABLE = Finding(
    rule="F01",
    name="unreadable",
    severity="error",
    prim="/",
    message="the file is no USD stage: it holds NUL bytes",
    layer="work/Lab3_06_LOCALIZATION.usd",
    unopened="stage",
)
MISSING_FILE = Finding(
    rule="X01",
    name="missing-file",
    severity="error",
    prim="work/Lab3_08_NAV2.usd",
    message="the submission has no stage for checkpoint 08",
    handout="11",
)


def requirement(group: str, name: str, *, met: bool = True) -> Requirement:
    return Requirement(
        id=f"{group}/wire/{name}",
        group=group,
        kind="wire",
        title=f"{name} is wired",
        met=met,
        handout="C9",
    )


FAILED = StageResult(
    path=LAYER,
    checkpoint="05",
    findings=(MISSING_WIRE, OLD_NAME, UNRESOLVED),
    requirements=(
        requirement("ROS_Clock", "publish.execIn"),
        requirement("ROS_Clock", "publish.timeStamp"),
        requirement("ROS_Drive", "make_array.input0", met=False),
        requirement("ROS_Drive", "make_array.input1"),
    ),
)
PASSED = StageResult(
    "work/Lab3_00_INITIAL.usda",
    "00",
    requirements=tuple(requirement("ROS_Clock", f"port{number}") for number in range(2)),
)
BROKEN = StageResult("work/Lab3_06_LOCALIZATION.usd", "06", (UNREADABLE,))
GAP = "the sublayer ./edits.usda of the stage cannot be found"
NOT_JUDGED = StageResult(
    "work/warehouse.usd",
    None,
    not_judged=(NotJudged("K14", "/World/move", "inputs:targetPrim", "./robot.usd"),),
    coverage=NodeCoverage(
        nodes=9, waiting={"./robot.usd": 3}, unknown={"a.B": 1}, partly={"./robot.usd": 2}
    ),
    gaps=(GAP,),
)
CRASHED = StageResult(
    "work/Lab3_01_CLOCK.usda",
    "01",
    crashes=(Crash("T03", "KeyError: 'odom'"),),
)
SUBMISSION = Submission(
    path="work",
    findings=(MISSING_FILE,),
    checklist=(
        ChecklistItem("7", "/clock is published", "met", "01: ROS_Clock"),
        ChecklistItem("7", "/scan is published", "not met", "03: no publisher"),
        ChecklistItem("10", "the robot reaches its goal", "person"),
    ),
)
REPORT = Report((PASSED, FAILED, BROKEN), (SUBMISSION,))
EMPTY = Report(())

# What a hostile stage may put into a string: terminal and workflow commands, markup, formulas,
# characters that turn the text around, that XML forbids, and a path that is no valid Unicode.
HOSTILE = (
    "\x1b]0;owned\x07\x1b[2J",
    "\x9b31m",
    "\r\n::error::forged",
    "%0A::warning::forged",
    "a,line=1,col=1::x",
    "=cmd|' /C calc'!A0",
    "@SUM(1+1)",
    "<script>alert(1)</script>",
    "](https://example.org)[x",
    "**bold** `code` | cell | <b>",
    "\u202egnp.exe",
    "\x00\x0b\ufffe",
    "{0} {{1}}",
    "\udcff",
)


def hostile(text: str) -> Report:
    """Return a report in which every string that comes from a stage is `text`."""
    finding = Finding(
        rule="W01",
        name="missing-wire",
        severity="error",
        prim=f"/World/{text}",
        message=f"found {text}",
        property=text,
        expected=text,
        actual=text,
        layer=f"{text}.usda",
        line=1,
        column=1,
        hint=f"replace {text}",
        related=(text,),
    )
    missed = Requirement("g/wire/x", "World", "wire", f"title {text}", met=False)
    crash = Crash("T03", f"KeyError: {text}")
    result = StageResult(f"{text}.usda", "05", (finding,), (missed,), (crash,))
    item = ChecklistItem("7", f"item {text}", "not met", text)
    return Report((result,), (Submission(f"dir{text}", (finding,), (item,), (crash,)),))


def write_stage(folder: Path) -> None:
    """Write the stage that the example findings lie in, below `folder`."""
    path = folder / LAYER
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(STAGE_TEXT, encoding="utf-8")


def _missing_wire(subject: object) -> Iterator[Problem]:
    """A wire that the graph needs is not there.

    Why: the node computes with the default of its input, and the wheels stand still.

    Fix: draw the wire in the Action Graph editor.

    Example: `make_array.inputs:input0` without a source.
    """
    del subject
    yield from ()


RULES = {
    "W01": Rule("W01", "missing-wire", "error", "graph", _missing_wire, getdoc(_missing_wire) or "")
}
