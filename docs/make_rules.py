"""Writes `rules.md` and the rules in `lint.md` from the docstrings of the rules.

Run `python docs/make_rules.py` after a rule has changed; a test compares pages and docstrings.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from lab3_usd.check.manual import rules_in
from lab3_usd.check.registry import FAMILIES, Rule
from lab3_usd.spec.load.loader import load_lab

PAGE = Path(__file__).with_name("rules.md")
LINT_PAGE = Path(__file__).with_name("lint.md")
LINT = ("K", "UV")
_MARK = "<!-- Below: written by docs/make_rules.py from the docstrings of the rules. -->\n"
SECTIONS = {
    "Why": "Why it matters",
    "Fix": "How to repair it",
    "Example": "Example",
    "Basis": "What it rests on",
}
FAMILY_TITLES = {
    "files": "can the stage be read at all",
    "graphs": "is each Action Graph there, at its path, of the right kind",
    "nodes": "the nodes of a graph",
    "settings": "values of inputs",
    "targets": "relationships to prims",
    "wires": "connections between ports",
    "scene": "robot, physics and world",
    "lidar": "the lidar prim",
    "camera": "the camera prim",
    "sensors": "sensors of other kinds: an IMU, a contact sensor",
    "frames": "the TF tree that the stage publishes",
    "topics": "topics and their QoS",
    "starter": "what was changed of the supplied scene (with `--starter`)",
    "maps": "map files (with `--maps`, or in a submission)",
    "navigation": "parameter files of Nav2 in a submission",
    "evidence": "saved output of the running system in a submission",
    "submission": "the folder as a whole",
    "fence": "what a grader leaves unopened",
    "lint": "any stage of Isaac Sim, without a spec (`lab3 lint`)",
    "native": "OpenUSD's own validators (with `--native`)",
}
INTRODUCTION = """\
# Rules

<!-- Written by docs/make_rules.py from the docstrings of the rules: change those, not this. -->

Every finding names its rule. `lab3 rules --all` lists them; `lab3 rule W01` prints what is here.
`lab3 check --select W,P01` reports some of them only, `--ignore P09` leaves some out.

- An **error** is something the handout asks for and the stage does not have.
- A **warning** is odd, and often harmless.
- A **note** is good to know and never counts.

A finding may be milder or harsher than its rule usually is; its own severity counts. Ids are never
used again for something else.
"""


def page() -> str:
    """Return the whole page."""
    return "\n".join([INTRODUCTION, *_contents(), *_manuals()])


def lint_page() -> str:
    """Return the page of the linter: what is written by hand, and its rules."""
    by_hand = LINT_PAGE.read_text(encoding="utf-8").partition(_MARK)[0]
    rules = [rule for family, members in _families() if family in LINT for rule in members]
    lines = ["| rule | severity | what |", "|---|---|---|"]
    for rule in rules:
        opening = " ".join(rule.manual.split("\n\n")[0].split())
        lines.append(f"| [{rule.id} {rule.name}](#{anchor(rule)}) | {rule.severity} | {opening} |")
    manuals = [line for rule in rules for line in _manual(rule)]
    return by_hand + _MARK + "\n" + "\n".join([*lines, "", *manuals])


def _families() -> Iterator[tuple[str, list[Rule]]]:
    rules = sorted(
        rules_in(load_lab()).values(), key=lambda rule: (list(FAMILIES).index(rule.family), rule.id)
    )
    for family, members in groupby(rules, key=lambda rule: rule.family):
        yield family, list(members)


def _contents() -> Iterator[str]:
    yield "| | Family | Rules |"
    yield "|---|---|---|"
    for family, members in _families():
        name = FAMILIES[family]
        page = LINT_PAGE.name if family in LINT else ""
        links = " ".join(f"[{rule.id}]({page}#{anchor(rule)})" for rule in members)
        yield f"| {family} | **{name}**: {FAMILY_TITLES.get(name, name)} | {links} |"
    yield ""


def anchor(rule: Rule) -> str:
    """Return the anchor that Markdown viewers give to the heading of a rule."""
    return f"{rule.id}-{rule.name}".lower()


def _manuals() -> Iterator[str]:
    for family, members in _families():
        yield f"## {family}: {FAMILIES[family]}\n"
        if family in LINT:
            yield "See [the linter's page](lint.md).\n"
            continue
        for rule in members:
            yield from _manual(rule)


def _manual(rule: Rule) -> Iterator[str]:
    yield f"### {rule.id} {rule.name}\n"
    opening = " ".join(rule.manual.split("\n\n")[0].split())
    yield f"*{rule.severity}* · {opening}\n"
    for name, title in SECTIONS.items():
        if text := rule.section(name):
            yield f"**{title}.** {_sentence(text)}\n"


def _sentence(text: str) -> str:
    is_word = text.split(" ", 1)[0].isalpha()  # `tf2` and `map_server` stay as they are
    return text[:1].upper() + text[1:] if is_word else text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    LINT_PAGE.write_text(lint_page(), encoding="utf-8", newline="\n")
