"""Runs the commands that judge stages: finds, judges and reports them, once or at each save.

The first stage of a process takes usd-core 10 to 20 ms, which it spends outside of Python's lock
(GIL): as long as it takes to import the rules. Both at once saves 4 % of a check and of a lint (14
ms; the median of 41 pairs each, on two idle processors; nothing where these are busy).
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext, suppress
from pathlib import Path
from threading import Thread
from typing import Any

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd import hooks
from lab3_usd.commands.shared.options import understands_ansi
from lab3_usd.commands.shared.reporting import (
    Reporting,
    exit_code,
    rendered,
    selected_findings,
    without_baseline,
    write_report,
)
from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report, StageResult, Submission
from lab3_usd.pipeline.results import Results, Target, with_findings
from lab3_usd.report.formats.registry import format_named


@contextmanager
def imported_while_opening(*modules: str) -> Iterator[None]:
    """Import modules while the first stage of the body opens.

    They may import no more of usd-core than opening does, which imports some of it itself. One that
    cannot be imported fails where it is needed. What they write to standard error is lost, as
    usd-core's own warnings are.
    """
    from lab3_usd.stage.read.opening import opener

    def import_all() -> None:
        for module in modules:
            with suppress(Exception):
                importlib.import_module(module)

    importing = Thread(target=import_all)
    open_only = opener.get()

    def open_and_import(path: Path) -> Any:
        if importing.ident is not None:
            return open_only(path)
        try:
            importing.start()
        except RuntimeError:  # the system starts no more threads: imported where needed
            return open_only(path)
        try:
            return open_only(path)
        finally:
            importing.join()

    before = opener.set(open_and_import)
    try:
        yield
    finally:
        opener.reset(before)


AFTER_OPENING = (
    "lab3_usd.stage.read.stage_reader",
    "lab3_usd.pipeline.results",
    "lab3_usd.stage.layer_text",
)


class Judge(Struct, frozen=True):
    """How one command finds the stages of a path, and judges them in N processes.

    `module` is what judges a stage once it is open. `shared` are the files and folders that
    everything is judged with; `renew` is called when one of these was saved.
    """

    find: Callable[[str], Iterable[Target]]
    judge: Callable[[list[Target], int], Iterator[Results]]
    module: str
    shared: tuple[str, ...] = ()
    renew: Callable[[], object] = tuple


def passed_in(report: Path) -> Mapping[str, bool]:
    """Return the real paths of the files in a JSON report, with whether each passed.

    Raises:
        UsageError: it cannot be read, or is no such report.
    """
    try:
        results = json.loads(report.read_bytes())["results"]
        passed = [(str(result["path"]), result["verdict"] == "pass") for result in results]
    except OSError as error:
        raise UsageError(f"{report}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise UsageError(f"{report}: is not a report, as --format json writes one") from error
    return {os.path.realpath(path): is_right for path, is_right in passed}


def _only(passed: Mapping[str, bool], judge: Judge) -> Judge:
    """Return what judges no file, or submission, of which all passed; one not in there is new."""

    def find(path: str) -> Iterator[Target]:
        for target in judge.find(path):
            whole = os.path.realpath(target.path) + os.sep
            within = [
                is_right for each, is_right in passed.items() if f"{each}{os.sep}".startswith(whole)
            ]
            if not within or not all(within):
                yield target

    return replace(judge, find=find)


def judge_and_report(paths: Iterable[str], judge: Judge, reporting: Reporting) -> int:
    """Judge everything that the paths name, print the report, and return the exit code.

    Raises:
        UsageError: a path names nothing that can be judged.
    """
    if reporting.view.last_failed is not None:
        judge = _only(passed_in(Path(reporting.view.last_failed)), judge)
        if not any(True for path in paths for _ in judge.find(path)):
            click.echo(f"nothing to judge again: all passed in {reporting.view.last_failed}")
            return 0
    if reporting.view.watch:
        from lab3_usd.commands.shared.watching import Watched, prepare, watch

        prepare(reporting.report)
        watched = Watched(
            names=lambda: [entry.path for path in paths for entry in judge.find(path)],
            judge=lambda name: _judged([*judge.find(name)], judge, reporting),
            render=lambda report: rendered(report, reporting),
            shared=judge.shared,
            renew=judge.renew,
        )
        return watch(paths, watched, reporting.report)
    entries = [entry for path in paths for entry in judge.find(path)]
    from lab3_usd.stage.read.opening import kept_open

    needed = (judge.module, *AFTER_OPENING, format_named(reporting.report.form).module)
    # The comparison with the starter, and some formats, look at the stage again.
    with imported_while_opening(*needed), kept_open():
        report = _judged(entries, judge, reporting)
        write_report(rendered(report, reporting), reporting.report.output)
    return exit_code(report, reporting.report)


def _judged(entries: list[Target], judge: Judge, reporting: Reporting) -> Report:
    """Judge all entries, and keep the findings that are asked for."""
    results: list[StageResult] = []
    submissions: list[Submission] = []
    dry_runs: dict[str, object] = {}
    judged = judge.judge(entries, reporting.view.jobs)
    # Processes end with the generator that they answer.
    ends = closing(judged) if isinstance(judged, Generator) else nullcontext()
    with ends, _progress(judged, len(entries), quiet=reporting.view.quiet) as bar:
        for stages, folders in bar:
            for stage in stages:
                result, drawn = hooks.with_dry_run(stage) if reporting.plays else (stage, None)
                if drawn is not None:
                    dry_runs[stage.path] = drawn
                findings = selected_findings(result.findings, result.path, reporting)
                results.append(with_findings(result, findings))
            submissions += (
                replace(folder, findings=selected_findings(folder.findings, folder.path, reporting))
                for folder in folders
            )
    report = Report(tuple(results), tuple(submissions), dry_runs=dry_runs)
    return without_baseline(report, reporting)


def _progress(judged: Iterable[Any], count: int, *, quiet: bool) -> Any:
    """Show a bar on standard error while many files are judged, on a terminal only."""
    if quiet or count < 3 or not understands_ansi(sys.stderr):  # noqa: PLR2004
        return nullcontext(judged)
    return click.progressbar(judged, count, label="checking", file=sys.stderr)
