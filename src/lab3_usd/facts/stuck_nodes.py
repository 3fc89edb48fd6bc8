"""Which nodes run and yet do nothing, because of the prims and values that they are given."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.articulations import articulations, is_empty
from lab3_usd.facts.domains import LAST_DOMAIN, context_inputs, domain_of, domains, invalid_contexts
from lab3_usd.facts.execution_order import (
    State,
    live_nodes,
    nodes_in,
    nodes_with,
    referenced_graphs,
    run_states,
    running_nodes,
    signal_sources,
    states_without,
)
from lab3_usd.facts.followed_bodies import followed_bodies
from lab3_usd.facts.reaching_values import LiveNodes, Nodes, effective_value, live_sources
from lab3_usd.facts.render_products import shown_by
from lab3_usd.facts.sensor_faults import faults_of
from lab3_usd.facts.stalled_nodes import is_given, unmet_needs
from lab3_usd.isaac.behaviour import TargetOf
from lab3_usd.isaac.node_types import INPUT, KIND
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.isaac.topics import product_input
from lab3_usd.model.physics import (
    ARTICULATION_API,
    BODY_API,
    bodies_below,
    ends,
    is_body,
    is_joint,
    joints_at,
)
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, absence_reason, once_per_stage

_FLAT = "laser_scan"
_SENSORS = ("Camera", "OmniLidar", "OmniRadar")


class Stuck(Struct, frozen=True, eq=False):
    """A node that does nothing and passes no signal on, and why.

    `sure` is False where only a missing asset, or the stage that uses this one, could tell.
    """

    node: Node
    why: str
    sure: bool = True


@once_per_stage
def stuck_nodes(stage: StageModel) -> dict[str, Stuck]:
    """Return the nodes that do nothing although they may run, by path."""
    by_path: dict[str, Stuck] = {}
    for one in (
        *_without_body(stage),
        *_without_prim(stage),
        *_without_context(stage),
        *_without_camera(stage),
        *(
            Stuck(lost.node, f"{lost.port} is {lost.path}, which shows no camera", lost.sure)
            for lost in lost_products(stage)
        ),
        *_without_scan(stage),
    ):
        by_path.setdefault(one.node.path, one)
    return by_path


@once_per_stage
def working_states(stage: StageModel) -> dict[str, State]:
    """Return how surely each node does its work while the timeline plays, by path.

    As `run_states`, except for nodes that are stuck and those that wait for their signals.
    """
    stuck, states = stuck_nodes(stage), run_states(stage)
    if not stuck:
        return states
    surely = {path for path, one in stuck.items() if one.sure}
    at_most = states_without(stage, stuck=surely) if surely else states
    at_least = states_without(stage, stuck=stuck)
    return {
        path: "runs" if at_least.get(path) == "runs" and path not in stuck else "may run"
        for path in at_most
        if path not in surely
    }


@once_per_stage
def working_nodes(stage: StageModel) -> LiveNodes:
    """Return the nodes that do their work, or may, by path."""
    states = working_states(stage)
    if states == run_states(stage):
        return running_nodes(stage)
    live = live_nodes(stage)
    return LiveNodes((live[path] for path in states), live.variables)


def obstacle(node: Node, stage: StageModel) -> Stuck | None:
    """Return the stuck node for which a node does nothing: itself, or one that it waits for."""
    stuck, live = stuck_nodes(stage), live_nodes(stage)
    ahead = {node.path: node}
    for path in (waiting := [node.path]):
        if path in stuck:
            return stuck[path]
        before = [*signal_sources(ahead[path], live), *read_products(ahead[path], live)]
        waiting += [each.path for each in before if each.path not in ahead]
        ahead.update((each.path, each) for each in before)
    return None


def read_products(node: Node, live: Nodes) -> Iterator[Node]:
    """Yield the nodes whose render product another one reads."""
    for port in node.ports:
        for source, _ in live_sources(node, port, live):
            if source.type is not None and source.type.product is not None:
                yield source


def is_module(stage: StageModel) -> bool:
    """Whether a stage holds graphs and neither robot nor sensor, for others to refer to."""
    if stage.unresolved:
        return False
    bodies = (*stage.with_api(ARTICULATION_API), *stage.with_api(BODY_API))
    sensors = (prim for kind in _SENSORS for prim in stage.of_type(kind))
    return not bodies and all(prim.path in stage.platform.application_prims for prim in sensors)


def is_placeholder(path: str, stage: StageModel) -> bool:
    """Whether a target stands for the prim that uses a graph, or for the graph where none does."""
    return path.rpartition("/")[2] == stage.platform.graph.evaluation.placeholder


def is_made_later(path: str, stage: StageModel) -> bool:
    """Whether the application makes a prim, or it is a node, or what a graph is used for."""
    if is_placeholder(path, stage):
        return any(top in referenced_graphs(stage) for top in upwards(path))
    live = live_nodes(stage)
    made = path in stage.platform.application_prims or stage.platform.graph.ignores(path)
    # The bundle that a node gives is a prim below it.
    return made or path in live or path.rpartition("/")[0] in live


def _without_target(node: Node, port: str, stage: StageModel) -> Iterator[Stuck]:
    """Yield that the only prim which an input names is not there, or that it names none."""
    path = next(iter(node.targets(port)), "")
    if not path:
        yield Stuck(node, f"{port} names no prim")
    elif stage.prim(path) is None and not is_made_later(path, stage):
        is_open = stage.unknown(path) is not None or is_module(stage)
        why = f"{port} names {path}, which {absence_reason(stage, path)}"
        yield Stuck(node, why, sure=not is_open)


def _without_body(stage: StageModel) -> Iterator[Stuck]:
    for node, asked in nodes_in(stage.platform.bodies, stage):
        yield from _without_target(node, INPUT + asked.prim, stage)
    for followed in followed_bodies(stage):
        if not followed.is_body or (
            followed.body is not None and _is_hollow(followed.body.path, stage)
        ):
            why = f"{followed.port} is {followed.prim.path}, which gives no body to follow"
            yield Stuck(followed.node, why, sure=followed.unknown is None)


def _without_prim(stage: StageModel) -> Iterator[Stuck]:
    live = live_nodes(stage)
    for node, asked in nodes_in(stage.platform.targets, stage):
        port = INPUT + asked.input
        lacking = [
            need for need in unmet_needs(node, stage.platform, live) if asked.input in need.inputs
        ]
        if lacking:
            yield Stuck(node, f"{port} names no prim")
        elif switched_off_target(node, stage):
            yield Stuck(node, f"{port} is {node.targets(port)[0]}, which is disabled")
        elif node.targets(port) and not _has_other(node, asked, stage.platform, live):
            yield from _without_target(node, port, stage)
            unread = refused_target(node, stage)
            path = node.targets(port)[0]
            if unread is not None or ((asked.holds or asked.part_of) and _is_hollow(path, stage)):
                is_open = unread is not None and unread.unknown is not None
                yield Stuck(node, f"{port} is {path}, which is not {asked.what}", not is_open)


def _is_hollow(path: str, stage: StageModel) -> bool:
    """Whether an articulation begins at or below a prim, and has neither body nor joint."""
    roots = articulations(path, stage)
    has_body = any(bodies_below(stage, root) for root in roots)
    return bool(roots) and not has_body and all(is_empty(root, stage) for root in roots)


def _has_other(node: Node, asked: TargetOf, platform: Platform, live: Nodes) -> bool:
    """Whether a node is given something that it works with instead of its prim."""
    needs = platform.needs.get(node.type.type, ()) if node.type is not None else ()
    inputs = (name for need in needs if asked.input in need.inputs for name in need.inputs)
    return any(is_given(node, name, live) for name in inputs if name != asked.input)


class RefusedTarget(Struct, frozen=True, eq=False):
    """A prim that a node cannot read; `unknown` is a missing asset that could make it so."""

    asked: TargetOf
    prim: Prim
    unknown: UnresolvedAsset | None


def refused_target(node: Node, stage: StageModel) -> RefusedTarget | None:
    """Return the prim that a node is to read and cannot, None where there is none."""
    asked = None if node.type is None else stage.platform.targets.get(node.type.type)
    if asked is None or not is_release_within(stage.platform.release, asked.since, ""):
        return None
    prim = stage.prim(next(iter(node.targets(INPUT + asked.input)), ""))
    if prim is None or _is_readable(prim, asked, stage):
        return None
    unknown = stage.unknown_below(prim.path) if asked.holds else stage.unknown(prim.path)
    if unknown is None and asked.part_of:
        unknown = stage.unknown(*_around(prim, stage))
    return RefusedTarget(asked, prim, unknown)


def _is_readable(prim: Prim, asked: TargetOf, stage: StageModel) -> bool:
    above = [carrier for path in upwards(prim.parent) if (carrier := stage.prim(path))]
    is_held = any(asked.holds in held.apis for held in stage.below(prim.path) if held.present)
    is_inside = any(asked.inside in carrier.apis for carrier in above)
    return (
        (not asked.types or prim.type in asked.types)
        and (not asked.schemas or bool(set(asked.schemas) & set(prim.apis)))
        and (not asked.inside or is_inside)
        and (not asked.holds or is_held or is_body(prim) or is_joint(prim))
        and (not asked.part_of or asked.part_of in prim.apis or _is_part(prim, stage))
    )


def _is_part(prim: Prim, stage: StageModel) -> bool:
    """Whether a prim is a link or joint of an articulation, wherever its root stands.

    Physics finds an articulation by them too (PhysX, BaseSimulationView.cpp), and not by a prim
    above its root.
    """
    own = _around(prim, stage)
    return any(
        path in own
        for root in articulations("/", stage)
        for path in (root, *bodies_below(stage, root))
    )


def _around(prim: Prim, stage: StageModel) -> frozenset[str]:
    """Return a body or joint, and what joints tie to it."""
    ahead = [prim.path] if is_body(prim) else list(ends(prim)) if is_joint(prim) else []
    paths = {*ahead}
    while ahead:
        tied = joints_at([ahead.pop()], stage)
        new = {path for joint in tied for path in (joint.path, *ends(joint))} - paths
        paths |= new
        ahead += new
    return frozenset(paths)


def switched_off_target(node: Node, stage: StageModel) -> str:
    """Return the path of the prim that a node is to read and that is switched off, '' for none."""
    asked = None if node.type is None else stage.platform.targets.get(node.type.type)
    path = "" if asked is None else next(iter(node.targets(INPUT + asked.input)), "")
    prim = stage.prim(path) if path else None
    is_off = asked and asked.switch and prim and prim.attributes.get(asked.switch) is False
    return path if is_off else ""


def _without_context(stage: StageModel) -> Iterator[Stuck]:
    for node, port, handle in invalid_contexts(stage):
        yield Stuck(node, f"{port} is {handle}, not a handle from a ROS2 Context")
    live = live_nodes(stage)
    is_over = any((domain.number or 0) > LAST_DOMAIN for domain in domains(stage))
    for entry in context_inputs(stage) if is_over else ():
        domain = domain_of(entry.node, live, stage.platform)
        if (domain.number or 0) > LAST_DOMAIN:
            why = f"ROS 2 has no domain {domain.number}"
            yield Stuck(entry.node, why, sure=not domain.from_environment)


def _without_camera(stage: StageModel) -> Iterator[Stuck]:
    """Yield the nodes that make no render product: OgnIsaacCreateRenderProduct.py:77-160."""
    live = live_nodes(stage)
    for node, ports in nodes_with(lambda kind: kind.product, stage):
        yield from _without_target(node, ports.camera, stage)
        named = next(iter(node.targets(ports.named)), "")
        product = stage.products.get(named)
        if product is not None:
            is_there = (
                stage.prim(product.camera) or product.camera in stage.platform.application_prims
            )
            if not is_there:
                is_open = stage.unknown(named, product.camera or named) is not None
                yield Stuck(node, f"{ports.named} is {named}, which shows no camera", not is_open)
            continue
        for size in ports.size:
            if effective_value(node, size, live) == 0:
                yield Stuck(node, f"{size} is 0")


class LostProduct(Struct, frozen=True, eq=False):
    """A render product that a node names by its path, and that is not there or shows no camera.

    `sure` is False where the application or a missing asset may make it.
    """

    node: Node
    port: str
    path: str
    sure: bool


def lost_products(stage: StageModel) -> Iterator[LostProduct]:
    """Yield the render products whose path is written, and which give nothing to publish.

    Source: OgnROS2CameraHelper.py:258-264.
    """
    for node, _ in nodes_in(stage.platform.sensors, stage):
        port = "" if node.type is None else product_input(node.type.topics[0])
        path = None if node.sources(port) else node.value(port)
        product = stage.products.get(str(path))
        if not isinstance(path, str) or not path or (product is not None and product.camera):
            continue
        is_made = product is None and stage.platform.graph.ignores(path)
        is_open = is_made or stage.unknown(path) is not None
        yield LostProduct(node, port, path, not is_open)


def _without_scan(stage: StageModel) -> Iterator[Stuck]:
    """Yield the nodes that refuse the sensor of their render product."""
    live = live_nodes(stage)
    for node, asked in nodes_in(stage.platform.sensors, stage):
        if node.type is None or not asked.needs:
            continue
        shown = shown_by(node, product_input(node.type.topics[0]), stage, live)
        prim = None if shown is None else stage.prim(shown.sensor)
        if prim is None:
            continue
        is_open = stage.unknown(prim.path) is not None
        if not {prim.type, *prim.apis} & {*asked.types, *asked.schemas_in(stage.platform.release)}:
            yield Stuck(node, f"{prim.path} is no {' or '.join(asked.types)}", not is_open)
        elif prim.type in asked.types and asked.needs not in prim.apis:
            yield Stuck(node, f"{prim.path} has no {asked.needs}", not is_open)
        else:
            is_scan = effective_value(node, KIND, live) == _FLAT
            for fault in faults_of(prim, stage):
                if fault.stops(is_scan=is_scan):
                    yield Stuck(node, f"{fault.message}, at {prim.path}", not fault.is_open)
