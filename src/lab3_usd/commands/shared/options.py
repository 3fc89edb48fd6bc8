"""Options that several commands share, each group of them a record that a command gets."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click
from click.core import ParameterSource
from msgspec import Struct

from lab3_usd.commands.shared.paths import (
    AssetFolder,
    Input,
    OutputAlone,
    OutputBaseline,
    OutputFile,
    OutputFolder,
    refuse_inputs,
)
from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from lab3_usd.report.options import Source

_Command = Callable[..., Any]
Option = Callable[[_Command], _Command]


def all_of(*options: Option) -> Option:
    """Return several options as one, which adds them in this order."""

    def add(command: _Command) -> _Command:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def recorded(name: str, kind: type[Struct]) -> Option:
    """Hand the options that a record has as fields to the command as one, under a name."""
    return made_of(name, kind.__struct_fields__, kind)


def made_of(name: str, fields: Collection[str], make: Callable[..., object]) -> Option:
    """Hand what is made of some options to the command in their place, under a name."""

    def add(command: _Command) -> _Command:
        @wraps(command)
        def call(**parameters: Any) -> Any:
            values = {field: parameters.pop(field) for field in fields}
            return command(**parameters, **{name: make(**values)})

        return call

    return add


def named_options(options: Struct, *names: str) -> dict[str, object]:
    """Return some of the options of a record, by what they are called on the command line."""
    return {f"--{name.replace('_', '-')}": getattr(options, name) for name in names}


def refuse_options(given: Mapping[str, object], why: str) -> None:
    """Refuse options, by their names, that are set where they have no meaning.

    Raises:
        UsageError: one is set.
    """
    for option, value in given.items():
        if value:
            raise UsageError(f"{option} {why}")


def complete_rules(
    _context: click.Context, _param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the ids of rules, behind the last comma."""
    from click.shell_completion import CompletionItem

    from lab3_usd.check.registry import all_rules

    before, comma, typed = incomplete.rpartition(",")
    return [
        CompletionItem(f"{before}{comma}{rule.id}", help=rule.name)
        for rule in all_rules().values()
        if rule.id.startswith(typed.upper())
    ]


def complete_checkpoints(
    _context: click.Context, _param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the checkpoints of the lab."""
    from lab3_usd.spec.load.loader import load_lab

    checkpoints = load_lab().checkpoints.items()
    return _offered({number: point.title for number, point in checkpoints}, incomplete)


def complete_formats(
    _context: click.Context, _param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the formats of reports."""
    from lab3_usd.report.formats.registry import all_formats

    return _offered({name: form.purpose for name, form in all_formats().items()}, incomplete)


def complete_releases(
    _context: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the releases of Isaac Sim, newest first; a stage may say where it comes from."""
    from lab3_usd.pipeline.any_stage import AUTO, lint_platform

    texts = {name: f"Isaac Sim {name}" for name in reversed(lint_platform().known_releases)}
    if "--from" in param.opts:
        texts[AUTO] = "as the stage says"
    return _offered(texts, incomplete)


def _offered(texts: Mapping[str, str], incomplete: str) -> list[CompletionItem]:
    """Return the values that begin as what was typed, each with its text."""
    from click.shell_completion import CompletionItem

    named = (item for item in texts.items() if item[0].startswith(incomplete))
    return [CompletionItem(value, help=text) for value, text in named]


def checkpoint_option(text: str = "Check for this checkpoint.") -> Option:
    """Return the option that names a checkpoint of the lab."""
    return click.option(
        "--checkpoint", metavar="NN", shell_complete=complete_checkpoints, help=text
    )


def release_option(option: str, name: str, text: str) -> Option:
    """Return an option that names a release of Isaac Sim."""
    return click.option(
        option, name, metavar="RELEASE", shell_complete=complete_releases, help=text
    )


isaac_option = release_option(
    "--isaac",
    "release",
    "Use the types, ports and defaults of this release of Isaac Sim, such as 5.1.",
)
from_option = release_option(
    "--from",
    "moved_from",
    "Also report what differs in this release, from which the stage comes; auto finds it.",
)


def file_option(*names: str, text: str) -> Option:
    """Return an option that names a file to read."""
    return click.option(*names, type=Input(path_type=Path), metavar="FILE", help=text)


class FiniteRange(click.FloatRange):
    """A range of numbers; `nan` lies in none, which click's own ranges accept."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a number of the range."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not a number", param, ctx)
        return number


rules_options = all_of(
    click.option(
        "--select",
        multiple=True,
        metavar="RULES",
        shell_complete=complete_rules,
        help="Only these rules (W01) or families (W).",
    ),
    click.option(
        "--ignore",
        multiple=True,
        metavar="RULES",
        shell_complete=complete_rules,
        help="Not these rules or families.",
    ),
)


class ReportOptions(Struct, frozen=True):
    """In which form findings are reported, where, and which of them count."""

    form: str
    output: str | None
    fail_on: str
    exit_zero: bool
    baseline: Path | None
    write_baseline: Path | None


report_options = all_of(
    click.option(
        "--format",
        "form",
        default="text",
        metavar="NAME",
        shell_complete=complete_formats,
        show_default=True,
        help="Format: text, json, sarif, ... (a wrong name lists them all).",
    ),
    click.option("--output", "-o", type=OutputFile(), help="Write the report to this file."),
    rules_options,
    click.option(
        "--fail-on",
        type=click.Choice(["error", "warning"]),
        default="error",
        show_default=True,
        help="Exit 1 from this severity on.",
    ),
    click.option("--exit-zero", is_flag=True, help="Exit 0 regardless of findings."),
    file_option("--baseline", text="Hide the findings in this file."),
    click.option(
        "--write-baseline",
        type=OutputBaseline(path_type=Path),
        metavar="FILE",
        help="Write all findings to this file, for --baseline.",
    ),
    recorded("report", ReportOptions),
)


native_option = click.option(
    "--native", is_flag=True, help="Also run the validators that come with OpenUSD (rules UV)."
)


scene_option = click.option(
    "--stage",
    "scene",
    type=Input(exists=True, dir_okay=False),
    metavar="STAGE",
    help="The stage that scripts load; their graphs are checked on it.",
)


assets_option = click.option(
    "--assets",
    multiple=True,
    type=AssetFolder(),
    metavar="URL=FOLDER",
    help="Folder with the assets of a server; may be repeated.",
)


def _set_color(context: click.Context, _option: click.Parameter, when: str) -> None:
    context.color = {"auto": None, "always": True, "never": False}[when]


color_option: Option = click.option(
    "--color",
    type=click.Choice(["auto", "always", "never"]),
    default="auto",
    show_default=True,
    expose_value=False,
    callback=_set_color,
    help="Colour the text; auto: on a terminal, subject to NO_COLOR and FORCE_COLOR.",
)


class ViewOptions(Struct, frozen=True):
    """How many judge at once, and how much is shown."""

    jobs: int
    watch: bool
    quiet: bool
    verbose: bool
    each: bool
    source: Source
    statistics: bool
    last_failed: str | None


view_options = all_of(
    click.option(
        "--jobs",
        "-j",
        type=click.IntRange(1, 256),
        default=1,
        metavar="N",
        show_default=True,
        help="Check N files or submissions at once, each in its own process.",
    ),
    click.option(
        "--watch", is_flag=True, help="Check again after each save, until Ctrl-C (extra watch)."
    ),
    click.option("--quiet", "-q", is_flag=True, help="Only the summary lines."),
    click.option("--verbose", "-v", is_flag=True, help="Also why each rule matters."),
    click.option("--each", is_flag=True, help="Report a folder file by file, not fault by fault."),
    click.option(
        "--source",
        type=click.Choice(["auto", "always", "never"]),
        default="auto",
        show_default=True,
        help="Show the lines of the file at fault; auto: for a single stage.",
    ),
    click.option("--statistics", is_flag=True, help="Count the faults by rule."),
    click.option(
        "--last-failed",
        type=Input(),
        metavar="REPORT",
        help="Leave out what passed in this report, which --format json wrote.",
    ),
    color_option,
    recorded("view", ViewOptions),
)


class _TextOrJson(click.Choice[str]):
    """Text or JSON; who asks for a page is told how a command writes one, if it does."""

    def __init__(self) -> None:
        super().__init__(["text", "json"])

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        has_page = ctx is not None and any("--page" in each.opts for each in ctx.command.params)
        if value == "html" and has_page:
            self.fail("--page FILE writes an HTML page", param, ctx)
        return super().convert(value, param, ctx)


text_or_json: Option = click.option(
    "--format",
    "form",
    type=_TextOrJson(),
    default="text",
    show_default=True,
    help="Format of the report.",
)


def written_file(name: str, what: str) -> Option:
    """Return the options of a command that writes one file: where, and whether it replaces one."""
    kind = OutputAlone(path_type=Path, dir_okay=False)
    return all_of(
        click.option("--output", "-o", name, required=True, type=kind, help=what),
        click.option("--force", is_flag=True, help="Replace a file that exists."),
    )


def written_folder(what: str, files: str = "files") -> Option:
    """Return the options of a command that writes files: in which folder, and the same."""
    kind = OutputFolder(path_type=Path)
    return all_of(
        click.option("--output", "-o", "folder", required=True, type=kind, help=what),
        click.option("--force", is_flag=True, help=f"Replace {files} that exist."),
    )


def write_into(
    folder: Path, files: Mapping[Path, bytes], *, force: bool, err: bool = False
) -> None:
    """Write all files of a folder, which is made if there is none, or none; print their paths.

    Raises:
        UsageError: one is read by the call, exists and `force` is not set, or cannot be written.
    """
    from lab3_usd.files import make_folder, refuse_existing, write_whole

    refuse_inputs(files)
    for path in files:
        refuse_existing(path, force=force)
    make_folder(folder)
    for path, content in files.items():
        write_whole(path, content, force=force)
        echo(path, err=err)


def split_rules(values: Iterable[str]) -> tuple[str, ...]:
    """Return rule ids and families out of repeated, comma-separated options, in capitals.

    Raises:
        UsageError: there is no such rule or family; left out, it would hide every fault.
    """
    parts = [part for value in values for part in value.split(",") if part.strip()]
    if not parts:
        return ()
    from lab3_usd.check.registry import check_rule_names

    return check_rule_names(parts)


def wants_color() -> bool:
    """Whether text is coloured: as --color says, else the environment, else the terminal.

    NO_COLOR counts before FORCE_COLOR, as in Python itself (no-color.org, force-color.org).
    """
    context = click.get_current_context(silent=True)
    if context is not None and context.color is not None:
        return context.color
    if os.environ.get("NO_COLOR"):
        return False
    return bool(os.environ.get("FORCE_COLOR")) or understands_ansi(sys.stdout)


def understands_ansi(stream: TextIO) -> bool:
    """Whether a stream is a terminal that obeys escape sequences.

    The classic console of Windows does where click writes to it, which has colorama for that.
    """
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def width() -> int:
    """Return the columns that the environment names, else those of the terminal, else 100.

    They are 40 at least. shutil tells them as well, and takes longer to import than a report to
    write.
    """
    named = os.environ.get("COLUMNS", "")
    if named.isdecimal() and int(named):
        return max(int(named), _NARROWEST)
    try:
        return max(os.get_terminal_size(sys.stdout.fileno()).columns or _COLUMNS, _NARROWEST)
    except (OSError, ValueError):  # it is none, is closed, or stands for a file
        return _COLUMNS


_COLUMNS, _NARROWEST = 100, 40


def terminal_width() -> int:
    """Return the columns of the terminal, unlimited if the output goes to a program."""
    import sys

    return width() if sys.stdout.isatty() else sys.maxsize


def echo(text: object, *, err: bool = False) -> None:
    """Print a line, with escapes for characters of names that do not print."""
    from lab3_usd.report.safe_text import visible

    click.echo(visible(str(text)), err=err)


def echo_folded(line: str) -> None:
    """Print a line, folded in a terminal: what goes on is indented below its start."""
    from lab3_usd.report.safe_text import folded

    columns, indent = terminal_width(), line[: len(line) - len(line.lstrip())]
    lines = folded(line.lstrip(), columns, indent, f"{indent}    ")
    click.echo("\n".join(lines))


def lab_words(context: click.Context) -> tuple[str, ...]:
    """Return the words that name the lab on the command line, which a printed command repeats."""
    return ("--lab", context.meta[LAB_VARIABLE]) if LAB_VARIABLE in context.meta else ()


def given_words(context: click.Context, names: Collection[str] | None = None) -> Iterator[str]:
    """Yield the options of the command line again, as words; of `names`, or all."""
    for option in context.command.params:
        name = option.name or ""
        is_given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        is_wanted = names is None or name in names
        if not (is_given and is_wanted and isinstance(option, click.Option)):
            continue
        value = context.params[name]
        for text in value if option.multiple else (value,):
            yield from option.opts[:1] if option.is_flag else (option.opts[0], str(text))
