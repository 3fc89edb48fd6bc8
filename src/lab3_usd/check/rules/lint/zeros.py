"""Rules about nodes that compute on zeros: what they need is neither wired nor set."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lint.contexts import context_inputs, domains
from lab3_usd.check.lint.needs import array_items, unmet_needs
from lab3_usd.check.lint.reach import has_job, is_wired
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem


@rule("K10", "works-on-zeros", scope="lint")
def works_on_zeros(subject: LintSubject) -> Iterator[Problem]:
    """An input that a node needs is neither wired nor set.

    Why: an input without a wire and without a value is 0 or empty. A publisher without a time
    stamps everything 0, a helper without a render product publishes nothing, a controller without
    a wheel radius gives no command. Isaac Sim says nothing of it, or logs a line each frame.

    Fix: wire the input from the node that computes it, or set it in the Property panel.

    Example: `ros2_publish_odometry.inputs:timeStamp` without a wire.
    """
    for node in subject.live.values():
        if subject.is_open(node.path) or not (subject.runs(node.path) or is_wired(node, subject)):
            continue
        for need in unmet_needs(node, subject):
            known = [name for name in need.inputs if node.has_port(f"inputs:{name}")]
            names = " and ".join(f"inputs:{name}" for name in known)
            verb = "are" if len(known) > 1 else "is"
            yield Problem(
                node.path,
                f"{names} {verb} neither wired nor set: {need.effect}",
                property=f"inputs:{known[0]}",
                expected="a wire or a value",
                severity=need.severity if need.severity != "error" else None,
            )


@rule("K11", "array-with-gaps", scope="lint")
def array_with_gaps(subject: LintSubject) -> Iterator[Problem]:
    """A node makes an array of inputs of which one is empty, or has inputs beyond its size.

    Why: an element that is neither wired nor set is empty: a joint without a name, which no robot
    has, so that the controller moves nothing. Inputs beyond the array's size are left out.

    Fix: wire the input named here, or correct the array's size in the Property panel.

    Example: `joint_name_array.inputs:input0` lost its wire, while `input1` has one.
    """
    for node in subject.live.values():
        if subject.is_open(node.path):
            continue
        items = array_items(node)
        if items is None:
            continue
        if items.filled:
            for port in items.empty:
                yield Problem(
                    node.path,
                    f"{port} is neither wired nor set, so that an element of the array is empty",
                    property=port,
                    expected="a wire or a value",
                )
        for port in items.beyond:
            yield Problem(
                node.path,
                f"{port} is left out: {items.count_port} is {items.count}",
                property=items.count_port,
                actual=str(items.count),
                severity="warning",
            )


@rule("K12", "context-missing", scope="lint", severity="warning")
def context_missing(subject: LintSubject) -> Iterator[Problem]:
    """A ROS node has no context, while others of the stage have one.

    Why: without a context a node is in the domain that the environment names in `ROS_DOMAIN_ID`,
    else in 0. The others are in the domain of their ROS2 Context. Where these differ, the node is
    alone.

    Fix: wire Context of the ROS2 Context to Context of this node.

    Example: of four publishers one has no wire at `inputs:context`.
    """
    wired = [found for found in context_inputs(subject) if found.contexts]
    bare = [found for found in context_inputs(subject) if not found.is_set]
    for found in bare if wired else ():
        if has_job(found.node) and subject.runs(found.node.path):
            yield Problem(
                found.node.path,
                f"{found.port} is not wired: the domain is the environment's, while "
                f"{len(wired)} other nodes of the stage are in that of {wired[0].contexts[0].path}",
                property=found.port,
                expected=f"{wired[0].contexts[0].path}.outputs:context",
            )


@rule("K13", "contexts-differ", scope="lint", severity="warning")
def contexts_differ(subject: LintSubject) -> Iterator[Problem]:
    """Two contexts of the stage name different ROS domains.

    Why: nodes of different domains do not see each other. A robot whose clock is in one domain and
    whose odometry is in another has no time.

    Fix: give all ROS2 Context nodes the same Domain Id, and the same choice of Use Domain ID Env
    Var.

    Example: one context has `domain_id = 5`, the other `domain_id = 0`.
    """
    found = domains(subject)
    if len(found) < 2:  # noqa: PLR2004 - the first is what the others differ from
        return
    (first, nodes), *others = found.items()
    for domain, contexts in others:
        for context in contexts:
            yield Problem(
                context.path,
                f"context is of {domain}, that of {nodes[0].path} of {first}",
                expected=first,
                actual=domain,
                related=tuple(node.path for node in nodes),
            )
