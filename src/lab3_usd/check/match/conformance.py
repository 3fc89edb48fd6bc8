"""Whether what a spec asks of a node or a connection is met: the single place that decides it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import GraphSubject, WireFault
from lab3_usd.facts.endpoints import used_topics
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.topics import resolved_topic
from lab3_usd.isaac.values import Value, are_alike
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import (
    GraphModel,
    Node,
    RenderProduct,
    listed_once,
    once_per_stage,
    same_value,
)
from lab3_usd.spec.graph import NodeSpec, Setting, Target, Variable, Wire


def setting_matches(node: Node, setting: Setting, value: Value | None) -> bool:
    """Whether `value` at the setting's port is what the handout asks for.

    Topics are compared as ROS 2 resolves them.
    """
    if value is None:
        return False
    if node.type is not None and setting.port in node.type.topics:
        return resolved_topic(str(value)) == resolved_topic(str(setting.value))
    return same_value(value, setting.value)


def is_variable_met(graph: GraphModel, variable: Variable) -> bool:
    """Whether a graph has a variable with the type and the value asked for."""
    state = graph.variables.get(variable.name)
    return (
        state is not None
        and are_alike(state.usd_type, variable.usd_type)
        and same_value(state.value, variable.value)
    )


class Found(Struct, frozen=True):
    """A setting of the spec, the node it is asked of, its value there, and whether it is met."""

    node: Node
    spec: NodeSpec
    setting: Setting
    value: Value | None
    met: bool


@listed_once
def settings_of(subject: GraphSubject) -> Iterator[Found]:
    """Yield every setting of every matched node."""
    namespace = INPUT + subject.lab.platform.ros.namespace
    for node, spec in subject.matched:
        names = {namespace, *spec.type.topics}
        is_same_topic = resolves_as_asked(node, spec, subject)
        for setting in spec.settings:
            value = effective_value(node, setting.port, subject.live_nodes)
            met = (is_same_topic and setting.port in names) or setting_matches(node, setting, value)
            yield Found(node, spec, setting, value, met)


@once_per_stage
def rightly_fed(subject: GraphSubject) -> frozenset[tuple[str, str]]:
    """Return the inputs to which the lab leads no wire, and one brings the value they should have.

    They have it as well as if it were typed there: by a constant, a variable or what these give.
    """
    asked = {(judged.node.path, judged.setting.port): judged.met for judged in settings_of(subject)}
    unasked = (fault for fault in subject.wire_faults if fault.kind == "unasked")
    right = []
    for node, port in ((fault.node, fault.port) for fault in unasked):
        value = effective_value(node, port, subject.live_nodes)
        default = None if node.type is None else node.type.default(port, None)
        if value is not None and asked.get((node.path, port), value == default):
            right.append((node.path, port))
    return frozenset(right)


@once_per_stage
def right_once_renamed(subject: GraphSubject) -> tuple[WireFault, ...]:
    """Return the dead wires that lead to nodes of a graph by the path that it should have."""
    graph, path = subject.roles.graph, subject.spec.path
    if graph is None or graph.path == path:
        return ()
    dead = (fault for fault in subject.wire_faults if fault.kind == "dead" and fault.actual)
    return tuple(
        fault
        for fault in dead
        if is_at_or_below(prim := str(fault.actual).rpartition(".")[0], path)
        and f"{graph.path}{prim.removeprefix(path)}" in subject.live_nodes
    )


@once_per_stage
def right_sources(subject: GraphSubject) -> frozenset[str]:
    """Return the extra nodes of which nothing is used but the values of inputs `rightly_fed`."""
    uses: dict[str, set[tuple[str, str]]] = {}
    for graph in subject.graphs():
        for node in graph.nodes:
            for port, state in node.ports.items():
                for source in state.sources:
                    uses.setdefault(source.rpartition(".")[0], set()).add((node.path, port))
    paths: set[str] = set()
    waiting = [node.path for node in subject.roles.extra if node.path in uses]
    while True:
        more = {
            path
            for path in waiting
            if all(end in rightly_fed(subject) or end[0] in paths for end in uses[path])
        }
        if more <= paths:
            return frozenset(paths)
        paths |= more


def resolves_as_asked(node: Node, spec: NodeSpec, subject: GraphSubject) -> bool:
    """Whether namespace and names of a node make the topics that those of its role make."""
    port, live = INPUT + subject.lab.platform.ros.namespace, subject.live_nodes
    asked = {setting.port: setting.value for setting in spec.settings}
    own, wanted = effective_value(node, port, live), asked.get(port) or ""
    # A namespace of its own counts alone, none lets those of the prims above count.
    if own is None or (wanted and not own and node.namespaces) or not spec.type.topics:
        return False
    return all(
        resolved_topic(str(effective_value(node, topic, live) or ""), str(own))
        == resolved_topic(str(asked.get(topic, spec.type.default(topic, None))), str(wanted))
        for topic in used_topics(node, spec.type, live)
    )


def target_matches(node: Node, target: Target) -> bool:
    """Whether the relationship names exactly the prims asked for, in any order.

    The prims of the handout are as good, even where they do not work.
    """
    return targets_prims(node, target, target.prims) or targets_handout_prims(node, target)


def targets_handout_prims(node: Node, target: Target) -> bool:
    """Whether the relationship names what the handout asks for and what does not work here."""
    return bool(target.handout_prims) and targets_prims(node, target, target.handout_prims)


def targets_prims(node: Node, target: Target, prims: Sequence[str]) -> bool:
    """Whether the relationship names exactly these prims, in any order, beside optional ones."""
    return set(node.targets(target.port)).difference(target.optional) == set(prims)


def wrong_product(
    node: Node, spec: NodeSpec, products: Mapping[str, RenderProduct]
) -> tuple[str, RenderProduct, tuple[str, ...]] | None:
    """Return the input by which a node uses a render product that is not the lab's, and that one.

    The ports that do not count then, and should, are the third. Of several products that are named
    Isaac Sim takes none (OgnIsaacCreateRenderProduct.py:116-123).
    """
    ports = None if node.type is None else node.type.product
    if ports is None or len(node.targets(ports.named)) != 1:
        return None
    product = products.get(node.targets(ports.named)[0])
    if product is None:
        return None  # one that is not in the file is made anew
    cameras = [target.prims for target in spec.targets if target.port == ports.camera]
    sizes = {setting.port: setting.value for setting in spec.settings}
    wrong = [ports.camera] if cameras and cameras[0] != (product.camera,) else []
    for index, port in enumerate(ports.size):
        if port in sizes and product.size[index : index + 1] != (sizes[port],):
            wrong.append(port)
    return (ports.named, product, tuple(wrong)) if wrong else None


def source_path(source: Node, wire: Wire) -> str:
    """Return the property path from which `wire` leaves when `source` plays its source role."""
    return f"{source.path}.{wire.source.port}"


def source_paths(source: Node, wire: Wire, equivalents: Mapping[str, str]) -> list[str]:
    """Return the property paths that may feed `wire`: that of its source, and of its stand-ins.

    `equivalents` maps the path of each stand-in to the role it stands in for.
    """
    stand_ins = [path for path, role in equivalents.items() if role == wire.source.role]
    return [source_path(source, wire), *(f"{path}.{wire.source.port}" for path in stand_ins)]


def is_fed(source: Node, target: Node, wire: Wire, equivalents: Mapping[str, str]) -> bool:
    """Whether `wire` enters `target` from its source or from a stand-in of that."""
    sources = target.sources(wire.target.port)
    return source_path(source, wire) in sources or any(
        path in sources for path in source_paths(source, wire, equivalents)
    )
