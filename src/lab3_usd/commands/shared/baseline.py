"""Baselines: known findings, which reports leave out, and what is known not to be judged."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.config.settings import Config, chosen
from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole
from lab3_usd.model.finding import Finding, Report, StageResult, Submission
from lab3_usd.report.entries import fingerprinted, site
from lab3_usd.report.options import NAME, tool_version

VERSION = 1
_Result = TypeVar("_Result", StageResult, Submission)


class KnownFinding(Struct, frozen=True):
    """A finding of a baseline: its file, relative to the baseline, and its key.

    Rule, site and message are for people; the fingerprint stays when lines are renumbered.
    """

    file: str
    fingerprint: str
    rule: str
    site: str
    message: str


class KnownGap(Struct, frozen=True):
    """A stage of a baseline that was not judged: its file, and one reason."""

    file: str
    because: str


class Baseline(Struct, frozen=True):
    """The findings that are known, and what could not be judged."""

    version: int
    findings: tuple[KnownFinding, ...]
    not_judged: tuple[KnownGap, ...] = ()


def write_baseline(report: Report, path: Path) -> int:
    """Write every finding of a report as known, and return how many there are."""
    entries = [known_finding for known_finding, _ in _known_findings(report, path)]
    content = {
        "version": VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        "findings": [msgspec.to_builtins(known_finding) for known_finding in entries],
        "not_judged": [msgspec.to_builtins(gap) for gaps in _gaps(report, path) for gap in gaps[1]],
    }
    write_whole(path, (json.dumps(content, indent=1) + "\n").encode(), force=True)
    return len(entries)


def read_baseline(path: Path) -> Baseline:
    """Read a baseline.

    Raises:
        UsageError: it cannot be read, or is none.
    """
    try:
        baseline = msgspec.json.decode(path.read_bytes(), type=Baseline)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from error
    except (msgspec.MsgspecError, UnicodeError) as error:
        raise UsageError(f"{path}: is not a baseline, as --write-baseline writes one") from error
    if baseline.version != VERSION:
        raise UsageError(f"{path}: is a baseline of version {baseline.version}, expected {VERSION}")
    return baseline


def without_known(
    report: Report, path: Path, config: Config
) -> tuple[Report, tuple[KnownFinding, ...]]:
    """Return a report without what a baseline knows, and the known findings that are resolved.

    These are of the files of this report, and of the rules that are asked for.

    Raises:
        UsageError: the baseline cannot be read, or is none.
    """
    baseline = read_baseline(path)
    by_key, current = _grouped(baseline.findings), list(_known_findings(report, path))
    present = _grouped(known_finding for known_finding, _ in current)
    kept = {
        id(finding)
        for known_finding, finding in current
        if not _is_among(
            known_finding, present[_key(known_finding)], by_key.get(_key(known_finding), [])
        )
    }

    def without(result: _Result) -> _Result:
        new = tuple(finding for finding in result.findings if id(finding) in kept)
        hidden = tuple(finding for finding in result.findings if id(finding) not in kept)
        return replace(result, findings=new, hidden=hidden)

    paths = [result.path for result in report.results]
    paths += [submission.path for submission in report.submissions]
    files = {_from(path, file) for file in paths}
    gone = tuple(
        known_finding
        for key, group in by_key.items()
        for known_finding in group
        if known_finding.file in files
        and not _is_among(known_finding, group, present.get(key, []))
        and chosen(known_finding.rule, config.select, config.ignore)
    )
    results = tuple(without(result) for result in report.results)
    submissions = tuple(without(submission) for submission in report.submissions)
    accepted = tuple(
        name for name, gaps in _gaps(report, path) if set(gaps) <= set(baseline.not_judged)
    )
    new = replace(report, results=results, submissions=submissions, accepted=accepted)
    return new, gone


def _gaps(report: Report, path: Path) -> Iterator[tuple[str, list[KnownGap]]]:
    """Yield the stages of which something that matters was not judged, and the reasons."""
    for result in report.results:
        if result.gaps:
            name = _from(path, result.path)
            yield result.path, [KnownGap(name, gap) for gap in result.gaps]


def _key(entry: KnownFinding) -> tuple[str, str]:
    """Return the key by which a baseline recognises a finding."""
    return entry.file, entry.fingerprint.partition(":")[0]


def _grouped(findings: Iterable[KnownFinding]) -> dict[tuple[str, str], list[KnownFinding]]:
    groups: dict[tuple[str, str], list[KnownFinding]] = {}
    for finding in findings:
        groups.setdefault(_key(finding), []).append(finding)
    return groups


def _is_among(
    finding: KnownFinding, own: Sequence[KnownFinding], group: Sequence[KnownFinding]
) -> bool:
    """Whether a finding of one group is in another group of the same rule and place.

    A lone one is, whatever it says now; of several the message tells which is which.
    """
    is_lone = len(own) == len(group) == 1
    return is_lone or any(entry.message == finding.message for entry in group)


def _known_findings(report: Report, path: Path) -> list[tuple[KnownFinding, Finding]]:
    return [
        (
            KnownFinding(
                _from(path, entry.path),
                fingerprint,
                entry.finding.rule,
                site(entry.finding),
                entry.finding.message,
            ),
            entry.finding,
        )
        for entry, fingerprint in fingerprinted(report)
    ]


def _from(path: Path, file: str) -> str:
    """Return the path of a file as seen from the folder of the baseline."""
    return Path(os.path.relpath(file, path.parent)).as_posix()
