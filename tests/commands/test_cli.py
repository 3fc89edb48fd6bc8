"""The command line itself: start-up, exit statuses, completion, and the manual of rules."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from errno import ENAMETOOLONG, ENOSPC
from pathlib import Path

import click
import forking
import pytest
from fork_server import FORKED_WORKERS
from grade_files import starter, submission
from in_process import invoke as lab3
from places import REPOSITORY

from lab3_usd import cli
from lab3_usd.check.manual import PARTS
from lab3_usd.check.registry import FAMILIES, all_rules
from lab3_usd.commands.completion import PowerShellComplete
from lab3_usd.commands.table import all_commands
from lab3_usd.errors import UsageError
from lab3_usd.report.options import UNKNOWN, tool_version

HEAVY = {"pxr", "networkx", "yaml", "jinja2"}


def modules_after(*arguments: str) -> set[str]:
    code = (
        "import sys\n"
        "from lab3_usd.cli import lab3\n"
        f"lab3.main({list(arguments)!r}, standalone_mode=False)\n"
        "print(*sys.modules, file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return set(done.stderr.split())


def test_help_imports_nothing_heavy() -> None:
    assert modules_after("--help") & HEAVY == set()


# The manual names things of the lab, which is compiled only where Python may write.
def test_the_manual_of_a_rule_imports_nothing_heavy() -> None:
    assert modules_after("rule", "W01") & HEAVY <= {"yaml"}


def test_help_lists_every_command_below_who_uses_it() -> None:
    found = re.findall(r"^Commands for (.+):\n((?: .+\n)+)", lab3("--help").stdout, re.MULTILINE)
    listed = {users: re.findall(r"^  ([a-z0-9]+) ", lines, re.MULTILINE) for users, lines in found}
    expected: dict[str, list[str]] = {}
    for name, command in all_commands().items():
        expected.setdefault(command.users, []).append(name)
    assert listed == expected


def test_help_shows_three_examples_of_commands_that_exist() -> None:
    examples = re.findall(r"^  lab3 ([a-z]+) ", lab3("--help").stdout, re.MULTILINE)
    assert len(examples) == 3
    assert set(examples) <= set(cli.all_commands())


@pytest.mark.parametrize("name", list(cli.all_commands()))
def test_every_command_explains_itself(name: str) -> None:
    result = lab3(name, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: lab3 {name}")


def test_version_is_that_of_the_package() -> None:
    assert lab3("--version").stdout.strip() == f"lab3, version {tool_version()}"


def test_the_version_of_a_copy_that_is_not_installed_is_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "path", [])
    result = lab3("--version")
    assert (result.exit_code, result.stdout) == (0, f"lab3, version {UNKNOWN}\n")


def test_an_unknown_command_is_wrong_use() -> None:
    result = lab3("qqqq")
    assert result.exit_code == cli.EXIT_USAGE
    assert "qqqq" in result.stderr
    assert "did you mean" not in result.stderr


def test_a_command_keeps_the_name_that_it_had() -> None:
    assert lab3("play", "--help").stdout == lab3("record", "--help").stdout


@pytest.mark.parametrize(("slip", "meant"), [("chek", "check"), ("bild", "build"), ("tff", "tf")])
def test_a_slip_in_a_command_is_answered_with_the_command(slip: str, meant: str) -> None:
    result = lab3(slip)
    assert result.exit_code == cli.EXIT_USAGE
    assert f"did you mean '{meant}'" in result.stderr


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "lab3_usd", "--version"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout == lab3("--version").stdout


def test_an_error_of_ours_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["lab3", "tf", "none.usda"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == cli.EXIT_USAGE
    assert capsys.readouterr().err == "lab3: none.usda: there is no such file\n"


@pytest.mark.parametrize("name", list(cli.all_commands()))
def test_the_help_of_a_command_ends_with_calls_that_it_takes(name: str) -> None:
    lines = lab3(name, "--help").stdout.splitlines()
    calls = [line.split() for line in lines[lines.index("  Examples:") + 1 :]]
    assert calls == [call.split() for call in all_commands()[name].calls]
    assert max(map(len, lines)) <= 80
    for _, *words in calls:
        command = cli.lab3.get_command(click.Context(cli.lab3), words[0])
        assert command is not None
        command.make_context(words[0], words[1:])


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_completion_script_calls_back_into_lab3(shell: str) -> None:
    result = lab3("completion", shell)
    assert result.exit_code == 0
    assert re.search(f'_LAB3_COMPLETE ?= ?"?{shell}_complete', result.stdout)


@pytest.mark.parametrize(
    ("words", "typed", "offered"),
    [
        ("rule", "w0", {"W01", "W07"}),
        ("check --select", "P01,W0", {"P01,W01"}),
        ("fix --ignore", "W0", {"W01"}),
        ("check --checkpoint", "", {"00", "08"}),
        ("build --only", "0", {"05"}),
        ("lint --format", "s", {"sarif"}),
        ("lint --isaac", "5", {"5.0", "5.1"}),
        ("fix --from", "", {"4.5", "auto"}),
        ("check --color", "", {"auto", "never"}),
        ("check", "wo", set()),  # files, which PowerShell completes itself
    ],
)
def test_rules_checkpoints_and_formats_are_completed(
    monkeypatch: pytest.MonkeyPatch, words: str, typed: str, offered: set[str]
) -> None:
    monkeypatch.setenv("COMP_WORDS", "\n".join(["lab3", *words.split(), *([typed] * bool(typed))]))
    monkeypatch.setenv("COMP_WORD", typed)
    lines = PowerShellComplete(cli.lab3, {}, "lab3", "_LAB3_COMPLETE").complete().splitlines()
    values = {line.partition("\t")[0] for line in lines}
    assert values >= offered
    assert all(line.partition("\t")[2] for line in lines)
    assert bool(values) == bool(offered)


def test_the_tab_key_completes_commands_and_imports_none() -> None:
    environment = {
        **os.environ,
        "_LAB3_COMPLETE": "bash_complete",
        "COMP_WORDS": "lab3 ru",
        "COMP_CWORD": "1",
    }
    code = (
        "import atexit, sys\n"
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
        "from lab3_usd.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env=environment,
    )
    assert done.stdout.split() == ["plain,rules", "plain,rule"]
    imported = {name for name in done.stderr.split() if name.startswith("lab3_usd.commands.")}
    assert imported == {"lab3_usd.commands.table"}


FULL = """
import errno, os
from unittest.mock import patch
from lab3_usd.cli import main
full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
with patch("tempfile.mkstemp", side_effect=full):
    main()
"""


@pytest.mark.parametrize(
    "words",
    [
        ["build", "--only", "00", "--out", "new"],
        ["check", "ana", "--output", "report.txt"],
        ["grade", "class", "--starter", "starter.usda", "--output", "book"],
        ["starter", "--out", "new.usda"],
    ],
    ids=lambda words: words[0],
)
def test_a_disk_that_is_full_has_one_exit_status(tmp_path: Path, words: list[str]) -> None:
    shutil.copyfile(starter(), tmp_path / "starter.usda")
    for folder in ("ana", "class/ana"):
        submission(tmp_path / folder, "00")
    done = forking.run(
        [sys.executable, "-c", FULL, *words],
        cwd=tmp_path,
        env={**os.environ, **FORKED_WORKERS},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert (done.returncode, os.strerror(ENOSPC) in done.stderr) == (cli.EXIT_CRASH, True)


SAYS_IT_RAN = "import os\nopen(os.path.join(os.path.dirname(__file__), 'ran'), 'a').write(__name__)"


GRADE = ["grade", "class", "--starter", "starter.usda", "--output", "book"]


PROGRAM = "../program.py"  # like the script that pip makes: its own folder comes first
SCRIPT = "from lab3_usd.__main__ import start\nif __name__ == '__main__':\n    start()\n"
LINT = ["lint", "--jobs", "2", "class", "starter.usda"]


@pytest.mark.parametrize(
    "words",
    [["-m", "lab3_usd", *GRADE], ["-mlab3_usd", "rules"], [PROGRAM, *LINT]],
    ids=["grade", "rules", "lint"],
)
def test_no_module_of_the_working_directory_is_run(tmp_path: Path, words: list[str]) -> None:
    (tmp_path / "program.py").write_text(SCRIPT)
    folder = tmp_path / "here"
    submission(folder / "class" / "ana", "00")
    shutil.copyfile(starter(), folder / "starter.usda")
    for name in ("typing", "msgspec", "yaml", "click", "pxr", "shutil", "tempfile"):
        (folder / f"{name}.py").write_text(SAYS_IT_RAN)
    (folder / "multiprocessing").mkdir()
    (folder / "multiprocessing" / "__init__.py").write_text(SAYS_IT_RAN)
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, capture_output=True, check=False, timeout=100
    )
    assert [*folder.rglob("ran")] == []
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device without room")
def test_a_full_disk_is_no_failure_of_the_program() -> None:
    with open("/dev/full", "wb") as full:  # noqa: PTH123 - a device, not a path
        done = forking.run(
            [sys.executable, "-c", "from lab3_usd.cli import main; main()", "rules"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=60,
        )
    assert done.returncode == cli.EXIT_CRASH
    assert done.stderr.splitlines() == [
        f"lab3: the output cannot be written: {os.strerror(ENOSPC)}"
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="says it in other words")
@pytest.mark.parametrize("command", ["check", "fix", "lint", "tf"])
def test_a_name_that_the_system_does_not_take_is_no_failure_of_the_program(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"{'x' * 300}.usda"
    monkeypatch.setattr(sys, "argv", ["lab3", command, name])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == cli.EXIT_USAGE
    error = capsys.readouterr().err
    assert error.startswith(f"lab3: {name}: ")
    assert os.strerror(ENAMETOOLONG) in error
    assert error.count("\n") == 1


def test_rules_lists_every_rule_once_and_families_in_order() -> None:
    lines = lab3("rules", "--all").stdout.splitlines()
    families = [line.split() for line in lines if not line.startswith(" ")]
    listed = [line.split()[:3] for line in lines if line.startswith(" ")]
    assert families == [[letter, name] for letter, name in FAMILIES.items()]
    assert sorted(listed) == [[r.id, r.severity, r.name] for r in all_rules().values()]


def listed_families(*options: object) -> set[str]:
    lines = lab3(*options, "rules").stdout.splitlines()
    return {line.split()[0] for line in lines if not line.startswith(" ")}


def test_rules_lists_what_the_lab_can_need() -> None:
    jetbot = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
    assert {*FAMILIES} - listed_families() == {"D", "UV"}
    assert {*FAMILIES} - listed_families("--lab", jetbot) == {"B", "C", "M", "V", "K", "Y", "UV"}
    shown = lab3("--lab", jetbot, "rules").stdout
    assert re.findall(r"(?i)camera|amcl|nav2|\bmap\b|localization", shown) == []


def test_help_is_a_command_as_well_as_an_option() -> None:
    assert lab3("help").stdout == lab3("--help").stdout
    assert lab3("help", "lint").stdout == lab3("lint", "--help").stdout


def test_a_file_that_is_no_lab_is_not_said_to_be_missing(tmp_path: Path) -> None:
    note = tmp_path / "note.txt"
    note.write_text("")
    with pytest.raises(UsageError, match="is neither a folder nor a zip"):
        lab3("--lab", note, "rules")


def test_each_rule_needs_a_part_that_is_known() -> None:
    assert {rule.needs for rule in all_rules().values()} - {""} <= {*PARTS}


def test_rule_prints_the_whole_manual() -> None:
    printed = " ".join(lab3("rule", "W01").stdout.split())
    for paragraph in all_rules()["W01"].manual.split("\n\n"):
        assert " ".join(paragraph.split()) in printed


def test_a_rule_is_found_by_its_name_too() -> None:
    rule = all_rules()["W01"]
    assert lab3("rule", rule.name).stdout == lab3("rule", "w01").stdout


def test_a_rule_is_found_by_the_name_that_it_had_earlier() -> None:
    rule = all_rules()["K10"]
    assert rule.formerly
    assert lab3("rule", rule.formerly).stdout == lab3("rule", "K10").stdout


def test_an_unknown_rule_is_wrong_use_and_close_ones_are_named() -> None:
    result = lab3("rule", "W0")
    assert result.exit_code == cli.EXIT_USAGE
    assert "W01" in result.stderr


@pytest.mark.parametrize(
    ("word", "rules"), [("wire", {"W01", "K20"}), ("WIRE", {"W01"}), ("camera", {"C01", "S16"})]
)
def test_a_word_lists_the_rules_whose_name_or_first_sentence_has_it(
    word: str, rules: set[str]
) -> None:
    result = lab3("rule", word)
    assert result.exit_code == 0
    listed = set(re.findall(r"^  ([A-Z]+\d{2,3}) ", result.stdout, re.MULTILINE))
    assert listed >= rules
    assert "T01" not in listed


def test_a_rule_like_no_other_points_to_the_list() -> None:
    result = lab3("rule", "zzzzzz")
    assert result.exit_code == cli.EXIT_USAGE
    assert "lab3 rules" in result.stderr


def left(code: str) -> tuple[int, str]:
    """Run a program that ends by leaving the command line: its exit status, and what it printed."""
    done = forking.run(
        [sys.executable, "-c", f"import sys; from lab3_usd import cli\n{code}\ncli.run()"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    return done.returncode, done.stdout


def test_a_rule_whose_id_is_taken_is_no_internal_error() -> None:
    code = (
        "from lab3_usd.check.registry import all_rules, rule\n"
        "cli.lab3.main = lambda **_: (all_rules(), rule('K10', 'x', 'lint')(lambda stage: ()))"
    )
    assert left(code) == (cli.EXIT_USAGE, "")


@pytest.mark.parametrize("status", [0, 1, 3])
def test_leaving_at_once_loses_neither_status_nor_output(status: int) -> None:
    code = f"cli.main = lambda: (print('x' * 100_000, end=''), sys.exit({status}))"
    assert left(code) == (status, "x" * 100_000)


def test_threads_that_are_left_are_waited_for() -> None:
    code = (
        "import threading, time\n"
        "late = threading.Thread(target=lambda: (time.sleep(0.2), print('done')))\n"
        "cli.main = late.start"
    )
    assert left(code) == (0, "done\n")
