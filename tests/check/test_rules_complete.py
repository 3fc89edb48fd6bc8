"""Every rule has a manual, a test that triggers it, and a case that it leaves alone.

A rule about graphs has its case file `cases/<ID>.yaml`. Any other rule is triggered where a test
module names it in a string of its own (`"M04"`) or with a site (`"M04 maps/turtlebot3_map.yaml"`).
It must leave a complete, correct submission alone, or else one that lacks what a note is about:
starter and maps.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys

import pytest
import quick_yaml
from places import TESTS
from submissions import STARTER, checked, said, write_submission

from lab3_usd.check import checker
from lab3_usd.check.registry import FAMILIES, Rule, all_rules, rules_of

CASES = TESTS / "cases"
GRAPH_FAMILIES = "GNPRW"
OF_OTHER_LABS = ("G08", "G09")  # about what the bundled lab has none of: a test module names them
RULES = list(all_rules().values())
IN_CASES = [
    rule for rule in RULES if rule.family in GRAPH_FAMILIES and rule.id not in OF_OTHER_LABS
]
OTHERS = ("K", "Y", "UV")  # see test_lint_rules.py and test_native.py
ELSEWHERE = [rule for rule in RULES if rule not in IN_CASES and rule.family not in OTHERS]
_NAMED = re.compile(r"['\"]([A-Z]\d{2,3})(?= |['\"])")


def has_manual(rule: Rule) -> bool:
    first, *sections = rule.manual.split("\n\n")
    titles = [section.partition(":")[0] for section in sections]
    return (
        first.endswith(".")
        and titles in (["Why", "Fix", "Example"], ["Why", "Fix", "Example", "Basis"])
        and all(rule.section(title) for title in titles)
    )


# Rules that say what Kit or the renderer does, whose code is not public.
CLOSED = (
    "K02",
    "K03",
    "K05",
    "K07",
    "K11",
    *(f"K{n}" for n in range(20, 26)),
    "K28",
    "K30",
    "K34",
    "K72",
)


@pytest.mark.parametrize("rule_id", [*CLOSED, "K73"])
def test_a_rule_about_closed_code_says_what_it_rests_on(rule_id: str) -> None:
    assert all_rules()[rule_id].section("Basis")


def test_every_rule_has_a_manual() -> None:
    assert [rule.id for rule in RULES if not has_manual(rule)] == []


def is_id(text: str) -> bool:
    return re.fullmatch(r"[A-Z]+(\d\d|[1-9]\d\d)", text) is not None


def test_the_id_after_99_has_three_digits() -> None:
    assert [text for text in ("K99", "K100", "K1", "K001", "K1000", "k10") if is_id(text)] == [
        "K99",
        "K100",
    ]


def test_every_rule_has_an_id_of_its_family_and_a_name() -> None:
    assert [rule.id for rule in RULES if not is_id(rule.id)] == []
    assert [rule.id for rule in RULES if rule.family not in FAMILIES] == []
    unnamed = [rule.id for rule in RULES if not re.fullmatch(r"[a-z]+(-[a-z]+)*", rule.name)]
    assert unnamed == []


def test_no_two_rules_have_one_name() -> None:
    names = [rule.name for rule in RULES]
    assert [name for name in names if names.count(name) > 1] == []


def has_both_cases(rule: Rule) -> bool:
    case = quick_yaml.load((CASES / f"{rule.id}.yaml").read_text())
    triggers = [*case["expect"], *case.get("notes", [])]
    is_triggered = rule.id in {line.split()[0] for line in triggers}
    return is_triggered and bool(case["break"] and case["clear"])


def test_a_rule_about_graphs_has_a_case_that_triggers_it_and_one_that_does_not() -> None:
    assert [rule.id for rule in IN_CASES if not has_both_cases(rule)] == []


def test_every_case_file_is_of_a_rule() -> None:
    assert sorted(path.stem for path in CASES.glob("*.yaml")) == [rule.id for rule in IN_CASES]


def named_in_tests() -> frozenset[str]:
    """The rules that test modules name in their strings."""
    texts = (path.read_text() for path in TESTS.rglob("*.py"))
    return frozenset(rule for text in texts for rule in _NAMED.findall(text))


def test_some_test_triggers_every_rule() -> None:
    named = named_in_tests()
    assert [rule.id for rule in ELSEWHERE if rule.id not in named] == []


@pytest.fixture(scope="module")
def said_of_correct_ones(tmp_path_factory: pytest.TempPathFactory) -> list[set[str]]:
    """The rules that speak of a correct submission, and of one where there is nothing to note."""
    folders = [tmp_path_factory.mktemp(name) / "submission" for name in ("whole", "bare")]
    for folder in folders:
        write_submission(folder)
    (folders[1] / STARTER).unlink()
    shutil.rmtree(folders[1] / "maps")
    severities = ("error", "warning", "note")
    return [{each.split()[0] for each in said(checked(folder), *severities)} for folder in folders]


def test_a_correct_submission_leaves_every_rule_silent(
    said_of_correct_ones: list[set[str]],
) -> None:
    always = set.intersection(*said_of_correct_ones)
    assert [rule.id for rule in ELSEWHERE if rule.id in always] == []


# Each family in a process that has imported none before.
ALONE = """
import json, os, sys
from lab3_usd.check.registry import rules_of
families, *scopes = sys.argv[1:]
for family in families:
    if os.fork():
        assert os.wait()[1] == 0
        continue
    print(json.dumps([[each.id for each in rules_of(scope, family)] for scope in scopes]))
    break
"""


def test_a_family_asked_for_alone_is_whole_and_alone() -> None:
    scopes, families = sorted({rule.scope for rule in RULES}), "CLNSTU"
    asked = [sys.executable, "-c", ALONE, families, *scopes]
    done = subprocess.run(asked, capture_output=True, text=True, check=True)
    found = dict(zip(families, map(json.loads, done.stdout.splitlines()), strict=True))
    assert found == {
        family: [
            [rule.id for rule in RULES if (rule.family, rule.scope) == (family, scope)]
            for scope in scopes
        ]
        for family in families
    }


def test_a_stage_is_judged_by_every_rule_of_its_scopes() -> None:
    scopes = {"graph": checker.GRAPH_FAMILIES, "model": ("F",)} | dict.fromkeys(
        ("stage", "robot", "frames", "requirements"), checker.STAGE_FAMILIES
    )
    for scope, families in scopes.items():
        wanted = [rule.id for rule in RULES if rule.scope == scope]
        assert [rule.id for rule in rules_of(scope, *families)] == wanted


def test_rules_of_several_families_stand_in_order() -> None:
    found = [rule.id for rule in rules_of("stage", "S", "C")]
    assert found == sorted(found)
    assert {each[0] for each in found} == {"C", "S"}
