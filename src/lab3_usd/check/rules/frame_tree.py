"""Rules about the frame above the robot's odometry, which no stage may place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.lab_frames import TfView
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import frame_places, rule
from lab3_usd.check.repairs import removal_or_repair
from lab3_usd.check.robot.sensors import is_named
from lab3_usd.facts.domains import domain_of
from lab3_usd.facts.execution_order import running_nodes
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.node_types import NodeType, TfPorts
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import AbsentPrim, Node, PortState, once_per_stage
from lab3_usd.spec.lab import FrameSpec

_DELETED = "deactivated"


class _Placement(Struct, frozen=True):
    """A node that places a guarded frame: below which one, and why nothing receives it, if so."""

    node: str
    parent: str | None
    child: str
    port: str | None
    unheard: str = ""


@rule("T07", "odom-below-another-frame", scope="frames", needs="guarded root")
def odom_below_another_frame(view: TfView) -> Iterator[Problem]:
    """A publisher places `odom` below another frame.

    Why: AMCL publishes `map -> odom`. With a second parent the frame jumps between the two, and
    navigation loses the robot. A publisher that nothing triggers is reported too: it publishes as
    soon as one connection is added. A deactivated one is a note.

    Fix: if it is the publisher of the lab, set Parent Frame ID to `{root}` and Child Frame ID to
    `{base}`. Delete or deactivate any other one. Isaac Sim's menu for odometry creates one named
    TFWorld2Odom below `/Graph/ROS_Odometry`.

    Example: `/Graph/ROS_Odometry/TFWorld2Odom` publishes `world -> {root}`.
    """
    subject = view.subject
    frames = subject.lab.frames
    placements = _placements(view)
    for placement in placements:
        if not _competes(placement, frames):
            yield _placed(placement, view)
    nodes = {placement.node for placement in placements}
    for path in view.live_nodes:
        if path not in nodes and _is_forbidden_name(path, subject):
            yield Problem(
                path,
                "a node of this name publishes what the lab must not have",
                handout=_handout_of_names(frames),
                fix=removal_or_repair(subject, path),
            )
    yield from _put_away(subject)


@once_per_stage
def _placements(view: TfView) -> tuple[_Placement, ...]:
    guarded, placements = view.subject.lab.frames.guarded, dict[str, _Placement]()
    for edge in view.edges:
        if edge.cause not in placements and view.is_guarded(edge):
            port = _wrong_port(edge.parent, tf_ports(view.live_nodes[edge.cause]), view)
            placements[edge.cause] = _Placement(edge.cause, edge.parent, edge.child, port)
    for path, node in view.live_nodes.items():
        names = tf_ports(node).names
        if not names or path in placements or path in view.elsewhere:
            continue
        parent, child = (effective_value(node, name, view.live_nodes) for name in names)
        if not isinstance(child, str) or child not in guarded:
            continue
        domain = domain_of(node, view.live_nodes, view.platform)
        if path not in view.role_specs and not view.is_heard(domain):
            continue
        parent = parent if isinstance(parent, str) else None
        runs = path in running_nodes(view.subject.stage)
        unheard = ", though not on a topic of tf2" if runs else ", though nothing triggers it"
        port = _wrong_port(parent, tf_ports(node), view)
        placements[path] = _Placement(path, parent, child, port, unheard)
    return tuple(placements.values())


def _competes(placement: _Placement, frames: FrameSpec) -> bool:
    """Whether a node publishes what localization does."""
    edge = None if frames.localization is None else frames.localization.edge
    return (placement.parent, placement.child) == edge


def _wrong_port(parent: str | None, ports: TfPorts, view: TfView) -> str | None:
    """Return the setting to correct: the child's name where the parent's is right as it is."""
    right = {parent for parent, _ in view.subject.lab.frames.edges}
    if ports.names:
        return ports.names[1] if parent in right else ports.names[0]
    return ports.prims[1] if ports.prims else None


def _asked(placement: _Placement, view: TfView) -> tuple[str, str | None]:
    """Return the expectation about the node, and a hint if the lab needs it.

    The publisher that the lab requires must not be deleted: it places the robot in `odom`.
    """
    if placement.node not in view.role_specs:
        return "no such publisher", None
    asked = view.subject.lab.frames.edges
    up, down = next((edge for edge in asked if placement.child in edge), ("", placement.child))
    hint = f"set Parent Prim to the prim of `{up}`; keep the node"
    if tf_ports(view.live_nodes[placement.node]).names:
        hint = f"set Parent Frame ID to `{up}` and Child Frame ID to `{down}`; keep the node"
    return f"{up} -> {down}", hint


def _placed(placement: _Placement, view: TfView) -> Problem:
    frames = view.subject.lab.frames
    localization = frames.localization
    is_localized = localization is not None and placement.child == localization.edge[1]
    may = f"only {localization.by} may" if localization and is_localized else "nothing may"
    what = f"place '{placement.child}'" if placement.child in frames.guarded else "publish it"
    handout = frames.guarded.get(placement.child) or _handout_of_names(frames)
    problem = _published(placement, f"{placement.unheard}; {may} {what}", handout, view)
    return replace(problem, covers=frame_places(placement.child))


def _published(placement: _Placement, end: str, handout: str, view: TfView) -> Problem:
    """Return that a node publishes a transform, with the end of the message."""
    parent = "an unknown frame" if placement.parent is None else placement.parent
    actual, (expected, hint) = f"{parent} -> {placement.child}", _asked(placement, view)
    site, name = placement.node, placement.port
    fix = removal_or_repair(view.subject, site, name)
    message = f"publishes {actual}{end}"
    return Problem(site, message, name, expected, actual, handout, hint=hint, fix=fix)


def _is_forbidden_name(path: str, subject: StageSubject) -> bool:
    """Whether the prim has a forbidden name, a copy's number left aside."""
    return is_named(path.rpartition("/")[2], subject.lab.frames.forbidden_names)


def _handout_of_names(frames: FrameSpec) -> str:
    """Return the section that forbids a transform, that of the tree where none does."""
    return next((entry.handout for entry in frames.forbidden_transforms), frames.handout)


def _put_away(subject: StageSubject) -> Iterator[Problem]:
    """Note the publishers that somebody deactivated, as 8.11 advises."""
    platform = subject.lab.platform
    gone = [prim for graph in subject.stage.graphs for prim in graph.absent if graph.active]
    for absent in (*gone, *subject.stage.absent):
        kind = platform.get(absent.type_name)
        named = _is_forbidden_name(absent.path, subject)
        if absent.reason == _DELETED and (named or _places_odom(kind, absent, subject)):
            yield _note(absent.path, subject)
    for graph in subject.stage.graphs:
        for node in () if graph.active else graph.nodes:
            if _is_forbidden_name(node.path, subject) or _places_odom(node.type, node, subject):
                yield _note(node.path, subject)


def _places_odom(kind: NodeType | None, given: AbsentPrim | Node, subject: StageSubject) -> bool:
    if kind is None or kind.tf is None or not kind.tf.names:
        return False
    port = kind.tf.names[1]
    ports: Mapping[str, PortState] = given.ports
    value = ports[port].value if port in ports else kind.ports[port].default
    return value in subject.lab.frames.guarded


def _note(path: str, subject: StageSubject) -> Problem:
    return Problem(
        path,
        "is deactivated and publishes nothing; it can be deleted",
        handout=_handout_of_names(subject.lab.frames),
        severity="note",
    )


@rule("T08", "competes-with-localization", scope="frames", needs="localization")
def competes_with_localization(view: TfView) -> Iterator[Problem]:
    """The stage publishes `map -> odom`, as localization does.

    Why: AMCL corrects the robot's pose by moving `odom` in `map`. A second publisher of the same
    transform resets it at every update, and the robot jumps.

    Fix: if it is the publisher of the lab, set Parent Frame ID to `{root}` and Child Frame ID to
    `{base}`. Delete any other one from the stage. Localization places this frame while the system
    runs.

    Example: a Publish Raw Transform Tree has Parent Frame ID `map` and Child Frame ID `odom`.
    """
    subject = view.subject
    localization = subject.lab.frames.localization
    if localization is None:
        return
    for placement in _placements(view):
        if _competes(placement, subject.lab.frames):
            end = f", which {localization.by} publishes"
            yield _published(placement, end, localization.handout, view)
