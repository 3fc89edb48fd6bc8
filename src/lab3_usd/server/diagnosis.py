"""Judges the text of a stage or a script as an editor has it, saved or not, and repairs it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.config.settings import Config, config_for, selected
from lab3_usd.errors import Lab3Error
from lab3_usd.files import copy_beside, is_script_file
from lab3_usd.fix.line_changes import text_changes
from lab3_usd.fix.scripts import script_changes
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.changes import TextChange
from lab3_usd.model.finding import Finding, Report, Site, StageResult, site_of
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.script_results import NO_GRAPH
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.spec.load.loader import load_lab

FIRST_LINE = "#usda"


class Diagnosis(Struct, frozen=True):
    """The findings of a text, with the lines that repair each, by its site.

    `not_judged` are the reasons why parts of the stage could not be checked, `failure` why nothing
    could.
    """

    findings: tuple[Finding, ...] = ()
    changes: Mapping[Site, tuple[TextChange, ...]] = {}
    not_judged: tuple[str, ...] = ()
    failure: str = ""


def is_judged(path: str, text: str) -> bool:
    """Whether a text is a stage, or a script that may build graphs."""
    return text.startswith(FIRST_LINE) or (
        path.endswith(".py") and lint_platform().building.module in text
    )


def diagnose(path: Path, text: str, release: str = "") -> Diagnosis:
    """Lint a stage or a script of which an editor holds the text, by a release of Isaac Sim.

    What is not saved yet is written to a file for a moment: beside the stage, so that what it
    refers to is found. A script refers to nothing. The configuration of the folder counts.
    """
    try:
        config = config_for([str(path)])
        if path.is_file() and path.read_bytes() == text.encode():
            return _judged(path, path, config, release)
        if is_script_file(path):
            with TemporaryDirectory() as folder:
                script = Path(folder, path.name)
                script.write_bytes(text.encode())
                return _judged(script, path, config, release)
        with copy_beside(path, text.encode()) as copy:
            return _judged(copy, path, config, release)
    except (Lab3Error, OSError) as error:
        return Diagnosis(failure=str(error))


def _judged(file: Path, path: Path, config: Config, release: str) -> Diagnosis:
    """Judge a file that stands for the one at `path`."""
    settings = JudgeSettings(release=release or BASE, heeds_ignores=True, config=config)
    result = lint_stage(file, settings)
    gaps = () if result.gaps == (NO_GRAPH,) else result.gaps
    findings = (
        replace(finding, layer=str(path) if finding.layer == str(file) else finding.layer)
        for finding in result.findings
    )
    return Diagnosis(
        selected(findings, str(path), config),
        _changes(file, result, settings.release),
        (*gaps, *(f"{open_.prim}: needs {open_.asset}" for open_ in result.not_judged)),
        "; ".join(crash.error for crash in result.crashes),
    )


def _changes(
    file: Path, result: StageResult, release: str
) -> Mapping[Site, tuple[TextChange, ...]]:
    """Return the lines that repair each finding in the file itself."""
    if is_script_file(file):
        return {
            site_of(each): lines
            for each in result.findings
            if each.fix is not None and (lines := script_changes(each, file, release))
        }
    changes = text_changes(Report((result,)), load_lab(), None)
    return {
        site: lines
        for (_, site), lines in changes.items()
        if all(line.file == str(file) for line in lines)
    }
