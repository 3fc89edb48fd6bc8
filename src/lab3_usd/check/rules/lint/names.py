"""Rules about values and names: of tokens, topics and frames."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lint.names import did_you_mean, likely_name
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.lint.written_names import refused_namespaces, written_frames, written_topics
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import effective_value
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import display


@rule("K34", "value-of-another-type", scope="lint")
def value_of_another_type(subject: LintSubject) -> Iterator[Problem]:
    """A value is declared with a type that the port does not have.

    Why: Isaac Sim makes the port with its own type and leaves the value out, so that the default
    counts.

    Fix: delete the node, add it again and set the value in the Property panel.

    Example: `inputs:wheelRadius` written as a string by a script, although it is a double.
    """
    for node in subject.live.values():
        for name, state in node.ports.items():
            port = None if node.type is None else node.type.port(name)
            if port is None or state.value is None or port.is_union or port.is_target:
                continue
            if state.usd_type not in ("", port.usd_type, *_SAME.get(port.usd_type, ())):
                yield Problem(
                    node.path,
                    f"{name} is of type {state.usd_type}, expected {port.usd_type}",
                    property=name,
                    expected=port.usd_type,
                    actual=state.usd_type,
                )


# Files of earlier releases declare these otherwise, and are read all the same.
_SAME = {
    "string": ("token",),
    "token": ("string",),
    "uint64": ("uint", "int", "int64"),
    "uint": ("int", "uint64"),
    "double": ("float",),
    "float": ("double",),
    "vector3d": ("double3",),
}


@rule("K35", "value-not-offered", scope="lint")
def value_not_offered(subject: LintSubject) -> Iterator[Problem]:
    """An input holds a token that it does not offer.

    Why: the node refuses the value with an error, or takes another one.

    Fix: choose one of the values that the Property panel offers.

    Example: `inputs:type = "depth_image"` on a ROS2 Camera Helper, which offers `depth`.
    """
    for node in subject.live.values():
        for name in node.ports:
            port = None if node.type is None else node.type.port(name)
            if port is None or not port.allowed:
                continue
            value = effective_value(node, name, subject.live)
            known = (*port.allowed, *(() if node.type is None else node.type.message))
            if isinstance(value, str) and value not in ("", port.default, *known):
                near = likely_name(value, port.allowed)
                yield Problem(
                    node.path,
                    f"{name} is {display(value)}, which {subject.title(node)} does not offer"
                    f"{did_you_mean(near)}",
                    property=name,
                    expected=near or ", ".join(port.allowed),
                    actual=value,
                )


@rule("K37", "topic-name", scope="lint")
def topic_name(subject: LintSubject) -> Iterator[Problem]:
    """ROS 2 refuses the name of a topic or namespace, or the bridge changes that of a topic.

    Why: the bridge strips whatever is no letter or digit from both ends of a name, and ROS 2
    refuses what is left where it holds spaces, dashes or a digit first. A name that is refused
    gives no publisher; one that is changed gives a topic that nobody looks for.

    Fix: write letters, digits, underscores and slashes, a letter first.

    Example: `inputs:topicName = "camera-1/rgb image"`.
    """
    for name in written_topics(subject):
        if name.resolved is None:
            yield Problem(
                name.node.path,
                f"{name.port} is {display(name.written)}, which ROS 2 refuses"
                if name.written
                else f"{name.port} is empty, so that there is no topic",
                property=name.port,
                actual=name.written,
            )
        elif name.is_changed:
            yield Problem(
                name.node.path,
                f"{name.port} is {display(name.written)}, and the topic is {name.resolved}",
                property=name.port,
                expected=name.resolved,
                actual=name.written,
                severity="warning",
            )
    for node, namespace in refused_namespaces(subject):
        yield Problem(
            node.path,
            f"the namespace of its topics is {display(namespace)}, which ROS 2 refuses",
            expected="letters, digits, underscores and slashes, a letter first",
            actual=namespace,
        )


@rule("K38", "frame-name", scope="lint", severity="warning")
def frame_name(subject: LintSubject) -> Iterator[Problem]:
    """The name of a frame is empty, or begins with a slash.

    Why: tf2 refuses an empty name and one that begins with a slash: no transform is found for the
    message.

    Fix: write the name as in the TF tree, without a slash.

    Example: `inputs:frameId = "/base_scan"`.
    """
    for node, port, value in written_frames(subject):
        is_stripped = node.type is not None and node.type.tf is not None  # by tf2
        if not value or (value.startswith("/") and not is_stripped):
            what = "is empty" if not value else f"is {display(value)}, with a slash first"
            yield Problem(
                node.path,
                f"{port} {what}",
                property=port,
                expected=value.lstrip("/") or "the name of a frame",
                actual=value,
            )
