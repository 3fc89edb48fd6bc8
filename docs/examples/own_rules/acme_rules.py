"""Rules of a company of its own."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.own_rules import Problem, SetValue, Subject, effective_value, own_rule


@own_rule("ACME01", "topic-with-capitals", severity="warning")
def topic_with_capitals(subject: Subject) -> Iterator[Problem]:
    """A topic has capital letters in its name.

    Why: our launch files know lower-case names only.

    Fix: write the name in lower case.

    Example: `/Odom`.
    """
    for node in subject.nodes():
        topic = effective_value(node, "inputs:topicName", subject.live)
        if isinstance(topic, str) and topic != topic.lower():
            yield Problem(
                node.path,
                f"inputs:topicName is '{topic}'",
                property="inputs:topicName",
                expected=topic.lower(),
                actual=topic,
                fix=(SetValue(node.path, "inputs:topicName", "string", topic.lower()),),
            )
