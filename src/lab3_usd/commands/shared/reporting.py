"""How the commands that judge stages report: output, findings selected, format, exit code."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from lab3_usd import hooks
from lab3_usd.commands.shared.options import (
    ReportOptions,
    ViewOptions,
    echo,
    given_words,
    lab_words,
    wants_color,
    width,
)
from lab3_usd.commands.shared.paths import refuse_stage_ending
from lab3_usd.config.settings import Config, selected
from lab3_usd.data import program
from lab3_usd.errors import EXIT_CRASH, EXIT_FOUND, UsageError
from lab3_usd.model.finding import Finding, Report, StageResult, Submission, family_of
from lab3_usd.report.formats.registry import format_named, render
from lab3_usd.report.options import Options
from lab3_usd.spec.load.loader import load_lab

if TYPE_CHECKING:
    from lab3_usd.fix.line_changes import Changes

GRADESCOPE = "gradescope"  # the format with the points of grading


class Reporting(Struct, frozen=True):
    """How a command reports: in which form, how much, and which findings are asked for.

    `starter` is the one that repairs take parts from. With `plays`, each stage is played as well.
    """

    report: ReportOptions
    view: ViewOptions
    config: Config
    starter: str | None = None
    plays: bool = False


def refuse_unusable(paths: Sequence[str], options: ReportOptions) -> None:
    """Refuse an unknown format, paths that lead to nothing, and a report that is called as a stage.

    Raises:
        UsageError: there is no such format, no file or folder at a path, or the output has the
            ending of a stage.
    """
    format_named(options.form)
    for path in paths:
        if not Path(path).exists():
            from lab3_usd.files import absence

            raise UsageError(absence(Path(path), "file or folder"))
    if options.output is not None:
        refuse_stage_ending(Path(options.output))


def wants_native(*, is_given: bool, select: Sequence[str]) -> bool:
    """Whether OpenUSD's validators are asked for, by the option or by a rule that is selected.

    Raises:
        UsageError: they are, and the installed usd-core has none.
    """
    if not (is_given or select):
        return False
    from lab3_usd.model.native import FAMILY

    if not is_given and FAMILY not in map(family_of, select):
        return False
    from lab3_usd.stage.read.native_validators import native_validation

    native_validation()
    return True


def selected_findings(
    findings: Iterable[Finding], path: str, reporting: Reporting
) -> tuple[Finding, ...]:
    """Return the selected findings of a file, with the severities of the configuration.

    An unreadable file is reported in any case. Points are those of all findings.
    """
    if reporting.report.form == GRADESCOPE:
        return tuple(findings)
    return selected(findings, path, reporting.config)


def without_baseline(report: Report, reporting: Reporting) -> Report:
    """Return a report without known findings, and print those that are resolved.

    Stages that are not judged stay so; where the reasons are known, that is printed as well.

    Raises:
        UsageError: the baseline cannot be read, or is none.
    """
    written, given = reporting.report.write_baseline, reporting.report.baseline
    baseline = given if written is None else written
    if baseline is None or reporting.report.form == GRADESCOPE:
        return report
    from lab3_usd.commands.shared.baseline import without_known, write_baseline

    if written is not None:
        count = write_baseline(report, written)
        click.echo(
            f"{program()}: {count} finding{'s' * (count != 1)} written to {written}", err=True
        )
    new, gone = without_known(report, baseline, reporting.config)
    if gone:
        click.echo(f"{program()}: {len(gone)} of {given} no longer found:", err=True)
    for finding in gone:
        click.echo(f"  {finding.file}: {finding.rule} {finding.site}", err=True)
    count = sum(_is_accepted(result, new) for result in new.results)
    if count and given is not None:
        stages = f"{count} stage{'s' * (count > 1)}"
        click.echo(f"{program()}: {stages} not judged, for the reasons in {given}", err=True)
    return new


def _is_accepted(result: StageResult, report: Report) -> bool:
    if result.is_beside_the_point:
        return True
    return result.verdict == "not judged" and result.path in report.accepted


# The options of a report that decide what is found, which lab3 fix has as well.
_FOR_REPAIRS = (
    *("checkpoint", "starter", "release", "moved_from", "assets"),
    *("config_file", "isolated", "select", "ignore"),
)


def rendered(report: Report, reporting: Reporting) -> str:
    """Return a report in the format asked for.

    Raises:
        SpecError: the rubric of the lab is wrong.
        UsageError: a grade is asked for several submissions.
    """
    options, view = reporting.report, reporting.view
    form = format_named(options.form)
    rules = None
    if form.manual or view.verbose:
        from lab3_usd.check.manual import rules_in

        rules = rules_in(load_lab())
    changes: Changes = {}
    if form.changes:
        from lab3_usd.fix.line_changes import text_changes

        changes = text_changes(report, load_lab(), reporting.starter)
    to_terminal = options.output is None
    is_checked = any(result.checkpoint is not None for result in report.results)
    has_points = options.form == "text" and is_checked and len(report.results) > 1
    render_options = Options(
        color=to_terminal and wants_color(),
        width=width() if to_terminal and options.form == "text" else 100,
        verbosity="quiet" if view.quiet else "verbose" if view.verbose else "normal",
        statistics=view.statistics,
        source=view.source,
        each=view.each,
        points=load_lab().points if has_points else {},
        grade=hooks.grade_of(report, load_lab()) if options.form == GRADESCOPE else None,
        editor=True,
        changes=changes,
        lab=lab_words(click.get_current_context()),
        given=tuple(given_words(click.get_current_context(), _FOR_REPAIRS)),
    )
    return render(options.form, report, rules, render_options)


def write_report(text: str, output: str | None) -> None:
    """Write a report to standard output, or to the file given."""
    if output is None:
        # What is coloured was asked to be: click, which knows Windows' consoles, takes nothing out.
        click.echo(text.encode("utf-8", "replace").decode(), nl=False, color=True)
        return
    from lab3_usd.files import write_whole

    write_whole(Path(output), text.encode("utf-8", "replace"), force=True)
    echo(f"{program()}: the report is in {output}", err=True)


def exit_code(report: Report, options: ReportOptions) -> int:
    """Return the exit code of a run; a crashed rule outweighs all findings."""
    judged: list[StageResult | Submission] = [*report.results, *report.submissions]
    if any(result.crashes for result in judged):
        return EXIT_CRASH
    if options.exit_zero:
        return 0
    bad = ("error", "warning") if options.fail_on == "warning" else ("error",)
    not_judged = [result for result in report.results if result.verdict == "not judged"]
    if not all(_is_accepted(result, report) for result in not_judged):
        return EXIT_FOUND
    is_bad = any(finding.severity in bad for result in judged for finding in result.findings)
    return EXIT_FOUND if is_bad else 0
