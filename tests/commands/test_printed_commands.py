"""Every command that an output names: it exists, has these options, and the next step runs."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from html_pages import read
from in_process import invoke as lab3
from places import REPOSITORY

from lab3_usd import cli
from lab3_usd.check.registry import all_rules

CARTER = REPOSITORY / "docs" / "examples" / "carter.usda"
LABS = REPOSITORY / "docs" / "examples" / "labs"
SOURCES = REPOSITORY / "src" / "lab3_usd"
NAMED = re.compile(r"(?:\{program\(\)\}|(?<![\w/.-])lab3) ([a-z][a-z0-9]*)((?: --?[a-z][\w-]*)*)")


def texts() -> Iterator[str]:
    """Yield what outputs are made of: the code, templates, data, and the manuals of rules."""
    for path in sorted(SOURCES.rglob("*")):
        if path.suffix in {".py", ".j2", ".js", ".yaml"}:
            yield path.read_text(encoding="utf-8")
    yield from (rule.manual for rule in all_rules().values())


def named() -> set[tuple[str, tuple[str, ...]]]:
    return {
        (found[1], tuple(found[2].split())) for text in texts() for found in NAMED.finditer(text)
    }


def options_of(name: str) -> set[str]:
    command = cli.lab3.get_command(click.Context(cli.lab3), name)
    assert command is not None, f"there is no lab3 {name}"
    inner = command.commands.values() if isinstance(command, click.Group) else [command]
    return {option for each in inner for param in each.params for option in param.opts}


def test_each_command_that_a_text_names_exists_with_its_options() -> None:
    commands = named()
    assert {name for name, _ in commands} - set(cli.all_commands()) == set()
    unknown = {
        (name, option)
        for name, options in commands
        for option in options
        if option not in {"--help", *options_of(name)}
    }
    assert unknown == set()


@pytest.mark.parametrize(
    "arguments",
    [
        ("lint",),
        ("lint", "--fix"),
        ("fix", "--lint"),
        ("fix", "--lint", "--isaac", "6.1"),
        ("lint", "--isaac", "6.1", "--ignore", "K47", "--isolated"),
        ("--lab", LABS / "jetbot", "lint"),
    ],
    ids=lambda words: " ".join(map(str, words)).replace(str(LABS), ""),
)
def test_the_command_that_a_report_ends_with_repairs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = shutil.copy(CARTER, tmp_path / "my robot.usda")
    before = path.read_bytes()
    asked = {*arguments} - {"lint", "fix", "--fix"}
    last = lab3(*arguments, path.name).stdout.splitlines()[-1]
    words = shlex.split(last.partition(": lab3 ")[2].partition(";")[0])
    assert {*map(str, asked)} <= {*words}
    again = lab3(*words)
    assert again.exit_code == 1  # some is left
    if "--in-place" not in words:
        words = shlex.split(again.stdout.splitlines()[-1].partition(": lab3 ")[2])
        assert lab3(*words).exit_code == 1
    assert path.read_bytes() != before


def test_the_commands_of_a_check_have_its_lab_and_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lab = LABS / "jetbot"
    lab3("--lab", lab, "build", "--only", "2", "--out", "work")
    (built,) = Path("work").iterdir()
    text = built.read_text(encoding="utf-8").replace('"/clock"', '"/clok"')
    Path("mine.usda").write_text(text, encoding="utf-8")
    given = ("--lab", str(lab), "check", "--checkpoint", "2")
    last = lab3(*given, "mine.usda").stdout.splitlines()[-1]
    words = shlex.split(last.partition(": lab3 ")[2])
    assert words == ["--lab", str(lab), "fix", "mine.usda", "--checkpoint", "2"]
    page = read(lab3(*given, "--format", "html", "mine.usda").stdout)
    command = page.one("p", "command").text
    assert lab3(*shlex.split(command)[1:]).exit_code == 0
    assert lab3(*given, "mine.usda").exit_code == 0
