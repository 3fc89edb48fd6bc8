"""The stages of the bundled lab, a starter, and submissions made of them."""

from __future__ import annotations

import atexit
import shutil
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from lab3_usd.deliverables.evidence.saved_outputs import read_texts
from lab3_usd.deliverables.submission_files import entries_below
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.scoring import Grade, facts_of, grade_facts
from lab3_usd.model.finding import ChecklistItem, Finding, StageResult
from lab3_usd.model.folder import Evidence
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files
from lab3_usd.stage.write.starter import build_starter

ROS = load_lab().ros


def read_evidence(folder: Path, root: Path | None = None) -> Evidence:
    """Read what the texts in `folder` show, named relative to `root`, by default the folder."""
    base = folder if root is None else root
    files = [folder / entry.path for entry in entries_below(folder) if not entry.why_not]
    named = {file.relative_to(base).as_posix(): file for file in files}
    return read_texts(named, folder.relative_to(base).as_posix(), ROS)


LAB = load_lab()


def build_all(lab: Lab) -> Path:
    """Build the stages and the starter of the lab in force, and return their folder."""
    folder = Path(mkdtemp(prefix="built"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    build_files(
        lab, None, plan_files(lab, folder / "work", list(lab.checkpoints), "usda"), BuildOptions()
    )
    build_starter(folder / "starter.usda")
    return folder


@cache
def built() -> Path:
    return build_all(LAB)


def starter() -> Path:
    return built() / "starter.usda"


def stage(number: str) -> Path:
    return built() / "work" / f"{LAB.checkpoints[number].file}.usda"


def submission(folder: Path, number: str) -> Path:
    """Write a submission with this stage."""
    (folder / "work").mkdir(parents=True)
    shutil.copyfile(stage(number), folder / "work" / stage(number).name)
    return folder


def grade(
    rubric: Rubric,
    results: Iterable[StageResult],
    checklist: Iterable[ChecklistItem] = (),
    *,
    findings: Iterable[Finding] = (),
    late: bool = False,
) -> Grade:
    """Return the points for the results of one submission, in whatever order they come."""
    return grade_facts(rubric, facts_of(results, rubric.required, findings, checklist), late=late)
