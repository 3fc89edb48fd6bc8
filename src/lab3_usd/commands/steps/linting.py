"""How `lab3 lint` works: which stages the paths name, how they are judged and reported."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from typing import Any

from lab3_usd.commands.steps.reporting import (
    exit_code,
    news,
    progress,
    refuse_missing,
    refuse_output,
    rendered,
    wanted,
    wants_native,
    write_report,
)
from lab3_usd.judge.lint import LintSettings, find_stages, lint_lab, lint_stages
from lab3_usd.judge.results import with_findings
from lab3_usd.model.finding import Report
from lab3_usd.report.formats.registry import format_named
from lab3_usd.spec.isaac import NEWEST


def run(paths: list[str], options: Mapping[str, Any]) -> int:
    """Judge every stage that the paths name, print the report, and return the exit code.

    Raises:
        UsageError: a path does not exist, or the format or the release is unknown.
    """
    format_named(options["form"])
    refuse_missing(paths)
    refuse_output(options["output"], paths)
    settings = LintSettings(
        options["release"] or NEWEST, heeds_ignores=True, native=wants_native(options)
    )
    lint_lab(settings.release)
    if options["watch"]:
        return _watched(paths, settings, options)
    stages = [stage for path in paths for stage in find_stages(path)]
    from lab3_usd.stage.read.opening import kept_open  # noqa: PLC0415 - pxr, only when it is needed

    with kept_open():
        report = _judged(stages, settings, options)
        write_report(rendered(report, options), options["output"])
    return exit_code(report, options)


def _judged(stages: list[str], settings: LintSettings, options: Mapping[str, Any]) -> Report:
    judged = lint_stages(stages, settings, options["jobs"])
    with closing(judged), progress(judged, len(stages), options) as bar:
        results = [with_findings(each, wanted(each.findings, each.path, options)) for each in bar]
    return news(Report(tuple(results)), options)


def _watched(paths: list[str], settings: LintSettings, options: Mapping[str, Any]) -> int:
    from lab3_usd.commands.steps.watching import Watched, prepare, watch  # noqa: PLC0415 - only with --watch

    prepare(options)
    watched = Watched(
        names=lambda: [stage for path in paths for stage in find_stages(path)],
        judge=lambda name: _judged([name], settings, options),
        render=lambda report: rendered(report, options),
    )
    return watch(paths, watched, options)
