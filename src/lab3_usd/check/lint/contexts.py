"""Which ROS contexts a stage has, and which nodes use each of them."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import effective_value, live_sources
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, OUTPUT

_CONTEXT = "context"
_DOMAIN, _FROM_ENVIRONMENT = "inputs:domain_id", "inputs:useDomainIDEnvVar"


class ContextInput(Struct, frozen=True, eq=False):
    """The context of a node: what makes it, and whether anything is wired or set at all."""

    node: Node
    port: str
    contexts: tuple[Node, ...]
    is_set: bool


def context_inputs(subject: LintSubject) -> Iterator[ContextInput]:
    """Yield the context of every live node that takes one."""
    port = INPUT + _CONTEXT
    for node in subject.live.values():
        if node.type is not None and port in node.type.ports:
            made = tuple(source for source, _ in live_sources(node, port, subject.live))
            yield ContextInput(node, port, made, bool(node.sources(port) or node.value(port)))


def domains(subject: LintSubject) -> dict[str, list[Node]]:
    """Return the contexts that a node uses by the domain they name, in words."""
    found: dict[str, list[Node]] = {}
    used = {node.path: node for each in context_inputs(subject) for node in each.contexts}
    for node in used.values():
        if node.type is None or OUTPUT + _CONTEXT not in node.type.ports:
            continue
        number = effective_value(node, _DOMAIN, subject.live)
        if effective_value(node, _FROM_ENVIRONMENT, subject.live) is True:
            words = f"the environment's domain, else domain {number}"
        else:
            words = f"domain {number}"
        found.setdefault(words, []).append(node)
    return found


def domain_of(node: Node, subject: LintSubject) -> str:
    """Return the domain in which a node talks, as far as the stage tells."""
    made = [each for each, _ in live_sources(node, INPUT + _CONTEXT, subject.live)]
    for words, contexts in domains(subject).items():
        if made and made[0] in contexts:
            return words
    return ""
