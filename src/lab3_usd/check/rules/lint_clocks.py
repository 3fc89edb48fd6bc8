"""Rules about ROS contexts and their domains, and about the clocks that stamp messages."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.missing_wires import clock_publisher, context_wire
from lab3_usd.check.registry import rule
from lab3_usd.facts.clocks import CLOCK, Stamp, topic_clocks
from lab3_usd.facts.domains import (
    LAST_DOMAIN,
    Domain,
    context_inputs,
    domain_of,
    domains,
    invalid_contexts,
    may_meet,
)
from lab3_usd.facts.endpoints import Endpoint, moving_prims, running_endpoints
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.stalled_nodes import has_side_effects
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.changes import ClearValue
from lab3_usd.model.finding import Problem


@rule("K12", "context-missing", severity="warning")
def context_missing(subject: LintSubject) -> Iterator[Problem]:
    """A ROS node has no context, unlike others, or a number instead.

    Why: without a context a node uses the domain in the environment variable `ROS_DOMAIN_ID`, or 0.
    The others use the domain of their ROS2 Context. If the domains differ, the node cannot
    communicate with the others; a context that names 0, or what the environment says, names the
    same. With a number that no ROS2 Context has made, the node does nothing,
    without a message: an error.

    Fix: connect Context of the ROS2 Context to Context of this node.

    Example: one of four publishers has no wire at `inputs:context`.
    """
    # Domain() is that of a node without a context.
    connected = [
        entry
        for entry in context_inputs(subject.stage)
        if entry.contexts and domain_of(entry.node, subject.live, subject.platform) != Domain()
    ]
    for entry in context_inputs(subject.stage) if connected else ():
        if not entry.is_set and has_side_effects(entry.node) and subject.runs(entry.node.path):
            other = connected[0]
            context = other.contexts[0].path
            yield Problem(
                entry.node.path,
                f"{entry.port} is not connected: the domain is that of the environment, while "
                f"{other.node.path} takes its domain from {context}",
                property=entry.port,
                expected=f"{context}.outputs:context",
                fix=context_wire(entry.node, entry.port, subject),
            )
    for node, port, handle in invalid_contexts(subject.stage):
        if has_side_effects(node):
            yield Problem(
                node.path,
                f"{port} is {handle}, not a handle from a ROS2 Context: the node does nothing",
                property=port,
                expected="a wire from a ROS2 Context",
                actual=str(handle),
                severity="error",
                fix=context_wire(node, port, subject) or (ClearValue(node.path, port),),
            )


@rule("K13", "contexts-differ", severity="warning")
def contexts_differ(subject: LintSubject) -> Iterator[Problem]:
    """Two contexts name different ROS domains.

    Why: nodes in different domains do not see each other: odometry in one domain has no clock from
    another. Domains that each have a clock and messages with its time count as intended, as those
    of two robots.

    Fix: give all ROS2 Context nodes the same Domain Id, and the same setting of Use Domain ID Env
    Var, or give each domain a clock of its own.

    Example: one context has `domain_id = 5`, the other `domain_id = 0`.
    """
    contexts_of = domains(subject.stage)
    clocks, others_of = set[str](), set[str]()
    for direction in ("publishes", "subscribes"):
        for endpoint in running_endpoints(subject.stage, direction):
            (clocks if endpoint.type == CLOCK else others_of).add(endpoint.domain.name)
    if not contexts_of or {domain.name for domain in contexts_of} <= clocks & others_of:
        return
    # What most contexts name is meant.
    first, nodes = max(contexts_of.items(), key=lambda each: len(each[1]))
    for domain, contexts in contexts_of.items():
        for context in contexts if domain != first else ():
            yield Problem(
                context.path,
                f"context names {domain}, {nodes[0].path} names {first}",
                expected=str(first),
                actual=str(domain),
                related=tuple(node.path for node in nodes),
            )


@rule("K16", "domain-of-environment", severity="warning")
def domain_of_environment(subject: LintSubject) -> Iterator[Problem]:
    """The environment can override the domain of a context.

    Why: with Use Domain ID Env Var on, its default, the context uses `ROS_DOMAIN_ID` if that is
    set, and ignores its own number. On another computer the robot is in another domain.

    Fix: switch Use Domain ID Env Var off, or leave Domain Id at 0.

    Example: a ROS2 Context with `inputs:domain_id = 5` and nothing else.
    """
    ros = subject.platform.ros
    port, switch = INPUT + ros.domain, INPUT + ros.domain_by_environment
    for contexts in domains(subject.stage).values():
        for context in contexts:
            number = effective_value(context, port, subject.live)
            is_asked = effective_value(context, switch, subject.live) is True
            if is_asked and number:
                text = f"{port} is {number}, but ROS_DOMAIN_ID wins where it is set"
                yield Problem(context.path, text, property=switch, expected="False", actual="True")


@rule("K17", "domain-range")
def domain_range(subject: LintSubject) -> Iterator[Problem]:
    """A context names a domain that ROS 2 does not have.

    Why: DDS uses the network ports from 7400 + 250 x domain on, and there is no port above 65535.
    Above domain 232 no node can communicate. If `ROS_DOMAIN_ID` can replace the number, it is a
    warning.

    Fix: choose a Domain Id from 0 to 232; up to 101 is safe on all systems.

    Example: a ROS2 Context with `inputs:domain_id = 250`.
    """
    port = INPUT + subject.platform.ros.domain
    for domain, contexts in domains(subject.stage).items():
        for context in contexts if (domain.number or 0) > LAST_DOMAIN else ():
            yield Problem(
                context.path,
                f"{port} is {domain.number}, and the last domain of ROS 2 is {LAST_DOMAIN}",
                property=port,
                expected=f"0 to {LAST_DOMAIN}",
                actual=domain.name,
                severity="warning" if domain.from_environment else None,
            )


@rule("K44", "clock-elsewhere", severity="warning", formerly="two-clocks")
def clock_elsewhere(subject: LintSubject) -> Iterator[Problem]:
    """The clock is published on another topic than `/clock`.

    Why: nodes that use simulation time subscribe to `/clock` only. A clock on another topic, such
    as one in the namespace of a robot, reaches only nodes that remap it.

    Fix: publish one clock, on `/clock`.

    Example: two robots publish `/robot_1/clock` and `/robot_2/clock`.
    """
    clocks = [end for end in running_endpoints(subject.stage, "publishes") if end.type == CLOCK]
    first: dict[str, dict[str, Endpoint]] = {}  # by domain and topic
    for clock in clocks:
        first.setdefault(clock.domain.name, {}).setdefault(str(clock.topic), clock)
    for endpoint in clocks:
        if endpoint.topic != "/clock":
            beside = first[endpoint.domain.name].items()
            other = next((clock for topic, clock in beside if topic != endpoint.topic), None)
            reason = f"another clock is on {other.topic}" if other else "programs listen to /clock"
            attribute = subject.platform.ros.namespace_attribute  # moves topics of nodes below
            moving = moving_prims(endpoint.node, subject.stage, subject.live)
            yield Problem(
                endpoint.node.path,
                f"publishes a clock on {endpoint.topic}; {reason}",
                property=endpoint.port,
                expected="/clock",
                actual=endpoint.topic,
                related=() if other is None else (other.node.path,),
                assumes=tuple((path, attribute) for path, _ in moving),
            )


@rule("K45", "system-time", severity="warning")
def system_time(subject: LintSubject) -> Iterator[Problem]:
    """A message has system time, others have simulation time.

    Why: the two clocks are decades apart. No transform has the time of the message, so no node can
    place it.

    Fix: connect Time Stamp to Isaac Read Simulation Time, and switch Use System Time off.

    Example: `inputs:useSystemTime = 1` on a lidar helper, beside a `/clock` of simulation time.
    """
    every = list(topic_clocks(subject.stage))
    simulated = {stamp.domain.name: stamp for stamp in every[::-1] if stamp.clock == "simulation"}
    for stamp in every:
        other = simulated.get(stamp.domain.name)
        if other is not None and stamp.clock == "system":
            yield Problem(
                stamp.node.path,
                f"{stamp.topic} is stamped with system time, {other.topic} with simulation time",
                property=stamp.port,
                expected="simulation time",
                actual="system time",
                related=(other.node.path,),
            )


@rule(
    "K46",
    "stamps-restart",
    severity="note",
    counted=("time stamp that restarts at Stop", "time stamps that restart at Stop"),
)
def stamps_restart(subject: LintSubject) -> Iterator[Problem]:
    """Time restarts on Stop for some messages only.

    Why: after Stop and Play, the restarted stamps are behind the clock. Such messages are dropped,
    or cannot be placed, until they catch up.

    Fix: choose the same Reset On Stop for all nodes that read simulation time, and the same Reset
    Simulation Time On Stop for the helpers.

    Example: `/clock` has `resetOnStop = 0` while the lidar helper keeps its default, which is on.
    """
    simulated = [stamp for stamp in topic_clocks(subject.stage) if stamp.clock == "simulation"]
    leading: dict[str, Stamp] = {}  # by domain: the clock, else the first message
    for stamp in sorted(simulated, key=lambda stamp: not stamp.is_clock):
        leading.setdefault(stamp.domain.name, stamp)
    for stamp in simulated:
        first = leading[stamp.domain.name]
        if {stamp.restarts, first.restarts} == {True, False}:
            words = ["restarts", "continues"] if stamp.restarts else ["continues", "restarts"]
            yield Problem(
                stamp.node.path,
                f"the time of {stamp.topic} {words[0]} on Stop, that of {first.topic} {words[1]}",
                property=stamp.port,
                related=(first.node.path,),
            )


@rule("K47", "no-clock", severity="warning")
def no_clock(subject: LintSubject) -> Iterator[Problem]:
    """Messages have simulation time, but there is no clock.

    Why: nodes that use simulation time wait forever for a `/clock`. Others compare the stamps,
    which begin near 0, with the time of the computer, and find no transform. A clock in a
    deactivated graph does not count (IsaacSim issue 419).

    Fix: add a ROS2 Publish Clock in the same domain, with its time from Isaac Read Simulation Time.

    Example: a graph with odometry and transforms only.
    """
    stamped: dict[Domain, list[Stamp]] = {}
    for stamp in topic_clocks(subject.stage):
        if stamp.clock == "simulation":
            stamped.setdefault(stamp.domain, []).append(stamp)
    clocks = nodes_of(lambda kind: kind.message.get("") == CLOCK, subject.stage)
    # A script or a node of an unknown type that runs may send it.
    is_known = not subject.stage.scripts and not any(
        node.type is None
        and subject.runs(path)
        and node.type_name not in subject.platform.deprecated
        for path, node in subject.live.items()
    )
    # A graph that is only an over may hold the clock.
    absent = (prim.path.rpartition("/")[0] for prim in subject.stage.absent)
    off = [graph.path for graph in subject.graphs() if not graph.active]
    overs = tuple((path, None) for path in dict.fromkeys((*off, *absent)))
    is_or_are = "is" if len(off) == 1 else "are"
    resting = f"; {' and '.join(off)} {is_or_are} not in the scene" if off else ""
    for domain, simulated in stamped.items() if is_known else ():
        meeting = (domain_of(clock, subject.live, subject.platform) for clock in clocks)
        if not any(may_meet(domain, other) for other in meeting):
            first, more = simulated[0], len(simulated) - 1
            and_more = f" and {more} other topic{'s' * (more > 1)} use" if more else " uses"
            yield Problem(
                first.node.path,
                f"{first.topic}{and_more} simulation time, but nothing publishes /clock{resting}",
                expected="a publisher of /clock",
                related=tuple(dict.fromkeys((*off, *(s.node.path for s in simulated[1:])))),
                rests_on=next(iter(subject.stage.unresolved), None),
                fix=() if off else clock_publisher(first, subject),
                assumes=overs,
                identity="/",
            )
