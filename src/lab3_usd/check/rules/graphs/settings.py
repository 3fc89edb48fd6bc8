"""Rules about the values that the handout sets."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.harmless_faults import with_setting
from lab3_usd.check.match.conformance import setting_matches, setting_value
from lab3_usd.check.match.subject import GraphSubject
from lab3_usd.check.registry import rule
from lab3_usd.model.derived import once_per_stage
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import display, role_title, short_source
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import Port, Value
from lab3_usd.spec.graph import NodeSpec, Setting
from lab3_usd.spec.values import are_alike


class Found(Struct, frozen=True):
    """A setting of the spec, the node it is asked of, its value there, and whether it is met."""

    node: Node
    spec: NodeSpec
    setting: Setting
    value: Value | None
    met: bool


@once_per_stage
def settings_of(subject: GraphSubject) -> tuple[Found, ...]:
    """Return every setting of every matched node."""
    return tuple(_find_settings(subject))


def _find_settings(subject: GraphSubject) -> Iterator[Found]:
    for node, spec in subject.matched():
        for setting in spec.settings:
            value = setting_value(subject.live_nodes, node, setting.port)
            yield Found(node, spec, setting, value, setting_matches(node, setting, value))


def setting_problem(found: Found, message: str) -> Problem:
    """Return the problem of one setting, with how to set it right."""
    setting, wanted = found.setting, display(found.setting.value)
    port = setting.port.partition(":")[2]
    wires = ", ".join(map(short_source, found.node.sources(setting.port)))
    first = f"delete the wire from {wires}, then " if wires else ""
    return Problem(
        prim=found.node.path,
        property=setting.port,
        message=message,
        expected=wanted,
        actual=display(found.value),
        handout=setting.handout,
        hint=f"{first}select {role_title(found.spec)} "
        f"and set {port} to {wanted} in the Property panel",
    )


def _wrong_type(node: Node, port: Port | None) -> str | None:
    """Return the type that the file declares, when it is none the port can have."""
    state = None if port is None else node.state(port.name)
    if port is None or state is None or port.is_union:
        return None
    # No type is told of a port without a value.
    is_right = not state.usd_type or are_alike(state.usd_type, port.usd_type)
    return None if is_right else state.usd_type


def _frames_forbidden(subject: GraphSubject, found: Found) -> bool:
    """Whether a frame is part of the forbidden transform, which a rule of its own names."""
    tf = found.spec.type.tf
    if tf is None or found.setting.port not in tf.names:
        return False
    child = setting_value(subject.live_nodes, found.node, tf.names[1])
    return child == subject.lab.frames.unplaced != ""


def _swapped(subject: GraphSubject) -> dict[tuple[str, str], str]:
    """Return the settings whose values stand in each other's node: (prim, port) -> other prim."""
    wrong = [found for found in settings_of(subject) if not found.met]
    pairs = {}
    for one, other in combinations(wrong, 2):
        if one.spec.type is not other.spec.type or one.setting.port != other.setting.port:
            continue
        if _would_be_met(one, other.value) and _would_be_met(other, one.value):
            pairs[one.node.path, one.setting.port] = other.node.path
            pairs[other.node.path, one.setting.port] = ""
    return pairs


def _would_be_met(found: Found, value: Value | None) -> bool:
    return setting_matches(found.node, found.setting, value)


@rule("P01", "wrong-value", scope="graph")
def wrong_value(subject: GraphSubject) -> Iterator[Problem]:
    """An input has another value than the handout asks for.

    Why: the graph runs, but with a topic, frame, size or speed that no other component expects.

    Fix: select the node and type the value named here into its field in the Property panel.

    Example: `topicName` 'scan1' instead of '{scan}': a subscriber waits for a scan that never
    comes.
    """
    swapped = _swapped(subject)
    # Where a wire that belongs elsewhere ends, the rule of that wire speaks.
    strays = {fault.elsewhere for fault in subject.wire_faults if fault.kind == "moved"}
    for found in settings_of(subject):
        node, port = found.node, found.setting.port
        if found.met or (node.path, port) in swapped or not _is_authored(node, port):
            continue
        if _has_wrong_type(node, port) or _frames_forbidden(subject, found):
            continue
        if f"{node.path}.{port}" in strays:
            continue
        what = display(found.value) if found.value is not None else _wired(found)
        message = f"{port} is {what}, expected {display(found.setting.value)}"
        message += with_setting(subject, found.spec.role, found.setting, found.value)
        yield setting_problem(found, message)


def _wired(found: Found) -> str:
    return f"wired from {short_source(found.node.sources(found.setting.port)[0])}"


def _is_authored(node: Node, port: str) -> bool:
    state = node.state(port)
    return state is not None and (state.value is not None or bool(state.sources))


def _has_wrong_type(node: Node, port: str) -> bool:
    return _wrong_type(node, None if node.type is None else node.type.port(port)) is not None


@rule("P02", "wrong-default", scope="graph")
def wrong_default(subject: GraphSubject) -> Iterator[Problem]:
    """An input still has its default, but the handout asks for another value.

    Why: a field that was never edited is not written into the file, and Isaac Sim 6.0.1 uses its
    own default. The defaults of `useDomainIDEnvVar` and `resetOnStop` are True. The default frame
    ids are base_link, sim_lidar and sim_camera.

    Fix: select the node and set the field named here in the Property panel.

    Example: `useDomainIDEnvVar` not set: the domain id comes from the environment.
    """
    for found in settings_of(subject):
        node, port = found.node, found.setting.port
        if found.met or _is_authored(node, port) or _has_wrong_type(node, port):
            continue
        default, wanted = display(found.value), display(found.setting.value)
        message = f"{port} was left at its default {default}, expected {wanted}"
        yield setting_problem(found, message)


@rule("P03", "wrong-value-type", scope="graph")
def wrong_value_type(subject: GraphSubject) -> Iterator[Problem]:
    """An input is declared with a type that its node type does not have.

    Why: Isaac Sim may be unable to read the value and use the default instead.

    Fix: delete the node, add it again from the node list, and set its fields.

    Example: `inputs:wheelRadius` written as a string by a script, although it is a double.
    """
    for found in settings_of(subject):
        port = found.spec.type.port(found.setting.port)
        declared = _wrong_type(found.node, port)
        if declared is not None and port is not None:
            message = f"{port.name} is of type {declared}, expected {port.usd_type}"
            problem = setting_problem(found, message)
            title = role_title(found.spec)
            hint = f"delete {title}, add it again from the node list and set its fields"
            yield replace(problem, expected=port.usd_type, actual=declared, hint=hint)


@rule("P07", "swapped-values", scope="graph")
def swapped_values(subject: GraphSubject) -> Iterator[Problem]:
    """Two nodes hold each other's value.

    Why: with the wheel names exchanged, the left command goes to the right wheel, and the robot
    turns the wrong way.

    Fix: exchange the two values in the Property panel.

    Example: the first Constant Token holds {other_joint}, the second {joint}.
    """
    swapped = _swapped(subject)
    for found in settings_of(subject):
        port = found.setting.port
        other = swapped.get((found.node.path, port))
        if other:
            name = other.rpartition("/")[2]
            message = (
                f"{port} is {display(found.value)}, expected {display(found.setting.value)}; "
                f"{name} holds the value that belongs here"
            )
            hint = f"exchange the values of {found.node.name} and {name}"
            problem = setting_problem(found, message)
            yield replace(problem, hint=hint, related=(f"{other}.{port}",))
