"""Rules about what inputs get: nothing, a wire and a value, another quantity, a wrong name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.missing_wires import likely_wire, lost_constant, wire_hint
from lab3_usd.check.registry import rule
from lab3_usd.facts.arrays import array_items
from lab3_usd.facts.articulations import commands, leaves_joints
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.likely_names import did_you_mean, likely_name, likely_port
from lab3_usd.facts.quantities import quantity_of
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.facts.stalled_nodes import (
    feeds,
    has_side_effects,
    is_nothing,
    is_wired,
    needs_of,
    unmet_needs,
)
from lab3_usd.facts.stuck_nodes import is_made_later
from lab3_usd.facts.wires import connections
from lab3_usd.isaac.behaviour import Need
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.node_types import INPUT, NUMBERS, OUTPUT
from lab3_usd.model.finding import Problem, display, format_paths
from lab3_usd.model.joint_drives import DRIVE, drive_prefix
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel, absence_reason


@rule("K10", "unset-input", formerly="works-on-zeros")
def unset_input(subject: LintSubject) -> Iterator[Problem]:
    """A required input is neither connected nor set.

    Why: an input without a wire and a value is 0 or empty. A publisher without a time stamps every
    message with 0, a helper without a render product publishes nothing, a controller without a
    wheel radius outputs no command. A constant time is no better. Isaac Sim reports nothing, or
    logs a line at every update. In a file with graphs but neither robot nor sensor, another stage
    may supply the prims: a warning.

    Fix: connect the input to the node that computes it, or set it in the Property panel.

    Example: `ros2_publish_odometry.inputs:timeStamp` without a wire.
    """
    needs = subject.platform.needs
    for node in nodes_of(lambda kind: kind.type in needs, subject.stage):
        if not (subject.runs(node.path) or is_wired(node, subject.stage)):
            continue
        for need in unmet_needs(node, subject.platform, subject.live):
            inputs = [INPUT + name for name in need.inputs if node.has_port(INPUT + name)]
            may_be_filled = subject.is_module and any(
                node.type is not None and node.type.ports[port].is_target for port in inputs
            )
            fixed, is_zero = _fixed_input(node, inputs, need, subject)
            unset = f"{inputs[0]} is not connected and has no value"
            if len(inputs) > 1:
                unset = f"none of {', '.join(inputs)} is connected or set"
            is_lost = len(inputs) == 1 and not fixed
            wire = likely_wire(node, inputs[0], subject) if is_lost else ()
            expected = "a wire or a value"
            if fixed:
                useful = "a value that changes" if need.changing else "another value"
                expected = "a value above 0" if need.positive else useful
            yield Problem(
                node.path,
                (fixed or unset) + (f": {need.effect}" if is_zero else ""),
                property=inputs[0],
                expected=expected,
                hint=wire_hint(wire),
                fix=wire,
                likely=True,
                severity="warning" if need.severity == "warning" or may_be_filled else None,
                rests_on=subject.stage.unknown_inputs(node),
            )


def _fixed_input(
    node: Node, ports: list[str], need: Need, subject: LintSubject
) -> tuple[str, bool]:
    """Say which of some inputs has a useless value, '' for none, and whether that is nothing."""
    for port in ports:
        value = effective_value(node, port, subject.live)
        if value is None:
            continue
        if node.sources(port) or (need.changing and not is_nothing(value)):
            return f"{port} is always {display(value)}", need.positive or is_nothing(value)
        state = node.state(port)
        if state is not None and state.value not in {None, "", ()}:  # written, and as good as none
            return f"{port} is {display(value)}", True
    return "", True


def _has_numbers(node: Node, ports: Iterable[str], subject: LintSubject) -> bool:
    """Whether a node makes an array of numbers, by its values and the types of its wires."""
    for port in ports:
        if isinstance(effective_value(node, port, subject.live), (int, float)):
            return True
        for source, name in live_sources(node, port, subject.live):
            declared = None if source.type is None else source.type.port(name)
            if declared is not None and declared.usd_type in NUMBERS:
                return True
    return False


@rule("K11", "array-gaps", formerly="array-with-gaps")
def array_gaps(subject: LintSubject) -> Iterator[Problem]:
    """An array has an empty element, or inputs beyond its size.

    Why: an element that is neither connected nor set is empty. No joint has an empty name, so the
    controller moves nothing. Inputs beyond the size of the array are ignored.

    Fix: connect the input named here, or correct the array's size in the Property panel.

    Example: `joint_name_array.inputs:input0` lost its wire, while `input1` has one.

    Basis: Make Array is a node of Kit, whose code is not public; its page describes one input for
    each element. An empty joint name is rejected in `articulation.py:767`. Gaps in an array of
    numbers are a warning: `test_articulation_controller.py:320-360` of v6.0.1 commands with some.
    """
    for command in commands(subject.stage):
        port = command.ports.joints
        if "" in (command.names or ()) and not command.node.sources(port):
            text = f"{port} has an empty element, and no joint has an empty name"
            yield Problem(command.node.path, text, property=port, expected="names of joints")
    for node in nodes_of(lambda kind: kind.dynamic, subject.stage):
        items = array_items(node)
        if items is None:
            continue
        for port in items.filled:
            if effective_value(node, port, subject.live) == "":
                yield Problem(
                    node.path,
                    f"{port} is connected to an empty text: an element of the array is empty",
                    property=port,
                    expected="a text",
                    assumes=tuple(
                        (source.path, name)
                        for source, name in live_sources(node, port, subject.live)
                    ),
                )
        if items.filled:
            has_numbers = _has_numbers(node, items.filled, subject)
            if items.empty:
                port = items.empty[0]
                wire = lost_constant(node, port, subject) if len(items.empty) == 1 else ()
                yield Problem(
                    node.path,
                    f"no wire and no value at {format_paths(items.empty)}: the array has an empty "
                    "element there",
                    property=port,
                    expected="a wire or a value",
                    severity="warning" if has_numbers else None,
                    hint=wire_hint(wire),
                    fix=wire,
                    likely=True,
                    rests_on=subject.stage.unknown_inputs(node),
                )
        if items.beyond:
            yield Problem(
                node.path,
                f"{items.count_port} is {items.count}, which leaves out "
                f"{format_paths(items.beyond)}",
                property=items.count_port,
                actual=str(items.count),
                severity="warning",
                rests_on=subject.stage.unknown_inputs(node),
                assumes=((node.path, items.count_port),),
            )


@rule(
    "K25",
    "value-and-wire",
    severity="note",
    formerly="value-under-a-wire",
    counted=("value overridden by a wire", "values overridden by wires"),
)
def value_and_wire(subject: LintSubject) -> Iterator[Problem]:
    """An input has a connection and a value.

    Why: the wire wins. The value looks effective, and takes effect again when the wire is deleted.

    Fix: clear the value if it is misleading.

    Example: `inputs:jointNames` holds two names and is connected to Make Array.

    Basis: a saved stage keeps the value beside the wire. Kit's code is not public.
    """
    for wire in connections(subject.stage):
        value = wire.node.ports[wire.port].value
        default = None if wire.node.type is None else wire.node.type.default(wire.port, None)
        if wire.is_live and value not in (None, default) and not is_nothing(value):
            yield Problem(
                wire.node.path,
                f"{wire.port} is connected: its value {display(value)} is ignored",
                property=wire.port,
                actual=display(value),
                assumes=((wire.node.path, wire.port),),
            )


@rule("K28", "wired-literal", severity="warning")
def wired_literal(subject: LintSubject) -> Iterator[Problem]:
    """A wire leads into an input that must be set instead.

    Why: the documentation of the node calls the input literal only, as Array Size of Make Array.
    Isaac Sim may drop the wire, or read its value only once: what it does is not public.

    Fix: delete the wire and type the value.

    Example: `inputs:arraySize` of Make Array is connected to a Constant Int.

    Basis: NVIDIA's pages of the nodes. Kit's code is not public: a warning.
    """
    for wire in connections(subject.stage):
        port = None if wire.node.type is None else wire.node.type.port(wire.port)
        if wire.is_live and port is not None and port.literal_only:
            yield Problem(
                wire.node.path,
                f"{wire.port} of {subject.title(wire.node)} is to be set, and is connected",
                property=wire.port,
                actual=wire.path,
                related=(wire.source_prim,),
                assumes=((wire.node.path, wire.port),),
            )


@rule("K26", "driven-by-messages", severity="warning")
def driven_by_messages(subject: LintSubject) -> Iterator[Problem]:
    """A node runs only when a message arrives.

    Why: Exec Out of a subscriber fires only when a new message has arrived. The nodes behind it
    stop when the sender stops: a publisher sends nothing, and a limited acceleration is not
    completed.

    Fix: trigger the node from On Playback Tick; a subscriber keeps the last message.

    Example: a ROS2 Publish Odometry whose Exec In is connected to ROS2 Subscribe Twist.
    """
    judged: set[str] = set()
    for wire in connections(subject.stage):
        kind = None if wire.source is None else wire.source.type
        node, taker = wire.node, wire.node.type
        if kind is None or taker is None or node.path in judged or wire.kind != "execution":
            continue
        is_driven = kind.role == "subscriber" and wire.source_port.startswith(OUTPUT)
        is_alone = all(source == wire.path for source in node.sources(wire.port))
        publishes = has_side_effects(node) and taker.role != "service" and not taker.drives
        works_in_time = any(node.value(port) for port in taker.step_limits)
        if is_driven and is_alone and (publishes or works_in_time):
            judged.add(node.path)
            yield Problem(
                node.path,
                f"{subject.title(node)} executes only when a message arrives at "
                f"{wire.source_prim.rpartition('/')[2]}",
                property=wire.port,
                expected="a wire from On Playback Tick",
                actual=wire.path,
            )


@rule("K27", "another-quantity", severity="warning")
def another_quantity(subject: LintSubject) -> Iterator[Problem]:
    """A wire brings another quantity than its input expects.

    Why: a wire carries any number, so another quantity gives no message, but the robot does not
    follow its commands. It is an error where nothing moves: speeds as positions of joints whose
    drives have no stiffness, or as efforts against their damping. So is a time step as a time
    stamp: the time of the messages does not advance, and no transform fits it; a number of frames
    runs 60 times too fast.

    Fix: connect the output, or the component of the vector, that the input expects.

    Example: `linear.y` is connected to `inputs:linearVelocity` of a Differential Controller.
    """
    typed, needs = subject.platform.quantities, subject.platform.needs
    stage, stamp = subject.stage, INPUT + subject.platform.ros.stamp
    for node in nodes_of(lambda kind: kind.type in typed or kind.type in needs, stage):
        for port, quantities in _quantities(node, subject).items():
            given = quantity_of(node, port, stage)
            if given is not None and given.name not in quantities:
                own = [command for command in commands(stage) if command.node is node]
                leaves = given.name in _SPEEDS and any(leaves_joints(c, port, stage) for c in own)
                is_still = leaves or (given.name == _STEP and port == stamp)
                yield Problem(
                    node.path,
                    f"{port} expects {' or '.join(quantities)}, but {given.maker.name} provides "
                    f"{given.name}",
                    property=port,
                    expected=" or ".join(quantities),
                    actual=given.name,
                    related=(given.maker.path,),
                    severity="error" if is_still else None,
                )


_TIME, _STEP = "the time", "a time step"
_SPEEDS = ("speeds of wheels", "speeds of joints")


def _quantities(node: Node, subject: LintSubject) -> dict[str, tuple[str, ...]]:
    """Return the quantities that the inputs of a node are meant for; a stamp that counts is one."""
    quantity = subject.platform.quantities.get(node.type_name)
    takes = {INPUT + name: taken for name, taken in quantity.takes.items()} if quantity else {}
    needed = {
        INPUT + name
        for need in needs_of(node, subject.platform, subject.live)
        for name in need.inputs
    }
    stamp = INPUT + subject.platform.ros.stamp
    return {**takes, stamp: (_TIME,)} if stamp in needed else takes


# Inputs of Kit's nodes that read or write a prim, by the pages of Read and Write Prim Attribute:
# the prim itself, or its path where that is to be used, and the property.
_PRIM, _PATH, _BY_PATH, _PROPERTY = (
    INPUT + name for name in ("prim", "primPath", "usePath", "name")
)
_OF_DRIVES = "drive:"
# UsdPhysics, PhysicsDriveAPI
_DRIVE_NAMES = ("damping", "maxForce", "stiffness", "targetPosition", "targetVelocity", "type")


@rule("K99", "unknown-name")
def unknown_name(subject: LintSubject) -> Iterator[Problem]:
    """A node names a variable, prim or property that does not exist.

    Why: it reads nothing, writes nothing, or never signals; what depends on it gets no value. A
    script of the stage can make variables while it runs: then it is a warning.

    Fix: correct the name, or create the variable in Window > Graph Editors > Variables.

    Example: Write Prim Attribute with `inputs:primPath = "/World/Rovr"`, a robot called
    `/World/Rover`.
    """
    for node in subject.live.values():
        if node.type is None or not (subject.runs(node.path) or feeds(node, subject.stage)):
            continue
        if node.type.variable:
            yield from _variable(node, node.type.variable[0], subject)
        elif node.has_port(_BY_PATH) and node.has_port(_PATH):
            yield from _prim_and_property(node, subject)


def _variable(node: Node, port: str, subject: LintSubject) -> Iterator[Problem]:
    """Yield that the graph of a node has no variable of the name that it reads or sets."""
    name = effective_value(node, port, subject.live)
    variables = _variables(node.path, subject.stage)
    if not isinstance(name, str) or name in variables:
        return
    near, stage = likely_name(name, variables), subject.stage
    # Nothing of a scene makes variables in the graphs that a script makes.
    missing = (stage.unknown_node if stage.build else stage.unknown)(node.path)
    what = f"is {display(name)}, which is not a variable of its graph{did_you_mean(near)}"
    yield Problem(
        node.path,
        f"{port} {what if name else 'is empty: it names no variable of its graph'}",
        property=port,
        expected=near or ", ".join(variables) or "a variable of the graph",
        actual=name,
        severity="warning" if stage.scripts else None,
        rests_on=stage.unknown_inputs(node) or missing,
    )


def _variables(path: str, stage: StageModel) -> list[str]:
    """Return the variables of the graphs around a node: a compound is a graph in a graph."""
    above = {*upwards(path)}
    names: list[str] = []
    for graph in stage.graphs:
        if graph.path in above:
            written = (name for name in graph.attributes if name.startswith(VARIABLE))
            names += (*graph.variables, *(name.removeprefix(VARIABLE) for name in written))
    return [*dict.fromkeys(names)]


def _prim_and_property(node: Node, subject: LintSubject) -> Iterator[Problem]:
    """Yield that there is no prim at a path, or that its property is misspelt."""
    path = next(iter(node.targets(_PRIM)), "")
    if effective_value(node, _BY_PATH, subject.live) is True:
        written = effective_value(node, _PATH, subject.live)
        path = written if isinstance(written, str) else ""
        if path and subject.stage.prim(path) is None and not is_made_later(path, subject.stage):
            is_path = path.startswith("/")
            reason = absence_reason(subject.stage, path) if is_path else "is not a path of a prim"
            yield Problem(
                node.path,
                f"{_PATH} is {display(path)}, which {reason}",
                property=_PATH,
                expected="the path of a prim",
                actual=path,
                severity="warning" if subject.is_module else None,
                rests_on=subject.stage.unknown(path) if is_path else None,
            )
    prim, name = subject.stage.prim(path), effective_value(node, _PROPERTY, subject.live)
    if prim is None or not isinstance(name, str) or not name or name in _properties(prim):
        return
    # A name that is in no file may be of a schema: not every other one is misspelt.
    ports = {f"{INPUT}{own}": own for own in _properties(prim)}
    near = ports.get(likely_port(INPUT + name, [*ports]) or "")
    if near or name.startswith(_OF_DRIVES):
        yield Problem(
            node.path,
            f"{_PROPERTY} is {display(name)}, and {path} has no such property{did_you_mean(near)}",
            property=_PROPERTY,
            expected=near or "a property of the prim",
            actual=name,
            rests_on=subject.stage.unknown(path),
        )


def _properties(prim: Prim) -> list[str]:
    """Return the properties of a prim that its file has, and those of its drives."""
    kinds = (api.removeprefix(f"{DRIVE}:") for api in prim.apis if api.startswith(f"{DRIVE}:"))
    driven = (drive_prefix(kind) + name for kind in kinds for name in _DRIVE_NAMES)
    return [*prim.attributes, *prim.relationships, *driven]
