"""Writes `rules.md`, the index of all rules, from the docstrings of the rules.

Run `python docs/make_rules.py` after a rule has changed; a test compares page and docstrings.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from lab3_usd.check.manual import rules_in
from lab3_usd.check.registry import FAMILIES, Rule
from lab3_usd.commands.rules import first_sentence
from lab3_usd.spec.load.loader import load_lab

PAGE = Path(__file__).with_name("rules.md")
USUAL = "error"
FAMILY_TITLES = {
    "files": "layers and assets",
    "graphs": "existence, path and kind of Action Graphs",
    "nodes": "existence and type",
    "settings": "values of inputs",
    "targets": "relationships to prims",
    "wires": "connections between ports",
    "scene": "robot, physics and world",
    "lidar": "prim, pose and values",
    "camera": "prim, pose and image",
    "sensors": "others, such as an IMU",
    "frames": "the TF tree of the stage",
    "topics": "publishers, types, QoS",
    "starter": "changes to the supplied scene, with `--starter`",
    "maps": "map files, with `--maps` or in a submission",
    "navigation": "Nav2 parameters in a submission",
    "evidence": "saved output of the running system",
    "submission": "the folder as a whole",
    "unopened": "files that a grader leaves unopened",
    "lint": "any stage, without a lab (`lab3 lint`)",
    "physics": "how robots stand, and what they start in, without a lab (`lab3 lint`)",
    "scripts": "Python scripts that build graphs: where they stop, or lose something",
    "native": "OpenUSD's own validators, with `--native`; `lab3 rules --all` lists their faults",
}
INTRODUCTION = """\
# Rules

<!-- Written by docs/make_rules.py from the docstrings of the rules: change those, not this. -->

`lab3 rule W01` prints a manual: the fault, its effect on the robot, the repair, an example, the
parameters; each has a page of the site. `lab3 rule --all` prints all manuals,
`lab3 rule wire` lists the rules about a word.
`--select W,P01` reports only these rules or families; `--ignore P09` omits some.

An **error** contradicts the handout or, in `lab3 lint`, does not work; rules are errors unless
marked. A **warning** is unusual and often harmless. A **note** is information and never counts. A
single finding can be milder or more severe than its rule. Ids are never reused.
"""


def page() -> str:
    """Return the whole page."""
    families = list(_families())
    return "\n".join([INTRODUCTION, *_contents(families), *_lists(families)])


def _families() -> Iterator[tuple[str, list[Rule]]]:
    rules = sorted(
        rules_in(load_lab()).values(), key=lambda rule: list(FAMILIES).index(rule.family)
    )
    for family, members in groupby(rules, key=lambda rule: rule.family):
        yield family, list(members)


def _contents(families: list[tuple[str, list[Rule]]]) -> Iterator[str]:
    yield ", ".join(f"[{FAMILIES[family]}](#{anchor(family)})" for family, _members in families)
    yield ""


def heading(family: str) -> str:
    """Return the heading of a family."""
    return f"{family}: {FAMILIES[family]}"


def anchor(family: str) -> str:
    """Return the anchor that Markdown viewers give to the heading of a family."""
    return heading(family).lower().replace(":", "").replace(" ", "-")


def _lists(families: list[tuple[str, list[Rule]]]) -> Iterator[str]:
    for family, members in families:
        title = FAMILY_TITLES.get(FAMILIES[family], FAMILIES[family])
        yield f"## {heading(family)}\n"
        yield f"{title[:1].upper()}{title[1:]}.\n"
        if FAMILIES[family] == "native":  # their names say it
            yield f"{', '.join(f'**{rule.id}** {rule.name}' for rule in members)}.\n"
            continue
        for rule in members:
            severity = "" if rule.severity == USUAL else f" ({rule.severity})"
            yield f"- **{rule.id} {rule.name}**{severity}: {first_sentence(rule)}."
        yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
