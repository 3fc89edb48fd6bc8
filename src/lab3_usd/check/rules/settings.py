"""Rules about values: those that the handout sets, and inputs that it leaves alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from msgspec.structs import replace

from lab3_usd.check.lab_topics import role_specs
from lab3_usd.check.match.conformance import Found, resolves_as_asked, setting_matches, settings_of
from lab3_usd.check.match.rule_inputs import GraphSubject, StageSubject
from lab3_usd.check.message_suffixes import with_setting
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.repairs import edits_at
from lab3_usd.facts.endpoints import moving_prims
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.frame_targets import frame_of_prim
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.render_products import sensor_of
from lab3_usd.isaac.node_types import INPUT, Port
from lab3_usd.isaac.topics import resolved_topic
from lab3_usd.isaac.values import Value
from lab3_usd.model.changes import ClearValue, SetValue
from lab3_usd.model.finding import Problem, display, format_paths, role_title, short_source
from lab3_usd.model.physics import REVOLUTE
from lab3_usd.model.stage import Node, listed_once, same_value
from lab3_usd.spec.graph import NodeSpec
from lab3_usd.spec.lab import Checkpoint, Lab


def setting_problem(subject: GraphSubject, judged: Found, message: str) -> Problem:
    """Return the problem of one setting, with how to set it right."""
    setting, wanted = judged.setting, display(judged.setting.value)
    port = setting.port.partition(":")[2]
    wires = ", ".join(map(short_source, judged.node.sources(setting.port)))
    first = f"delete the wire from {wires}, then " if wires else ""
    return Problem(
        prim=judged.node.path,
        property=setting.port,
        message=message,
        expected=wanted,
        actual=display(judged.value),
        handout=setting.handout,
        hint=f"{first}select {role_title(judged.spec)} "
        f"and set {port} to {wanted} in the Property panel",
        fix=edits_at(subject, f"{judged.node.path}.{setting.port}"),
    )


def _frames_forbidden(subject: GraphSubject, judged: Found) -> bool:
    """Whether a frame is part of the forbidden transform, which a rule of its own names."""
    tf = judged.spec.type.tf
    if tf is None or judged.setting.port not in tf.names:
        return False
    child = effective_value(judged.node, tf.names[1], subject.live_nodes)
    return child in subject.lab.frames.guarded


def _swapped(subject: GraphSubject) -> dict[tuple[str, str], str]:
    """Return the settings whose values stand in each other's node: (prim, port) -> other prim."""
    wrong = [judged for judged in settings_of(subject) if not judged.met]
    pairs = {}
    for one, other in combinations(wrong, 2):
        if one.spec.type is not other.spec.type or one.setting.port != other.setting.port:
            continue
        if _would_be_met(one, other.value) and _would_be_met(other, one.value):
            pairs[one.node.path, one.setting.port] = other.node.path
            pairs[other.node.path, one.setting.port] = ""
    return pairs


def _would_be_met(judged: Found, value: Value | None) -> bool:
    return setting_matches(judged.node, judged.setting, value)


@rule("P01", "wrong-value", scope="graph")
def wrong_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input has a wrong value.

    Why: the graph runs, but with a topic, frame, size or speed that no other component expects.

    Fix: select the node and type the value named here into its field in the Property panel.

    Example: {running system?}`topicName` '{scan}1' instead of '{scan}': a subscriber waits for
    messages that never come{else}a variable of another name: nothing is read{/}.
    """
    for judged in settings_of(subject):
        node, port = judged.node, judged.setting.port
        if judged.met or not _is_authored(node, port) or _frames_forbidden(subject, judged):
            continue
        actual = display(judged.value)
        if judged.value is None:
            actual = f"connected to {short_source(node.sources(port)[0])}"
        message = f"{port} is {actual}, expected {display(judged.setting.value)}"
        message += with_setting(subject, judged.spec.role, judged.setting, judged.value)
        problem = setting_problem(subject, judged, message)
        likely = _names_what_is_there(subject, judged)
        yield replace(problem, assumes=((node.path, port),), likely=likely)


def _names_what_is_there(subject: GraphSubject, judged: Found) -> bool:
    """Whether the value fits the stage as it is, and the right one does not yet.

    It names a joint, or the frame of the sensor that the node reads or of its link, which stands
    elsewhere or has another name. The right value alone would stop the robot, or put the data of
    the sensor in the wrong place: what it names gets its name and place back first.
    """
    if not isinstance(judged.value, str):
        return False
    stage, wanted = subject.stage, judged.setting.value
    names = {prim.name for prim in stage.prims.values() if prim.type == REVOLUTE and prim.present}
    sensor = sensor_of(judged.node, subject.live_nodes)
    if sensor is not None and judged.value not in names:
        names = {frame_of_prim(path, stage) for path in (sensor, sensor.rpartition("/")[0]) if path}
    return judged.value in names and wanted not in names


def _is_authored(node: Node, port: str) -> bool:
    state = node.state(port)
    return state is not None and (state.value is not None or bool(state.sources))


@rule("P02", "wrong-default", scope="graph")
def wrong_default(subject: GraphSubject) -> Iterator[Problem]:
    """An input has its default, which is wrong here.

    Why: a field that was never edited is not written into the file, and Isaac Sim {isaac} uses its
    own default. The defaults of `useDomainIDEnvVar` and `resetOnStop` are True. A default frame id
    need not be a frame of the robot.

    Fix: select the node and set the field named here in the Property panel.

    Example: `useDomainIDEnvVar` not set: the domain id comes from the environment.
    """
    for judged in settings_of(subject):
        node, port = judged.node, judged.setting.port
        if judged.met or _is_authored(node, port):
            continue
        default, wanted = display(judged.value), display(judged.setting.value)
        message = f"{port} was left at its default {default}, expected {wanted}"
        yield replace(setting_problem(subject, judged, message), assumes=((node.path, port),))


@rule("P07", "swapped-values", scope="graph")
def swapped_values(subject: GraphSubject) -> Iterator[Problem]:
    """Two nodes have each other's value.

    Why: each value reaches the other node's user. {wheels?}With the wheel names exchanged, the left
    command goes to the right wheel, and the robot turns the wrong way.{/}

    Fix: exchange the two values in the Property panel.

    Example: the first Constant Token holds {other_joint}, the second {joint}.
    """
    swapped = _swapped(subject)
    for judged in settings_of(subject):
        port = judged.setting.port
        other = swapped.get((judged.node.path, port))
        if other:
            name = other.rpartition("/")[2]
            message = (
                f"{port} is {display(judged.value)}, expected {display(judged.setting.value)}; "
                f"{name} holds the value that belongs here"
            )
            hint = f"exchange the values of {judged.node.name} and {name}"
            problem = setting_problem(subject, judged, message)
            related = f"{other}.{port}"
            fix = (*problem.fix, *edits_at(subject, related))
            yield replace(problem, hint=hint, related=(related,), fix=fix, covers=((other, port),))


@rule("P04", "kept-default-changed", scope="graph")
def kept_default_changed(subject: GraphSubject) -> Iterator[Problem]:
    """An input that must keep its default was changed.

    Why: a QoS profile, system time or skipped frames change which subscribers receive the topic,
    and when. A robot path overrides the target prim without a message.

    Fix: select the node and reset the field in the Property panel.

    Example: `useSystemTime` True on the helper of a sensor: no transform matches the time stamps of
    the messages.
    """
    for node, spec, port, value in _changed(subject):
        if port.short in subject.lab.policy.keep_default:
            yield _kept_problem(subject, node, spec, port, display(value))
    for fault in subject.wire_faults:
        spec = subject.spec.nodes[subject.roles.role_of[fault.node.path]]
        wired = spec.type.port(fault.port)
        if wired is None or fault.kind != "unasked":
            continue
        # From G on, a rule about topics speaks of profiles.
        judged_as_topic = subject.checkpoint.topics and _is_profile(wired)
        if wired.short in subject.lab.policy.keep_default and not judged_as_topic:
            source = short_source(fault.actual)
            problem = _kept_problem(subject, fault.node, spec, wired, f"connected to {source}")
            yield replace(problem, hint=f"delete the wire from {source}")


def _is_profile(port: Port) -> bool:
    return "qos" in port.short


def _kept_problem(
    subject: GraphSubject, node: Node, spec: NodeSpec, port: Port, actual: str
) -> Problem:
    expected = display(port.default)
    message = f"{port.name} is {actual}, expected its default {expected}"
    hint = f"select {role_title(spec)} and reset {port.short} in the Property panel"
    handout = subject.lab.handout
    usual = handout.behind("P04", spec.handout) if _is_profile(port) else spec.handout
    section = dict(spec.keep).get(port.name, usual)
    fix = edits_at(subject, f"{node.path}.{port.name}")
    return Problem(node.path, message, port.name, expected, actual, section, hint=hint, fix=fix)


@listed_once
def _changed(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Port, Value | None]]:
    """Yield the inputs that the handout does not set and that are away from their default."""
    for node, spec in subject.matched:
        for port in subject.spec.free_inputs[spec.role]:
            state = node.ports.get(port.name)
            is_left_alone = state is None or state.value is None
            if (is_left_alone and port.former is None) or node.sources(port.name):
                continue
            value = node.value(port.name)
            if not same_value(value, port.default):
                yield node, spec, port, value


@rule("P05", "unasked-value", scope="graph", severity="warning")
def unasked_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input that the lab does not mention was changed.

    Why: the robot in the handout behaves as described with the default.

    Fix: reset the field in the Property panel unless your instructor asked for the value.

    Example: {wheels?}`maxWheelSpeed` 2: the robot drives at most at 0.05 m/s{else}`timeNumerator`
    2: the time step is another one{/}.
    """
    policy = subject.lab.policy
    left = (*policy.keep_default, subject.lab.platform.ros.namespace)
    for node, spec, port, value in _changed(subject):
        agrees = port.short in policy.stamp_reset.ports and value is False
        if port.short not in left and not agrees:
            expected, actual = display(port.default), display(value)
            message = f"{port.name} is {actual}, the handout leaves it at {expected}"
            section = dict(spec.keep).get(port.name, spec.handout)
            problem = Problem(node.path, message, port.name, expected, actual, section)
            yield _left_alone(problem, port.name, subject)
    for node, spec, name, prims in _aimed(subject):
        expected, actual = format_paths(()), format_paths(prims)
        message = f"{name} names {actual}, the handout leaves it empty"
        problem = Problem(node.path, message, name, expected, actual, spec.handout)
        yield _left_alone(problem, name, subject)


def _left_alone(problem: Problem, name: str, subject: GraphSubject) -> Problem:
    """Return a problem of an input that the handout leaves alone, which another one explains."""
    fix = edits_at(subject, f"{problem.prim}.{name}")
    return replace(problem, fix=fix, assumes=((problem.prim, name),))


def _aimed(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, str, tuple[str, ...]]]:
    """Yield the relationships that the handout leaves empty and that name prims of the student.

    A node that does by itself what a missing node should do for it is reported as the missing node.
    """
    own = subject.lab.platform.graph.ignored_below
    for node, spec in subject.matched:
        wires = subject.spec.wires_into(spec.role)
        lacks_source = any(subject.roles.node_of[wire.source.role] is None for wire in wires)
        for port in subject.spec.free_targets[spec.role]:
            prims = tuple(path for path in node.targets(port.name) if not path.startswith(own))
            if prims and not lacks_source:
                yield node, spec, port.name, prims


@rule("P06", "namespace", scope="graph")
def namespace(subject: GraphSubject) -> Iterator[Problem]:
    """A namespace of a node changes its topic.

    Why: with a namespace, `{scan}` becomes `/<namespace>{scan}`, and nothing in the lab subscribes
    to it. One of white space is a note: Isaac Sim trims it to nothing.

    Fix: select the node and clear nodeNamespace in the Property panel, or delete the wire into it.

    Example: `nodeNamespace` 'lab' on the clock publisher: the topic is /lab/clock.
    """
    name = INPUT + subject.lab.platform.ros.namespace
    for node, spec in subject.matched:
        value = effective_value(node, name, subject.live_nodes)
        is_free = name in [port.name for port in subject.spec.free_inputs[spec.role]]
        if not is_free or not isinstance(value, str):
            continue
        is_moved, sources, shown = bool(resolved_topic(value)), node.sources(name), display(value)
        is_as_asked = is_moved and resolves_as_asked(node, spec, subject)
        if is_as_asked or not (is_moved or value.isspace()):
            continue
        short = subject.lab.platform.ros.namespace
        hint = f"select {role_title(spec)} and clear {short} in the Property panel"
        if sources:
            hint = f"delete the wire from {', '.join(map(short_source, sources))}"
        yield Problem(
            node.path,
            f"{name} is {shown}, expected no namespace",
            name,
            "''",
            shown,
            spec.handout,
            severity=None if is_moved else "note",
            hint=hint,
            fix=edits_at(subject, f"{node.path}.{name}"),
        )


@rule("P08", "topic-spelling", scope="graph", severity="note")
def topic_spelling(subject: GraphSubject) -> Iterator[Problem]:
    """A topic is spelled differently, but means the same.

    Why: Isaac Sim removes characters other than letters and digits from both ends and adds a
    leading slash, so `clock` becomes `/clock`. A namespace may also stand in the name. The topic
    works.

    Fix: nothing is required. Write the leading slash to be clear.

    Example: `topicName` 'clock' instead of '/clock'.
    """
    for judged in settings_of(subject):
        is_topic = judged.setting.port in judged.spec.type.topics
        if is_topic and judged.met and judged.value != judged.setting.value:
            message = f"{judged.setting.port} is {_same_topic(judged, subject)}"
            site = (judged.node.path, judged.setting.port)
            yield replace(setting_problem(subject, judged, message), assumes=(site,))


def _same_topic(judged: Found, subject: GraphSubject) -> str:
    """Say why a topic is the one asked for: by its spelling, or by another namespace before it."""
    own, asked = display(judged.value), display(judged.setting.value)
    if setting_matches(judged.node, judged.setting, judged.value):
        return f"{own}, which is {asked} to ROS 2"
    port = INPUT + subject.lab.platform.ros.namespace
    space = str(effective_value(judged.node, port, subject.live_nodes) or "")
    of_role = next((str(each.value) for each in judged.spec.settings if each.port == port), "")
    topic = resolved_topic(str(judged.value), space)
    return f"{own}{_within(space)}, which gives {topic} as {asked}{_within(of_role)} does"


def _within(namespace: str) -> str:
    return f" in the namespace '{namespace}'" if namespace else ""


@rule("P09", "stamp-reset", scope="stage", severity="note")
def stamp_reset(subject: StageSubject) -> Iterator[Problem]:
    """A sensor's time restarts on Stop, the clock's does not.

    Why: the clock has resetOnStop False. The sensor helpers reset their own time by default.
    After Stop and Play, their messages have time stamps in the past. There is one finding for the
    stage.

    Fix: set resetSimulationTimeOnStop False on the helpers, or restart Isaac Sim between runs. The
    handout does not ask for it.

    Example: {scan} has time stamp 2.0 s while /clock is at 95.0 s after a second Play.
    """
    reset = subject.lab.policy.stamp_reset
    ports = list(_with_value(subject, reset.ports, value=True))
    if ports and any(_with_value(subject, (reset.agree,), value=False)):
        (prim, port), more = ports[0], ports[1:]
        related = tuple(f"{path}.{name}" for path, name in more)
        message = f"{port} is True: time stamps restart at Stop, but the clock does not"
        yield Problem(prim, message, port, "False", "True", related=related)


def _with_value(
    subject: StageSubject, ports: Sequence[str], *, value: bool
) -> Iterator[tuple[str, str]]:
    """Yield node and input of the lab's graphs where one of some inputs has a value."""
    names = [f"{INPUT}{short}" for short in ports]
    for node in (node for roles in subject.roles.values() for node in roles.node_of.values()):
        if node is None or node.type is None:
            continue
        for name in names:
            if name in node.type.ports and node.value(name) is value:
                yield node.path, name


def _namespaces(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    made = {sensor.path: name for name, sensor in lab.sensors.items()}
    made |= {graph.path: name for name, graph in lab.graphs.items()}
    there = {*checkpoint.sensors, *checkpoint.graphs}
    for path, name in lab.scene.namespaces.items():
        if made.get(path) is None or made[path] in there:
            group, handout = lab.scene.group_of(path), lab.policy.handout
            title = f"{path} has the namespace {name}"
            yield Demand(f"{group}/namespace/{path.rpartition('/')[2]}", title, path, handout)


@rule("P10", "namespace-attribute", scope="stage", demands=_namespaces)
def namespace_attribute(subject: StageSubject) -> Iterator[Problem]:
    """A prim's namespace moves a topic, or a required one is missing.

    Why: Isaac Sim joins the namespaces of the prim and all its ancestors and puts them before the
    topic name. A sensor helper uses those of its sensor. `{scan}` becomes `/<namespace>{scan}`
    although the node says `{scan}`.

    Fix: select the prim named here and clear its Namespace in the Property panel.

    Example: `isaac:namespace` 'lab' on the robot root.
    """
    attribute, stage, lab = subject.lab.platform.ros.namespace_attribute, subject.stage, subject.lab
    live = live_nodes(stage)
    moved: dict[tuple[str, str], list[str]] = {}
    for path, role in role_specs(subject).items():
        node = live.get(path) if role.type.topics else None
        for site in () if node is None else moving_prims(node, stage, live):
            moved.setdefault(site, []).append(path)
    asked = lab.scene.namespaces
    for demand in _namespaces(lab, subject.checkpoint):
        prim, name = stage.prim(demand.prim), asked[demand.prim]
        actual = None if prim is None else prim.attributes.get(attribute, "")
        if prim is not None and actual != name:
            yield Problem(
                demand.prim,
                f"{attribute} is {display(actual)}, expected {display(name)}",
                attribute,
                name,
                display(actual),
                hint=f"select {demand.prim} and set {attribute} to {name} in the Property panel",
                fix=(SetValue(demand.prim, attribute, "string", name),),
                unmet=(demand.id,),
                rests_on=stage.unknown(demand.prim),
            )
    for (path, value), nodes in moved.items():
        if resolved_topic(value) and path not in asked:
            named = nodes[0].rpartition("/")[2] if len(nodes) == 1 else f"{len(nodes)} nodes"
            message = f"{attribute} is {display(value)}, which moves the topics of {named}"
            yield Problem(
                path,
                message,
                attribute,
                expected="''",
                actual=display(value),
                related=tuple(nodes),
                fix=(ClearValue(path, attribute),),
                costs=tuple(
                    graph
                    for graph, roles in subject.roles.items()
                    if not roles.role_of.keys().isdisjoint(nodes)
                ),
            )
