"""How `lab3 check` works: what the paths mean, what is judged, how it is reported."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import click
from msgspec.structs import replace

from lab3_usd.check.checker import UNREADABLE
from lab3_usd.check.finding import Finding, Report, StageResult, Submission
from lab3_usd.commands.judging import (
    Entry,
    Judged,
    checkpoint_at,
    crashed_entry,
    judge_entry,
    open_starter_once,
    verdict_of,
)
from lab3_usd.commands.options import chosen, wants_color, width
from lab3_usd.errors import UsageError
from lab3_usd.report.formats import Options, format_named, render
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Lab

EXIT_FOUND = 1
EXIT_CRASH = 3
STAGE_ENDINGS = (".usd", ".usda", ".usdc", ".usdz", ".uda")


def run(paths: list[str], options: Mapping[str, Any]) -> int:
    """Judge everything the paths name, print the report, and return the exit status.

    Raises:
        UsageError: a path does not exist, a format or checkpoint is unknown, a file's checkpoint
            is not known.
    """
    format_named(options["form"])
    lab = load_lab()
    _check_inputs(paths, options)
    _check_output(paths, options)
    work = [entry for path in paths for entry in _plan(path, options, lab)]
    from lab3_usd.stage.opening import kept_open  # noqa: PLC0415 - pxr, only when it is needed

    # The comparison with the starter, and some formats, look at the stage again.
    with kept_open():
        report = _judged_all(work, options)
        _write(_rendered(report, options), options["output"])
    open_starter_once.cache_clear()
    return 0 if options["exit_zero"] and not _crashed(report) else _status(report, options)


def _judged_all(work: list[Entry], options: Mapping[str, Any]) -> Report:
    results: list[StageResult] = []
    submissions: list[Submission] = []
    with closing(_judged(work, options)) as judged, _progress(judged, len(work), options) as bar:
        for found, about in bar:
            results += (_filtered(result, options) for result in found)
            submissions += (_filtered_submission(each, options) for each in about)
    return Report(tuple(results), tuple(submissions))


def _check_inputs(paths: Iterable[str], options: Mapping[str, Any]) -> None:
    named = [options[name] for name in ("starter", "maps") if options[name] is not None]
    for path in (*paths, *named):
        if not Path(path).exists():
            message = f"{path}: there is no such file or folder"
            raise UsageError(message)


def _check_output(paths: Iterable[str], options: Mapping[str, Any]) -> None:
    """Refuse to write the report over anything that this call reads.

    Raises:
        UsageError: the output is a stage, a given file, or a file that a given folder holds.
    """
    if options["output"] is None:
        return
    output = Path(options["output"])
    named = [*paths, *(each for each in (options["starter"], options["maps"]) if each)]
    read = {Path(each).resolve() for each in named}
    is_read = output.exists() and not read.isdisjoint({output.resolve(), *output.resolve().parents})
    if is_read or output.suffix.lower() in STAGE_ENDINGS:
        message = f"{output}: is, or may be, a file that is checked; write the report elsewhere"
        raise UsageError(message)


def _plan(path: str, options: Mapping[str, Any], lab: Lab) -> Iterator[Entry]:
    """Yield what a path names: stage files, or a folder that is a submission."""
    if not Path(path).is_dir():
        checkpoint_at(path, options, lab)
        yield Entry(path, is_submission=False)
        return
    from lab3_usd.check.folder import is_submission  # noqa: PLC0415 - only for folders

    if is_submission(Path(path)):
        yield Entry(path, is_submission=True)
        return
    files = sorted(each for each in Path(path).iterdir() if each.suffix.lower() in STAGE_ENDINGS)
    if not files:
        message = f"{path}: holds no stage and is no submission (no work/ and no Lab3_NN files)"
        raise UsageError(message)
    for file in files:
        checkpoint_at(str(file), options, lab)
        yield Entry(str(file), is_submission=False)


def _judged(work: list[Entry], options: Mapping[str, Any]) -> Generator[Judged]:
    """Yield what is said of each entry, in order, judged in as many processes as asked for."""
    jobs = min(options["jobs"], len(work))
    if jobs < 2:  # noqa: PLR2004
        yield from (judge_entry(options, entry) for entry in work)
        return
    from lab3_usd.commands.processes import in_processes  # noqa: PLC0415 - only with --jobs

    judge, crashed = (partial(each, dict(options)) for each in (judge_entry, crashed_entry))
    yield from in_processes(judge, crashed, work, jobs)


def _filtered(result: StageResult, options: Mapping[str, Any]) -> StageResult:
    findings = _wanted(result.findings, options)
    return replace(result, findings=findings, verdict=verdict_of(result, findings))


def _filtered_submission(found: Submission, options: Mapping[str, Any]) -> Submission:
    return replace(found, findings=_wanted(found.findings, options))


def _wanted(findings: tuple[Finding, ...], options: Mapping[str, Any]) -> tuple[Finding, ...]:
    """Return the findings asked for; that a file could not be read is said in any case."""
    return tuple(
        each
        for each in findings
        if each.rule == UNREADABLE or chosen(each, options["select"], options["ignore"])
    )


def _progress(judged: Iterable[Judged], count: int, options: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Show a bar on standard error while many files are judged, on a terminal only."""
    hidden = options["quiet"] or count < 3 or not sys.stderr.isatty()  # noqa: PLR2004
    return click.progressbar(judged, count, label="checking", file=sys.stderr, hidden=hidden)


def _rendered(report: Report, options: Mapping[str, Any]) -> str:
    form = format_named(options["form"])
    rules = None
    if form.manual or options["verbose"]:
        from lab3_usd.check.registry import all_rules  # noqa: PLC0415 - only where it is quoted

        rules = all_rules()
    to_terminal = options["output"] is None
    told = Options(
        color=to_terminal and wants_color(),
        width=width() if to_terminal else 100,
        verbosity="quiet" if options["quiet"] else "verbose" if options["verbose"] else "normal",
        statistics=options["statistics"],
    )
    return render(options["form"], report, rules, told)


def _write(text: str, output: str | None) -> None:
    if output is None:
        sys.stdout.buffer.write(text.encode("utf-8", "replace"))
        sys.stdout.buffer.flush()
        return
    from lab3_usd.files import write_whole  # noqa: PLC0415 - only with --output

    write_whole(Path(output), text.encode("utf-8", "replace"), force=True)


def _crashed(report: Report) -> bool:
    return any(each.crashes for each in _parts(report))


def _parts(report: Report) -> Iterator[StageResult | Submission]:
    yield from report.results
    yield from report.submissions


def _status(report: Report, options: Mapping[str, Any]) -> int:
    if _crashed(report):
        return EXIT_CRASH
    bad = ("error", "warning") if options["fail_on"] == "warning" else ("error",)
    found = any(finding.severity in bad for each in _parts(report) for finding in each.findings)
    return EXIT_FOUND if found else 0
