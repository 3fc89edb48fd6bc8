"""What features add to the core: commands, formats of reports, and answers to its questions.

The core builds, checks, lints and repairs stages (see docs/architecture.md). It imports no feature,
not even inside a function. A feature is a package of `lab3_usd.features` whose `FEATURE` says what
it registers; it is imported where the core has no command, format or answer of its own.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from lab3_usd.isaac.platform import Platform
    from lab3_usd.model.finding import Report, StageResult
    from lab3_usd.model.folder import FolderFile, RecordingShown
    from lab3_usd.model.grade import GradeSummary
    from lab3_usd.pipeline.results import Results, Target
    from lab3_usd.spec.lab import Lab

FEATURES = (
    "author",
    "sim",
    "draw",
    "diff",
    "bag",
    "live",
    "server",
    "navigation",
    "collect",
    "play",
    "grade",
    "new_lab",
    "doctor",
    "html",
)

Users = Literal["any Isaac Sim stage", "students", "graders", "course authors", "this installation"]


class Command(NamedTuple):
    """A command: who uses it, what it does, calls of it; its module defines `command`."""

    users: Users
    text: str
    calls: tuple[str, ...]
    module: str


class Format(NamedTuple):
    """One output format: the module that renders it, and what it is for.

    `manual` says that the renderer quotes the rules' manuals, so that they are worth importing.
    """

    module: str
    purpose: str
    manual: bool = False
    changes: bool = False


class Feature(NamedTuple):
    """What a feature registers.

    `additions` are the modules with the options that it adds to commands of other features,
    `answers` those of the functions below that it answers; both by name.
    """

    commands: Mapping[str, Command] = {}
    formats: Mapping[str, Format] = {}
    additions: Mapping[str, str] = {}
    answers: Mapping[str, str] = {}


def features() -> Iterator[Feature]:
    """Yield what each feature registers."""
    for name in FEATURES:
        feature: Feature = importlib.import_module(f"lab3_usd.features.{name}").FEATURE
        yield feature


def added_to(command: str) -> list[Any]:
    """Return the modules with the options that features add to a command."""
    modules = (feature.additions.get(command) for feature in features())
    return [importlib.import_module(module) for module in modules if module is not None]


def _answer(name: str) -> Callable[..., Any] | None:
    """Return the function of a feature that answers a question; None where none does."""
    modules = (feature.answers.get(name) for feature in features())
    module = next(filter(None, modules), None)
    return None if module is None else getattr(importlib.import_module(module), name)


def _needed(name: str) -> Callable[..., Any]:
    """Return the function of a feature that answers a question.

    Raises:
        UsageError: none does.
    """
    answer = _answer(name)
    if answer is None:
        raise UsageError(f"this installation has no feature for it ({name})")
    return answer


def changes_to(path: Path, content: bytes) -> Iterator[str]:
    """Yield the differences between a stage and what it would hold: `fix --diff` of a binary one.

    Raises:
        StageError: one of them cannot be opened.
        UsageError: nothing can be written beside the stage, whose references the copy needs.
    """
    changes: Iterator[str] = _needed("changes_to")(path, content)
    return changes


def effects_of(stage: Any, platform: Platform) -> frozenset[str]:
    """Return what an open stage does: which nodes publish what, and what moves.

    Nothing is known of one that cannot be played.
    """
    answer = _answer("effects_of")
    return frozenset() if answer is None else answer(stage, platform)


def with_dry_run(result: StageResult) -> tuple[StageResult, object | None]:
    """Return a result with a note for each bad check of a dry run, and what a page shows of it.

    That is `check --sim`. Nothing is shown of what was not played.
    """
    played: tuple[StageResult, object | None] = _needed("with_dry_run")(result)
    return played


def read_recordings(
    root: Path,
    entries: Sequence[FolderFile],
    until: tuple[Lab, str],
    may_open: Callable[[str], str],
) -> tuple[RecordingShown, ...]:
    """Judge the recordings of a submission at the checkpoints in their names, or the last.

    `may_open` receives each before it is opened, and returns a reason not to open it.
    """
    answer = _answer("read_recordings")
    return () if answer is None else tuple(answer(root, entries, until, may_open))


def find_untrusted(path: str) -> list[Target]:
    """Return the submission at a path: `check --untrusted`.

    Raises:
        UsageError: it is neither a folder nor an archive.
    """
    targets: list[Target] = _needed("find_untrusted")(path)
    return targets


def judge_untrusted(
    entries: Sequence[Target],
    starter: Path,
    assets: Mapping[str, Path],
    notify: Callable[[str], None],
) -> Iterator[Results]:
    """Judge submissions one after the other, each in a worker and as a copy in a sandbox.

    Raises:
        SpecError: the rubric of the lab is wrong.
        StageError: the starter cannot be opened.
        UsageError: there is no such submission, or no starter to judge it with.
    """
    judged: Iterator[Results] = _needed("judge_untrusted")(entries, starter, assets, notify)
    return judged


def grade_of(report: Report, lab: Lab) -> GradeSummary | None:
    """Return the grade of what was checked: `--format gradescope`.

    Raises:
        SpecError: the rubric of the lab is wrong, or it has none.
        UsageError: there are several submissions.
    """
    grade: GradeSummary | None = _needed("grade_of")(report, lab)
    return grade


def unpacked_lab(archive: Path) -> AbstractContextManager[Path]:
    """Unpack the zip of a lab; its folder is there until the context is left: `--lab ZIP`.

    Raises:
        UsageError: it holds a program, a file that is not taken in, YAML that unfolds, or no lab.
        ArchiveError: it cannot be read, or is damaged.
        TooLargeError: it holds too many files or too much in them.
    """
    unpacked: AbstractContextManager[Path] = _needed("unpacked_lab")(archive)
    return unpacked


def write_live_page(page: str, path: Path, version: int) -> None:
    """Write a version of a page that open browsers load: `--watch --format html`.

    Raises:
        UsageError: a file beside the page, which the first version would replace, is another's.
    """
    _needed("write_live_page")(page, path, version)


def end_live_page(page: str, path: Path) -> None:
    """Replace the live page with a plain report."""
    _needed("end_live_page")(page, path)
