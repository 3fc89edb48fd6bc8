"""Hand-made stages as plain data: the lab's graphs as the specs write them, and what breaks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from lab3_usd.check.fold import fold
from lab3_usd.check.match.rule_inputs import Roles, StageSubject
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import finding_of
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Finding, Problem
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import GraphModel, Node, PortState, StageModel
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

ROBOT = "/turtlebot3_burger"
BASE = f"{ROBOT}/base_footprint"
CAMERA = f"{BASE}/Camera_1"
LINKS = (
    "base_footprint",
    "base_link",
    "base_scan",
    "caster_back_link",
    "wheel_left_link",
    "wheel_right_link",
)
JOINTS = {
    "base_joint": ("base_footprint", "base_link"),
    "scan_joint": ("base_link", "base_scan"),
    "caster_back_joint": ("base_link", "caster_back_link"),
    "wheel_left_joint": ("base_link", "wheel_left_link"),
    "wheel_right_joint": ("base_link", "wheel_right_link"),
}
ODOM_TF = "ROS_OdomTF"
COMPUTE = "isaac_compute_transform_tree"
PUBLISH = "ros2_publish_transform_tree"
PUBLISHER_TYPE = "isaacsim.ros2.bridge.ROS2Publisher"
IMU_TYPE = "isaacsim.ros2.bridge.ROS2PublishImu"
RAW = "ros2_publish_raw_transform_tree"


def lab() -> Lab:
    return load_lab()


def node(path: str, type_name: str, /, **inputs: Value) -> Node:
    """A node with values at its inputs."""
    name = lab().platform.type_name(type_name)
    made = Node(path, name, lab().platform.types.get(name), 1, {})
    made = made if name == type_name else replace(made, written_type=type_name)
    for name, value in inputs.items():
        made = valued(made, f"inputs:{name}", value)
    return made


def state(given: Node, port: str) -> PortState:
    """The port as it is, or as the catalog declares it where it was left alone."""
    known = None if given.type is None else given.type.port(port)
    return given.ports.get(port, PortState(port, "" if known is None else known.usd_type))


def wired(given: Node, port: str, *sources: str) -> Node:
    """The node with an input fed from these property paths, and from nothing else."""
    changed = replace(state(given, port), sources=sources)
    return replace(given, ports={**given.ports, port: changed})


def rewired(given: Node, old: str, new: str) -> Node:
    """The node with its wires from outputs of one name taken from those of another."""
    ports = {
        name: replace(state, sources=tuple(path.replace(old, new) for path in state.sources))
        for name, state in given.ports.items()
    }
    return replace(given, ports=ports)


def valued(given: Node, port: str, value: Value | None) -> Node:
    """The node with a value at an input."""
    changed = replace(state(given, port), value=value)
    return replace(given, ports={**given.ports, port: changed})


def aimed(given: Node, port: str, *targets: str) -> Node:
    """The node with a relationship to these prims, and to nothing else."""
    return replace(given, ports={**given.ports, port: PortState(port, "rel", targets=targets)})


def graph(path: str, *nodes: Node, active: bool = True, **attributes: Value) -> GraphModel:
    """A graph as it is saved, holding these nodes."""
    form = {a.name: a.value for a in lab().platform.graph.attributes}
    named = {name.replace("__", ":"): value for name, value in attributes.items()}
    return GraphModel(path, active, {**form, **named}, nodes)


def graph_of(spec: GraphSpec, path: str | None = None) -> GraphModel:
    """The graph as the spec asks for it, at its path or another."""
    place = path or spec.path
    nodes = {}
    for role, wanted in spec.nodes.items():
        made = node(f"{place}/{role}", wanted.type.type)
        for setting in wanted.settings:
            made = valued(made, setting.port, setting.value)
        for target in wanted.targets:
            made = aimed(made, target.port, *target.prims)
        nodes[role] = made
    for wire in spec.wires:
        source = f"{place}/{wire.source.role}.{wire.source.port}"
        nodes[wire.target.role] = wired(nodes[wire.target.role], wire.target.port, source)
    return graph(place, *nodes.values())


def robot() -> dict[str, Prim]:
    """The prims of a flat TurtleBot3 whose root carries the robot API, with its sensors."""
    links = tuple(f"{ROBOT}/{name}" for name in LINKS)
    joints = tuple(f"{ROBOT}/joints/{name}" for name in JOINTS)
    prims = [
        Prim(
            ROBOT,
            "Xform",
            ("IsaacRobotAPI",),
            relationships={"isaac:physics:robotLinks": links, "isaac:physics:robotJoints": joints},
        ),
        *(Prim(path, "Xform", ("PhysicsRigidBodyAPI", "IsaacLinkAPI")) for path in links),
        *(
            Prim(
                path,
                "PhysicsFixedJoint",
                (),
                relationships={
                    "physics:body0": (f"{ROBOT}/{parent}",),
                    "physics:body1": (f"{ROBOT}/{child}",),
                },
            )
            for path, (parent, child) in zip(joints, JOINTS.values(), strict=True)
        ),
        Prim(CAMERA, "Camera", ()),
        Prim(f"{ROBOT}/base_scan/Lidar2D", "OmniLidar", ("OmniSensorGenericLidarCoreAPI",)),
        Prim("/World", "Xform", ()),
    ]
    prims[1] = replace(prims[1], apis=(*prims[1].apis, "PhysicsArticulationRootAPI"))
    return {prim.path: prim for prim in prims}


def stage(*extra: GraphModel, prims: Mapping[str, Prim] | None = None) -> StageModel:
    """A complete stage with further graphs."""
    graphs = tuple(graph_of(spec) for spec in lab().graphs.values())
    return StageModel(lab().platform, "Z", 1.0, 1.0, (*graphs, *extra), prims or robot())


def only(*graphs: GraphModel, prims: Mapping[str, Prim] | None = None) -> StageModel:
    """A stage with the robot and these graphs only."""
    return StageModel(lab().platform, "Z", 1.0, 1.0, graphs, prims or robot())


def with_node(given: StageModel, changed: Node) -> StageModel:
    """The stage with one node in the place of its namesake, or added to the graph above it."""
    graphs = []
    for each in given.graphs:
        if changed.path.rpartition("/")[0] != each.path:
            graphs.append(each)
            continue
        nodes = {n.path: n for n in each.nodes} | {changed.path: changed}
        graphs.append(replace(each, nodes=tuple(nodes[path] for path in sorted(nodes))))
    return replace(given, graphs=tuple(graphs))


def without_node(given: StageModel, path: str) -> StageModel:
    """The stage without one node."""
    graphs = (replace(g, nodes=tuple(n for n in g.nodes if n.path != path)) for g in given.graphs)
    return replace(given, graphs=tuple(graphs))


def with_prim(given: StageModel, path: str, **changes: object) -> StageModel:
    """The stage with one prim changed."""
    changed = replace(given.prims[path], **changes)  # type: ignore[arg-type]  # fields of Prim
    return replace(given, prims={**given.prims, path: changed})


def without_prim(given: StageModel, path: str) -> StageModel:
    """The stage without one prim."""
    return replace(given, prims={p: prim for p, prim in given.prims.items() if p != path})


def role(given: StageModel, name: str, graph_name: str = ODOM_TF) -> Node:
    """The node that plays a role in a stage made by this module."""
    place = lab().graphs[graph_name].path
    return next(n for g in given.graphs for n in g.nodes if n.path == f"{place}/{name}")


def left_beside(
    blamed: Iterable[str], found: Mapping[str, Iterable[Problem]]
) -> list[tuple[str, str, str | None]]:
    """Rule, prim and property of the problems that are left where the blamed nodes are wrong.

    `node.inputs:port` blames a port, a node alone its type.
    """
    sites = (place.partition(".") for place in blamed)
    errors = [Finding("", "", "error", prim, "", port or "node:type") for prim, _, port in sites]
    findings = [
        finding_of(all_rules()[rule_id], problem, None)
        for rule_id, problems in found.items()
        for problem in problems
    ]
    return [
        (left.rule, left.prim, left.property) for left in fold([*errors, *findings]) if left.rule
    ]


def subject(given: StageModel, checkpoint: str = "05") -> StageSubject:
    """The stage at one checkpoint, its nodes matched to the roles they are named by."""
    found = lab()
    asked = found.checkpoints[checkpoint].graphs
    roles = {name: _roles(given, found.graphs[name]) for name in asked}
    return StageSubject(found, found.checkpoints[checkpoint], given, roles)


def _roles(given: StageModel, spec: GraphSpec) -> Roles:
    home = next((g for g in given.graphs if g.path == spec.path), None)
    nodes = {} if home is None else {n.name: n for n in home.nodes}
    node_of = {name: nodes.get(name) for name in spec.nodes}
    role_of = {n.path: name for name, n in node_of.items() if n is not None}
    extra = tuple(n for n in nodes.values() if n.path not in role_of)
    return Roles(home, node_of, role_of, extra=extra)
