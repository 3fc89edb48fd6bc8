"""Rules about the values of inputs: what the handout sets, and what it leaves alone."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.met import same_value, setting_met, setting_value
from lab3_usd.check.model import Node
from lab3_usd.check.names import resolved_topic
from lab3_usd.check.registry import rule
from lab3_usd.check.say import shown, titled
from lab3_usd.check.subject import GraphSubject, Roles, StageSubject
from lab3_usd.spec.catalog import Port, Value
from lab3_usd.spec.spec import NodeSpec, Setting

_FAMILIES = (
    ("float", "double", "half"),
    ("int", "uint", "int64", "uint64", "uchar"),
    ("string", "token"),
)


def _settings(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Setting, Value | None]]:
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        for setting in spec.settings if node is not None else ():
            if node is not None:
                yield node, spec, setting, setting_value(subject.live, node, setting.port)


def _problem(node: Node, spec: NodeSpec, setting: Setting, value: Value | None, message: str) -> Problem:
    port = setting.port.partition(":")[2]
    return Problem(
        prim=node.path,
        property=setting.port,
        message=message,
        expected=shown(setting.value),
        actual=shown(value),
        handout=setting.handout,
        hint=f"select {titled(spec)} and set {port} to {shown(setting.value)} in the Property panel",
    )


def _wrong_type(node: Node, port: Port | None) -> str | None:
    """Return the type that the file declares, when it is none the port can have."""
    state = None if port is None else node.state(port.name)
    if port is None or state is None or port.is_union or state.usd_type == port.usd_type:
        return None
    for family in _FAMILIES:
        if state.usd_type in family and port.usd_type in family:
            return None
    return state.usd_type


def _makes_forbidden_frame(subject: GraphSubject, node: Node) -> bool:
    """Whether a publisher's frames are the forbidden ones, which a rule of their own names."""
    tf = None if node.type is None else node.type.tf
    if tf is None or not tf.names:
        return False
    return node.value(tf.names[1]) == subject.lab.frames.forbidden_edge[1]


def _swapped(subject: GraphSubject) -> dict[tuple[str, str], str]:
    """Return the settings whose values stand in each other's node: (prim, port) -> other prim."""
    wrong = [
        (node, spec, setting, value)
        for node, spec, setting, value in _settings(subject)
        if not setting_met(node, setting, value)
    ]
    found = {}
    for index, (node, spec, setting, value) in enumerate(wrong):
        for other, other_spec, other_setting, other_value in wrong[index + 1 :]:
            same_kind = spec.type is other_spec.type and setting.port == other_setting.port
            if same_kind and setting_met(node, other_setting, value):
                if setting_met(other, setting, other_value):
                    found[node.path, setting.port] = other.path
                    found[other.path, setting.port] = ""
    return found


@rule("P01", "wrong-value", scope="graph")
def wrong_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input has another value than the handout asks for.

    Why: the graph runs, with another topic, frame, size or speed than everything that talks to
    it expects.

    Fix: select the node and type the value named here into its field in the Property panel.

    Example: `topicName` 'scan1' instead of '/scan': Nav2 waits for a scan that never comes.
    """
    swapped = _swapped(subject)
    for node, spec, setting, value in _settings(subject):
        if (node.path, setting.port) in swapped or setting_met(node, setting, value):
            continue
        if not _is_authored(node, setting.port) or _has_wrong_type(node, setting.port):
            continue
        tf = None if node.type is None else node.type.tf
        if tf is not None and setting.port in tf.names and _makes_forbidden_frame(subject, node):
            continue
        message = f"{setting.port} is {shown(value)}, expected {shown(setting.value)}"
        yield _problem(node, spec, setting, value, message)


def _is_authored(node: Node, port: str) -> bool:
    state = node.state(port)
    return state is not None and (state.value is not None or bool(state.sources))


def _has_wrong_type(node: Node, port: str) -> bool:
    return _wrong_type(node, None if node.type is None else node.type.port(port)) is not None


@rule("P02", "wrong-default", scope="graph")
def wrong_default(subject: GraphSubject) -> Iterator[Problem]:
    """An input was left at its default, which is not what the handout asks for.

    Why: a field that nobody touched is not written into the file; Isaac Sim 6.0.1 then uses its
    own default. `useDomainIDEnvVar` and `resetOnStop` are True, frame ids are base_link,
    sim_lidar and sim_camera by default.

    Fix: select the node and set the field named here in the Property panel.

    Example: `useDomainIDEnvVar` left alone: the domain is whatever the environment says.
    """
    for node, spec, setting, value in _settings(subject):
        if _is_authored(node, setting.port) or setting_met(node, setting, value):
            continue
        if _has_wrong_type(node, setting.port):
            continue
        message = (
            f"{setting.port} was left at its default {shown(value)}, expected {shown(setting.value)}"
        )
        yield _problem(node, spec, setting, value, message)


@rule("P03", "wrong-value-type", scope="graph")
def wrong_value_type(subject: GraphSubject) -> Iterator[Problem]:
    """An input is declared with a type that its node type does not have.

    Why: Isaac Sim cannot read the value and uses its default instead.

    Fix: delete the node and add it again from the node list, then set its fields.

    Example: `double inputs:wheelRadius` written as a string by a script.
    """
    for node, spec, setting, value in _settings(subject):
        port = None if node.type is None else node.type.port(setting.port)
        declared = _wrong_type(node, port)
        if declared is not None and port is not None:
            message = f"{setting.port} is of type {declared}, expected {port.usd_type}"
            yield _problem(node, spec, setting, value, message)


@rule("P04", "kept-default-changed", scope="graph")
def kept_default_changed(subject: GraphSubject) -> Iterator[Problem]:
    """An input that must stay at its default was changed.

    Why: a QoS profile, system time or skipped frames change who hears the topic and when; a robot
    path silently overrides the target prim.

    Fix: select the node and reset the field in the Property panel.

    Example: `useSystemTime` True on the lidar: the scan's stamps fit no transform.
    """
    for node, spec, port, value in _changed(subject):
        if port.short in subject.lab.policy.keep_default:
            message = f"{port.name} is {shown(value)}, expected its default {shown(port.default)}"
            hint = f"select {titled(spec)} and reset {port.short} in the Property panel"
            section = dict(spec.keep).get(port.name, "G6" if "qos" in port.short else spec.handout)
            expected, actual = shown(port.default), shown(value)
            yield Problem(
                node.path, message, port.name, expected, actual, section, hint=hint
            )


def _changed(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Port, Value | None]]:
    """Yield the inputs that the handout does not set and that are away from their default."""
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        asked = {setting.port for setting in spec.settings}
        wired = {wire.target.port for wire in subject.spec.wires_into(role)}
        for port in spec.type.ports.values() if node is not None else ():
            free = not (port.is_source or port.is_execution or port.is_target or port.is_union)
            if node is None or not free or port.name in asked or port.name in wired:
                continue
            value = node.value(port.name)
            if not node.sources(port.name) and not same_value(value, port.default):
                yield node, spec, port, value


@rule("P05", "unasked-value", scope="graph", severity="warning")
def unasked_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input that the handout leaves alone was changed.

    Why: the handout's robot behaves as described with the default; acceleration limits, for one,
    stop the controller unless its time step is wired.

    Fix: reset the field in the Property panel unless your instructor asked for the value.

    Example: `maxAcceleration` 0.5 with nothing wired to `dt`: the robot does not move.
    """
    policy = subject.lab.policy
    left = (*policy.keep_default, policy.namespace)
    for node, spec, port, value in _changed(subject):
        if port.short not in left:
            message = (
                f"{port.name} is {shown(value)}, the handout leaves it at {shown(port.default)}"
            )
            section = dict(spec.keep).get(port.name, spec.handout)
            expected, actual = shown(port.default), shown(value)
            yield Problem(node.path, message, port.name, expected, actual, section)


@rule("P06", "namespace", scope="graph")
def namespace(subject: GraphSubject) -> Iterator[Problem]:
    """A node namespace moves a topic.

    Why: with a namespace `/scan` becomes `/<namespace>/scan`, and nothing in the lab listens there.

    Fix: select the node and clear nodeNamespace in the Property panel.

    Example: `nodeNamespace` 'tb3' on the clock publisher: the topic is /tb3/clock.
    """
    for node, spec, port, value in _changed(subject):
        if port.short == subject.lab.policy.namespace and resolved_topic(str(value)):
            message = f"{port.name} is {shown(value)}, expected no namespace"
            hint = f"select {titled(spec)} and clear {port.short} in the Property panel"
            yield Problem(
                node.path, message, port.name, "''", shown(value), spec.handout, hint=hint
            )


@rule("P07", "swapped-values", scope="graph")
def swapped_values(subject: GraphSubject) -> Iterator[Problem]:
    """Two nodes hold each other's value.

    Why: with the wheel names exchanged the left command goes to the right wheel: the robot turns
    the wrong way.

    Fix: exchange the two values in the Property panel.

    Example: the first Constant Token holds wheel_right_joint, the second wheel_left_joint.
    """
    swapped = _swapped(subject)
    for node, spec, setting, value in _settings(subject):
        other = swapped.get((node.path, setting.port))
        if other:
            name = other.rpartition("/")[2]
            message = (
                f"{setting.port} is {shown(value)}, expected {shown(setting.value)}; "
                f"{name} holds the value that belongs here"
            )
            problem = _problem(node, spec, setting, value, message)
            yield Problem(
                problem.prim, message, problem.property, problem.expected, problem.actual,
                problem.handout, (f"{other}.{setting.port}",),
                hint=f"exchange the values of {node.name} and {name}",
            )  # fmt: skip


@rule("P08", "topic-spelling", scope="graph", severity="note")
def topic_spelling(subject: GraphSubject) -> Iterator[Problem]:
    """A topic is spelled otherwise than in the handout, and resolves to the same name.

    Why: Isaac Sim trims what is no letter or digit off both ends and puts a slash before the
    rest, so that `clock` is `/clock`. Nothing is lost.

    Fix: nothing needs to be done; write the leading slash to be clear.

    Example: `topicName` 'clock' instead of '/clock'.
    """
    for node, spec, setting, value in _settings(subject):
        is_topic = node.type is not None and setting.port in node.type.topics
        if is_topic and setting_met(node, setting, value) and value != setting.value:
            message = f"{setting.port} is {shown(value)}, which is {shown(setting.value)} to ROS 2"
            yield _problem(node, spec, setting, value, message)


@rule("P09", "stamp-reset", scope="stage", severity="note")
def stamp_reset(subject: StageSubject) -> Iterator[Problem]:
    """A sensor's time restarts on Stop while the clock goes on.

    Why: the handout sets resetOnStop False on the clock; the sensor helpers reset their own time
    by default. After Stop and Play, scans and images carry stamps of the past. Said once for the
    stage.

    Fix: set resetSimulationTimeOnStop False on the helpers, or restart Isaac Sim between runs. The
    handout does not ask for it.

    Example: /scan stamped 2.0 s while /clock says 95.0 s after a second Play.
    """
    found = [site for roles in subject.roles.values() for site in _resetting(subject, roles)]
    if found:
        (prim, port), others = found[0], found[1:]
        related = tuple(f"{path}.{name}" for path, name in others)
        message = f"{port} is True: stamps restart on Stop, while the clock goes on"
        yield Problem(prim, message, port, "False", "True", "8.16", related)


def _resetting(subject: StageSubject, roles: Roles) -> Iterator[tuple[str, str]]:
    """Yield the inputs that make a helper's own time restart."""
    for node in roles.node_of.values():
        for port in node.type.ports.values() if node is not None and node.type is not None else ():
            if node is not None and port.short in subject.lab.policy.stamp_ports:
                if node.value(port.name) is True:
                    yield node.path, port.name


@rule("P10", "namespace-attribute", scope="stage")
def namespace_attribute(subject: StageSubject) -> Iterator[Problem]:
    """A prim above a graph or sensor carries a namespace that moves its topics.

    Why: Isaac Sim joins the namespaces of all ancestors before the topic name; `/scan` becomes
    `/<namespace>/scan` although the node says `/scan`.

    Fix: select the prim named here and clear its Namespace in the Property panel.

    Example: `isaac:namespace` 'tb3' on the robot root.
    """
    attribute = subject.lab.policy.namespace_attribute
    graphs = [subject.lab.graphs[name].path for name in subject.checkpoint.graphs]
    for path, prim in subject.stage.prims.items():
        value = prim.attributes.get(attribute)
        if prim.present and value and any(graph.startswith(f"{path}/") for graph in graphs):
            message = f"{attribute} is {shown(value)}, which moves every topic below this prim"
            yield Problem(path, message, attribute, "''", shown(value))
