"""The command line: which commands exist, and the exit codes."""

from __future__ import annotations

import copy
import errno
import gc
import importlib
import os
import sys
from collections.abc import Callable
from io import TextIOWrapper
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import click

from lab3_usd import hooks
from lab3_usd.commands.table import EXAMPLES, FORMER, all_commands, command_named
from lab3_usd.data import LAB_VARIABLE, TEAM_VARIABLE, as_called, program, variable_set
from lab3_usd.errors import (
    EXIT_CRASH,
    EXIT_INTERRUPTED,
    EXIT_USAGE,
    EndedBySignalError,
    Lab3Error,
    NoRoomError,
    UsageError,
    failure_text,
    guess,
    is_no_room,
)

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_OUT_OF_REACH = {errno.EACCES, errno.ENAMETOOLONG}  # a path that was given, or one below it


_NO_THREAD = "can't start new thread"  # how Python says it


class LazyGroup(click.Group):
    """A group whose commands are imported when they are run."""

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """Name the commands, group by group."""
        return list(all_commands())

    def get_command(self, _ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command; None when there is no such command."""
        listed = command_named(cmd_name)
        if listed is None:
            return None
        command = _as_called(importlib.import_module(listed.module).command)
        calls = (f"  {call}" for call in listed.calls)
        command.epilog = as_called("\n".join(("\b", "Examples:", *calls)))
        return command

    def format_commands(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table, so that help imports none of them."""
        for users, commands in groupby(all_commands().items(), lambda item: item[1].users):
            with formatter.section(f"Commands for {users}"):
                formatter.write_dl([(name, command.text) for name, command in commands])

    def format_epilog(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show examples."""
        with formatter.section("Examples"):
            examples = [(as_called(line), text) for line, text in EXAMPLES.items()]
            formatter.write_dl(examples, col_max=50)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the called command; for an unknown name, suggest similar ones."""
        if args[0] == "help":  # as git and cargo have it
            args = [*args[1:2], "--help"]
            if len(args) == 1:
                click.echo(ctx.get_help())
                ctx.exit()
        name = FORMER.get(args[0], args[0])
        args = [name, *args[1:]]
        if command_named(name) is None and not name.startswith("-"):
            hint = guess(name, all_commands(), f"{program()} --help lists all")
            raise click.UsageError(f"there is no command '{name}'; {hint}")
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete the names of commands from the table, so that the Tab key imports none."""
        from click.shell_completion import CompletionItem

        named = [
            CompletionItem(name, help=command.text)
            for name, command in all_commands().items()
            if name.startswith(incomplete)
        ]
        return named + click.Command.shell_complete(self, ctx, incomplete)


def _as_called(command: click.Command) -> click.Command:
    """Return a command whose help has the name by which the program was started."""
    named = copy.copy(command)
    named.help = None if command.help is None else as_called(command.help)
    named.params = [copy.copy(param) for param in command.params]
    for param in named.params:
        if isinstance(param, click.Option) and param.help is not None:
            param.help = as_called(param.help)
    if isinstance(named, click.Group):
        named.commands = {name: _as_called(inner) for name, inner in named.commands.items()}
    else:
        named.callback = _writing_over_no_input(named.callback)
    return named


def _writing_over_no_input(call: Callable[..., Any] | None) -> Callable[..., Any] | None:
    """Return what a command does, which first looks that it would not write over what it reads."""

    def refuse_then_call(**parameters: Any) -> Any:
        from lab3_usd.commands.shared.paths import refuse_inputs_as_outputs

        refuse_inputs_as_outputs(click.get_current_context())
        return None if call is None else call(**parameters)

    return refuse_then_call


def _print_version(context: click.Context, _option: click.Parameter, asked: bool) -> None:  # noqa: FBT001
    if asked:
        from lab3_usd.report.options import tool_version

        click.echo(f"{program()}, version {tool_version()}")
        context.exit()


def _use_lab(context: click.Context, _option: click.Parameter, given: str | None) -> None:
    """Name the lab's folder in the environment, which every process of this command reads.

    A zip is unpacked to a folder that is there until the command ends.
    """
    named = os.environ.get(LAB_VARIABLE) if given is None else given
    is_zip = named is not None and named.lower().endswith(".zip") and Path(named).is_file()
    if named is None or (given is None and not is_zip):
        return
    if not is_zip and not Path(named).is_dir():
        is_there = Path(named).exists()
        fault = "is neither a folder nor a zip" if is_there else "there is no such folder or zip"
        raise UsageError(f"{named}: {fault}; --lab names one that describes a lab")
    if given is not None:
        context.meta[LAB_VARIABLE] = given
    folder = Path(named).resolve()
    context.with_resource(variable_set(LAB_VARIABLE, None))
    if is_zip:
        folder = context.with_resource(hooks.unpacked_lab(folder))
    context.with_resource(variable_set(LAB_VARIABLE, str(folder)))


def _use_team(context: click.Context, _option: click.Parameter, given: str | None) -> None:
    """Name the team in the environment until the command ends."""
    if given is None:
        return
    if not (given.isascii() and given.isalnum()):
        raise UsageError(f"--team {given}: expected letters and digits")
    context.with_resource(variable_set(TEAM_VARIABLE, given))


@click.group(
    cls=LazyGroup,
    context_settings={
        "help_option_names": ["-h", "--help"],
        # Of an option with two names one is documented.
        "token_normalize_func": lambda name: "output" if name == "out" else name,
    },
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Show the version and exit.",
)
@click.option(
    "--lab",
    type=click.Path(),
    metavar="DIR|ZIP",
    is_eager=True,
    expose_value=False,
    callback=_use_lab,
    help="The folder that describes the lab, or a zip of it, in place of the bundled one (or set "
    "LAB3_LAB).",
)
@click.option(
    "--team",
    metavar="N",
    is_eager=True,
    expose_value=False,
    callback=_use_team,
    help="The team whose values of the lab count, in place of that in the names of files (or set "
    "LAB3_TEAM).",
)
def lab3() -> None:
    """Lint, check, repair and simulate USD stages of robots, without Isaac Sim."""


def run() -> NoReturn:
    """Run the command line and exit at once, without tearing down usd-core and Python.

    Where threads are left, they are waited for as ever.
    """
    status: object = 0
    try:
        main()
    except SystemExit as leaving:
        status = leaving.code
    try:
        sys.stdout.flush()
    except OSError:  # the reader has gone, or the disk is full: nothing can be reported
        _close_output()
        status = status or EXIT_CRASH
    threading = sys.modules.get("threading")
    if not isinstance(status, int) or (threading is not None and threading.active_count() > 1):
        sys.exit(status if isinstance(status, (int, str)) else None)
    sys.stderr.flush()
    os._exit(status)


def main() -> None:
    """Run the command line; a wrong call is one line on stderr and exit code 2.

    With --format json, JSON is printed with every exit code.
    """
    gc.freeze()  # what is imported so far is no garbage
    _write_utf8()
    if os.environ.get(f"_{program().upper()}_COMPLETE", "").startswith("powershell"):
        importlib.import_module("lab3_usd.commands.completion")  # click itself does not know it
    try:
        lab3.main(prog_name=program(), standalone_mode=False)
    except click.exceptions.Abort as ended:
        by = ended.__cause__
        status = by.status if isinstance(by, EndedBySignalError) else EXIT_INTERRUPTED
        _fail("interrupted", status, "crash")
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        sys.exit(EXIT_USAGE)
    except click.UsageError as error:
        help_hint = "" if error.ctx is None else f" (see {error.ctx.command_path} --help)"
        _fail(f"{error.format_message()}{help_hint}", EXIT_USAGE, "usage")
    except NoRoomError as error:
        _fail(_one_line(error), EXIT_CRASH, "crash")
    except (Lab3Error, click.ClickException) as error:
        _fail(_one_line(error), EXIT_USAGE, "usage")
    except BrokenPipeError:
        # The reader of a pipe has gone (`lab3 check ... | head`); nothing is left to say.
        _close_output()
        sys.exit(EXIT_CRASH)
    except Exception as error:  # noqa: BLE001 - reported as what it is: our own failure
        if isinstance(error, OSError) and is_no_room(error):
            _close_output()
            _fail(f"the output cannot be written: {error.strerror}", EXIT_CRASH, "crash")
        if isinstance(error, OSError) and error.errno in _OUT_OF_REACH and error.filename:
            _fail(f"{error.filename}: {error.strerror}", EXIT_USAGE, "usage")
        if isinstance(error, RuntimeError) and str(error) == _NO_THREAD:
            line = "the system starts no more threads for this user; end other programs"
            _fail(line, EXIT_CRASH, "crash")
        _fail(f"internal error, please report it: {failure_text(error)}", EXIT_CRASH, "crash")


def _write_utf8() -> None:
    """Let both streams take any text, as the same bytes on every system.

    A pipe or file on Windows takes the code page of the country, which lacks most letters.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace", newline="\n")


def _close_output() -> None:
    """Discard all further output."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _one_line(error: Exception) -> str:
    from lab3_usd.report.safe_text import visible

    return visible(str(error))


def _fail(message: str, status: int, kind: Literal["usage", "crash"]) -> NoReturn:
    click.echo(f"{program()}: {message}", err=True)
    if _json_asked_for(sys.argv[1:]):
        from lab3_usd.report.formats.json_report import error_report
        from lab3_usd.report.safe_text import json_text

        click.echo(json_text(error_report(message, kind), 2), nl=False)
    sys.exit(status)


def _json_asked_for(arguments: list[str]) -> bool:
    """Whether a check was asked to answer in JSON, however its option was written."""
    pairs = zip(arguments, [*arguments[1:], ""], strict=True)
    return arguments[:1] == ["check"] and any(
        first == "--format=json" or (first, second) == ("--format", "json")
        for first, second in pairs
    )
