"""The program under its second name: help and messages use the name that was typed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from in_process import invoke

from lab3_usd.cli import lab3, main
from lab3_usd.commands.table import all_commands
from lab3_usd.data import PROGRAMS, program

OTHER = PROGRAMS[1]
# What a name of the program is no part of: its package, its configuration.
OWN = re.compile(r"lab3-usd|lab3\.toml|tool\.lab3")


@pytest.fixture(autouse=True)
def typed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [f"/usr/bin/{OTHER}", "chekc"])


def test_both_names_are_installed(repository: Path) -> None:
    project = (repository / "pyproject.toml").read_text()
    started = re.findall(r'^(\w+) = "lab3_usd\.__main__:start"$', project, re.MULTILINE)
    assert tuple(started) == PROGRAMS


@pytest.mark.parametrize("command", [(), *((name,) for name in all_commands()), ("lab", "new")])
def test_the_help_of_a_command_names_the_program_as_typed(command: tuple[str, ...]) -> None:
    result = CliRunner().invoke(lab3, [*command, "--help"], prog_name=program())
    assert result.output.startswith(f"Usage: {OTHER}")
    assert "lab3" not in OWN.sub("", result.output)


def test_a_message_names_the_program_as_typed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().err.startswith(f"{OTHER}: there is no command 'chekc'")


def test_a_manual_names_the_program_as_typed() -> None:
    shown = invoke("rule", "E01").stdout
    assert f"`{OTHER} collect" in shown
    assert "`lab3" not in shown


def test_another_name_of_the_script_is_that_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["/usr/bin/pytest"])
    assert program() == PROGRAMS[0]
