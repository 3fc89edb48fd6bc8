"""The files of one student's report folder: HTML, JSON and Gradescope."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from lab3_usd.check.manual import rules_in
from lab3_usd.grade.book.sheet import grade_sheet
from lab3_usd.grade.scoring.rubric import Item, Rubric
from lab3_usd.grade.scoring.scoring import Grade, ItemGrade
from lab3_usd.model.finding import Report
from lab3_usd.report.formats.markdown import text
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.spec.load.loader import load_lab

HTML, JSON, GRADESCOPE = "report.html", "report.json", "results.json"


def write_reports(report: Report, rubric: Rubric, points: Grade, name: str) -> dict[str, str]:
    """Return the texts of the report files by name; `name` is the student's, where it is known."""
    student = report.submissions[0].path if report.submissions else ""
    summary = grade_sheet(rubric, points, student, name)
    return {
        HTML: render("html", report, rules_in(load_lab()), Options(grade=summary)),
        JSON: render("json", report, None, Options()),
        GRADESCOPE: gradescope(report, rubric, points),
    }


def gradescope(report: Report, rubric: Rubric, points: Grade) -> str:
    """Return a Gradescope result: a test for each item of the rubric, with its points.

    What the checker says of the groups that an item is about goes into the item's test.
    """
    document = json.loads(render("gradescope", report, None, Options()))
    said = {test["name"]: test["output"] for test in document["tests"]}
    graded = {each.id: each for each in points.items}
    tests = [_test(item, graded[item.id], rubric, said) for item in rubric.items]
    tests += [{"name": name, "output": output} for name, output in said.items() if output]
    document["score"] = points.earned
    document["tests"] = tests
    return json.dumps(document, indent=2) + "\n"


def _test(item: Item, graded: ItemGrade, rubric: Rubric, said: dict[str, str]) -> Mapping[str, Any]:
    groups = dict.fromkeys(each.group for each in rubric.asked[item.id])
    names = [f"Checkpoint {item.checkpoint}: {group}" for group in groups]
    blocks = [said.pop(name, "") for name in names]
    if graded.state in {"missing", "unreadable", "blocked"} or graded.because:
        because = f": {graded.because}" if graded.because else ""
        blocks.insert(0, text(f"{graded.state}{because}"))
    return {
        "name": item.title,
        "score": graded.earned,
        "max_score": graded.possible,
        "status": "passed" if graded.state == "full" else "failed",
        "visibility": item.visibility,
        "output": "\n\n".join(block for block in blocks if block),
    }
