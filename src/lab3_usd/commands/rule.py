"""`lab3 rule`: the manual of one rule, from its docstring."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping

import click

from lab3_usd.check.manual import rules_in
from lab3_usd.check.registry import Rule, families, padded_id, twins
from lab3_usd.commands.rules import first_sentence, rule_lines
from lab3_usd.commands.shared.configuration import own_rules_option, use_own_rules
from lab3_usd.commands.shared.options import complete_rules, width
from lab3_usd.data import program
from lab3_usd.report.safe_text import folded
from lab3_usd.spec.load.loader import load_lab

WIDTH = 100  # at most
SUGGESTED = 3
SHORTEST = 3  # letters of a word that is searched
SECTIONS = ("Why", "Fix", "Example", "Basis")


@click.command("rule")
@click.argument("rule_id", metavar="[ID]", default="", shell_complete=complete_rules)
@click.option("--search", "words", metavar="WORD", help="List the rules whose manuals hold WORD.")
@click.option("--all", "whole", is_flag=True, help="Print the manuals of all rules.")
@own_rules_option
def command(rule_id: str, words: str | None, *, whole: bool, config_file: str | None) -> None:
    """Explain one rule: the fault, its effect, the repair, and an example.

    ID is an id such as W01, or the name of a rule. Any other word lists the rules whose names or
    first sentences contain it.
    """
    severities = use_own_rules(config_file)
    lab = load_lab()
    rules = rules_in(lab, severities)
    if [bool(rule_id), bool(words), whole].count(True) != 1:
        raise click.UsageError("give the id of one rule, --search WORD, or --all")
    if words is not None:
        lower = words.lower()
        matching = [
            rule
            for rule in rules.values()
            if lower in rule.name or lower in " ".join(rule.manual.lower().split())
        ]
        if not matching:
            raise click.UsageError(f"no manual of a rule holds {words!r}")
        click.echo("\n".join(rule_lines(matching)))
        return
    if whole:
        order = [*families()]
        ordered = sorted(rules.values(), key=lambda rule: order.index(rule.family))
        manuals = (manual_lines(rule, lab.handout.rules.get(rule.id, "")) for rule in ordered)
        click.echo("\n\n\n".join("\n".join(lines) for lines in manuals))
        return
    about = rules_about(rule_id, rules)
    if about:
        click.echo("\n".join(rule_lines(about)))
        return
    rule = find_rule(rule_id, rules)
    click.echo("\n".join(manual_lines(rule, lab.handout.rules.get(rule.id, ""))))


def rules_about(word: str, rules: Mapping[str, Rule]) -> list[Rule]:
    """Return the rules about a word, none for the id or name of a rule or the start of an id."""
    sought = word.lower()
    named = {name for rule in rules.values() for name in (rule.id.lower(), rule.name)}
    named |= {rule.formerly for rule in rules.values()}
    if not sought.isalpha() or len(sought) < SHORTEST or sought in named:
        return []
    return [
        rule
        for rule in rules.values()
        if sought in rule.name or sought in first_sentence(rule).lower()
    ]


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
    ids = [padded_id(wanted.upper()), *(each for each in rules if each.startswith(wanted.upper()))]
    close = [rule_id for rule_id in ids if rule_id in rules][:SUGGESTED]
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
    columns = min(width(), WIDTH)
    yield f"{rule.id} {rule.name} ({rule.severity}, {families()[rule.family]})"
    for twin in twins(rule):
        where = "without a lab" if twin.scope == "lint" else "in a lab"
        yield f"{twin.id} {twin.name} ({twin.severity}, {families()[twin.family]}) {where}"
    yield ""
    yield from folded(rule.manual.split("\n\n")[0], columns)
    for title in SECTIONS:
        if text := rule.section(title):
            yield ""
            yield from folded(f"{title}: {text}", columns, rest="  ")
    for number in rule.parameters:
        yield ""
        text = f"Parameter: {number.name} = {number.default:g}, {number.about}"
        yield from folded(text, columns, rest="  ")
    if handout:
        yield ""
        yield f"Handout: {handout}"
