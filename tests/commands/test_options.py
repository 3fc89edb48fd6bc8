"""What the options of several commands take, and what they refuse."""

from __future__ import annotations

import sys
from io import StringIO
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from in_process import invoke

from lab3_usd import build_checkpoint, cli
from lab3_usd.commands.shared.options import complete_rules, split_rules, wants_color
from lab3_usd.errors import Lab3Error, UsageError


@pytest.fixture(scope="module")
def clock(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A correct checkpoint 01."""
    path = tmp_path_factory.mktemp("options") / "Lab3_01_ros_clock.usda"
    return str(build_checkpoint(None, "01", path))


def test_rules_and_families_may_be_repeated_or_joined_by_commas() -> None:
    assert split_rules(["W, p01", "s"]) == ("W", "P01", "S")


def test_rules_are_completed_behind_the_last_comma_with_their_names() -> None:
    context = click.Context(click.Command("check"))
    items = complete_rules(context, click.Argument(["rules"]), "K01,w0")
    assert (items[0].value, items[0].help) == ("K01,W01", "missing-wire")
    assert {item.value[:6] for item in items} == {"K01,W0"}


@pytest.mark.parametrize("wrong", ["W1", "YY", "missing-wires", "W011"])
def test_a_rule_that_does_not_exist_is_refused_and_hides_nothing(wrong: str) -> None:
    with pytest.raises(UsageError, match=f"'{wrong.upper()}'"):
        split_rules([f"P01,{wrong}"])


@pytest.mark.parametrize("number", ["1", "01"])
def test_every_command_takes_a_checkpoint_with_and_without_its_zero(
    clock: str, number: str, tmp_path: Path
) -> None:
    calls = (
        ("check", "--checkpoint", number, clock),
        ("draw", "--checkpoint", number, clock, "--out", str(tmp_path)),
        ("build", "--only", number, "--out", str(tmp_path)),
    )
    results = [invoke(*call) for call in calls]
    assert [result.exit_code for result in results] == [0, 0, 0]


def test_no_command_at_all_shows_the_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["lab3"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == cli.EXIT_USAGE
    assert capsys.readouterr().err.startswith("Usage: lab3 ")


class Terminal:
    """A standard output that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("environment", "is_terminal", "colored"),
    [
        ({"TERM": "xterm"}, True, True),
        ({"TERM": "xterm"}, False, False),
        ({}, True, True),  # as on Windows
        ({"TERM": "dumb"}, True, False),
        ({"NO_COLOR": "1"}, True, False),
        ({"FORCE_COLOR": "1"}, False, True),
        ({"FORCE_COLOR": "1", "TERM": "dumb"}, False, True),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, True, False),
    ],
)
def test_the_environment_and_the_terminal_decide_about_colour(
    monkeypatch: pytest.MonkeyPatch,
    environment: dict[str, str],
    *,
    is_terminal: bool,
    colored: bool,
) -> None:
    for name in ("TERM", "NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "stdout", Terminal() if is_terminal else StringIO())
    assert wants_color() == colored


@pytest.mark.parametrize("command", ["check", "lint", "sim"])
@pytest.mark.parametrize(("when", "colored"), [("always", True), ("never", False)])
def test_an_option_decides_about_colour_before_the_environment(
    clock: str, monkeypatch: pytest.MonkeyPatch, command: str, when: str, *, colored: bool
) -> None:
    monkeypatch.setenv("NO_COLOR" if colored else "FORCE_COLOR", "1")
    result = CliRunner().invoke(cli.lab3, [command, clock, "--color", when])
    assert ("\x1b[" in result.stdout) == colored


def test_forced_colour_goes_through_a_pipe(clock: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert "\x1b[" in invoke("check", clock).stdout


@pytest.mark.parametrize("command", ["check", "lint", "fix", "tf"])
def test_a_file_with_another_ending_is_offered(clock: str, command: str) -> None:
    with pytest.raises(Lab3Error, match=f"did you mean {clock}"):
        invoke(command, clock.removesuffix("a"))


def test_a_name_with_a_slip_is_offered_right(clock: str) -> None:
    with pytest.raises(UsageError, match=f"did you mean {clock}"):
        invoke("check", clock.replace("clock", "clok"))


def test_a_name_like_no_other_is_answered_without_an_offer(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no such file or folder$"):
        invoke("check", tmp_path / "x.usd")


@pytest.mark.parametrize("command", ["check", "lint", "fix", "tf"])
def test_of_a_link_to_nothing_it_is_said_where_it_leads(command: str, tmp_path: Path) -> None:
    link = tmp_path / "x.usda"
    link.symlink_to("gone.usda")
    with pytest.raises(Lab3Error, match=r"x.usda: is a link to gone.usda, which does not exist$"):
        invoke(command, link)


def test_of_a_folder_without_stages_those_below_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="lab3 build --out"):
        invoke("check", tmp_path)
    work = tmp_path / "ana" / "work"
    work.mkdir(parents=True)
    (work / "x.usda").touch()
    with pytest.raises(UsageError, match=f"holds no stage and .* stages are in {work} "):
        invoke("check", tmp_path)
    (tmp_path / "robot.usda").touch()
    with pytest.raises(UsageError, match=f"no stage with a checkpoint .* are in {work} "):
        invoke("check", tmp_path)
