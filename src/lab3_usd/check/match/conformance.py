"""Whether what a spec asks of a node or a connection is met: the single place that decides it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import GraphSubject, Roles
from lab3_usd.isaac.node_types import INPUT, can_connect
from lab3_usd.isaac.topics import resolved_topic
from lab3_usd.isaac.values import Value
from lab3_usd.model.stage import Node, RenderProduct, once_per_stage, same_value
from lab3_usd.spec.graph import NodeSpec, Setting, Target, Wire


def setting_value(nodes: Mapping[str, Node], node: Node, port: str, depth: int = 8) -> Value | None:
    """Return the effective value of an input, followed through wires from other inputs.

    `nodes` holds the live nodes of the stage by path. None where what comes over a wire is known
    at run time only. `depth` ends the search where inputs feed each other in a ring.
    """
    for source in node.sources(port):
        path, _, source_port = source.rpartition(".")
        feeding = nodes.get(path)
        if feeding is not None and _is_kept(feeding, source_port, node, port):
            # An input that a wire leaves from, as every constant's, brings what reaches it.
            if not source_port.startswith(INPUT) or not depth:
                return None
            return setting_value(nodes, feeding, source_port, depth - 1)
    return node.value(port)


def _is_kept(feeding: Node, source_port: str, node: Node, port: str) -> bool:
    """Whether the application keeps this wire; one between types that do not fit it drops."""
    if not feeding.has_port(source_port):
        return False
    source = None if feeding.type is None else feeding.type.port(source_port)
    target = None if node.type is None else node.type.port(port)
    if source is None or target is None:
        return True
    is_source = source.is_source or source_port.startswith(INPUT)
    return is_source and can_connect(source, target)


def setting_matches(node: Node, setting: Setting, value: Value | None) -> bool:
    """Whether `value` at the setting's port is what the handout asks for.

    Topics are compared as ROS 2 resolves them.
    """
    if value is None:
        return False
    if node.type is not None and setting.port in node.type.topics:
        return resolved_topic(str(value)) == resolved_topic(str(setting.value))
    return same_value(value, setting.value)


class Found(Struct, frozen=True):
    """A setting of the spec, the node it is asked of, its value there, and whether it is met."""

    node: Node
    spec: NodeSpec
    setting: Setting
    value: Value | None
    met: bool


@once_per_stage
def settings_of(subject: GraphSubject) -> tuple[Found, ...]:
    """Return every setting of every matched node."""
    values = (
        (node, spec, setting, setting_value(subject.live_nodes, node, setting.port))
        for node, spec in subject.matched
        for setting in spec.settings
    )
    return tuple(
        Found(node, spec, setting, value, setting_matches(node, setting, value))
        for node, spec, setting, value in values
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
    """Whether the relationship names exactly these prims, in any order."""
    return sorted(set(node.targets(target.port))) == sorted(set(prims))


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
    if source_path(source, wire) in sources:
        return True
    return any(path in sources for path in source_paths(source, wire, equivalents))


def is_live(live: Mapping[str, Node], source: str) -> bool:
    """Whether a connection's source is a port that exists on a live node.

    A wire from another node's input brings the value there, but no signal.
    """
    path, _, port = source.rpartition(".")
    node = live.get(path)
    if node is None or not node.has_port(port):
        return False
    known = None if node.type is None else node.type.port(port)
    if known is None or known.is_source:
        return True
    return port.startswith(INPUT) and not known.is_execution and not known.is_target


def types_fit(live: Mapping[str, Node], node: Node, port: str, source: str) -> bool:
    """Whether what comes from a live source can go into this input."""
    path, _, source_port = source.rpartition(".")
    feeding = live[path]
    output = None if feeding.type is None else feeding.type.port(source_port)
    target = None if node.type is None else node.type.port(port)
    return output is None or target is None or can_connect(output, target)


def closes_cycle(roles: Roles, node: Node, port: str, source: str) -> bool:
    """Whether an execution wire lets a node trigger itself."""
    known = None if node.type is None else node.type.port(port)
    if known is None or not known.is_execution:
        return False
    goal = source.rpartition(".")[0]
    nodes = () if roles.graph is None else roles.graph.nodes
    reached, frontier = {node.path}, [node.path]
    while frontier:
        current = frontier.pop()
        if current == goal:
            return True
        for follower in nodes:
            if follower.path not in reached and _is_triggered_by(follower, current):
                reached.add(follower.path)
                frontier.append(follower.path)
    return False


def _is_triggered_by(node: Node, path: str) -> bool:
    if node.type is None:
        return False
    return any(
        source.rpartition(".")[0] == path
        for port in node.type.ports.values()
        if port.is_execution and not port.is_source
        for source in node.sources(port.name)
    )
