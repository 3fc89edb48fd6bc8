"""Assets of a submission at places where nobody may look."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from in_process import invoke
from msgspec.structs import replace
from other_labs import stage, starter, submission

from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers import worker_main
from lab3_usd.grade.workers.submission_grading import GradingSetup, grade_submission
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task

SETTINGS = PoolSettings(None, None, Limits())


@pytest.fixture(scope="module")
def course() -> GradingSetup:
    return worker_main.load_setup(replace(SETTINGS, starter=starter()))


ARCS = {
    "sublayer": lambda text, asset: text.replace("(\n", f"(\n    subLayers = [@{asset}@]\n", 1),
    "reference": lambda text, asset: (
        f'{text}\ndef Xform "Odd" (\n    references = @{asset}@\n)\n{{\n}}\n'
    ),
    "payload": lambda text, asset: (
        f'{text}\ndef Xform "Odd" (\n    payload = @{asset}@\n)\n{{\n}}\n'
    ),
}


@pytest.mark.parametrize("arc", ARCS)
@pytest.mark.parametrize("strict", [False, True])
def test_what_may_not_be_followed_is_an_asset_that_is_missing(
    course: GradingSetup,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arc: str,
    *,
    strict: bool,
) -> None:
    usual = os.path.realpath

    def realpath(path: Any, **options: Any) -> Any:
        """Some releases of Python follow links below /proc/1/root, and are refused."""
        if strict and str(path).startswith("/proc/1/root/"):
            raise PermissionError(13, "Permission denied", "/proc/1/root")
        return usual(path, **options)

    monkeypatch.setattr("os.path.realpath", realpath)
    path = submission(tmp_path / "ana", "00", "01") / "work" / stage("01").name
    path.write_text(ARCS[arc](path.read_text(), "/proc/1/root/x.usda"))
    (tmp_path / "copy").mkdir()
    ana = Task("ana", "ana", (Source(tmp_path / "ana"),))
    found = grade_submission(course, ana, tmp_path / "copy", lambda _name: None)
    assert (found["status"], found["crashes"]) == ("graded", [])
    assert "/proc/1/root/x.usda" in found["reports"]["report.json"]
    assert invoke("lint", path).exit_code in {0, 1}
