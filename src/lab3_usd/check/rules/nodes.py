"""Rules about nodes.

Every one the handout names, once, active, of the right type; those that it does not ask for, and
those that change the scene or the run while it plays.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import chain, count

from lab3_usd.check.lab_topics import role_specs
from lab3_usd.check.match.conformance import right_sources
from lab3_usd.check.match.diagnosis import absent_nodes, in_another_graph, missing_roles
from lab3_usd.check.match.rule_inputs import GraphSubject, RobotSubject, StageSubject
from lab3_usd.check.message_suffixes import note_if_harmless, shown_graph
from lab3_usd.check.registry import TF, rule
from lab3_usd.check.repairs import TYPE, VERSION, edits_at
from lab3_usd.check.requirements import demands_of
from lab3_usd.check.robot.ground import planes
from lab3_usd.check.robot.wheels import is_doubtful, second_commanders
from lab3_usd.check.rules.world import at_rest
from lab3_usd.facts.changes import effect_on_run, writing_nodes, written_paths
from lab3_usd.facts.endpoints import Endpoint, running_endpoints
from lab3_usd.facts.execution_order import live_nodes, severity_if_uncertain
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.behaviour import WriterPorts
from lab3_usd.isaac.graph import PortRef
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.changes import Activate, AddNode, Edit, RemovePrim
from lab3_usd.model.finding import Problem, Severity, node_title, role_title
from lab3_usd.model.physics import SCENE
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import (
    DEACTIVATED,
    ELSEWHERE,
    OUTSIDE,
    OVER,
    AbsentPrim,
    Node,
    StageModel,
    once_per_stage,
)
from lab3_usd.spec.contradictions.names import transform_topics
from lab3_usd.spec.graph import NodeSpec
from lab3_usd.spec.lab import Lab


@rule("N01", "missing-node", scope="graph")
def missing_node(subject: GraphSubject) -> Iterator[Problem]:
    """A required node is missing or deactivated.

    Why: the node's computation, publication or trigger is missing. Nodes connected to it do not
    run, or use their defaults. Its connections are not reported one by one.

    Fix: in the Action Graph editor, search for the node by the title given here, add it, and make
    the connections in the handout's table. For a deactivated prim, right-click it in the Stage
    panel and choose Activate. Drag a node that is outside the graph back into it.

    Example: {graph_name} without Isaac Read Simulation Time.
    """
    graph = subject.roles.graph
    if graph is None:
        return
    missing = missing_roles(subject.spec, subject.roles)
    if not missing:
        return
    absent = absent_nodes(subject.spec, subject.roles, subject.stage)
    overs = [prim for prim in absent.values() if prim.reason == OVER]
    asset = subject.stage.unresolved_above(graph.path)
    if asset is not None and len(overs) > 1:
        yield _missing_with_asset(subject, graph.path, asset.asset, overs)
        missing = [node for node in missing if node.role in absent]
        missing = [node for node in missing if absent[node.role] not in overs]
    taken = {*(node.path for node in graph.nodes), *(prim.path for prim in graph.absent)}
    for spec in missing:
        present = absent.get(spec.role) or in_another_graph(spec, subject)
        reason = ""
        if present is not None:
            # An asset that is missing could have brought the node that only an over is left of.
            is_over = present.reason == OVER
            lost = subject.stage.unresolved_above(present.path) if is_over else None
            below = "" if lost is None else f", and {lost.asset} below it cannot be found"
            reason = f": {present.path} is {present.reason}{below}"
        harmless_note = note_if_harmless(subject, spec.role)
        fix: tuple[Edit, ...] = ()
        if present is None:
            names = chain([spec.role], (f"{spec.role}_{number}" for number in count(2)))
            paths = (f"{graph.path}/{name}" for name in names)
            prims = subject.stage.prims
            free = next(path for path in paths if path not in taken and prims.get(path) is None)
            fix = (AddNode.of(free, spec.node),)
        elif present.reason in {DEACTIVATED, OVER}:
            fix = (Activate(present.path),)
        yield Problem(
            prim=graph.path,
            message=f"node {role_title(spec)} ({spec.role}) is missing{reason}{harmless_note}",
            expected=spec.type.type,
            handout=spec.handout,
            related=() if present is None else (present.path,),
            hint=_repair_hint(subject, spec, present),
            fix=fix,
            unmet=(f"{subject.spec.name}/node/{spec.role}",),
            covers=() if present is None else ((present.path, None),),
        )


def _missing_with_asset(
    subject: GraphSubject, graph: str, asset: str, overs: list[AbsentPrim]
) -> Problem:
    """Say once that the nodes are in an asset which cannot be found, where overs change them."""
    return Problem(
        prim=graph,
        message=f"nodes of {subject.spec.name} are missing: {len(overs)} are only overs without a "
        f"def, and {asset} below them cannot be found",
        expected=f"{len(subject.spec.nodes)} nodes",
        handout=subject.spec.handout,
        related=tuple(over.path for over in overs),
        hint=f"hand in {asset} beside the stage, or choose File > Collect As in Isaac Sim",
    )


def _repair_hint(subject: GraphSubject, spec: NodeSpec, prim: AbsentPrim | None) -> str:
    """Return how to repair a missing node: one that is in the file already is not added again."""
    graph = subject.roles.graph
    name = subject.spec.name
    if graph is not None:
        name = shown_graph(graph.path, (graph_model.path for graph_model in subject.stage.graphs))
    if prim is None:
        return f"add {role_title(spec)} to {name} and {_wiring(subject, spec)}"
    if prim.reason == DEACTIVATED:
        return f"right-click {prim.path} in the Stage panel and choose Activate"
    if prim.reason in {OUTSIDE, ELSEWHERE} and graph is not None:
        return f"drag {prim.path} back below {graph.path} in the Stage panel and check its wires"
    define = "write def instead of over for" if prim.reason == OVER else "delete"
    otherwise = ", or delete it" if prim.reason == OVER else ""
    return (
        f"{define} {prim.path} in the file{otherwise}, "
        f"add {role_title(spec)} to {name} and {_wiring(subject, spec)}"
    )


def _wiring(subject: GraphSubject, spec: NodeSpec) -> str:
    """Name the connections of a node, its own ports as `out` and `in` of the others' prims."""
    node_of, wires = subject.roles.node_of, subject.spec.wires

    def port(ref: PortRef) -> str:
        name = ref.short.partition(".")[2]
        if ref.role == spec.role:
            return name
        node = node_of[ref.role]
        return f"{ref.role if node is None else node.path.rpartition('/')[2]}.{name}"

    own = [wire for wire in wires if spec.role in {wire.source.role, wire.target.role}]
    return "connect " + ", ".join(f"{port(wire.source)} -> {port(wire.target)}" for wire in own)


@rule("N03", "wrong-node-type", scope="graph")
def wrong_node_type(subject: GraphSubject) -> Iterator[Problem]:
    """A node has another type.

    Why: another type behaves differently. On Physics Step never fires in a graph that the app's
    update evaluates. On Tick may fire at another rate, or while the simulation is stopped. Make
    Array (`MakeArray`) is a deprecated node with a similar name.

    Fix: delete the node, add the one named here from the node list, and connect it as before.

    Example: On Tick instead of On Playback Tick.
    """
    for role, node in subject.roles.retyped.items():
        spec = subject.spec.nodes[role]
        platform = subject.lab.platform
        alike = ""
        if platform.lookalikes.get(node.type_name) == spec.type.type:
            alike = "; the name looks alike and is not registered"
        elif platform.deprecated.get(node.type_name) == spec.type.type:
            alike = "; the type is deprecated"
        is_same_title = node.type is not None and node.type.ui_name == spec.type.ui_name
        title = node.type_name if is_same_title or node.type is None else node.type.ui_name
        yield Problem(
            prim=node.path,
            property=TYPE,
            message=f"node is {title or 'of no type'}, expected {role_title(spec)}{alike}",
            expected=spec.type.type,
            actual=node.saved_type,
            handout=spec.handout,
            hint=f"replace the node by {role_title(spec)} and {_wiring(subject, spec)}",
            fix=edits_at(subject, f"{node.path}.{TYPE}"),
        )


@rule("N04", "old-node-version", scope="graph", severity="note")
def old_node_version(subject: GraphSubject) -> Iterator[Problem]:
    """A node has an older version of its type.

    Why: Isaac Sim {isaac} updates the node when it opens the stage.

    Fix: open the stage in Isaac Sim {isaac} and save it again.

    Example: Isaac Create Render Product version 2 instead of 3.
    """
    for node, spec in subject.matched:
        if node.version is not None and node.version < spec.type.version:
            yield Problem(
                prim=node.path,
                property=VERSION,
                message=f"{role_title(spec)} is of an older version, {node.version}",
                expected=str(spec.type.version),
                actual=str(node.version),
                handout=spec.handout,
                fix=edits_at(subject, f"{node.path}.{VERSION}"),
            )


@rule("N02", "extra-node", scope="graph", severity="warning")
def extra_node(subject: GraphSubject) -> Iterator[Problem]:
    """The graph contains a node that the lab does not use.

    Why: the node may do nothing, or may repeat the work of another node. A second node with the
    same settings (context, tick, subscriber) works like the first. One that only gives an input the
    value that it should have is a note.

    Fix: select the node in the Action Graph editor and delete it.

    Example: a second ROS2 Context in {next_graph_name}.
    """
    for node in subject.roles.extra:
        yield Problem(
            node.path,
            f"{node_title(node)} is not part of {subject.spec.name}",
            severity="note" if node.path in right_sources(subject) else None,
            actual=node.saved_type,
            handout=subject.spec.handout,
            fix=(RemovePrim(node.path),),
            assumes=((node.path, None),),
        )


def _published_again(subject: GraphSubject, node: Node) -> tuple[Endpoint, Endpoint] | None:
    """Return where an extra node publishes a topic of the lab, and where another node does."""
    asked = _topics_asked(subject.lab)
    if subject.checkpoint.frames:
        asked -= transform_topics(subject.lab)  # which the rules of frames judge
    by_node, by_topic = _published(subject.stage)
    pairs = [
        (own, other)
        for own in by_node.get(node.path, ())
        if own.topic in asked
        for other in by_topic[own.topic]
        if other.node is not node
    ]
    return min(pairs, key=lambda pair: not _is_sure(pair), default=None)


_Ends = dict[str | None, list[Endpoint]]


@once_per_stage
def _published(stage: StageModel) -> tuple[_Ends, _Ends]:
    """Return what is published, by its node and by its topic."""
    by_node, by_topic = _Ends(), _Ends()
    for endpoint in running_endpoints(stage, "publishes"):
        by_node.setdefault(endpoint.node.path, []).append(endpoint)
        by_topic.setdefault(endpoint.topic, []).append(endpoint)
    return by_node, by_topic


def _is_sure(pair: tuple[Endpoint, Endpoint]) -> bool:
    return all(endpoint.sure for endpoint in pair)


@lru_cache(maxsize=16)
def _topics_asked(lab: Lab) -> frozenset[str]:
    """Return the topics that the graphs of a lab publish, which is the same for every stage."""
    from lab3_usd.spec.contradictions.names import graph_topics  # which few stages need

    return frozenset(topic.name for topic in graph_topics(lab) if not topic.is_subscribed)


@rule("N07", "repeated-publisher", scope="graph")
def repeated_publisher(subject: GraphSubject) -> Iterator[Problem]:
    """An extra node publishes a topic of the lab again.

    Why: subscribers cannot tell the two streams apart. Two transform publishers give one frame two
    parents.

    Fix: delete the node that the handout does not ask for.

    Example: a second ROS2 Publish Clock in {graph_name}.
    """
    for node in subject.roles.extra:
        is_script = subject.platform.scripts.runs(node.type_name)
        pair = None if is_script else _published_again(subject, node)
        if pair is not None:
            own, other = pair
            yield Problem(
                node.path,
                f"{node_title(node)} is not part of {subject.spec.name} and publishes "
                f"{own.topic} again",
                property=own.port,
                actual=own.topic,
                handout=subject.spec.handout,
                related=(other.node.path,),
                severity=None if _is_sure(pair) else "warning",
                fix=(RemovePrim(node.path),),
            )


@rule("N08", "script-node", scope="stage")
def script_node(subject: StageSubject) -> Iterator[Problem]:
    """A node or prim runs code from the file.

    Why: the code may run when somebody opens the stage and presses Play. The lab needs no code.

    Fix: delete the node. If a prim carries the script, remove Python Scripting in the Property
    panel.

    Example: a Script Node that publishes a topic from Python.
    """
    for script in subject.stage.scripts:
        is_node = subject.lab.platform.scripts.runs(script.carrier)
        what = "node" if is_node else "prim"
        yield Problem(
            script.prim,
            f"{what} runs code out of the file, which the lab does not need",
            property=TYPE if is_node else None,
            actual=script.carrier,
            fix=(RemovePrim(script.prim),),
        )


@rule("N12", "wheels-commanded-twice", scope="robot", needs="wheels")
def wheels_commanded_twice(subject: RobotSubject) -> Iterator[Problem]:
    """A second node commands the wheels.

    Why: both controllers write the wheel velocities at every update, and the last one wins. The
    robot does not move, or does not follow its commands.

    Fix: delete the graph of that node. Isaac Sim's menu for a differential controller creates one.

    Example: `/Graph/differential_controller/ArticulationController`, created by Tools > Robotics >
    OmniGraph Controllers > Differential Controller.
    """
    stage, robot = subject.stage, subject.robot
    live = live_nodes(stage)
    for node, own in second_commanders(subject):
        doubtful = (
            "warning" if is_doubtful(node, live) else severity_if_uncertain(stage, node.path, own)
        )
        yield Problem(
            node.path,
            f"{node_title(node)} commands the wheels as well, which only {own} may do",
            expected="one controller",
            actual=node.saved_type,
            handout=robot.wheels.handout or robot.handout,
            related=(own,),
            severity=doubtful,
            fix=(RemovePrim(node.path),),
        )


@rule("N13", "scene-written", scope="stage")
def scene_written(subject: StageSubject) -> Iterator[Problem]:
    """A node changes the scene, commands the robot, or ends the run.

    Why: the written values replace the saved ones. It is an error if the node moves, disables or
    commands the robot or its ground, changes a node of the lab, or stops the simulation. Any other
    node that writes is a warning: the lab needs none. A node that is never triggered, or only by a
    key or the mouse, is not a fault.

    Fix: delete the node, or aim it at a prim that is not part of the lab.

    Example: Write Prim Attribute sets `drive:angular:physics:targetVelocity` of `{joint}`.
    """
    stage, lab = subject.stage, subject.lab
    live, played = live_nodes(stage), role_specs(subject)
    extra = {node.path for roles in subject.roles.values() for node in roles.extra}
    for node, ports in writing_nodes(stage):
        if node.path in played:
            continue  # the lab asks for it
        path, effect = node.path, effect_on_run(node, ports, live)
        written = written_paths(node, ports, live)
        hit = next(
            (at for at in written if _takes(at, ports, subject) and _is_of_lab(at, subject)), ""
        )
        name = effective_value(node, INPUT + ports.property, live) if ports.property else ""
        is_seen_only = (
            isinstance(name, str) and bool(name) and name.startswith(lab.platform.appearance)
        )
        is_harmful = bool(effect) or (bool(hit) and not is_seen_only)
        if not is_harmful and (path in extra or ports.is_view):
            continue  # the rule of extra nodes reports it
        what = f"{hit}.{name}" if hit and isinstance(name, str) and name else hit
        effect = effect or f"changes {what or ports.what} while the simulation runs"
        message = f"{node_title(node)} {effect}"
        severity: Severity | None = "warning"
        if is_harmful:
            severity = severity_if_uncertain(stage, path)
        role, robot = played.get(hit), lab.scene.robot_of(hit or "")
        yield Problem(
            path,
            message,
            expected="no node that writes",
            actual=node.saved_type,
            handout=role.handout if role is not None else (robot or lab.scene.robot).handout,
            related=(hit,) if hit else (),
            severity=severity,
            fix=(RemovePrim(path),),
            unmet=_unmet(hit, subject) if is_harmful and hit else (),
            # What ends the run ends the work of each graph.
            costs=(*subject.roles, TF) if is_harmful and not hit else (),
        )


def _takes(path: str, ports: WriterPorts, subject: StageSubject) -> bool:
    """Whether a prim can be written by a node of this type."""
    prim = subject.stage.prim(path) if ports.schemas else None
    return not ports.schemas or (prim is not None and not {*ports.schemas}.isdisjoint(prim.apis))


def _is_of_lab(path: str, subject: StageSubject) -> bool:
    """Whether a prim is, holds or belongs to the robot, what carries it, or a graph of the lab."""
    if subject.lab.scene.robot_of(path) or path in role_specs(subject):
        return True
    robots = [robot.path for robot in subject.lab.scene.robots]
    parts = [*robots, *(prim.path for robot in subject.robots for prim in planes(robot))]
    parts += [prim.path for prim in subject.stage.of_type(SCENE) if prim.present]
    parts += [roles.graph.path for roles in subject.roles.values() if roles.graph is not None]
    return any(is_at_or_below(part, path) for part in parts)


def _unmet(path: str, subject: StageSubject) -> tuple[str, ...]:
    """Return what a lab asks of a prim, else that the robot stays as it is."""
    for name, roles in subject.roles.items():
        if path in roles.role_of:
            return (f"{name}/node/{roles.role_of[path]}",)
    demands = demands_of(subject.lab, subject.checkpoint)
    robot = subject.lab.scene.robot_of(path) or subject.lab.scene.robot
    return tuple(demand.id for demand in demands if demand.prim == path) or (at_rest(robot),)
