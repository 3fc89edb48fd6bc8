"""Rules about nodes: every one the handout names, once, active, of the right type."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import strays
from lab3_usd.check.all_the_same import without_node
from lab3_usd.check.finding import Problem
from lab3_usd.check.model import DEACTIVATED, OUTSIDE, OVER, Absent, Node, StageModel
from lab3_usd.check.registry import rule
from lab3_usd.check.say import titled
from lab3_usd.check.subject import GraphSubject, Roles
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.spec import GraphSpec, NodeSpec


def _missing(spec: GraphSpec, roles: Roles) -> list[NodeSpec]:
    """Return the roles that no node plays and no node of another type stands in for."""
    if roles.graph is None:
        return []
    return [
        each
        for role, each in spec.nodes.items()
        if roles.node_of[role] is None and role not in roles.retyped
    ]


def absent_nodes(
    spec: GraphSpec, roles: Roles, stage: StageModel, catalog: Catalog
) -> dict[str, Absent]:
    """Pair missing roles with prims of their type that are in the file but not in the graph.

    A prim that is named like a role is that role's before it may be another's.
    """
    outside = (Absent(node.path, node.type_name, OUTSIDE) for node in strays(stage))
    offers = [*(() if roles.graph is None else roles.graph.absent), *outside]
    found: dict[str, Absent] = {}
    for must_be_named in (True, False):
        for each in _missing(spec, roles):
            for offer in offers if each.role not in found else ():
                is_named = offer.path.endswith(f"/{each.role}")
                fits = catalog.get(offer.type_name) is each.type
                if fits and (is_named or not must_be_named):
                    found[each.role] = offer
                    offers.remove(offer)
                    break
    return found


@rule("N01", "missing-node", scope="graph")
def missing_node(subject: GraphSubject) -> Iterator[Problem]:
    """A node that the handout asks for is not in the graph, or is deactivated.

    Why: what it computes, publishes or triggers is missing; what is wired to it does not run, or
    works on its defaults. Its wires are not reported one by one.

    Fix: in the Action Graph editor, search for the node by the title given here, add it, and make
    the wires of the handout's table. A deactivated prim: right-click it in the Stage panel and
    choose Activate. One that stands outside the graph: drag it back.

    Example: ROS_Clock without Isaac Read Simulation Time.
    """
    graph = subject.roles.graph
    absent = absent_nodes(subject.spec, subject.roles, subject.stage, subject.lab.catalog)
    for spec in _missing(subject.spec, subject.roles):
        there = absent.get(spec.role)
        why = "" if there is None else f": {there.path} is {there.reason}{_below(there, subject)}"
        spared = without_node(subject, spec.role)
        yield Problem(
            prim="" if graph is None else graph.path,
            message=f"node {titled(spec)} ({spec.role}) is missing{why}{spared}",
            expected=spec.type.type,
            handout=spec.handout,
            related=() if there is None else (there.path,),
            hint=_way_back(subject, spec, there),
        )


def _below(there: Absent, subject: GraphSubject) -> str:
    """Say which asset could have brought the node that only an over is left of."""
    missing = subject.stage.unresolved_above(there.path) if there.reason == OVER else None
    return "" if missing is None else f", and {missing.asset} below it cannot be found"


def _way_back(subject: GraphSubject, spec: NodeSpec, there: Absent | None) -> str:
    """Return how to repair a missing node: one that is in the file already is not added again."""
    name = subject.spec.name
    if there is None:
        return f"add {titled(spec)} to {name} and wire it as the handout shows"
    if there.reason == DEACTIVATED:
        return f"right-click {there.path} in the Stage panel and choose Activate"
    graph = subject.roles.graph
    if there.reason == OUTSIDE and graph is not None:
        return f"drag {there.path} back below {graph.path} in the Stage panel and check its wires"
    define = "write def instead of over for" if there.reason == OVER else "delete"
    otherwise = ", or delete it" if there.reason == OVER else ""
    return (
        f"{define} {there.path} in the file{otherwise}, "
        f"add {titled(spec)} to {name} and wire it as the handout shows"
    )


@rule("N03", "wrong-node-type", scope="graph")
def wrong_node_type(subject: GraphSubject) -> Iterator[Problem]:
    """A node of another type stands where the handout asks for this one.

    Why: it does something else: On Physics Step never fires in a graph that the app's update
    evaluates, On Tick may fire at another pace or while the simulation stands still, Make Array
    (`MakeArray`) is a removed node that only looks alike.

    Fix: delete the node, add the one named here from the node list, and wire it as before.

    Example: On Tick instead of On Playback Tick.
    """
    for role, node in subject.roles.retyped.items():
        spec = subject.spec.nodes[role]
        meant = subject.lab.catalog.lookalikes.get(node.type_name)
        alike = "; the name looks alike and is not registered" if meant == spec.type.type else ""
        is_same_title = node.type is not None and node.type.ui_name == spec.type.ui_name
        title = node.type_name if is_same_title or node.type is None else node.type.ui_name
        yield Problem(
            prim=node.path,
            property="node:type",
            message=f"node is {title or 'of no type'}, expected {titled(spec)}{alike}",
            expected=spec.type.type,
            actual=node.type_name,
            handout=spec.handout,
            hint=f"replace the node by {titled(spec)} and wire it as the handout shows",
        )


@rule("N04", "old-node-version", scope="graph", severity="note")
def old_node_version(subject: GraphSubject) -> Iterator[Problem]:
    """A node was saved by an older version of its type.

    Why: Isaac Sim 6.0.1 brings it up to date when it opens the stage.

    Fix: open the stage in Isaac Sim 6.0.1 and save it again.

    Example: Isaac Create Render Product version 2 instead of 3.
    """
    for node, spec in _played(subject):
        if node.version is not None and node.version < spec.type.version:
            yield _version_problem(node, spec, "an older")


@rule("N05", "new-node-version", scope="graph", severity="warning")
def new_node_version(subject: GraphSubject) -> Iterator[Problem]:
    """A node was saved by a newer version of its type than Isaac Sim 6.0.1 has.

    Why: ports and defaults may have changed since; what is said of this node may not hold.

    Fix: make the graph with Isaac Sim 6.0.1, which the course uses.

    Example: ROS2 Camera Helper version 4, when 6.0.1 has 3.
    """
    for node, spec in _played(subject):
        if node.version is not None and node.version > spec.type.version:
            yield _version_problem(node, spec, "a newer")


def _played(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec]]:
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        if node is not None:
            yield node, spec


def _version_problem(node: Node, spec: NodeSpec, kind: str) -> Problem:
    return Problem(
        prim=node.path,
        property="node:typeVersion",
        message=f"{titled(spec)} is of {kind} version, {node.version}",
        expected=str(spec.type.version),
        actual=str(node.version),
        handout=spec.handout,
    )


@rule("N06", "old-type-names", scope="graph", severity="warning")
def old_type_names(subject: GraphSubject) -> Iterator[Problem]:
    """The graph's nodes carry type names from before Isaac Sim 4.5.

    Why: Isaac Sim 6.0.1 renames them when it opens the stage, so that the graph works; it was
    not saved by 6.0.1. Said once for the graph.

    Fix: open the stage in Isaac Sim 6.0.1 and save it again.

    Example: a ROS2 Context whose type begins with `omni.isaac`.
    """
    graph = subject.roles.graph
    catalog = subject.lab.catalog
    nodes = () if graph is None else graph.nodes
    old = [node for node in nodes if catalog.modern(node.type_name) != node.type_name]
    if graph is not None and old:
        names = tuple(node.path for node in old)
        count = "1 node carries a type name" if len(old) == 1 else f"{len(old)} nodes carry names"
        message = f"{count} from before 4.5: {old[0].type_name}"
        expected = catalog.modern(old[0].type_name)
        yield Problem(
            graph.path, message, None, expected, old[0].type_name, subject.spec.handout, names
        )


# The other rules of this family.
from lab3_usd.check.rules import commands, extras  # noqa: E402, F401
