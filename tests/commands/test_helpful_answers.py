"""Answers to what people try first: each says what to do instead."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from in_process import lab3
from places import REPOSITORY

CARTER = REPOSITORY / "docs" / "examples" / "carter.usda"
OF_A_COURSE = ("older copy", "hand in", "checkpoint")


def answer(*arguments: object) -> str:
    """Return what is printed, to either stream, in one line."""
    printed = lab3(*arguments)
    assert printed.returncode != 0
    return re.sub(r"\s+", " ", printed.stdout + printed.stderr)


@pytest.fixture
def carter(tmp_path: Path) -> Path:
    path = tmp_path / "carter.usda"
    path.write_bytes(CARTER.read_bytes())
    return path


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("note.usda", b"hello\n", "is not USD"),
        ("note.txt", b"hello\n", "'.txt' is not a USD ending"),
        ("robot.zip", b"PK\x05\x06", "is an archive"),
        ("empty.usda", b"", "is empty"),
    ],
)
def test_what_is_no_stage_is_said_in_no_words_of_a_course(
    name: str, content: bytes, words: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    said = answer("lint", path)
    assert words in said
    assert not [word for word in OF_A_COURSE if word in said]


def test_a_device_is_no_stage() -> None:
    said = answer("lint", "/dev/null")
    assert "is not a file hint name a stage" in said


@pytest.mark.parametrize("command", [("robots",), ("sim",), ("add", "clock")])
def test_a_folder_is_no_stage_and_none_is_asked_for(
    command: tuple[str, ...], tmp_path: Path
) -> None:
    said = answer(*command, tmp_path)
    assert "is a folder" in said
    assert "name one stage in it" in said
    assert "folder with" not in said


def test_a_student_is_still_told_to_go_back(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_01_ros_clock.usda"
    path.write_text("hello\n")
    assert "older copy of the file; or open the stage of the checkpoint before" in answer(
        "check", path
    )


def test_an_address_keeps_its_slashes() -> None:
    said = answer("lint", "https://example.com/robots/a.usd")
    assert "https://example.com/robots/a.usd: is an address" in said


def test_an_original_is_compared_with_what_was_repaired(carter: Path) -> None:
    lab3("fix", "--lint", carter, "--in-place")
    original = carter.with_name("carter.usda.orig")
    files = sorted(carter.parent.iterdir())
    printed = lab3("diff", original, carter)
    assert printed.stdout.startswith(f"{original} -> {carter}: ")
    assert lab3("diff", original, original).returncode == 0
    assert sorted(carter.parent.iterdir()) == files


def test_an_original_is_never_to_take_the_name_of_what_was_repaired(carter: Path) -> None:
    lab3("fix", "--lint", carter, "--in-place")
    said = answer("tf", carter.with_name("carter.usda.orig"))
    assert "copy the file to carter_before.usda; carter.usda is there" in said
    assert "rename" not in said


def test_another_file_of_no_usd_ending_is_not_compared(carter: Path) -> None:
    copy = carter.rename(carter.with_name("carter.txt"))
    assert "rename the file to carter.usda" in answer("diff", copy, CARTER)


@pytest.mark.parametrize("options", [("--unsafe",), ("--in-place",), ("--diff", "--unsafe")])
def test_options_of_repairs_go_with_fix(options: tuple[str, ...], carter: Path) -> None:
    assert "go with --fix" in answer("lint", carter, *options)


def test_lint_makes_the_likely_repairs_that_fix_makes(carter: Path) -> None:
    by_lint = lab3("lint", carter, "--fix", "--unsafe", "--diff").stdout
    assert by_lint == lab3("fix", "--lint", carter, "--unsafe", "--diff").stdout
    assert by_lint != lab3("lint", carter, "--fix", "--diff").stdout


@pytest.mark.parametrize("command", ["sim", "bag"])
def test_who_asks_for_html_is_told_of_the_page(command: str, carter: Path) -> None:
    assert "--page FILE writes an HTML page" in answer(command, carter, "--format", "html")
    assert "'xml' is not one of 'text', 'json'" in answer(command, carter, "--format", "xml")


def test_a_command_without_pages_tells_of_none(carter: Path) -> None:
    assert "'html' is not one of" in answer("topics", carter, "--format", "html")


def test_what_is_no_baseline_names_no_other_command(carter: Path) -> None:
    path = carter.with_name("bad.json")
    path.write_text("{")
    assert "is not a baseline, as --write-baseline writes one" in answer(
        "lint", "--baseline", path, carter
    )


def test_bytes_of_a_configuration_are_named_by_their_line(carter: Path) -> None:
    path = carter.with_name("lab3.toml")
    path.write_bytes(b'color = "never"\nselect = ["K\xff"]\n')
    assert f"{path}: is not UTF-8 text: line 2 holds the byte 0xff" in answer("lint", carter)


def test_bytes_of_a_script_are_named_by_their_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.py"
    path.write_bytes(b"import omni.graph.core as og\n# caf\xe9\nog.Controller.edit('/G', {})\n")
    said = answer("lint", path)
    assert "is not UTF-8 text: line 2 holds the byte 0xe9" in said
    assert "name its encoding in the first line" in said


@pytest.mark.parametrize("command", ["sim", "bag"])
def test_what_cannot_be_played_is_an_error(command: str, tmp_path: Path) -> None:
    printed = lab3(command, tmp_path / "nosuch")
    assert (printed.returncode, printed.stdout) == (2, "")
    assert "nosuch" in printed.stderr


def test_a_rule_of_ones_own_that_fails_names_its_line(carter: Path) -> None:
    carter.with_name("house.py").write_text(
        "from lab3_usd.own_rules import own_rule\n\n\n"
        '@own_rule("ACME01", "broken")\n'
        "def broken(subject):\n"
        '    """It fails."""\n'
        "    yield 1 / 0\n"
    )
    config = carter.with_name("lab3.toml")
    config.write_text('rules = ["house.py"]\n')
    said = answer("lint", "--config", config, carter)
    assert "ZeroDivisionError: division by zero, at house.py:7" in said


@pytest.mark.parametrize("option", ["-o", "--output", "--out"])
def test_what_is_written_goes_by_one_option_under_both_its_names(option: str, carter: Path) -> None:
    folder = carter.parent
    assert lab3("build", option, folder / "stages", "--only", "01").returncode == 0
    assert lab3("draw", carter, "--lint", option, folder / "pictures").returncode == 0
    lab3("lint", carter, option, folder / "report.txt")
    assert {path.name for path in folder.iterdir()} >= {"stages", "pictures", "report.txt"}


@pytest.mark.parametrize("command", ["build", "draw", "lint", "fix", "map", "starter"])
def test_one_of_both_names_is_documented(command: str) -> None:
    shown = lab3(command, "--help").stdout
    assert "-o, --output" in shown
    assert not re.search(r"--out\b", shown)


def test_rules_are_searched_in_their_manuals() -> None:
    shown = lab3("rule", "--search", "Reset On Stop").stdout
    assert re.search(r"K39 +warning +other-release", shown)
    assert "K11" not in shown
    assert "no manual of a rule holds 'xyzzy'" in answer("rule", "--search", "xyzzy")


def test_only_what_failed_is_judged_again(carter: Path) -> None:
    folder, report = carter.parent, carter.with_name("last.json")
    (folder / "right.usda").write_text('#usda 1.0\ndef Xform "World" {}\n', encoding="utf-8")
    lab3("lint", folder, "--format", "json", "-o", report)
    shown = lab3("lint", folder, "--last-failed", report)
    assert shown.stdout.splitlines()[-2].startswith("1 file: 0 passed, 1 failed")
    lab3("lint", folder / "right.usda", "--format", "json", "-o", report)
    new = lab3("lint", folder, "--last-failed", report)
    assert new.stdout.splitlines()[-2].startswith("1 file: 0 passed, 1 failed")
    nothing = lab3("lint", folder / "right.usda", "--last-failed", report)
    assert (nothing.returncode, nothing.stdout.partition(":")[0]) == (0, "nothing to judge again")


@pytest.mark.parametrize("content", ["{", "[]", '{"results": [1]}'])
def test_what_is_no_report_is_refused(content: str, carter: Path) -> None:
    path = carter.with_name("last.json")
    path.write_text(content)
    assert "is not a report, as --format json writes one" in answer(
        "lint", carter, "--last-failed", path
    )


def test_repairs_are_named_in_one_order(carter: Path) -> None:
    for form in ("text", "markdown", "html"):
        shown = re.sub("<[^>]*>", "", lab3("lint", carter, "--format", form).stdout)
        assert "fix --lint" in shown.replace("\\", "")
        assert not re.search(r"fix \S+ --lint", shown)


@pytest.mark.parametrize("command", ["topics", "tf"])
def test_what_a_missing_file_could_hold_is_said(command: str, tmp_path: Path) -> None:
    path = tmp_path / "layered.usda"
    path.write_text("#usda 1.0\n(\n    subLayers = [@gone.usda@, @lost.usda@]\n)\n")
    said = lab3(command, path).stdout
    assert "2 assets cannot be found, and could hold more: gone.usda and others" in said
