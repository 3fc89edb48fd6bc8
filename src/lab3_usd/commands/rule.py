"""`lab3 rule`: the manual of one rule, from its docstring."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Iterator, Mapping

import click

from lab3_usd.check.manual import rules_in
from lab3_usd.check.registry import FAMILIES, Rule
from lab3_usd.data import program
from lab3_usd.spec.load.loader import load_lab

WIDTH = 100
SUGGESTED = 3
SECTIONS = ("Why", "Fix", "Example", "Basis")


@click.command("rule")
@click.argument("rule_id", metavar="ID")
def command(rule_id: str) -> None:
    """Explain one rule: what is wrong, why it matters, how to repair it, and an example.

    ID is an id such as W01, or a rule's name.
    """
    lab = load_lab()
    rule = find_rule(rule_id, rules_in(lab))
    click.echo("\n".join(manual_lines(rule, lab.handout.rules.get(rule.id, ""))))


def find_rule(wanted: str, rules: Mapping[str, Rule]) -> Rule:
    """Return the rule with this id or name.

    Raises:
        click.UsageError: there is none; names the closest ids.
    """
    by_name = {rule.name: rule for rule in rules.values()}
    former = {rule.formerly: rule for rule in rules.values() if rule.formerly}
    name = wanted.lower()
    rule = rules.get(wanted.upper()) or by_name.get(name) or former.get(name)
    if rule:
        return rule
    close = [rule_id for rule_id in rules if rule_id.startswith(wanted.upper())][:SUGGESTED]
    close = close or difflib.get_close_matches(wanted.upper(), rules, SUGGESTED, cutoff=0.5)
    close += [by_name[name].id for name in difflib.get_close_matches(name, by_name)]
    hint = f"{program()} rules lists all"
    if close:
        hint = f"did you mean {', '.join(dict.fromkeys(close))}"
    raise click.UsageError(f"no rule {wanted!r}; {hint}")


def manual_lines(rule: Rule, handout: str) -> Iterator[str]:
    """Yield the manual: a heading, what is wrong, and its named sections, wrapped.

    `handout` is the section of the handout behind the rule, where the lab names one.
    """
    yield f"{rule.id} {rule.name} ({rule.severity}, {FAMILIES[rule.family]})"
    yield ""
    yield from textwrap.wrap(rule.manual.split("\n\n")[0], WIDTH)
    for title in SECTIONS:
        if text := rule.section(title):
            yield ""
            yield from textwrap.wrap(f"{title}: {text}", WIDTH, subsequent_indent="  ")
    if handout:
        yield ""
        yield f"Handout: {handout}"
