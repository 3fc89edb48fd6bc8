"""`lab3 grade`: grade a class, each submission in isolation."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from msgspec import Struct

from lab3_usd.commands.shared.configuration import asset_places
from lab3_usd.commands.shared.options import (
    assets_option,
    echo_folded,
    file_option,
    given_words,
    lab_words,
    named_options,
    recorded,
    refuse_options,
    understands_ansi,
)
from lab3_usd.commands.shared.paths import (
    ChangedFolder,
    Input,
    MapInput,
    OutputFolder,
    refuse_inputs,
    refuse_missing_folder,
)
from lab3_usd.data import program
from lab3_usd.errors import EXIT_CRASH, UsageError
from lab3_usd.features.grade.grading import (
    ExportOptions,
    bound_options,
    check_export,
    export_options,
)

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from lab3_usd.grade.class_run import ClassSettings
    from lab3_usd.grade.gradebook import Row, Rows
    from lab3_usd.grade.intake.submission_copy import Limits


class ClassOptions(Struct, frozen=True):
    """What is graded with what, by how many, and where the results go.

    `explain` names a student of a gradebook, `regrade` a gradebook whose points count again.
    """

    starter: Path | None
    out: Path | None
    form: str | None
    rubric: Path | None
    jobs: int | None
    assets: tuple[str, ...]
    maps: Path | None
    resume: bool
    force: bool
    merge_uploads: bool
    explain: str | None
    regrade: Path | None
    adjust: Path | None
    late: Path | None
    cluster: str | None
    insecure_cluster: bool

    @property
    def book(self) -> Path:
        """The folder of the gradebook."""
        return self.out or self.regrade or Path()


def _refuse_empty(
    context: click.Context, parameter: click.Parameter, submissions: str | None
) -> str | None:
    """Refuse the empty name, which stands for the current folder and is never meant."""
    if submissions is not None and not submissions.strip():
        raise click.BadParameter(
            "give a folder, an archive or an address; '.' is the current folder", context, parameter
        )
    return submissions


def _complete_students(
    context: click.Context, _parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the students of the gradebook that -o names."""
    from click.shell_completion import CompletionItem

    from lab3_usd.grade.gradebook import read_gradebook

    try:
        rows = read_gradebook(Path(context.params.get("out") or ""))["students"]
    except UsageError:
        return []
    return [
        CompletionItem(row["student"], help=row["name"] or row["status"])
        for row in rows
        if row["student"].startswith(incomplete)
    ]


@click.command("grade")
@click.argument("submissions", callback=_refuse_empty, required=False, type=Input(readable=False))
@file_option(
    "--starter",
    text="The supplied starter: stages are compared with it, and may refer to its files.",
)
@click.option(
    "--output",
    "-o",
    "out",
    type=OutputFolder(path_type=Path),
    metavar="PATH",
    help="Folder for the gradebook, new or empty except with --resume; with --format, a file.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["gradescope"]),
    help="Grade one submission, and write its result instead of a gradebook.",
)
@file_option(
    "--rubric",
    text="Rubric with the points; by default the gradebook's, else the handout's check-off list.",
)
@click.option(
    "--jobs",
    "-j",
    type=click.IntRange(1, 256),
    metavar="N",
    help="Worker processes; by default the number of processors.",
)
@bound_options
@assets_option
@click.option(
    "--maps",
    type=MapInput(path_type=Path),
    metavar="PATH",
    help="The supplied map, its YAML or folder: maps are compared with it, missing ones replaced.",
)
@click.option("--resume", is_flag=True, help="Continue a gradebook; keep its finished results.")
@click.option("--force", is_flag=True, help="Remove the lock of a run that was killed.")
@click.option(
    "--merge-uploads",
    is_flag=True,
    help="Complete a student's last upload with files of the earlier ones.",
)
@click.option(
    "--explain",
    metavar="STUDENT",
    shell_complete=_complete_students,
    help="Print all points of one student of the gradebook -o.",
)
@click.option(
    "--regrade",
    type=ChangedFolder(path_type=Path),
    metavar="FOLDER",
    help="Count the points of this gradebook again by --rubric, without submissions.",
)
@file_option(
    "--adjust",
    text="Table of student, item, points and text: what you decide by hand.",
)
@file_option(
    "--late",
    text="Table of student and days, or student, submitted and deadline.",
)
@export_options
@click.option(
    "--cluster", metavar="ADDRESS", help="Dask scheduler whose workers grade: tls://host:port."
)
@click.option("--insecure-cluster", is_flag=True, help="Accept a public scheduler without TLS.")
@recorded("asked", ClassOptions)
def command(
    submissions: str | None, asked: ClassOptions, limits: Limits, export: ExportOptions
) -> None:
    """Grade a class: a folder for each student, archives, or single stages.

    SUBMISSIONS is a folder or an archive in the form that a learning platform exports, or the
    address of a folder in object storage. The gradebook has grades.csv, grades.json, index.html and
    a report folder for each student. With --format gradescope, SUBMISSIONS is one submission, and
    the result for a Gradescope autograder is written.

    Exit code: 0 every submission has a grade or a status, 2 wrong usage or rubric, 3 the program
    itself failed, 130 Ctrl-C or 143 SIGTERM: continue with --resume.

    With --explain, --regrade or --gradebook alone, an existing gradebook is read.
    """
    _check(submissions, asked, export)
    if asked.form is not None:
        _grade_alone(Path(str(submissions)), asked, limits)
        return
    if asked.regrade is not None:
        _regrade(asked.regrade, asked, export)
    if submissions is not None and asked.starter is not None:
        _grade(submissions, asked.starter, asked, limits, export)
    if export.gradebook is not None and export.roster is not None:
        _fill_export(export.gradebook, export.roster, asked, export)
    if asked.explain is not None:
        _explain(asked.book, asked.explain)


def _check(submissions: str | None, asked: ClassOptions, export: ExportOptions) -> None:
    """Refuse what is missing, or does not go together, before anything is read.

    Raises:
        UsageError: it does not go together.
    """
    reading = named_options(export, "gradebook") | named_options(asked, "regrade", "explain")
    afterwards = [option for option, value in reading.items() if value is not None]
    if asked.form is not None and afterwards:
        raise UsageError(f"{afterwards[0]} is for a class; --format grades one submission")
    check_export(export)
    for option, table in named_options(asked, "adjust", "late").items():
        if table and submissions is None and asked.regrade is None:
            raise UsageError(f"{option} goes with SUBMISSIONS or --regrade, which count the points")
    if submissions is None and not afterwards:
        raise click.MissingParameter(param_type="argument", param_hint="'SUBMISSIONS'")
    if asked.explain is not None and (submissions is not None or asked.regrade is not None):
        raise UsageError("--explain only reads a gradebook: give it with -o alone, after grading")
    if submissions is not None and asked.regrade is not None:
        raise UsageError("--regrade reads a gradebook, and no submissions")
    if submissions is not None and asked.starter is None:
        raise click.MissingParameter(param_type="option", param_hint="'--starter'")
    if asked.out is None and asked.regrade is None and asked.form is None:
        raise click.UsageError("Missing option '--output' / '-o'.", click.get_current_context())
    _check_tables(asked)
    if export.preview and (submissions is not None or asked.regrade is not None):
        raise UsageError("--preview writes nothing: grade first, then give it with --gradebook")


def _check_tables(asked: ClassOptions) -> None:
    """Refuse a gradebook, or a result, whose files would replace what is read.

    Raises:
        UsageError: they would, or a result has no folder to lie in.
    """
    out = asked.out or asked.regrade
    if out is None:
        return
    if asked.form is not None:
        refuse_missing_folder(out)
        refuse_inputs([out])
        return
    from lab3_usd.grade.gradebook import TABLES

    refuse_inputs(out / name for name in TABLES)


def _fill_export(platform: str, roster: Path, asked: ClassOptions, options: ExportOptions) -> None:
    """Fill the points into a platform's export, and show what becomes of each row."""
    from lab3_usd.grade.feedback import reasons_by_student, write_feedback
    from lab3_usd.grade.filled_export import decision_lines, fill_export, write_export
    from lab3_usd.grade.gradebook import read_gradebook
    from lab3_usd.report.entries import plural
    from lab3_usd.report.safe_text import visible

    out = asked.book
    book = read_gradebook(out)
    export = fill_export(
        platform,
        roster,
        book,
        options.column,
        options.map,
        reasons_by_student(book) if options.feedback else None,
        scale=options.scale,
    )
    path = out / export.name
    if options.preview:
        click.echo(f"{path}: not written (--preview)")
    else:
        click.echo(write_export(out, export, force=asked.force))
        for returned in write_feedback(out, export, book) if options.feedback else ():
            click.echo(f"{returned.path}: {plural(returned.students, 'student')}")
            for name in returned.left_out:
                click.echo(f"    left out: {visible(name)}")
    for text in decision_lines(export):
        click.echo(text)


def _explain(out: Path, student: str) -> None:
    """Print the sum of one student."""
    from lab3_usd.grade.gradebook import read_gradebook
    from lab3_usd.grade.regrade import student_in, sum_of
    from lab3_usd.report.safe_text import printable

    book = read_gradebook(out)
    for text in sum_of(book, student_in(book, student)):
        echo_folded(printable(text))


def _tell_exports(out: Path, now: ExportOptions) -> None:
    """Name the filled exports with points of before, except those that this call fills in again."""
    from lab3_usd.grade.gradebook import exports_in

    for path in exports_in(out):
        platform, _, is_feedback = path.stem.partition("-")
        if platform != now.gradebook or (is_feedback and not now.feedback):
            again = f"--gradebook {platform}{' --feedback' if is_feedback else ''}"
            _notify(f"{path}: has the points of before; fill it in again with {again}")


def _regrade(out: Path, asked: ClassOptions, export: ExportOptions) -> None:
    """Give a gradebook the points of a rubric, and say who changed."""
    from lab3_usd.grade.adjustments import Tables
    from lab3_usd.grade.regrade import regrade
    from lab3_usd.report.safe_text import printable
    from lab3_usd.spec.load.loader import load_lab

    by_hand = Tables(asked.adjust, asked.late)
    regraded = regrade(out, asked.rubric, load_lab(), by_hand, force=asked.force)
    for grade in regraded.changed:
        click.echo(printable(grade.text))
    for line in regraded.dropped:
        _notify(printable(line))
    if regraded.changed:
        _tell_exports(out, export)
    click.echo(f"{regraded.counts}: {out / 'index.html'}")


def _grade(
    submissions: str,
    starter: Path,
    asked: ClassOptions,
    limits: Limits,
    export: ExportOptions,
) -> None:
    """Grade a class into a gradebook."""
    from lab3_usd.grade.adjustments import Tables
    from lab3_usd.grade.class_run import ClassSettings
    from lab3_usd.grade.intake.addresses import is_address
    from lab3_usd.report.entries import plural

    settings = ClassSettings(
        submissions=submissions if is_address(submissions) else Path(submissions),
        starter=starter,
        out=asked.book,
        rubric=asked.rubric,
        by_hand=Tables(asked.adjust, asked.late),
        maps=asked.maps,
        limits=limits,
        jobs=asked.jobs or _processors(),
        resume=asked.resume,
        assets=asset_places(asked.assets),
        merge_uploads=asked.merge_uploads,
        force=asked.force,
        runner=_runner(asked.cluster, insecure=asked.insecure_cluster),
        notify=_notify,
    )
    rows = _graded_or_continued(settings)
    counts = Counter(row["status"] for row in rows)
    states = ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))
    submissions_graded = plural(counts.total(), "submission")
    click.echo(f"{submissions_graded} ({states}): {asked.book / 'index.html'}")
    _tell_failures(rows)
    _tell_exports(asked.book, export)
    if counts["tool failed"]:
        sys.exit(EXIT_CRASH)


def _graded_or_continued(settings: ClassSettings) -> Rows:
    """Grade a class; if the user or the system ends it, say how to continue."""
    done = total = 0
    bar: Any = None

    def show(now: int, of: int) -> None:
        nonlocal bar, done, total
        done, total = now, of
        if bar is None and understands_ansi(sys.stderr):
            bar = click.progressbar(length=of, label="grading", show_pos=True, file=sys.stderr)
            ending.enter_context(bar)
        if bar is not None:
            bar.update(now - bar.pos)

    try:
        with ExitStack() as ending:
            from lab3_usd.grade.class_run import grade_class

            return grade_class(settings, show)
    except KeyboardInterrupt:
        far = f"{done} of {total} done" if total else "nothing is graded yet"
        _notify(f"{far}; continue with: {_command_to_continue(settings.submissions)}")
        raise


def _command_to_continue(submissions: Path | str) -> str:
    """Return this command with --resume; what is secret in an address is left out."""
    from lab3_usd.grade.intake.addresses import public_place
    from lab3_usd.grade.workers.scheduler import shown_scheduler
    from lab3_usd.installation import command_line

    context = click.get_current_context()
    names = {str(option.name) for option in context.command.params} - {"resume", "force"}
    called = (program(), *lab_words(context), "grade", public_place(submissions))
    own, cluster = list(given_words(context, names)), context.params["cluster"]
    public = [shown_scheduler(word) if word == cluster else word for word in own]
    words = command_line(*called, *public, "--resume")
    is_whole = public_place(submissions) == str(submissions) and public == own
    return words if is_whole else f"{words} (with what stood in place of ***, a secret)"


_NAMED = 5  # students


def _tell_failures(rows: Iterable[Row]) -> None:
    """Name the students over whose files the program failed: somebody is to look at these."""
    from lab3_usd.report.safe_text import printable

    failed = [row for row in rows if row["crashes"] and row["status"] != "tool failed"]
    for row in failed[:_NAMED]:
        _notify(printable(f"{row['student']} has no grade: {row['reason']}"))
    if failed[_NAMED:]:
        _notify(f"{len(failed) - _NAMED} more have no grade, see crashes in grades.json")


def _grade_alone(submission: Path, asked: ClassOptions, limits: Limits) -> None:
    """Write the Gradescope result of one submission; where the program fails there is none.

    Raises:
        UsageError: an option for a class is given, or the output lies in what is graded.
    """
    of_classes = named_options(
        asked,
        *("adjust", "late", "resume", "force", "merge_uploads"),
        *("cluster", "insecure_cluster", "jobs"),
    )
    refuse_options(of_classes, "is for a class; --format grades one submission")
    from lab3_usd.commands.shared.reporting import write_report
    from lab3_usd.deliverables.maps import supplied_map
    from lab3_usd.grade.class_run import check_apart, grade_alone
    from lab3_usd.grade.gradebook import GRADESCOPE
    from lab3_usd.grade.workers.worker_messages import PoolSettings

    out = asked.out
    if out is not None:
        check_apart(submission, out)
    settings = PoolSettings(
        asked.starter,
        asked.rubric,
        limits,
        assets=asset_places(asked.assets),
        supplied_map=None if asked.maps is None else supplied_map(asked.maps),
    )
    graded = grade_alone(submission, settings, _notify)
    if graded["crashes"]:
        click.echo(f"{program()}: {graded['reason']}", err=True)
        sys.exit(EXIT_CRASH)
    write_report(graded["reports"][GRADESCOPE], None if out is None else str(out))


def _notify(line: str) -> None:
    click.echo(f"{program()}: {line}", err=True)


def _runner(cluster: str | None, *, insecure: bool) -> Any:
    if cluster is None:
        from lab3_usd.grade.workers.pool import run_tasks

        return run_tasks
    from lab3_usd.grade.workers.cluster import cluster_runner

    return cluster_runner(cluster, _notify, insecure=insecure)


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
