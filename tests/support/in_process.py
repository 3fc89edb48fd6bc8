"""The command line run in the process of the tests, where a process of its own is not the point."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from subprocess import CompletedProcess
from unittest.mock import patch

from click.testing import CliRunner, Result

from lab3_usd import cli


def invoke(*arguments: object) -> Result:
    """Run `lab3` with these arguments; only an exit becomes an exit code.

    `CliRunner` alone answers a crash with exit code 1, as if there were findings.
    """
    words = [str(argument) for argument in arguments]
    return CliRunner().invoke(cli.lab3, words, prog_name="lab3", catch_exceptions=False)


def lab3(*arguments: object, typed: str = "lab3") -> CompletedProcess[str]:
    """Run the program with these arguments, and return its exit code and what it prints.

    `typed` is the name by which it is called.
    """
    words = [typed, *map(str, arguments)]
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="") for _ in range(2))
    status: object = 0
    with patch.object(sys, "argv", words), redirect_stdout(out), redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as leaving:
            status = leaving.code or 0
    assert isinstance(status, int)
    return CompletedProcess(words, status, _text_of(out), _text_of(err))


def _text_of(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()
