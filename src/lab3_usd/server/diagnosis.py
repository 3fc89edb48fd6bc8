"""Judges the text of a stage as an editor has it, saved or not, and says what would repair it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.config.settings import Config, config_for, selected
from lab3_usd.errors import Lab3Error
from lab3_usd.files import temporary_beside
from lab3_usd.fix.line_changes import text_changes
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.changes import TextChange
from lab3_usd.model.finding import Finding, Report, Site, site_of
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.spec.load.loader import load_lab


class Diagnosis(Struct, frozen=True):
    """The findings of a text, with the lines that repair each, by its site.

    `not_judged` are the reasons why parts of the stage could not be checked, `failure` why nothing
    could.
    """

    findings: tuple[Finding, ...] = ()
    changes: Mapping[Site, tuple[TextChange, ...]] = {}
    not_judged: tuple[str, ...] = ()
    failure: str = ""


def diagnose(path: Path, text: str, release: str = "") -> Diagnosis:
    """Lint a stage of which an editor holds the text, by a release of Isaac Sim.

    What is not saved yet is written beside the file for a moment, so that what it refers to is
    found. The configuration of the folder counts.
    """
    try:
        config = config_for([str(path)])
        if path.is_file() and path.read_bytes() == text.encode():
            return _judged(path, path, config, release)
        copy = temporary_beside(path, path.suffix)
        try:
            copy.write_bytes(text.encode())
            return _judged(copy, path, config, release)
        finally:
            copy.unlink()
    except (Lab3Error, OSError) as error:
        return Diagnosis(failure=str(error))


def _judged(file: Path, path: Path, config: Config, release: str) -> Diagnosis:
    """Judge a file that stands for the one at `path`."""
    settings = JudgeSettings(release=release or BASE, heeds_ignores=True, config=config)
    result = lint_stage(file, settings)
    changes = text_changes(Report((result,)), load_lab(), None)
    own = {
        site: lines
        for (_, site), lines in changes.items()
        if all(line.file == str(file) for line in lines)
    }
    findings = (
        replace(finding, layer=str(path) if finding.layer == str(file) else finding.layer)
        for finding in result.findings
    )
    return Diagnosis(
        selected(findings, str(path), config),
        own,
        (*result.gaps, *(f"{open_.prim}: needs {open_.asset}" for open_ in result.not_judged)),
        "; ".join(crash.error for crash in result.crashes),
    )


def repairs_of(diagnosis: Diagnosis, finding: Finding) -> tuple[TextChange, ...]:
    """Return the lines that repair a finding; none where nothing safe does."""
    return diagnosis.changes.get(site_of(finding), ())
