"""Judges stages again whenever they are saved, in one process, until Ctrl-C."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd import hooks
from lab3_usd.commands.shared.options import ReportOptions, understands_ansi
from lab3_usd.commands.shared.reporting import write_report
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.installation import install_command
from lab3_usd.model.finding import Finding, Report, StageResult
from lab3_usd.report.entries import entries, fingerprinted, site
from lab3_usd.report.safe_text import printable

# Milliseconds without another event before a save counts as over, and at most.
STEP, DEBOUNCE = 5, 100
QUIET = 1000  # milliseconds without an event after which a look is taken whether one was missed

Stamp = tuple[int, int, int]


def saves(folders: Iterable[str]) -> Iterator[frozenset[str]]:
    """Yield the files that were written, moved or removed in these folders, save by save.

    Folders are watched rather than files: whoever saves by renaming makes another file. No files
    are yielded where none was written for a while. Ends where a folder is gone before it is
    watched.
    """
    from watchfiles import watch as file_events

    events = file_events(
        *folders,
        watch_filter=None,
        step=STEP,
        debounce=DEBOUNCE,
        rust_timeout=QUIET,
        yield_on_timeout=True,
        recursive=False,
    )
    with suppress(FileNotFoundError):
        for changes in events:
            yield frozenset(os.path.realpath(path) for _, path in changes)


def folders_of(files: Iterable[str]) -> dict[str, int]:
    """Return the folders to watch, each with its inode number.

    The folder above each belongs to them, or the nearest that there is: it tells when a folder
    goes and comes back. So does the folder of a link, which may come to lead elsewhere.
    """
    folders: set[str] = set()
    for file in files:
        path = os.path.realpath(file)
        inside = (folder for folder, _, _ in os.walk(path))
        folders.update(inside if Path(path).is_dir() else [str(Path(path).parent)])
        if Path(file).is_symlink():
            folders.add(os.path.realpath(Path(file).parent))
    above = {str(next(filter(Path.is_dir, Path(folder).parents))) for folder in folders - {os.sep}}
    numbers = {folder: stamp(Path(folder)) for folder in folders | above}
    return {folder: number[2] for folder, number in numbers.items() if number is not None}


def stamp(path: Path) -> Stamp | None:
    """Return modification time, size and inode of a file; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def seen(name: str) -> tuple[str, Stamp | None]:
    """Return the real path of a file, and its stamp."""
    file = os.path.realpath(name)
    return file, stamp(Path(file))


def holds(top: str, changed: Iterable[str]) -> bool:
    """Whether a saved file is this file, or lies in this folder."""
    whole = os.path.realpath(top)
    return any(path == whole or path.startswith(f"{whole}{os.sep}") for path in changed)


# A finding, behind its file and fingerprint, by which it is recognised in another report.
_Known = tuple[tuple[str, str], Finding]


class ReportChanges(Struct, frozen=True):
    """The findings that a save changed; `unknown` are those of files that cannot be read now."""

    new: tuple[Finding, ...]
    changed: tuple[Finding, ...]
    repaired: tuple[Finding, ...]
    unknown: tuple[Finding, ...] = ()


def changes_between(before: Report, after: Report) -> ReportChanges:
    """Compare two reports as a baseline does; a finding that only moved is unchanged.

    A finding of one rule at one place that says something else now is changed. Of a file that
    cannot be read nothing is known: its findings are neither repaired nor left.
    """
    unread = {result.path for result in after.results if result.verdict == "unreadable"}
    old, unknown = list[_Known](), list[Finding]()
    for key, finding in _known(before):
        if key[0] in unread and finding.unopened != "stage":
            unknown.append(finding)
        else:
            old.append((key, finding))
    new = list(_known(after))
    added, repaired = _surplus(new, old), _surplus(old, new)
    changed = []
    for reported in list(added):
        twin = next((other for other in repaired if other[0] == reported[0]), None)
        if twin is not None:
            added.remove(reported)
            repaired.remove(twin)
            changed.append(reported)
    return ReportChanges(
        tuple(finding for _, finding in added),
        tuple(finding for _, finding in changed),
        tuple(finding for _, finding in repaired),
        tuple(unknown),
    )


def _known(report: Report) -> Iterator[_Known]:
    """Yield every finding with what a baseline recognises it by."""
    for entry, text in fingerprinted(report):
        yield (entry.path, text.partition(":")[0]), entry.finding


def _surplus(reported: Iterable[_Known], others: Iterable[_Known]) -> list[_Known]:
    """Return as many findings as one report has more than the other, of each place and message."""
    left = Counter((key, finding.message) for key, finding in others)
    more = []
    for key, finding in reported:
        left[key, finding.message] -= 1
        if left[key, finding.message] < 0:
            more.append((key, finding))
    return more


def change_lines(saved: str, news: ReportChanges, after: Report) -> Iterator[str]:
    """Yield when which file was saved and what that changed in figures; then finding by finding."""
    left = Counter(entry.finding.severity for entry in entries(after))
    figures = [f"{count} {name}{'s' * (count != 1)}" for name, count in left.items()]
    changed = f", {len(news.changed)} changed" if news.changed else ""
    counts = f"{len(news.repaired)} repaired, {len(news.new)} new{changed}"
    if news.unknown:
        counts += f", {len(news.unknown)} unknown until it can be read"
    yield printable(f"{time_of_day()}  {saved}: {counts}; {', '.join(figures) or 'nothing'} left")
    listed = (("new", news.new), ("changed", news.changed), ("repaired", news.repaired))
    for word, findings in listed:
        for finding in findings:
            yield printable(
                f"  {word:<9} {finding.severity} {finding.rule} {site(finding)}: {finding.message}"
            )


def time_of_day() -> str:
    """Return the time of day."""
    return time.strftime("%H:%M:%S")


PATIENCE = 0.5  # seconds in which a file that is gone or cannot be read may still be written
_PAUSE = 0.01
# A binary stage is read, not mapped: mapped pages of a file that is cut short end the process.
# For text see `text_in_memory`.
_ENVIRONMENT = {"USDC_USE_ASSET": "1", "TF_ENV_SETTING_ALERTS_ENABLED": "0"}


class Watched(NamedTuple):
    """The stages and folders that are judged again, and how.

    `shared` are the files and folders that all of them are judged with; `renew` is called when
    one of these was saved.
    """

    names: Callable[[], list[str]]
    judge: Callable[[str], Report]
    render: Callable[[Report], str]
    shared: tuple[str, ...] = ()
    renew: Callable[[], object] = tuple


def prepare(options: ReportOptions) -> None:
    """Set what usd-core reads when it is imported.

    Raises:
        UsageError: the library for events of files is not installed, or a baseline is to be
            written again and again.
    """
    if options.write_baseline is not None:
        raise UsageError(
            "--watch and --write-baseline do not go together: write the baseline first"
        )
    try:
        import watchfiles  # noqa: F401 - an extra
    except ImportError as error:
        raise UsageError(f"--watch needs the extra watch: {install_command('watch')}") from error
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)


def watch(paths: Iterable[str], watched: Watched, options: ReportOptions) -> int:
    """Judge, report, and do both again after each save; return the exit code after Ctrl-C."""
    from lab3_usd.stage.read.watched_files import text_in_memory

    given = [*paths, *watched.shared]
    session = _Session(watched, options)
    with text_in_memory():
        try:
            session.judge_all()
            while True:
                session.judge_until_folders_change(given)
        except KeyboardInterrupt:
            pass
        finally:
            session.close()
    return 0


class _Session:
    """The report of each watched path, and the files that it depends on."""

    def __init__(self, watched: Watched, options: ReportOptions) -> None:
        self._watched = watched
        self._options = options
        self._reports: dict[str, Report] = {}
        self._read: dict[str, StageResult] = {}  # the last result of each stage that could be read
        self._files: dict[str, frozenset[str]] = {}
        self._seen: dict[str, tuple[str, Stamp | None]] = {}  # the stages as they were judged
        self._version = 0
        self._shared_files = self._used_by_shared()

    def judge_all(self) -> None:
        """Judge everything that there is."""
        names = self._watched.names()
        for name in names:
            self._judge(name)
        self._show([f"{time_of_day()}  watching, Ctrl-C ends"])

    def judge_until_folders_change(self, given: Iterable[str]) -> None:
        """Judge saved files until the set of watched folders changes."""
        watched = self._folders(given)
        for changed in saves(watched):
            stages = changed
            if not changed:  # what was saved before watching began
                now = ((seen(name), then) for name, then in self._seen.items())
                stages = frozenset(
                    file for (file, saved), then in now if saved and (file, saved) != then
                )
            self.judge_changed(stages)
            if self._folders(given) != watched:
                break
        self.judge_changed(frozenset())

    def _folders(self, given: Iterable[str]) -> dict[str, int]:
        used = (file for files in self._files.values() for file in files)
        return folders_of([*given, *used, *self._shared_files])

    def _used_by_shared(self) -> frozenset[str]:
        """Return the layers of the stages that all are judged with, of the starter."""
        from lab3_usd.stage.read.watched_files import used_files

        files = (Path(path) for path in self._watched.shared if not Path(path).is_dir())
        return frozenset().union(*map(used_files, files))

    def judge_changed(self, changed: frozenset[str]) -> None:
        """Judge what depends on the files that were saved, and not judged in the meantime."""
        changed -= {then[0] for name, then in self._seen.items() if seen(name) == then}
        tops = self._watched.shared
        is_shared = bool(changed & self._shared_files) or any(holds(top, changed) for top in tops)
        if is_shared:
            self._watched.renew()
        _forget(changed)
        if is_shared:
            self._shared_files |= self._used_by_shared()  # a damaged layer counts on
        names = self._names()
        touched = [
            name
            for name in names
            if is_shared
            or name not in self._reports
            or changed & self._files[name]
            or holds(name, changed)
        ]
        gone = self._reports.keys() - set(names)
        if not touched and not gone:
            return
        before = self._whole_as_read()
        for name in gone:
            del self._reports[name]
        try:
            for name in touched:
                self._judge(name)
        except Lab3Error as error:  # of the starter; the reports stay as they were
            click.echo(f"{time_of_day()}  {error}", err=True)
            return
        saved = ", ".join(touched or sorted(gone))
        after = self._whole()
        self._show(change_lines(saved, changes_between(before, after), after))

    def _names(self) -> list[str]:
        """Return what there is to judge; a file that is gone may be about to come back."""
        until = time.monotonic() + PATIENCE
        while True:
            try:
                names = self._watched.names()
            except Lab3Error:  # a file that is being saved under a name of its own
                names = [name for name in self._reports if Path(name).exists()]
            if self._reports.keys() <= set(names) or time.monotonic() > until:
                return names
            time.sleep(_PAUSE)

    def close(self) -> None:
        """Replace the live page with a plain report."""
        if self._page is not None and self._version:
            page = self._watched.render(self._whole())
            hooks.end_live_page(page, self._page)

    @property
    def _page(self) -> Path | None:
        """Return the file of the live page; None where the report is another one."""
        output = self._options.output
        return Path(output) if self._options.form == "html" and output is not None else None

    def _judge(self, name: str) -> None:
        from lab3_usd.stage.read.watched_files import may_be_whole

        path = Path(name)
        until = time.monotonic() + PATIENCE
        while True:
            before, is_over = seen(name), time.monotonic() > until
            report = None
            if is_over or path.is_dir() or may_be_whole(path):
                report = self._judged_once(name, is_over=is_over)
            is_whole = report is not None and (
                is_over or all(result.verdict != "unreadable" for result in report.results)
            )
            if report is not None and is_whole and seen(name) == before:
                self._reports[name] = report
                self._read |= {
                    result.path: result
                    for result in report.results
                    if result.verdict != "unreadable"
                }
                self._seen[name] = before
                return
            time.sleep(_PAUSE)
            _forget([str(path.resolve())])

    def _judged_once(self, name: str, *, is_over: bool) -> Report | None:
        """Return the report of a stage or folder; None while the starter is being written."""
        from lab3_usd.stage.read.opening import kept_open
        from lab3_usd.stage.read.watched_files import used_files

        path = Path(name)
        try:
            with kept_open():
                report = self._watched.judge(name)
                self._files[name] = frozenset() if path.is_dir() else used_files(path)
        except Lab3Error:
            if is_over:
                raise
            return None
        return report

    def _whole(self) -> Report:
        reports = self._reports.values()
        return Report(
            tuple(result for report in reports for result in report.results),
            tuple(submission for report in reports for submission in report.submissions),
            dry_runs={path: run for report in reports for path, run in report.dry_runs.items()},
        )

    def _whole_as_read(self) -> Report:
        """Return the whole report, with what was last found in files that cannot be read now."""
        whole, results = self._whole(), list[StageResult]()
        for result in whole.results:
            earlier = self._read.get(result.path)
            if earlier is not None and result.verdict == "unreadable":
                result = replace(result, findings=(*result.findings, *earlier.findings))  # noqa: PLW2901
            results.append(result)
        return replace(whole, results=tuple(results))

    def _show(self, lines: Iterable[str]) -> None:
        """Show what is new first, then the report."""
        page = self._page
        output, form = self._options.output, self._options.form
        if output is None and form == "text" and understands_ansi(sys.stdout):
            click.clear()
        text = self._watched.render(self._whole())
        if page is not None:
            hooks.write_live_page(text, page, self._version + 1)
        elif output is not None:
            write_report(text, output)
        self._version += 1  # a page that was refused is another's, and stays
        is_data = output is None and form != "text"
        click.echo("\n".join(lines), err=is_data)
        if output is None:
            click.echo("", err=is_data)
            write_report(text, None)


def _forget(paths: Iterable[str]) -> None:
    from lab3_usd.stage.read.watched_files import forget_files

    forget_files(paths)
