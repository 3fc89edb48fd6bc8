"""`lab3 rules`: the rules of a lab with severity and what each is about, by family."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import click

from lab3_usd.check.manual import rules_in, rules_of_lab
from lab3_usd.check.registry import FAMILIES, Rule
from lab3_usd.spec.load.loader import load_lab


@click.command("rules")
@click.option("--all", "whole", is_flag=True, help="Also those of lab3 lint and of other labs.")
def command(*, whole: bool) -> None:
    """List the rules that apply to the lab: id, severity, name and fault.

    `lab3 rule ID` explains one.
    """
    lab = load_lab()
    rules = rules_in(lab) if whole else rules_of_lab(lab)
    click.echo("\n".join(rule_lines(list(rules.values()))))


def rule_lines(rules: list[Rule]) -> Iterator[str]:
    """Yield the lines of the list: one family after the other, columns aligned."""
    width = max((len(rule.name) for rule in rules), default=0)
    families = list(FAMILIES)
    ordered = sorted(rules, key=lambda rule: (families.index(rule.family), rule.id))
    for family, members in groupby(ordered, key=lambda rule: rule.family):
        yield f"{family:<2} {FAMILIES[family]}"
        for rule in members:
            yield f"  {rule.id}  {rule.severity:<7}  {rule.name:<{width}}  {first_sentence(rule)}"


def first_sentence(rule: Rule) -> str:
    """Return what the rule is about: the first sentence of its manual, without the full stop."""
    opening = " ".join(rule.manual.split("\n\n")[0].split())
    return opening.split(". ")[0].removesuffix(".")
