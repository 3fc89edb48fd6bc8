"""Rules of one's own: in a file that the configuration names, or in an installed package."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from breaking import correct_stage
from foreign_robots import rover
from in_process import invoke as lab3
from places import REPOSITORY
from pxr import Sdf

from lab3_usd.check.own_rules import add_own_rules
from lab3_usd.check.registry import all_rules, own_rules_removed_on_exit
from lab3_usd.errors import UsageError
from lab3_usd.own_rules import rule_cases

EXAMPLE = REPOSITORY / "docs" / "examples" / "own_rules"
ODOMETRY = "/World/Odometry/odometry"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot with a topic that the example's rule is about, and the rule beside it."""
    for name in ("acme_rules.py", "lab3.toml"):
        shutil.copy(EXAMPLE / name, tmp_path)
    stage = rover()
    node = stage.GetPrimAtPath(ODOMETRY)
    node.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set("Odom")
    stage.GetRootLayer().Export(str(tmp_path / "robot.usda"))
    return tmp_path


@pytest.fixture
def trusted(folder: Path) -> tuple[str, Path]:
    return "--config", folder / "lab3.toml"


def found(*arguments: object) -> list[str]:
    document = json.loads(lab3(*map(str, arguments), "--format", "json").stdout)
    return [
        f"{each['rule']} {each['prim']}"
        for result in document["results"]
        for each in result["findings"]
        if each["rule"].startswith("ACME")
    ]


@pytest.fixture(scope="module", autouse=True)
def _forgotten() -> Iterator[None]:
    with own_rules_removed_on_exit():
        yield


def test_the_cases_of_the_example_hold_wherever_it_is_copied_to(tmp_path: Path) -> None:
    copy = shutil.copytree(EXAMPLE, tmp_path / "acme")
    with own_rules_removed_on_exit():
        add_own_rules([str(EXAMPLE / "acme_rules.py")])
        cases = rule_cases(copy / "cases")
        assert [case.expect for case in cases if case.expect]
        assert [case.found() for case in cases] == [case.expect for case in cases]


def test_a_rule_of_the_configuration_finds_what_it_is_about(
    folder: Path, trusted: tuple[str, Path]
) -> None:
    assert found("lint", *trusted, folder / "robot.usda") == [f"ACME01 {ODOMETRY}"]
    assert found("lint", *trusted, "--ignore", "ACME", folder / "robot.usda") == []


def test_its_fault_is_repaired_by_it(folder: Path, trusted: tuple[str, Path]) -> None:
    target = folder / "repaired.usda"
    lab3("lint", "--fix", *trusted, "--select", "ACME", "-o", target, folder / "robot.usda")
    assert found("lint", *trusted, target) == []


def test_each_process_has_the_rule(folder: Path, trusted: tuple[str, Path]) -> None:
    shutil.copy(folder / "robot.usda", folder / "second.usda")
    assert found("lint", *trusted, "--jobs", "2", folder) == [f"ACME01 {ODOMETRY}"] * 2


def test_it_judges_stages_of_a_lab_and_takes_no_point(
    folder: Path, trusted: tuple[str, Path]
) -> None:
    path = folder / "Lab3_01_ros_clock.usda"
    stage = correct_stage("01")
    stage.GetRootLayer().Export(str(path))
    rule = (folder / "acme_rules.py").read_text().replace("topic != topic.lower()", "True")
    (folder / "acme_rules.py").write_text(rule)
    document = json.loads(lab3("check", *trusted, "--format", "json", path).stdout)
    (result,) = document["results"]
    assert [each["rule"] for each in result["findings"]] == ["ACME01"]
    assert result["score"]["earned"] == result["score"]["possible"]


def test_a_file_beside_the_stage_does_not_run_unless_it_is_named(folder: Path) -> None:
    (folder / "acme_rules.py").write_text("raise SystemExit('it ran')\n")
    with pytest.raises(UsageError, match="would run as a program"):
        lab3("lint", folder / "robot.usda")
    assert lab3("lint", "--isolated", folder / "robot.usda").exit_code == 0
    assert lab3("topics", folder / "robot.usda").exit_code == 0


def test_an_installed_package_brings_rules(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = tmp_path / "packages"
    info = packages / "acme_rules-1.0.dist-info"
    info.mkdir(parents=True)
    text = (EXAMPLE / "acme_rules.py").read_text().replace("ACME01", "ACME02")
    (packages / "acme_installed.py").write_text(text)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-rules\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lab3_usd.rules]\nacme = acme_installed\n")
    monkeypatch.syspath_prepend(packages)
    (folder / "lab3.toml").write_text('rules = ["acme"]\n')
    assert found("lint", folder / "robot.usda") == [f"ACME02 {ODOMETRY}"]


def test_its_manual_is_a_page_like_others(trusted: tuple[str, Path]) -> None:
    page = lab3("rule", "ACME01", *trusted).stdout
    assert page.startswith("ACME01 topic-with-capitals (warning, custom rules)\n")
    assert "Why: our launch files know lower-case names only." in page
    assert "ACME01" in lab3("rules", "--all", *trusted).stdout
    assert "ACME01" not in all_rules()


def test_it_is_listed_with_the_severity_that_is_set(
    folder: Path, trusted: tuple[str, Path]
) -> None:
    with (folder / "lab3.toml").open("a") as file:
        file.write('[severity]\nACME = "note"\nK43 = "note"\n')
    assert lab3("rule", "ACME01", *trusted).stdout.startswith("ACME01 topic-with-capitals (note,")
    listed = [line.split()[:2] for line in lab3("rules", *trusted).stdout.splitlines()]
    assert ["ACME01", "note"] in listed
    assert ["K43", "note"] in listed
    assert ["K42", "error"] in listed


NUMBERED = """from lab3_usd.own_rules import own_rule

def check(subject):
    "A fault."
    yield from ()

for number, name in (('100', 'last'), ('99', 'former'), ('10', 'early')):
    own_rule('NUM' + number, name)(check)
"""


def test_the_id_after_99_is_listed_after_it(folder: Path, trusted: tuple[str, Path]) -> None:
    (folder / "acme_rules.py").write_text(NUMBERED)
    listed = lab3("rules", *trusted).stdout.splitlines()
    ids = [words[0] for words in map(str.split, listed) if words[0].startswith("NUM")]
    assert ids == ["NUM", "NUM10", "NUM99", "NUM100"]


TAKEN_TWICE = """from lab3_usd.own_rules import own_rule

@own_rule('ACME01', 'x')
def one(subject): ...

@own_rule('ACME01', 'y')
def two(subject): ...
"""


NAMESAKE = TAKEN_TWICE.replace("'x'", "'incompatible-qos'")
NO_SEVERITY = TAKEN_TWICE.replace("'x'", "'x', 'wrning'")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import nowhere\n", "acme_rules.py:1: cannot be imported: ModuleNotFoundError"),
        ("", "holds no rule"),
        (
            "from lab3_usd.own_rules import own_rule\nown_rule('K01', 'x')(lambda subject: ())\n",
            "K01 is not an id of a rule: at least two capital letters",
        ),
        (TAKEN_TWICE.replace("ACME01", "MY1"), "MY1 is not .*, then at least two digits, as in"),
        (
            "from lab3_usd.own_rules import own_rule\nown_rule('UV01', 'x')(lambda subject: ())\n",
            "its letters are those of a family",
        ),
        (NAMESAKE, "ACME01: its name incompatible-qos is that of K43"),
        (NO_SEVERITY, "ACME01: 'wrning' is none of error, warning, note"),
        (
            TAKEN_TWICE,
            r"ACME01 is taken by x at .*acme_rules.py:3; ACME02 is free",
        ),
    ],
)
def test_a_file_without_rules_is_wrong_use(
    folder: Path, trusted: tuple[str, Path], text: str, said: str
) -> None:
    (folder / "acme_rules.py").write_text(text)
    with pytest.raises(UsageError, match=said):
        lab3("lint", *trusted, folder / "robot.usda")


def test_a_rule_that_fails_itself_is_a_crash_and_no_pass(
    folder: Path, trusted: tuple[str, Path]
) -> None:
    text = (folder / "acme_rules.py").read_text().replace("for node in", "1 / 0\n    for node in")
    (folder / "acme_rules.py").write_text(text)
    assert lab3("lint", *trusted, folder / "robot.usda").exit_code == 3
