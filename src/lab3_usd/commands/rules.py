"""`lab3 rules`: the rules of lint and of a lab, with severity and what each is about, by family."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import click

from lab3_usd.check.manual import rules_in, rules_of_lab
from lab3_usd.check.registry import Rule, families
from lab3_usd.commands.shared.configuration import own_rules_option, use_own_rules
from lab3_usd.commands.shared.options import terminal_width
from lab3_usd.data import own_lab
from lab3_usd.model.finding import id_order
from lab3_usd.report.safe_text import folded
from lab3_usd.spec.load.loader import load_lab

_ANY_STAGE = ("lint", "script")
LEAST = 72  # columns that a list is wrapped to


@click.command("rules")
@click.option(
    "--all", "whole", is_flag=True, help="Also those of other labs and of other validators."
)
@own_rules_option
def command(*, whole: bool, config_file: str | None) -> None:
    """List the rules of lab3 lint and those of the lab: id, severity, name and fault.

    With --lab, only those of that lab.

    `lab3 rule ID` explains one.
    """
    severities = use_own_rules(config_file)
    lab = load_lab()
    rules = rules_in(lab, severities)
    if not whole:
        linted = (
            {} if own_lab() else {name: r for name, r in rules.items() if r.scope in _ANY_STAGE}
        )
        rules = linted | {name: rules[name] for name in rules_of_lab(lab)}
    click.echo("\n".join(rule_lines(list(rules.values()))))


def rule_lines(rules: list[Rule]) -> Iterator[str]:
    """Yield the lines of the list: one family after the other, columns aligned.

    On a terminal a long sentence goes on below its beginning; else each rule has one line.
    """
    name_width = max((len(rule.name) for rule in rules), default=0)
    columns = max(terminal_width(), LEAST)
    titles = families()
    order = list(titles)
    ordered = sorted(rules, key=lambda rule: (order.index(rule.family), id_order(rule.id)))
    for family, members in groupby(ordered, key=lambda rule: rule.family):
        yield f"{family:<2} {titles[family]}"
        for rule in members:
            head = f"  {rule.id}  {rule.severity:<7}  {rule.name:<{name_width}}  "
            yield from folded(first_sentence(rule), columns, head, " " * len(head))


def first_sentence(rule: Rule) -> str:
    """Return what the rule is about: the first sentence of its manual, without the full stop."""
    opening = " ".join(rule.manual.split("\n\n")[0].split())
    return opening.split(". ")[0].removesuffix(".")
