"""`pytest --lab3 work/`: every requirement of every checkpoint as a test of its own.

`pytest --lab3-lint robots/`: every stage of Isaac Sim as a test, which the linter passes or fails.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.model.finding import Finding, Requirement, StageResult

ENDINGS = (".usd", ".usda", ".usdc")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--lab3 PATH`, which may be given more than once."""
    group = parser.getgroup("lab3", "checkpoints of the lab")
    group.addoption(
        "--lab3",
        action="append",
        default=[],
        metavar="PATH",
        help="a checkpoint stage, or a folder of them: each requirement becomes a test",
    )
    group.addoption(
        "--lab3-lint",
        action="append",
        default=[],
        metavar="PATH",
        help="a stage of Isaac Sim, or a folder of them: each stage becomes a test",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Collect the stages beside whatever tests the course has of its own.

    They are judged by the lab that the configuration beside them names, as `check` judges them.

    Raises:
        pytest.UsageError: a path does not exist, or the configuration is wrong.
    """
    for option in ("--lab3", "--lab3-lint"):
        for path in config.getoption(option):
            if not Path(path).exists():
                raise pytest.UsageError(f"{option} {path}: there is no such file or folder")
            config.args.append(path)
    if config.getoption("--lab3") and not os.environ.get(LAB_VARIABLE):
        _use_lab(config)


def _use_lab(config: pytest.Config) -> None:
    """Name the lab of the first stage that has one in its configuration, until the tests end."""
    from lab3_usd.config.settings import places_for

    try:
        labs = [places_for(Path(path)).lab for path in config.getoption("--lab3")]
    except UsageError as error:
        raise pytest.UsageError(str(error)) from error
    lab = next(filter(None, labs), None)

    def put_back() -> None:
        os.environ.pop(LAB_VARIABLE, None)

    if lab is not None:
        os.environ[LAB_VARIABLE] = str(lab.resolve())
        config.add_cleanup(put_back)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take the stages that are named, or that lie in a folder that is."""
    if file_path.suffix.lower() not in ENDINGS:
        return None
    if _is_named(file_path, parent.config.getoption("--lab3-lint")):
        return LintedFile.from_parent(parent, path=file_path)
    if not _is_named(file_path, parent.config.getoption("--lab3")):
        return None
    from lab3_usd.judge.stage import checkpoint_of
    from lab3_usd.spec.load.loader import load_lab

    if checkpoint_of(file_path.name, load_lab()) is None:
        return None
    return CheckpointFile.from_parent(parent, path=file_path)


def _is_named(file: Path, paths: list[str]) -> bool:
    around = {file, *file.parents}
    return any(Path(path).resolve() in around for path in paths)


class LintedFile(pytest.File):
    """One stage of any robot; it is judged once, when its test is collected."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield the one test."""
        from lab3_usd.judge.lint import lint_stage

        item = NoFaultsItem.from_parent(self, name="lint")
        item.result = lint_stage(self.path)
        yield item


class CheckpointFile(pytest.File):
    """One checkpoint stage; it is judged once, when its tests are collected."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield a test for each requirement, and one for faults that belong to none."""
        from lab3_usd.judge.stage import check_stage

        result = check_stage(self.path)
        for requirement in result.requirements:
            item = RequirementItem.from_parent(self, name=requirement.id)
            item.requirement, item.result = requirement, result
            yield item
        whole = NoFaultsItem.from_parent(self, name="no faults")
        whole.result = result
        yield whole


class RequirementItem(pytest.Item):
    """Passes when the stage meets the requirement."""

    requirement: Requirement
    result: StageResult

    def runtest(self) -> None:
        """Fail with the findings that say why the requirement is not met."""
        if not self.requirement.met:
            group = f"/{self.requirement.group}"
            findings = [finding for finding in self.result.findings if group in f"{finding.prim}/"]
            raise UnmetError([self.requirement.title, *map(sentence, findings)])

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException]) -> str:  # type: ignore[override]
        """Say what is wrong, without a traceback."""
        return str(excinfo.value)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Name the test by its file and requirement."""
        return self.path, None, f"{self.path.name}: {self.requirement.title}"


class NoFaultsItem(pytest.Item):
    """Passes when the stage was judged, nothing in it is an error, and no rule failed itself."""

    result: StageResult

    def runtest(self) -> None:
        """Fail with every error of the stage, every gap, and every rule that crashed."""
        errors = [
            sentence(finding) for finding in self.result.findings if finding.severity == "error"
        ]
        crashes = [
            f"rule {crash.rule} failed itself: {crash.error}" for crash in self.result.crashes
        ]
        gaps = [f"not judged: {gap}" for gap in self.result.gaps]
        if errors or gaps or crashes:
            raise UnmetError([*errors, *gaps, *crashes])

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException]) -> str:  # type: ignore[override]
        """Say what is wrong, without a traceback."""
        return str(excinfo.value)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Name the test by its file."""
        return self.path, None, f"{self.path.name}: no faults"


class UnmetError(Exception):
    """What a stage does not meet, one line each."""

    def __init__(self, lines: list[str]) -> None:
        """Join the lines."""
        super().__init__("\n".join(lines))


def sentence(finding: Finding) -> str:
    """Return one finding as a line: rule, site, message, handout section."""
    site = finding.prim if finding.property is None else f"{finding.prim}.{finding.property}"
    section = "" if finding.handout is None else f" (handout {finding.handout})"
    return f"{finding.rule} {site}: {finding.message}{section}"
