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
from functools import cache

import pytest
import quick_yaml
from places import TESTS
from submissions import STARTER, checked, said, write_submission

from lab3_usd.check import checker
from lab3_usd.check.registry import FAMILIES, Rule, all_rules, rules_of

CASES = TESTS / "cases"
GRAPH_FAMILIES = "GNPRW"
RULES = list(all_rules().values())
IN_CASES = [rule for rule in RULES if rule.family in GRAPH_FAMILIES]
OTHERS = ("K", "UV")  # see test_lint_rules.py and test_native.py
ELSEWHERE = [rule for rule in RULES if rule.family not in (*GRAPH_FAMILIES, *OTHERS)]
_NAMED = re.compile(r"['\"]([A-Z]\d\d)(?= |['\"])")


def by_id(rule: Rule) -> str:
    return rule.id


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


def test_every_rule_has_an_id_of_its_family_and_a_name() -> None:
    assert [rule.id for rule in RULES if not re.fullmatch(r"[A-Z]+\d\d", rule.id)] == []
    assert [rule.id for rule in RULES if rule.family not in FAMILIES] == []
    unnamed = [rule.id for rule in RULES if not re.fullmatch(r"[a-z]+(-[a-z]+)*", rule.name)]
    assert unnamed == []


def test_no_two_rules_have_one_name() -> None:
    names = [rule.name for rule in RULES]
    assert [name for name in names if names.count(name) > 1] == []


@pytest.mark.parametrize("rule", IN_CASES, ids=by_id)
def test_a_rule_about_graphs_has_a_case_that_triggers_it_and_one_that_does_not(
    rule: Rule,
) -> None:
    case = quick_yaml.load((CASES / f"{rule.id}.yaml").read_text())
    triggers = [*case["expect"], *case.get("notes", [])]
    assert rule.id in {line.split()[0] for line in triggers}
    assert case["break"]
    assert case["clear"]


def test_every_case_file_is_of_a_rule() -> None:
    assert sorted(path.stem for path in CASES.glob("*.yaml")) == [rule.id for rule in IN_CASES]


@cache
def named_in_tests() -> frozenset[str]:
    """The rules that test modules name in their strings."""
    texts = (path.read_text() for path in TESTS.rglob("*.py"))
    return frozenset(rule for text in texts for rule in _NAMED.findall(text))


@pytest.mark.parametrize("rule", ELSEWHERE, ids=by_id)
def test_some_test_triggers_a_rule(rule: Rule) -> None:
    assert rule.id in named_in_tests()


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


@pytest.mark.parametrize("rule", ELSEWHERE, ids=by_id)
def test_a_correct_submission_leaves_a_rule_silent(
    rule: Rule, said_of_correct_ones: list[set[str]]
) -> None:
    assert any(rule.id not in spoken for spoken in said_of_correct_ones)


ALONE = """
import json, sys
from lab3_usd.check.registry import rules_of
family, *scopes = sys.argv[1:]
print(json.dumps([[each.id for each in rules_of(scope, family)] for scope in scopes]))
"""


@pytest.mark.parametrize("family", ["C", "L", "N", "S", "T", "U"])
def test_a_family_asked_for_alone_is_whole_and_alone(family: str) -> None:
    scopes = sorted({rule.scope for rule in RULES})
    asked = [sys.executable, "-c", ALONE, family, *scopes]
    done = subprocess.run(asked, capture_output=True, text=True, check=True)
    of_family = [rule for rule in RULES if rule.family == family]
    wanted = [[rule.id for rule in of_family if rule.scope == scope] for scope in scopes]
    assert json.loads(done.stdout) == wanted


def test_a_stage_is_judged_by_every_rule_of_its_scopes() -> None:
    scopes = {"graph": checker.GRAPH_FAMILIES, "model": ("F",)} | dict.fromkeys(
        ("stage", "robot", "frames", "outcome"), checker.STAGE_FAMILIES
    )
    for scope, families in scopes.items():
        wanted = [rule.id for rule in RULES if rule.scope == scope]
        assert [rule.id for rule in rules_of(scope, *families)] == wanted


def test_rules_of_several_families_stand_in_order() -> None:
    found = [rule.id for rule in rules_of("stage", "S", "C")]
    assert found == sorted(found)
    assert {each[0] for each in found} == {"C", "S"}
