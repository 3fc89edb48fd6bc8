"""`lab3` as a test invokes it: what the command raises, the test gets to see."""

from __future__ import annotations

from click.testing import CliRunner, Result

from lab3_usd import cli


def invoke(*arguments: object) -> Result:
    """Run `lab3` with these arguments; only an exit becomes an exit code.

    `CliRunner` alone answers a crash with exit code 1, as if there were findings.
    """
    words = [str(argument) for argument in arguments]
    return CliRunner().invoke(cli.lab3, words, prog_name="lab3", catch_exceptions=False)
