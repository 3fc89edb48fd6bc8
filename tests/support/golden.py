"""Golden texts in `tests/golden`: what is said of each of many cases, word for word.

`LAB3_UPDATE_GOLDEN=1 pytest` writes them anew, to be read before they are kept.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import to_builtins
from places import TESTS

from lab3_usd.check.manual import in_words_of
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import finding_of
from lab3_usd.model.changes import Repair
from lab3_usd.model.finding import Finding, Problem
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

FOLDER = TESTS / "golden"
UPDATE = bool(os.environ.get("LAB3_UPDATE_GOLDEN"))
HOW_TO_KEEP = "if this is meant, run the test with LAB3_UPDATE_GOLDEN=1 and read the difference"
_MOST_LISTED = 4
_IN_THE_FIRST_LINE = ("rule", "name", "severity", "prim", "property", "message")


def assert_golden(name: str, shown: Mapping[str, str]) -> None:
    """Compare the text of each case with the one that was kept."""
    if UPDATE:
        blocks = [f"# {case}\n{text}" for case, text in shown.items()]
        path = FOLDER / f"{name}.txt"
        path.write_text("\n".join(blocks), encoding="utf-8", newline="\n")
    kept = _blocks(name)
    assert {case: text.splitlines() for case, text in shown.items()} == kept, HOW_TO_KEEP


def assert_golden_case(name: str, case: str, text: str) -> None:
    """Compare the text of one case with the one that was kept."""
    if UPDATE:
        kept = {
            case: "".join(f"{line}\n" for line in block) for case, block in _blocks(name).items()
        }
        assert_golden(name, {**kept, case: text})
    assert text.splitlines() == _blocks(name).get(case), HOW_TO_KEEP


def _blocks(name: str) -> dict[str, list[str]]:
    """Return the lines that were kept of each case."""
    text = (FOLDER / f"{name}.txt").read_text(encoding="utf-8").removeprefix("# ")
    blocks = (block.split("\n", 1) for block in text.split("\n# "))
    return {case: block.removesuffix("\n").splitlines() for case, block in blocks}


def problems_text(problems: Mapping[str, Iterable[Problem]], lab: Lab) -> str:
    """Return the problems of each rule as their findings."""
    rules = all_rules()
    return findings_text(
        finding_of(rules[rule_id], problem, lab)
        for rule_id, found in problems.items()
        for problem in found
    )


def numbered(names: Iterable[str]) -> list[str]:
    """Return the names, each with how many the same came before it."""
    listed = list(names)
    return [f"{name} {listed[:place].count(name)}" for place, name in enumerate(listed)]


def findings_text(findings: Iterable[Finding], lab: Lab | None = None) -> str:
    """Return findings with everything that a rule says: a line for each, and one for each field.

    A hint that is the repair of the rule's manual is left out.
    """
    lines: list[str] = []
    words = lab or load_lab()
    for finding in findings:
        place = f"{finding.prim}.{finding.property}" if finding.property else finding.prim
        lines.append(f"{finding.severity} {finding.rule} {place}: {finding.message}")
        repair = in_words_of(words, all_rules()[finding.rule].hint) or None
        usual = Finding(finding.rule, "", "error", "", "", hint=repair)
        lines += [
            f"    {field}: {_shown(value)}"
            for field in Finding.__struct_fields__
            if field not in _IN_THE_FIRST_LINE
            and (value := getattr(finding, field)) != getattr(usual, field)
        ]
    return "".join(f"{line}\n" for line in lines).replace("\0", "\\0")


def _shown(value: Any) -> str:
    """Return a value as text; of a long list its ends."""
    if isinstance(value, Repair):
        edits = "; ".join(
            " ".join(_part_text(part) for part in to_builtins(edit).values() if part is not None)
            for edit in value.edits
        )
        return f"{value.title}{'' if value.safe else ' (unsafe)'}: {edits}"
    if not isinstance(value, tuple):
        return str(value)
    items = [".".join(filter(None, item)) if isinstance(item, tuple) else item for item in value]
    if len(items) > _MOST_LISTED:
        return f"{', '.join(items[:2])} ... {items[-1]} ({len(items)})"
    return ", ".join(map(str, items))


def _part_text(part: Any) -> str:
    """Return a part of an edit; of the edits that it consists of, the prims."""
    if isinstance(part, tuple) and part and isinstance(part[0], dict):
        return " ".join(entry["prim"] for entry in part)
    return str(part)


def assert_golden_text(name: str, shown: str) -> None:
    """Compare a text with the one that was kept under a name."""
    path = FOLDER / name
    if UPDATE:
        path.parent.mkdir(exist_ok=True)
        path.write_text(shown, encoding="utf-8", newline="\n")
    assert shown.splitlines() == path.read_text(encoding="utf-8").splitlines(), HOW_TO_KEEP
