"""`pytest --lab3 work/`: every requirement of every checkpoint as a test of its own.

`pytest --lab3-lint robots/`: every stage of Isaac Sim as a test, which the linter passes or fails,
and every script that builds graphs.

Both heed the configuration beside the stages, as the commands do, or that of `--lab3-config`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from msgspec.structs import replace

from lab3_usd.data import LAB_VARIABLE, variable_set
from lab3_usd.errors import UsageError
from lab3_usd.files import is_script_file

if TYPE_CHECKING:
    from lab3_usd.config.settings import Config
    from lab3_usd.model.finding import Finding, StageResult

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
        help="a stage of Isaac Sim, a script, or a folder of them: each becomes a test",
    )
    group.addoption(
        "--lab3-config",
        metavar="FILE",
        help="the configuration, not the nearest one; its rules of your own may be files",
    )
    group.addoption(
        "--lab3-baseline",
        metavar="FILE",
        help="findings and stages not judged that are accepted, from lab3 --write-baseline FILE",
    )


_CONFIGS = pytest.StashKey[dict[str, "Config"]]()  # by the paths given


def pytest_configure(config: pytest.Config) -> None:
    """Collect the stages beside whatever tests the course has of its own.

    They are judged by the lab that the configuration beside them names, as `check` judges them.

    Raises:
        pytest.UsageError: a path does not exist, or the configuration is wrong.
    """
    given = {option: config.getoption(option) for option in ("--lab3", "--lab3-lint")}
    for option, paths in given.items():
        for path in paths:
            if not Path(path).exists():
                raise pytest.UsageError(f"{option} {path}: there is no such file or folder")
            config.args.append(path)
    if any(given.values()):
        _use_configuration(config, [path for paths in given.values() for path in paths])


def _use_configuration(config: pytest.Config, paths: list[str]) -> None:
    """Read the configuration of each path: its rules judge, and its lab, until the tests end.

    Raises:
        pytest.UsageError: a configuration or the baseline is wrong.
    """
    from lab3_usd.check.registry import own_rules_removed_on_exit
    from lab3_usd.commands.shared.baseline import read_baseline
    from lab3_usd.config.settings import config_for, load_config

    afterwards = ExitStack()
    config.add_cleanup(afterwards.close)
    afterwards.enter_context(own_rules_removed_on_exit())
    file, baseline = (config.getoption(f"--lab3-{name}") for name in ("config", "baseline"))
    try:
        config.stash[_CONFIGS] = {
            path: load_config(Path(file)) if file else config_for([path], "--lab3-config")
            for path in paths
        }
        if baseline is not None:
            read_baseline(Path(baseline))
    except UsageError as error:
        raise pytest.UsageError(str(error)) from error
    labs = [config.stash[_CONFIGS][path].lab for path in config.getoption("--lab3")]
    lab = next(filter(None, labs), None)
    if lab is not None and not os.environ.get(LAB_VARIABLE):
        afterwards.enter_context(variable_set(LAB_VARIABLE, str(lab.resolve())))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take the stages that are named, or that lie in a folder that is."""
    is_script = is_script_file(file_path)
    if file_path.suffix.lower() not in ENDINGS and not is_script:
        return None
    is_linted = _configuration(parent.config, "--lab3-lint", file_path) is not None
    if is_linted and not (is_script and not _builds_graphs(file_path)):
        return LintedFile.from_parent(parent, path=file_path)
    if is_script or is_linted:
        return None
    configuration = _configuration(parent.config, "--lab3", file_path)
    if configuration is None:
        return None
    from lab3_usd.pipeline.stage import JudgeSettings, known_checkpoint
    from lab3_usd.spec.load.loader import load_lab

    if known_checkpoint(str(file_path), JudgeSettings(config=configuration), load_lab()) is None:
        return None
    return CheckpointFile.from_parent(parent, path=file_path)


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector
) -> pytest.Module | None:
    """Keep pytest from importing a script that is linted."""
    if _configuration(parent.config, "--lab3-lint", module_path) is None:
        return None
    return UnimportedModule.from_parent(parent, path=module_path)


class UnimportedModule(pytest.Module):
    """A script that is read and never imported: it has no tests of its own."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield nothing."""
        yield from ()


def _builds_graphs(script: Path) -> bool:
    """Whether a script may build graphs; one that does not is no test."""
    from lab3_usd.pipeline.any_stage import lint_platform
    from lab3_usd.scripts.sources import may_build

    return may_build(script, lint_platform().building.module)


def _configuration(config: pytest.Config, option: str, file: Path) -> Config | None:
    """Return the configuration for a file that the paths of an option name; None for others."""
    around = {file, *file.parents}
    for path in config.getoption(option):
        configuration = config.stash[_CONFIGS][path]
        if Path(path).resolve() in around:
            is_left_out = not Path(path).is_file() and configuration.excludes(file)
            return None if is_left_out else configuration
    return None


def _as_asked(result: StageResult, option: str, config: pytest.Config) -> StageResult:
    """Return a result with the findings that the configuration asks for and no baseline knows."""
    from lab3_usd.commands.shared.baseline import without_known
    from lab3_usd.config.settings import Config, selected
    from lab3_usd.model.finding import Report
    from lab3_usd.pipeline.results import with_findings

    configuration = _configuration(config, option, Path(result.path))
    if configuration is not None:
        findings = selected(result.findings, result.path, configuration)
        result = with_findings(result, findings)
    baseline = config.getoption("--lab3-baseline")
    if baseline is None:
        return result
    report, _ = without_known(Report((result,)), Path(baseline), Config())
    (new,) = report.results
    return replace(new, gaps=()) if new.path in report.accepted else new


class LintedFile(pytest.File):
    """One stage of any robot; it is judged once, when its test is collected."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield the one test."""
        from lab3_usd.config.settings import Config
        from lab3_usd.pipeline.stage import JudgeSettings, lint_stage

        given = _configuration(self.config, "--lab3-lint", self.path) or Config()
        result = lint_stage(self.path, JudgeSettings(heeds_ignores=True, config=given))
        if result.is_beside_the_point:
            return
        yield _whole(self, "lint", _as_asked(result, "--lab3-lint", self.config))


class CheckpointFile(pytest.File):
    """One checkpoint stage; it is judged once, when its tests are collected."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield a test for each requirement, and one for faults that belong to none."""
        from lab3_usd.pipeline.entries import judge_target
        from lab3_usd.pipeline.results import Target
        from lab3_usd.pipeline.stage import JudgeSettings

        configuration = _configuration(self.config, "--lab3", self.path)
        settings = JudgeSettings(heeds_ignores=True)
        if configuration is not None:
            settings = replace(
                settings,
                config=configuration,
                starter=configuration.starter,
                maps=configuration.maps,
            )
        (result,), _ = judge_target(settings, Target(str(self.path)))
        for requirement in result.requirements:
            item = StageItem.from_parent(self, name=requirement.id)
            item.title, item.faults = requirement.title, []
            if not requirement.met:
                group = f"/{requirement.group}"
                findings = (each for each in result.findings if group in f"{each.prim}/")
                item.faults = [requirement.title, *map(sentence, findings)]
            yield item
        yield _whole(self, "no faults", _as_asked(result, "--lab3", self.config))


def _whole(parent: pytest.File, name: str, result: StageResult) -> StageItem:
    """Return the test that a stage was judged, has no error, and that no rule failed itself."""
    item = StageItem.from_parent(parent, name=name)
    errors = (finding for finding in result.findings if finding.severity == "error")
    item.title = "no faults"
    item.faults = [
        *map(sentence, errors),
        *(f"not judged: {gap}" for gap in result.gaps),
        *(f"rule {crash.rule} failed itself: {crash.error}" for crash in result.crashes),
    ]
    return item


class StageItem(pytest.Item):
    """Passes when there are no `faults`: what a requirement or the whole stage lacks, in lines."""

    title: str
    faults: list[str]

    def runtest(self) -> None:
        """Fail with every fault."""
        if self.faults:
            raise UnmetError(self.faults)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException]) -> str:  # type: ignore[override]
        """Say what is wrong, without a traceback."""
        return str(excinfo.value)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Name the test by its file and what is required."""
        return self.path, None, f"{self.path.name}: {self.title}"


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
