"""The manual of a rule as Markdown: for an editor to show, and for its page of the site."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from lab3_usd.check.manual import rules_in
from lab3_usd.check.registry import Rule, families, twins
from lab3_usd.spec.load.loader import load_lab


@lru_cache(maxsize=64)
def manual_of(rule: str) -> str:
    """Return the manual of a rule, '' for one that does not exist."""
    entry = rules_in(load_lab()).get(rule)
    if entry is None:
        return ""
    return "\n\n".join([f"**{entry.id} {entry.name}** ({entry.severity})", *_paragraphs(entry)])


def rule_pages() -> Iterator[tuple[str, str]]:
    """Yield the id of each rule and its page, with a heading."""
    lab = load_lab()
    for rule in rules_in(lab).values():
        parts = [f"# {rule.id} {rule.name}"]
        parts += [f"`{rule.severity}`, {families()[rule.family]}"]
        parts += [f"See also [{twin.id} {twin.name}]({twin.id}.md)." for twin in twins(rule)]
        if section := lab.handout.rules.get(rule.id):
            parts.append(f"Handout: {section}")
        yield rule.id, "\n\n".join([*parts, *_paragraphs(rule)]) + "\n"


def _paragraphs(rule: Rule) -> Iterator[str]:
    """Yield the paragraphs of a manual, and its parameters."""
    for paragraph in rule.manual.split("\n\n"):
        title, colon, text = paragraph.partition(": ")
        yield f"**{title}:** {text}" if colon and title.isalpha() else paragraph
    for number in rule.parameters:
        yield (
            f"**Parameter:** `[parameters.{rule.id}] {number.name} = {number.default:g}`, "
            f"{number.about}"
        )
