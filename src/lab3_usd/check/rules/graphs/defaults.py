"""Rules about inputs that the handout leaves alone: defaults, namespaces, spelling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.match.conformance import same_value
from lab3_usd.check.match.lab_topics import role_specs
from lab3_usd.check.match.subject import GraphSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import live_nodes
from lab3_usd.check.ros.topics import moving_prims
from lab3_usd.check.rules.graphs.limits import stopping_limits
from lab3_usd.check.rules.graphs.settings import setting_problem, settings_of
from lab3_usd.model.derived import once_per_stage
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import display, format_paths, role_title, short_source
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, Port, Value
from lab3_usd.spec.graph import NodeSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.topic_names import resolved_topic


@rule("P04", "kept-default-changed", scope="graph")
def kept_default_changed(subject: GraphSubject) -> Iterator[Problem]:
    """An input that must keep its default was changed.

    Why: a QoS profile, system time or skipped frames change which subscribers receive the topic,
    and when. A robot path overrides the target prim without a message.

    Fix: select the node and reset the field in the Property panel.

    Example: `useSystemTime` True on the lidar: no transform matches the time stamps of the scan.
    """
    for node, spec, port, value in _changed(subject):
        if port.short in subject.lab.policy.keep_default:
            yield _kept_problem(subject.lab, node, spec, port, display(value))
    for fault in subject.wire_faults:
        spec = subject.spec.nodes[subject.roles.role_of[fault.node.path]]
        wired = spec.type.port(fault.port)
        if wired is not None and fault.kind == "unasked" and _is_kept_from_wires(subject, wired):
            source = short_source(fault.actual)
            problem = _kept_problem(subject.lab, fault.node, spec, wired, f"wired from {source}")
            yield replace(problem, hint=f"delete the wire from {source}")


def _is_kept_from_wires(subject: GraphSubject, port: Port) -> bool:
    """Whether no wire may end here; from G on, a rule about topics speaks of profiles."""
    judged_as_topic = subject.checkpoint.topics and _is_profile(port)
    return port.short in subject.lab.policy.keep_default and not judged_as_topic


def _is_profile(port: Port) -> bool:
    return "qos" in port.short


def _kept_problem(lab: Lab, node: Node, spec: NodeSpec, port: Port, actual: str) -> Problem:
    expected = display(port.default)
    message = f"{port.name} is {actual}, expected its default {expected}"
    hint = f"select {role_title(spec)} and reset {port.short} in the Property panel"
    usual = lab.handout.behind("P04", spec.handout) if _is_profile(port) else spec.handout
    section = dict(spec.keep).get(port.name, usual)
    return Problem(node.path, message, port.name, expected, actual, section, hint=hint)


_Changed = tuple[Node, NodeSpec, Port, Value | None]


@once_per_stage
def _changed(subject: GraphSubject) -> tuple[_Changed, ...]:
    return tuple(_find_changed(subject))


def _find_changed(subject: GraphSubject) -> Iterator[_Changed]:
    """Yield the inputs that the handout does not set and that are away from their default."""
    for node, spec in subject.matched():
        for port in subject.spec.free_inputs[spec.role]:
            value = node.value(port.name)
            if not node.sources(port.name) and not same_value(value, port.default):
                yield node, spec, port, value


@rule("P05", "unasked-value", scope="graph", severity="warning")
def unasked_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input that the handout does not mention was changed.

    Why: the robot in the handout behaves as described with the default.

    Fix: reset the field in the Property panel unless your instructor asked for the value.

    Example: `maxWheelSpeed` 2: the robot drives at most at 0.05 m/s.
    """
    policy = subject.lab.policy
    left = (*policy.keep_default, policy.namespace)
    for node, spec, port, value in _changed(subject):
        agrees = port.short in policy.stamp_reset.ports and value is False
        stops = port.name in dict(stopping_limits(subject.live_nodes, node))
        if port.short not in left and not agrees and not stops:
            message = (
                f"{port.name} is {display(value)}, the handout leaves it at {display(port.default)}"
            )
            section = dict(spec.keep).get(port.name, spec.handout)
            expected, actual = display(port.default), display(value)
            yield Problem(node.path, message, port.name, expected, actual, section)
    for node, spec, name, prims in _aimed(subject):
        message = f"{name} names {format_paths(prims)}, the handout leaves it empty"
        yield Problem(node.path, message, name, format_paths(()), format_paths(prims), spec.handout)


def _aimed(
    subject: GraphSubject,
) -> Iterator[tuple[Node, NodeSpec, str, tuple[str, ...]]]:
    """Yield the relationships that the handout leaves empty and that name prims of the student.

    A node that does by itself what a missing node should do for it is told as the missing node.
    """
    own = subject.lab.catalog.graph.ignored_below
    for node, spec in subject.matched():
        for port in subject.spec.free_targets[spec.role]:
            prims = tuple(path for path in node.targets(port.name) if not path.startswith(own))
            if prims and not _lacks_source(subject, spec):
                yield node, spec, port.name, prims


def _lacks_source(subject: GraphSubject, spec: NodeSpec) -> bool:
    """Whether a node is missing that a wire should come from."""
    wires = subject.spec.wires_into(spec.role)
    return None in (subject.roles.node_of[wire.source.role] for wire in wires)


@rule("P06", "namespace", scope="graph")
def namespace(subject: GraphSubject) -> Iterator[Problem]:
    """A node namespace changes the name of a topic.

    Why: with a namespace, `{scan}` becomes `/<namespace>{scan}`, and nothing in the lab subscribes
    to it.

    Fix: select the node and clear nodeNamespace in the Property panel.

    Example: `nodeNamespace` 'tb3' on the clock publisher: the topic is /tb3/clock.
    """
    for node, spec, port, value in _changed(subject):
        if port.short == subject.lab.policy.namespace and resolved_topic(str(value)):
            message = f"{port.name} is {display(value)}, expected no namespace"
            hint = f"select {role_title(spec)} and clear {port.short} in the Property panel"
            yield Problem(
                node.path, message, port.name, "''", display(value), spec.handout, hint=hint
            )


@rule("P08", "topic-spelling", scope="graph", severity="note")
def topic_spelling(subject: GraphSubject) -> Iterator[Problem]:
    """A topic is spelled differently from the handout, but resolves to the same name.

    Why: Isaac Sim removes characters other than letters and digits from both ends and adds a
    leading slash, so `clock` becomes `/clock`. The topic works.

    Fix: nothing is required. Write the leading slash to be clear.

    Example: `topicName` 'clock' instead of '/clock'.
    """
    for found in settings_of(subject):
        is_topic = found.setting.port in found.spec.type.topics
        if is_topic and found.met and found.value != found.setting.value:
            wanted = display(found.setting.value)
            message = f"{found.setting.port} is {display(found.value)}, which is {wanted} to ROS 2"
            yield setting_problem(found, message)


@rule("P09", "stamp-reset", scope="stage", severity="note")
def stamp_reset(subject: StageSubject) -> Iterator[Problem]:
    """The time of a sensor restarts on Stop while the clock continues.

    Why: the clock has resetOnStop False. The sensor helpers reset their own time by default.
    After Stop and Play, scans and images have time stamps in the past. There is one finding for the
    stage.

    Fix: set resetSimulationTimeOnStop False on the helpers, or restart Isaac Sim between runs. The
    handout does not ask for it.

    Example: {scan} has time stamp 2.0 s while /clock is at 95.0 s after a second Play.
    """
    reset = subject.lab.policy.stamp_reset
    found = list(_with_value(subject, reset.ports, value=True))
    if found and any(_with_value(subject, (reset.agree,), value=False)):
        (prim, port), others = found[0], found[1:]
        related = tuple(f"{path}.{name}" for path, name in others)
        message = f"{port} is True: stamps restart on Stop, while the clock goes on"
        yield Problem(prim, message, port, "False", "True", related=related)


def _with_value(
    subject: StageSubject, ports: Sequence[str], *, value: bool
) -> Iterator[tuple[str, str]]:
    """Yield node and input of the lab's graphs where one of some inputs has a value."""
    for node in (each for roles in subject.roles.values() for each in roles.node_of.values()):
        if node is None or node.type is None:
            continue
        for name in (f"{INPUT}{short}" for short in ports):
            if name in node.type.ports and node.value(name) is value:
                yield node.path, name


@rule("P10", "namespace-attribute", scope="stage")
def namespace_attribute(subject: StageSubject) -> Iterator[Problem]:
    """A namespace on a node, its sensor or a prim above them changes the name of a topic.

    Why: Isaac Sim joins the namespaces of the prim and all its ancestors and puts them before the
    topic name. A sensor helper uses those of its sensor. `{scan}` becomes `/<namespace>{scan}`
    although the node says `{scan}`.

    Fix: select the prim named here and clear its Namespace in the Property panel.

    Example: `isaac:namespace` 'tb3' on the robot root.
    """
    attribute, stage, lab = subject.lab.policy.namespace_attribute, subject.stage, subject.lab
    live = live_nodes(stage, lab)
    moved: dict[tuple[str, str], list[str]] = {}
    for path, role in role_specs(subject).items():
        node = live.get(path) if role.type.topics else None
        for site in () if node is None else moving_prims(node, stage, lab, live):
            moved.setdefault(site, []).append(path)
    for (path, value), nodes in moved.items():
        if resolved_topic(value):
            message = (
                f"{attribute} is {display(value)}, which moves the topics of {_counted(nodes)}"
            )
            yield Problem(path, message, attribute, "''", display(value), related=tuple(nodes))


def _counted(nodes: list[str]) -> str:
    return nodes[0].rpartition("/")[2] if len(nodes) == 1 else f"{len(nodes)} nodes"
