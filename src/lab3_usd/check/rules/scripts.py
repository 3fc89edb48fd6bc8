"""Rules about scripts that build graphs: the lines at which they stop, or lose something."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.any_wire import leaves_out, lost_port
from lab3_usd.facts.likely_names import did_you_mean
from lab3_usd.isaac.node_types import INPUT, NodeType
from lab3_usd.model.build import BuildFault, FaultKind
from lab3_usd.model.changes import RenameProperty
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node, PortState

_STATE = "state:"


def _faults(subject: LintSubject, *kinds: FaultKind) -> Iterator[BuildFault]:
    build = subject.stage.build
    return (fault for fault in (build.faults if build else ()) if fault.kind in kinds)


def _set_ports(subject: LintSubject) -> Iterator[tuple[Node, NodeType, PortState]]:
    """Yield the ports that a script gives a value or targets."""
    build = subject.stage.build
    written = () if build is None else build.places
    for node in subject.nodes():
        for state in node.ports.values():
            is_set = state.value is not None or state.targets
            if node.type is not None and is_set and (node.path, state.name, None) in written:
                yield node, node.type, state


@rule("B01", "value-at-unknown-port", scope="script")
def value_at_unknown_port(subject: LintSubject) -> Iterator[Problem]:
    """A value is set at a port that its node type lacks.

    Why: OmniGraph looks the attribute up and raises an error. The graph stays half built, and the
    script ends unless it catches the error. Ports were renamed and removed between releases.

    Fix: write the name of a port that the node has, or leave the line out.

    Example: `("odom.inputs:frameId", "odom")`; the port of ROS2 Publish Odometry is `odomFrameId`.

    Basis: the Python of OmniGraph (object lookup), and the ports of Isaac Sim's source. Ports
    of Kit's nodes are those of its documentation: another one is a warning.
    """
    for node, kind, state in _set_ports(subject):
        name = state.name
        if name.startswith(_STATE) or _is_quiet(node, name, subject):
            continue  # the first no catalog lists
        if kind.port(name) is not None and not leaves_out(kind, name):
            continue
        lost = lost_port(kind, name, subject, is_source=False)
        ports = ", ".join(known for known, port in kind.ports.items() if not port.is_source)
        what = "is set, and" if ":" in name else "is set without inputs: before it, and"
        yield Problem(
            node.path,
            f"{name} {what} {kind.ui_name} has no such port: the script stops here{lost.words}",
            property=name,
            expected=lost.right,
            actual=name,
            severity="warning" if kind.is_documented else None,
            hint=None if lost.right else f"write one of {ports}, or leave the line out",
            fix=_renaming(node, name, lost.right),
        )


def _is_quiet(node: Node, name: str, subject: LintSubject) -> bool:
    """Whether a script sets targets in a way that reports nothing."""
    build = subject.stage.build
    return build is not None and (node.path, name) in build.quiet


def _renaming(node: Node, name: str, near: str | None) -> tuple[RenameProperty, ...]:
    return (RenameProperty(node.path, name, near),) if near else ()


@rule("B02", "unknown-node", scope="script")
def unknown_node(subject: LintSubject) -> Iterator[Problem]:
    """A name names no node.

    Why: OmniGraph raises an error, and the script ends unless it catches it. Short names are known
    only to the call that makes the node, or to the controller object: another call of
    `og.Controller.edit` needs the path of the node.

    Fix: write the name as CREATE_NODES has it. In another call write the path, as in
    `"/Graph/Tick.outputs:tick"`, or use one `og.Controller()` object for both.

    Example: a second `og.Controller.edit` connects `"Tick.outputs:tick"`.

    Basis: the Python of OmniGraph (controller, object lookup), and public reports of the
    error on 5.1 and 6.0.1.
    """
    for fault in _faults(subject, "unknown-node", "forgotten-node"):
        if fault.kind == "forgotten-node":
            message = (
                f"'{fault.name}' is a short name of another call ({fault.earlier}), which this "
                f"one does not know: the script stops here"
            )
            yield _problem(fault, message, fault.prim)
            continue
        yield _unknown_name(fault, f"names no node of {fault.prim}")


def _problem(
    fault: BuildFault, message: str, expected: str | None = None, identity: str | None = None
) -> Problem:
    """Return what a script has wrong, at its place in the script."""
    prim, actual = fault.prim, fault.name
    return Problem(prim, message, None, expected, actual, span=fault.at, identity=identity)


def _unknown_name(fault: BuildFault, problem: str) -> Problem:
    message = f"'{fault.name}' {problem}: the script stops here{did_you_mean(fault.meant)}"
    return _problem(fault, message, fault.meant or None, fault.name)


@rule("B03", "unknown-command", scope="script")
def unknown_command(subject: LintSubject) -> Iterator[Problem]:
    """A key of an edit is not a command.

    Why: OmniGraph raises an error before it makes anything.

    Fix: use a key of `og.Controller.Keys`: CREATE_NODES, CONNECT, SET_VALUES, CREATE_ATTRIBUTES,
    CREATE_VARIABLES, CREATE_PRIMS, EXPOSE_PRIMS, PROMOTE_ATTRIBUTES, DISCONNECT, DISCONNECT_ALL or
    DELETE_NODES.

    Example: `og.Controller.Keys.SET_VALUE`, without its last letter.
    """
    for fault in _faults(subject, "unknown-key", "no-graph-path"):
        if fault.kind == "no-graph-path":
            message = "the graph has no graph_path: the script stops here"
            yield Problem("/", message, expected="graph_path", span=fault.at)
            continue
        yield _unknown_name(fault, "is not a command of an edit")


@rule("B04", "node-made-twice", scope="script")
def node_made_twice(subject: LintSubject) -> Iterator[Problem]:
    """A node is created where one already exists.

    Why: OmniGraph raises an error, and the script ends unless it catches it.

    Fix: give the second node another name, or pass `allow_exists_node=True`.

    Example: two entries of CREATE_NODES are called `"Context"`.
    """
    for fault in _faults(subject, "node-twice"):
        message = f"{fault.name} was already created in {fault.earlier}: the script stops here"
        yield _problem(fault, message)


@rule("B05", "element-not-created", scope="script")
def element_not_created(subject: LintSubject) -> Iterator[Problem]:
    """An input of an array is used and was not created.

    Why: a new Make Array has `input0` alone. OmniGraph looks the other inputs up and raises an
    error.

    Fix: create them with CREATE_ATTRIBUTES, as in `("names.inputs:input1", "token")`.

    Example: SET_VALUES sets `names.inputs:input1` without CREATE_ATTRIBUTES.

    Basis: the Python of OmniGraph, and NVIDIA's own scripts, which create each input.
    """
    build = subject.stage.build
    for node in subject.nodes() if build is not None else ():
        kind = node.type
        dynamic = None if kind is None else kind.dynamic
        if kind is None or dynamic is None or build is None:
            continue
        for name, state in node.ports.items():
            is_used = bool(state.sources) or state.value is not None
            is_made = name in kind.ports or (node.path, name) in build.created
            if is_used and not is_made and kind.port(name) is not None:
                yield Problem(
                    node.path,
                    f"{name} was not created, and a new {kind.ui_name} has "
                    f"{INPUT}{dynamic.prefix}0 alone: the script stops here",
                    property=name,
                    expected="an entry of CREATE_ATTRIBUTES",
                )


@rule("B06", "key-twice", scope="script", severity="warning")
def key_twice(subject: LintSubject) -> Iterator[Problem]:
    """An edit has a key twice.

    Why: Python keeps the last of two equal keys of a dictionary. The list of the first is lost
    without a message.

    Fix: join both lists under one key.

    Example: two entries `keys.CONNECT` in one call.
    """
    for fault in _faults(subject, "key-twice"):
        message = f"{fault.name.upper()} is given again further down, and the list here is lost"
        yield _problem(fault, message, "one list", f"{fault.prim} {fault.name}")


@rule("B07", "not-a-list", scope="script")
def not_a_list(subject: LintSubject) -> Iterator[Problem]:
    """The items of a command are in no list.

    Why: only a list counts as several items. A tuple is one item of the wrong form, and OmniGraph
    raises an error.

    Fix: write square brackets around the items.

    Example: `keys.CONNECT: (("a.outputs:x", "b.inputs:x"), ("a.outputs:y", "b.inputs:y"))`.

    Basis: the Python of OmniGraph (controller).
    """
    for fault in _faults(subject, "not-a-list", "no-port-name"):
        if fault.kind == "no-port-name":
            expected = "the name of a node and a port, as in Node.inputs:port"
            message = f"'{fault.name}' names no port: the script stops here"
            yield _problem(fault, message, expected, fault.name)
            continue
        message = f"{fault.name.upper()} is given a {fault.meant}, expected a list"
        problem = _problem(fault, f"{message}: the script stops here", "a list", fault.name)
        yield replace(problem, actual=fault.meant)


@rule("B08", "silent-target", scope="script")
def silent_target(subject: LintSubject) -> Iterator[Problem]:
    """Targets are set at a relationship that the node does not read.

    Why: `set_target_prims` creates a relationship of any name and reports nothing. The node still
    has no target.

    Fix: pass the name of the node's own input as `inputName`.

    Example: `set_target_prims(..., inputName="inputs:targetPrims")` for ROS2 Publish Joint State,
    whose input is `inputs:targetPrim`.
    """
    for node, kind, state in _set_ports(subject):
        if _is_quiet(node, state.name, subject) and kind.port(state.name) is None:
            ports = [name for name, port in kind.ports.items() if port.is_target]
            near = lost_port(kind, state.name, subject, is_source=False).right
            near = near if near in ports else ports[0] if len(ports) == 1 else near
            yield Problem(
                node.path,
                f"{state.name} is set, and {kind.ui_name} has no such input: the targets are lost "
                f"without a message{did_you_mean(near)}",
                property=state.name,
                expected=near,
                actual=state.name,
                severity="warning" if kind.may_have_more else None,
                fix=_renaming(node, state.name, near),
            )
