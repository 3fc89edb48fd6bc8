"""Rules about what never computes, and about what triggers sensors and how often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.missing_wires import execution_wire, fires_always, wire_hint
from lab3_usd.check.registry import rule
from lab3_usd.facts.changes import effect_on_run, writing_nodes
from lab3_usd.facts.execution_order import (
    ENABLED,
    event_of,
    gate_step,
    is_graph_evaluated,
    is_switched_on,
    nodes_of,
    shut_gate,
    signal_inputs,
    signal_sources,
    signals,
    signals_once,
    unchosen_output,
)
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.stalled_nodes import Stop, feeds, has_side_effects, stops
from lab3_usd.facts.stuck_nodes import read_products, switched_off_target
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import OVER, Node

_REASONS = {
    "unwired": "{port} is not connected",
    "once": "its only signal comes once, from {cause}, and only opens its topic",
    "counts": "{cause} needs more signals than the one that it receives",
    "off": "{cause}, which triggers it, is disabled",
}


@rule(
    "K01",
    "never-executes",
    formerly="never-computes",
    counted=(
        "node that waits for a switched-off node",
        "nodes that wait for a switched-off node",
    ),
)
def never_executes(subject: LintSubject) -> Iterator[Problem]:
    """No event reaches a node that does something.

    Why: a node with an execution input computes only when a signal arrives there. Without a signal
    it publishes, receives and moves nothing. After a single signal, a publisher or subscriber has
    only opened its topic. Nodes behind the one named here are listed with it.

    Fix: in the graph editor, drag a wire from an event, such as Tick of On Playback Tick, or from
    Exec Out of the node before it, to Exec In of this node.

    Example: a ROS2 Publish Odometry whose `execIn` is not connected.
    """
    for graph in subject.graphs():
        is_evaluated = graph.active and is_graph_evaluated(graph, subject.stage)
        for stop in stops(graph, subject.stage) if is_evaluated else ():
            if stop.reason not in _REASONS or not _matters(stop, subject):
                continue
            reason = _REASONS[stop.reason].format(port=stop.port, cause=stop.cause)
            waiting = "; waiting for it: " + ", ".join(node.name for node in stop.waiting)
            is_off = stop.reason == "off"
            wire = execution_wire(stop.node, stop.port, subject) if stop.reason == "unwired" else ()
            yield Problem(
                stop.node.path,
                f"{subject.title(stop.node)} never executes: {reason}"
                f"{waiting if stop.waiting else ''}",
                property=stop.port,
                expected="a wire from an event",
                related=tuple(node.path for node in stop.waiting),
                hint=f"switch {stop.cause} on again" if is_off else wire_hint(wire),
                severity="note" if is_off else None,
                fix=wire,
                rests_on=subject.stage.unknown_inputs(stop.node),
            )


def _matters(stop: Stop, subject: LintSubject) -> bool:
    """Whether a node with a job waits, or a node that runs takes data from one that does."""
    return any(
        has_side_effects(node)
        or any(subject.runs(target.path) for target in feeds(node, subject.stage))
        for node in (stop.node, *stop.waiting)
    )


@rule("K02", "graph-not-in-scene", severity="note", counted=("inactive graph", "inactive graphs"))
def graph_not_in_scene(subject: LintSubject) -> Iterator[Problem]:
    """A graph is deactivated, or an `over` without a definition.

    Why: Isaac Sim evaluates only graphs in the scene. A graph that is deactivated during Play may
    continue to publish until the stage is opened again. An `over` on an asset gives a graph only if
    the asset defines one.

    Fix: activate the graph in the Stage panel, or delete it; for an `over`, define the graph in the
    file with `def`.

    Example: `ActionGraph` with `active = false` still holds the only publisher of `/scan`.

    Basis: NVIDIA's documentation: OmniGraph works on the composed stage, which does not contain
    such a graph. Deactivation during Play was not tested.
    """
    for graph in subject.graphs():
        if graph.active:
            continue
        prim = subject.stage.prims.get(graph.path)
        is_over = prim is None or (prim.active and not prim.defined)
        reason = "is only an over without a def" if is_over else "is deactivated"
        nodes = len(graph.nodes) + len(graph.absent) + graph.hidden
        yield Problem(
            graph.path,
            f"graph {reason}: none of its {nodes} nodes executes",
            severity="error" if is_over else None,
            rests_on=subject.stage.unknown(graph.path) if is_over else None,
        )
    ignores = subject.platform.graph.ignores
    in_overs = Counter(  # that nothing makes a graph, as behind a payload
        prim.path.rpartition("/")[0]
        for prim in subject.stage.absent
        if prim.reason == OVER and prim.type_name and not ignores(prim.path)
    )
    for path, nodes in in_overs.items():
        text = f"holds {nodes} nodes and is only an over without a def: none of them executes"
        yield Problem(path, text, severity="error", rests_on=subject.stage.unknown(path))


@rule(
    "K94",
    "graph-beside-default-prim",
    severity="note",
    counted=("graph outside the default prim", "graphs outside the default prim"),
)
def graph_beside_default_prim(subject: LintSubject) -> Iterator[Problem]:
    """A graph is outside the default prim, its robot inside.

    Why: a stage that references this file gets the default prim and what is below it: the robot
    without this graph.

    Fix: if other stages reference this file, drag the graph below the default prim in the Stage
    panel.

    Example: `/Graph` commands `/World/robot`, and `/World` is the default prim.
    """
    top = subject.stage.default_prim
    for graph in subject.graphs():
        if not top or not graph.active or is_at_or_below(graph.path, top):
            continue
        ports = (port for node in graph.nodes for port in node.ports.values())
        named = next((path for p in ports for path in p.targets if is_at_or_below(path, top)), "")
        if named:
            yield Problem(
                graph.path,
                f"refers to {named}, but is outside the default prim {top}: a stage that "
                "references this file gets no graph",
                expected=f"a graph below {top}",
                related=(named,),
            )


@rule("K04", "event-never-fires")
def event_never_fires(subject: LintSubject) -> Iterator[Problem]:
    """An event node never fires in its graph.

    Why: On Physics Step fires only in an on-demand graph, On Playback Tick and On Tick only in a
    graph of the simulation pipeline. In other graphs the nodes behind them never compute.

    Fix: use the event for this kind of graph: On Playback Tick in an ordinary Action Graph, On
    Physics Step in an on-demand graph.

    Example: On Physics Step triggers the controllers of an ordinary Action Graph.
    """
    form = subject.platform.graph.evaluation
    for graph in subject.graphs():
        if not graph.active or not is_graph_evaluated(graph, subject.stage):
            continue
        if graph.attributes.get(form.evaluator) in form.all_nodes:
            continue
        for node in graph.nodes:
            needed = event_of(node, subject.platform)
            if needed and not subject.runs(node.path) and node.path in subject.live:
                waiting = feeds(node, subject.stage)
                if waiting:
                    yield Problem(
                        node.path,
                        f"{subject.title(node)} never fires in a graph of "
                        f"{graph.attributes.get(form.stage, 'no pipeline stage')}, so "
                        f"{', '.join(target.name for target in waiting)} never "
                        f"{'executes' if len(waiting) == 1 else 'execute'}",
                        expected=needed,
                        actual=str(graph.attributes.get(form.stage)),
                        related=tuple(target.path for target in waiting),
                    )


@rule("K06", "switched-off", severity="note", counted=("disabled node", "disabled nodes"))
def switched_off(subject: LintSubject) -> Iterator[Problem]:
    """A ROS 2 node, or a node that passes execution signals, is disabled.

    Why: with Enabled off, a helper publishes nothing, and a render product is not created, so its
    helpers publish nothing either. A sensor that is switched off is not read. A gate with a step of
    0, or one that starts closed and that nothing opens, passes no signal, and a Branch whose
    condition stays the same signals at one output only.

    Fix: if this is not intended, switch Enabled on, set the step to 1 or more, or connect the
    condition to what decides.

    Example: `inputs:enabled = 0` on a ROS2 Camera Helper.
    """
    for node in subject.live.values():
        if has_side_effects(node) and effective_value(node, ENABLED, subject.live) is False:
            # Nobody wires what should do nothing.
            severity: Severity | None = "warning" if subject.runs(node.path) else None
            yield Problem(
                node.path,
                f"{subject.title(node)} is disabled: it does nothing",
                property=ENABLED,
                expected="True",
                actual="False",
                severity=severity,
            )
        sensor = switched_off_target(node, subject.stage)
        asked = subject.platform.targets.get(node.type.type) if node.type and sensor else None
        if asked is not None and subject.runs(node.path):
            yield Problem(
                sensor,
                f"{asked.switch} is False, and {node.path} reads the sensor: {asked.effect}",
                property=asked.switch,
                expected="True",
                actual="False",
                related=(node.path,),
                severity="warning",
            )
        gate = shut_gate(node, subject.live, subject.platform)
        if gate is not None and (waiting := feeds(node, subject.stage)):
            why = _why_shut(node, gate, subject)
            yield _unreached(node, gate, why, "what lets signals pass", waiting)
        choice = None if node.type is None else node.type.choice
        closed = unchosen_output(node, subject.live)
        if choice is not None and closed is not None and subject.runs(node.path):
            waiting = [
                target
                for target in feeds(node, subject.stage)
                if any(f"{node.path}.{closed}" in state.sources for state in target.ports.values())
                and not subject.runs(target.path)
            ]
            chosen = str(closed == choice.outputs[0])
            why = f"{choice.by} is always {chosen}"
            if waiting:
                problem = _unreached(node, choice.by, why, "a value that changes", waiting)
                yield replace(problem, actual=chosen)


def _why_shut(node: Node, port: str, subject: LintSubject) -> str:
    door = subject.platform.doors.get(node.type_name)
    if door is None:
        return f"{port} is 0"
    if port == INPUT + door.enter:
        return f"{port} is not connected"
    return f"{port} is True, and nothing opens the gate at {INPUT}{door.toggle}"


def _unreached(node: Node, port: str, why: str, expected: str, waiting: Sequence[Node]) -> Problem:
    return Problem(
        node.path,
        f"{why}: no signal reaches {', '.join(target.name for target in waiting)}",
        property=port,
        expected=expected,
        related=tuple(target.path for target in waiting),
        severity="warning",
    )


@rule("K08", "two-events", severity="warning")
def two_events(subject: LintSubject) -> Iterator[Problem]:
    """Two events trigger one node at every update.

    Why: the node executes twice in an update. A publisher sends every message twice with the same
    time, and tf2 rejects the second; a controller limits an acceleration twice.

    Fix: delete one of the execution wires.

    Example: Exec In of a ROS2 Publish Transform Tree is connected to two On Playback Tick nodes.
    """
    for node in subject.live.values():
        if sum(len(node.sources(port)) for port in signal_inputs(node)) <= 1:
            continue  # which brings no other events than the node before has
        is_judged = any(map(has_side_effects, (node, *feeds(node, subject.stage))))
        events = _events(node, subject) if is_judged else {}
        # Of a node that is behind another one with the same events the first tells enough.
        ahead = [_events(source, subject) for source in signal_sources(node, subject.live)]
        if len(events) > 1 and all(set(earlier) != set(events) for earlier in ahead):
            names = ", ".join(event.name for event in events.values())
            yield Problem(
                node.path,
                f"executes once for each of {names}: {len(events)} times at each update",
                property=signal_inputs(node)[0],
                expected="a wire from one event",
                actual=names,
                related=tuple(events),
            )


def _events(node: Node, subject: LintSubject) -> dict[str, Node]:
    """Return the events by which a node surely executes at every update, by path."""
    events: dict[str, Node] = {}
    seen, ahead = {node.path}, [node]
    for current in ahead:
        if fires_always(current, subject.stage):
            events[current.path] = current
        for source, port in signals(current, subject.live):
            is_lasting = not signals_once(source, port, subject.live, subject.platform)
            if source.path not in seen and is_lasting and is_switched_on(source, subject.live):
                seen.add(source.path)
                ahead.append(source)
    return events


@rule("K09", "run-ends", severity="warning")
def run_ends(subject: LintSubject) -> Iterator[Problem]:
    """A node stops the simulation or closes Isaac Sim.

    Why: from then on no graph executes and nothing is published. What a key or the mouse triggers
    does not count.

    Fix: delete the node, or trigger it by a key.

    Example: Stop playback behind a Countdown that On Playback Tick starts.

    Basis: the documentation of these nodes; Kit's code is not public.
    """
    for node, ports in writing_nodes(subject.stage):
        effect = effect_on_run(node, ports, subject.live)
        if effect:
            yield Problem(node.path, f"{subject.title(node)} {effect}", actual=node.saved_type)


_HELPER, _SUBSCRIBER = "helper", "subscriber"


@rule("K91", "gated-sensor", severity="warning")
def gated_sensor(subject: LintSubject) -> Iterator[Problem]:
    """A gate precedes the helper of a sensor.

    Why: the first signal starts the sensor's writer, which then publishes each picture, whatever
    signals come. The gate delays the start, and slows nothing down.

    Fix: set Frame Skip Count of the helper, or the tick rate of the sensor, and remove the gate.

    Example: an Isaac Simulation Gate with step 10 before a ROS2 Camera Helper.

    Basis: `OgnROS2CameraHelper.py` attaches its writer once; IsaacSim issue 346.
    """
    for node in _helpers(subject):
        for gate in _ahead(node, subject):
            step = gate_step(gate, subject.live, subject.platform)
            if step > 1:
                yield Problem(
                    node.path,
                    f"{gate.name} passes one of {step} signals, but {subject.title(node)} "
                    "publishes each picture once it is started",
                    property=signal_inputs(node)[0],
                    related=(gate.path,),
                )
                break


@rule("K92", "sensor-waits-for-message", severity="warning")
def sensor_waits_for_message(subject: LintSubject) -> Iterator[Problem]:
    """A sensor waits for the first message of a subscriber.

    Why: a subscriber signals when a message has come. Until then there is no render product, and no
    scan or image is published.

    Fix: trigger the render product and the helper by On Playback Tick.

    Example: Exec Out of the subscriber of `/cmd_vel` triggers Isaac Create Render Product.

    Basis: `OgnROS2SubscribeTwist.cpp`: the execution output is set for a message that was taken.
    """
    for node in _helpers(subject):
        for waiting in (node, *read_products(node, subject.live)):
            ahead = [*_ahead(waiting, subject)]
            subscriber = next((s for s in ahead if s.type and s.type.role == _SUBSCRIBER), None)
            if subscriber is not None and not any(
                source.type is None or event_of(source, subject.platform) is not None
                for source in ahead  # which signals by itself, or may
            ):
                yield Problem(
                    node.path,
                    f"publishes nothing before the first message of {subscriber.name}, which alone "
                    f"triggers {waiting.name}",
                    related=tuple(dict.fromkeys((subscriber.path, waiting.path))),
                    assumes=tuple((node.path, port) for port in signal_inputs(node)),
                )
                break


def _helpers(subject: LintSubject) -> Iterator[Node]:
    helpers = nodes_of(lambda kind: kind.role == _HELPER, subject.stage)
    return (node for node in helpers if subject.runs(node.path))


def _ahead(node: Node, subject: LintSubject) -> Iterator[Node]:
    """Yield the nodes whose signals reach a node, nearest first, up to subscribers."""
    seen, waiting = {node.path}, [node]
    for current in waiting:
        for source in signal_sources(current, subject.live):
            if source.path not in seen:
                seen.add(source.path)
                yield source
                if source.type is None or source.type.role != _SUBSCRIBER:
                    waiting.append(source)
