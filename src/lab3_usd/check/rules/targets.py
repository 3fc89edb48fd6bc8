"""Rules about relationships: which prims a node works on, and lists that give too few frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.lab_frames import (
    TfView,
    frame_list_text,
    frame_sources,
    lacks_only_the_camera,
    missing_frames,
)
from lab3_usd.check.match.conformance import (
    target_matches,
    targets_handout_prims,
    targets_prims,
    wrong_product,
)
from lab3_usd.check.match.rule_inputs import GraphSubject
from lab3_usd.check.registry import frame_places, rule
from lab3_usd.check.repairs import edits_at, edits_in_stage
from lab3_usd.model.finding import MOST_ITEMS, Problem, display, format_paths
from lab3_usd.model.stage import Node
from lab3_usd.spec.graph import NodeSpec, Target


def _targets(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Target]]:
    """Yield each relationship that is judged as a list of prims."""
    for node, spec in subject.matched:
        for target in spec.targets:
            if target.port not in spec.frames_from:
                yield node, spec, target


def _problem(subject: GraphSubject, node: Node, target: Target, message: str) -> Problem:
    return Problem(
        prim=node.path,
        property=target.port,
        message=message,
        expected=format_paths(target.prims),
        actual=format_paths(node.targets(target.port)),
        handout=target.handout,
        hint="select the node, clear the field in the Property panel, "
        f"pick {format_paths(target.prims)}",
        fix=edits_at(subject, f"{node.path}.{target.port}"),
    )


def _difference(actual: Sequence[str], target: Target) -> str:
    """Say what a relationship names instead of the prims asked for; of long lists what differs."""
    if max(len(actual), len(target.prims)) <= MOST_ITEMS:
        return f"is {format_paths(tuple(actual))}, expected {format_paths(target.prims)}"
    lacking = tuple(prim for prim in target.prims if prim not in actual)
    foreign = tuple(prim for prim in actual if prim not in (*target.prims, *target.optional))
    said = {"lacks": lacking, "names, and should not,": foreign}
    return "; ".join(f"{verb} {format_paths(prims)}" for verb, prims in said.items() if prims)


def _awaits_its_sensor(subject: GraphSubject, node: Node, target: Target) -> bool:
    """Whether a relationship names where the lab has a sensor that stands elsewhere."""
    spec = subject.lab.graphs[subject.spec.name].nodes[subject.roles.role_of[node.path]]
    named = [candidate.prims for candidate in spec.targets if candidate.port == target.port]
    return named != [target.prims] and any(
        targets_prims(node, target, candidate) for candidate in named
    )


@rule("R01", "missing-target", scope="graph")
def missing_target(subject: GraphSubject) -> Iterator[Problem]:
    """A required relationship has no target.

    Why: without its target the node does nothing: it has no articulation to move, no sensor to
    read, or no body to follow. Isaac Compute Transform Tree without a parent prim puts its frames
    below `world`, separate from the robot.

    Fix: select the node, click the target field in the Property panel and choose the prim.

    Example: Articulation Controller without a target prim: the robot does not move.
    """
    for node, _, target in _targets(subject):
        if not node.targets(target.port):
            state, asked = node.state(target.port), format_paths(target.prims)
            message = f"{target.port} names no prim, expected {asked}"
            if state is not None and state.usd_type != "rel":
                message = f"{target.port} is an attribute, expected a relationship to {asked}"
            yield _problem(subject, node, target, message)


@rule("R02", "wrong-target", scope="graph")
def wrong_target(subject: GraphSubject) -> Iterator[Problem]:
    """A relationship has a wrong target.

    Why: the node works on the wrong prim. A helper on a sensor of another kind publishes nothing.
    {wheels?}Odometry of a wheel rotates on the spot.{/}

    Fix: select the node, clear the field in the Property panel and choose the prim named here.

    Example: the node of one sensor names the prim of another one. If the articulation root is on
    the robot root, `{base}` for the Articulation Controller is a warning: the handout asks for it,
    but Isaac Sim finds no articulation there.
    """
    for node, _, target in _targets(subject):
        actual = node.targets(target.port)
        if _awaits_its_sensor(subject, node, target):
            continue  # the sensor is to be moved back, and then it is the target
        if actual and not target_matches(node, target):
            yield _problem(subject, node, target, f"{target.port} {_difference(actual, target)}")
        if targets_handout_prims(node, target):
            root = format_paths(target.prims)
            message = (
                f"{target.port} is {format_paths(actual)} as in the handout, but the articulation"
            )
            message += f" root is on {root}: no articulation is found, and nothing moves"
            yield replace(_problem(subject, node, target, message), severity="warning")


@rule("R04", "named-render-product", scope="graph", needs="render product")
def named_render_product(subject: GraphSubject) -> Iterator[Problem]:
    """A node names another render product.

    Why: Isaac Create Render Product uses the product that it names as it is. Its own sensor and
    size then have no effect: the topic shows the view of another sensor.

    Fix: select the node and clear Render Product Prim in the Property panel.

    Example: `renderProductPrim` names `/Render/Product`, which shows another sensor.
    """
    for node, spec in subject.matched:
        wrong = wrong_product(node, spec, subject.stage.products)
        if wrong is None:
            continue
        name, product, ports = wrong
        size = " x ".join(map(str, product.size)) or "no size"
        wanted = {target.port: format_paths(target.prims) for target in spec.targets}
        wanted |= {setting.port: display(setting.value) for setting in spec.settings}
        expected = ", ".join(f"{port.partition(':')[2]} {wanted[port]}" for port in ports)
        actual = f"{format_paths((product.camera,) if product.camera else ())}, {size}"
        role = subject.roles.role_of[node.path]
        kinds = dict.fromkeys((target.port for target in spec.targets), "target")
        yield Problem(
            node.path,
            f"{name} names {product.prim}, which shows {actual}, expected {expected}",
            name,
            expected,
            actual,
            spec.handout,
            related=(product.prim,),
            hint=f"select the node and clear {name.partition(':')[2]} in the Property panel",
            fix=edits_at(subject, f"{node.path}.{name}"),
            unmet=tuple(
                f"{subject.spec.name}/{kinds.get(port, 'setting')}/{role}.{port.partition(':')[2]}"
                for port in ports
            ),
        )


@rule("T10", "robot-root-alone", scope="frames", severity="warning", needs="camera")
def robot_root_alone(view: TfView) -> Iterator[Problem]:
    """The robot root is the only target: the camera is omitted.

    Why: a robot root gives the prims below it with IsaacLinkAPI, IsaacSiteAPI or
    IsaacReferencePointAPI. The links in its robot schema do not matter. A camera has none of these
    schemas by default. Its frame is then missing from the required tree, and RViz cannot place the
    image. The robot still drives and navigates, and the handout allows this target: it costs no
    points.

    Fix: keep `{robot}` and add `{camera}` as a second target prim.

    Example: the Target Prims of Isaac Compute Transform Tree are `{robot}`, and `{camera_name}` is
    not published.
    """
    for maker in frame_sources(view):
        missing = missing_frames(maker, view)
        if missing and lacks_only_the_camera(maker, view):
            homes = ", ".join(maker.prims[frame] for frame in missing)
            yield Problem(
                maker.node.path,
                f"the robot root alone does not publish {frame_list_text(missing)}",
                property=maker.port,
                expected=f"{', '.join(maker.node.targets(maker.port))}, {homes}",
                actual=", ".join(maker.node.targets(maker.port)),
                handout=maker.handout,
                hint=f"add {homes} as a second target",
                fix=edits_in_stage(view.subject, maker.node.path, maker.port),
                assumes=((maker.node.path, maker.port),),
                covers=frame_places(*missing),
            )
