"""The steps of `lab3 check`: read the paths, judge them, report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from lab3_usd.commands.steps.options import checkpoint_number
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
from lab3_usd.judge.entries import (
    Entry,
    JudgeSettings,
    find_entries,
    judge_entries,
    with_kept_starter,
)
from lab3_usd.judge.results import with_findings
from lab3_usd.model.finding import Report, StageResult, Submission
from lab3_usd.report.formats.registry import format_named
from lab3_usd.spec.load.loader import load_lab


def run(paths: list[str], options: Mapping[str, Any]) -> int:
    """Judge everything the paths name, print the report, and return the exit code.

    Raises:
        UsageError: a path does not exist, a format or checkpoint is unknown, a file's checkpoint
            is not known.
    """
    format_named(options["form"])
    refuse_missing((*paths, *_given(options)))
    refuse_output(options["output"], (*paths, *_given(options)))
    number = options["checkpoint"]
    settings = JudgeSettings(
        checkpoint=None if number is None else checkpoint_number(number, load_lab().checkpoints),
        starter=_path(options["starter"]),
        maps=_path(options["maps"]),
        require_evidence=options["require_evidence"],
        config=options["config"],
        heeds_ignores=True,
        native=wants_native(options),
    )
    if options["watch"]:
        return _watched(paths, settings, {**options, "dry_runs": {}})
    entries = [entry for path in paths for entry in find_entries(path, settings)]
    from lab3_usd.stage.read.opening import kept_open  # noqa: PLC0415 - pxr, only when it is needed

    # The comparison with the starter, and some formats, look at the stage again.
    options = {**options, "dry_runs": {}}
    with kept_open():
        report = news(_judged(entries, settings, options), options)
        write_report(_rendered(report, options), options["output"])
    return exit_code(report, options)


def _rendered(report: Report, options: Mapping[str, Any]) -> str:
    return rendered(report, options, _points(report) if options["form"] == "text" else {})


def _watched(paths: list[str], settings: JudgeSettings, options: Mapping[str, Any]) -> int:
    from lab3_usd.commands.steps.watching import Watched, prepare, watch  # noqa: PLC0415 - only with --watch

    prepare(options)

    def names() -> list[str]:
        return [entry.path for path in paths for entry in find_entries(path, settings)]

    def judge(name: str) -> Report:
        opened = with_kept_starter(settings)
        return news(_judged([*find_entries(name, settings)], opened, options), options)

    watched = Watched(
        names,
        judge,
        render=lambda report: _rendered(report, options),
        shared=tuple(_given(options)),
        renew=with_kept_starter.cache_clear,
    )
    return watch(paths, watched, options)


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _judged(entries: list[Entry], settings: JudgeSettings, options: Mapping[str, Any]) -> Report:
    """Judge all entries, and keep the findings that are asked for."""
    results: list[StageResult] = []
    submissions: list[Submission] = []
    judged = judge_entries(entries, settings, options["jobs"])
    with closing(judged), progress(judged, len(entries), options) as bar:
        for stages, about in bar:
            played = _played(stages, options) if options["sim"] else stages
            results += (
                with_findings(each, wanted(each.findings, each.path, options)) for each in played
            )
            submissions += (
                replace(each, findings=wanted(each.findings, each.path, options)) for each in about
            )
    return Report(tuple(results), tuple(submissions))


def _played(stages: Iterable[StageResult], options: Mapping[str, Any]) -> Iterator[StageResult]:
    from lab3_usd.commands.steps.dry_runs import with_dry_run  # noqa: PLC0415 - only with --sim

    return (with_dry_run(each, options["dry_runs"]) for each in stages)


def _given(options: Mapping[str, Any]) -> list[str]:
    return [options[name] for name in ("starter", "maps") if options[name] is not None]


def _points(report: Report) -> dict[str, float]:
    """Return what each checkpoint is worth by the lab's rubric, where stages are told together."""
    if len(report.results) < 2:  # noqa: PLR2004
        return {}
    from lab3_usd.grade.scoring.load_rubric import FILE, load_rubric  # noqa: PLC0415 - for folders

    points: dict[str, float] = {}
    lab = load_lab()
    if not (lab.folder / FILE).is_file():
        return {}
    for item in load_rubric(None, lab).items:
        points[item.checkpoint] = points.get(item.checkpoint, 0.0) + item.points
    return points
