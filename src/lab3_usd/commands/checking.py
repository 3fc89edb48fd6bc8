"""How `lab3 check` works: what the paths mean, what is judged, how it is reported."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from msgspec.structs import replace

from lab3_usd.check.checker import UNREADABLE, check_stage, checkpoint_of, ordered
from lab3_usd.check.finding import Finding, Report, StageResult, Submission, Verdict
from lab3_usd.commands.options import checkpoint_number, chosen, wants_color, width
from lab3_usd.errors import UsageError
from lab3_usd.report.formats import Options, format_named, render
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Lab

if TYPE_CHECKING:
    from lab3_usd.check.unchanged import Starter

EXIT_FOUND = 1
EXIT_CRASH = 3
STAGE_ENDINGS = (".usd", ".usda", ".usdc", ".usdz", ".uda")
_Judged = tuple[tuple[StageResult, ...], tuple[Submission, ...]]


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
    results: list[StageResult] = []
    submissions: list[Submission] = []
    with _progress(work, options) as bar:
        for entry in bar:
            found, about = _judge(entry, options, lab)
            results += (_filtered(result, options) for result in found)
            submissions += (_filtered_submission(each, options) for each in about)
    report = Report(tuple(results), tuple(submissions))
    _write(_rendered(report, options), options["output"])
    return 0 if options["exit_zero"] and not _crashed(report) else _status(report, options)


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


def _plan(path: str, options: Mapping[str, Any], lab: Lab) -> Iterator[tuple[str, bool]]:
    """Yield what a path names: stage files, or a folder that is a submission (True)."""
    if not Path(path).is_dir():
        _checkpoint(path, options, lab)
        yield path, False
        return
    from lab3_usd.check.folder import is_submission  # noqa: PLC0415 - only for folders

    if is_submission(Path(path)):
        yield path, True
        return
    files = sorted(each for each in Path(path).iterdir() if each.suffix.lower() in STAGE_ENDINGS)
    if not files:
        message = f"{path}: holds no stage and is no submission (no work/ and no Lab3_NN files)"
        raise UsageError(message)
    for file in files:
        _checkpoint(str(file), options, lab)
        yield str(file), False


def _checkpoint(path: str, options: Mapping[str, Any], lab: Lab) -> str:
    """Return the checkpoint to judge a file at."""
    given = options["checkpoint"]
    if given is not None:
        return checkpoint_number(given, lab.checkpoints)
    found = checkpoint_of(Path(path).name, lab)
    if found is None:
        message = f"{path}: the name gives no checkpoint (Lab3_NN); give one with --checkpoint"
        raise UsageError(message)
    return found


def _judge(entry: tuple[str, bool], options: Mapping[str, Any], lab: Lab) -> _Judged:
    path, is_folder = entry
    if is_folder:
        return _judge_folder(path, options)
    checkpoint = _checkpoint(path, options, lab)
    result = check_stage(path, checkpoint, lab)
    if options["starter"] is not None:
        result = _against_starter(result, options["starter"], lab)
    if lab.checkpoints[checkpoint].localization:
        result = _with(result, [*_about_maps(checkpoint, options, lab)])
    return (result,), ()


def _judge_folder(path: str, options: Mapping[str, Any]) -> _Judged:
    from lab3_usd.check.folder import FolderSettings, check_folder  # noqa: PLC0415

    settings = FolderSettings(
        starter=_path(options["starter"]),
        maps=_path(options["maps"]),
        require_evidence=options["require_evidence"],
    )
    found = check_folder(Path(path), settings)
    return found.results, (found.submission,)


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _against_starter(result: StageResult, starter: str, lab: Lab) -> StageResult:
    from lab3_usd.check.unchanged import against_starter  # noqa: PLC0415 - only with --starter

    return against_starter(result, _starter(starter, lab), lab)


@lru_cache(maxsize=1)
def _starter(path: str, lab: Lab) -> Starter:
    """Open the starter once for all the stages that are compared with it."""
    from lab3_usd.check.unchanged import open_starter  # noqa: PLC0415

    return open_starter(Path(path), lab)


def _about_maps(checkpoint: str, options: Mapping[str, Any], lab: Lab) -> Iterable[Finding]:
    from lab3_usd.check.folder import lone_stage_notes, map_findings  # noqa: PLC0415

    if options["maps"] is None:
        return lone_stage_notes(checkpoint, lab)
    return map_findings(Path(options["maps"]), lab)


def _with(result: StageResult, more: list[Finding]) -> StageResult:
    if not more:
        return result
    findings = ordered((*result.findings, *more))
    return replace(result, findings=findings, verdict=_verdict(result, findings))


def _verdict(result: StageResult, findings: Iterable[Finding]) -> Verdict:
    if result.verdict == "unreadable":
        return "unreadable"
    has_errors = any(each.severity == "error" for each in findings)
    return "fail" if has_errors or result.crashes else "pass"


def _filtered(result: StageResult, options: Mapping[str, Any]) -> StageResult:
    findings = _wanted(result.findings, options)
    return replace(result, findings=findings, verdict=_verdict(result, findings))


def _filtered_submission(found: Submission, options: Mapping[str, Any]) -> Submission:
    return replace(found, findings=_wanted(found.findings, options))


def _wanted(findings: tuple[Finding, ...], options: Mapping[str, Any]) -> tuple[Finding, ...]:
    """Return the findings asked for; that a file could not be read is said in any case."""
    return tuple(
        each
        for each in findings
        if each.rule == UNREADABLE or chosen(each, options["select"], options["ignore"])
    )


def _progress(work: list[tuple[str, bool]], options: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Show a bar on standard error while many files are judged, on a terminal only."""
    hidden = options["quiet"] or len(work) < 3 or not sys.stderr.isatty()  # noqa: PLR2004
    return click.progressbar(work, label="checking", file=sys.stderr, hidden=hidden)


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
    return any(each.crashes for each in _judged(report))


def _judged(report: Report) -> Iterator[StageResult | Submission]:
    yield from report.results
    yield from report.submissions


def _status(report: Report, options: Mapping[str, Any]) -> int:
    if _crashed(report):
        return EXIT_CRASH
    bad = ("error", "warning") if options["fail_on"] == "warning" else ("error",)
    found = any(finding.severity in bad for each in _judged(report) for finding in each.findings)
    return EXIT_FOUND if found else 0
