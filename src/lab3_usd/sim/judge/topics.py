"""The topics, frames and rates that the lab asks for, their stamps, and one TF tree."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from msgspec.structs import replace

from lab3_usd.facts.tree import SentTransform, Tree
from lab3_usd.facts.tree import tree_of as build_tree
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.topics import STATIC
from lab3_usd.model.fault import FaultKind
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.expectations import Expected, RunFault, Trial, caused
from lab3_usd.spec.contradictions.names import graph_topics, spec_value
from lab3_usd.spec.graph import GraphSpec, NodeSpec
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.ros import FROM_THE_FIRST, TopicSpec
from lab3_usd.spec.scene import RobotSpec, SensorSpec

# The parts that topics play, by the type of their messages.
_PARTS = {
    "clock": "rosgraph_msgs/msg/Clock",
    "odometry": "nav_msgs/msg/Odometry",
    "transforms": "tf2_msgs/msg/TFMessage",
    "scan": "sensor_msgs/msg/LaserScan",
    "image": "sensor_msgs/msg/Image",
    "info": "sensor_msgs/msg/CameraInfo",
}
_COMMANDS = ("geometry_msgs/msg/Twist", "ackermann_msgs/msg/AckermannDriveStamped")
_JOINTS = "sensor_msgs/msg/JointState"
_MAP = "nav_msgs/msg/OccupancyGrid"
_KEPT = "transient_local"
_LIMITS = ("maxLinearSpeed", "maxAngularSpeed")
_RADIUS, _DISTANCE, _RIM = "wheelRadius", "wheelDistance", "maxWheelSpeed"
_LENGTHS = (_LIMITS[0], _RADIUS, _DISTANCE)
_PARENT, _CHILD = "header.frame_id", "child_frame_id"


def expected_at(lab: Lab, checkpoint: Checkpoint, robot: RobotSpec | None = None) -> Expected:
    """Return what a ROS node should see of a stage of this checkpoint.

    With a robot of the lab, the topics of others are left out. All robots together have the root
    that the lab localizes.
    """
    lab = lab.at(checkpoint.id)
    foreign = _topics_of_others(lab, robot) if robot is not None else set()
    required = [
        topic
        for topic in lab.topics_until(checkpoint.id).values()
        if (topic.subscribed or topic.source is None)
        and (not topic.optional or (checkpoint.optional and topic.since == checkpoint.id))
        and topic.name not in foreign
    ]
    names: dict[str, Any] = {part: _named(required, kind) for part, kind in _PARTS.items()}
    kept = static_topics(lab)
    moving = [topic for topic in required if topic.name not in kept]
    names["transforms"] = _named(moving, _PARTS["transforms"]) or names["transforms"]
    root, base = _frames_of_odometry(lab, robot)
    tree = lab.frames.on(names["transforms"])
    lidar = _sensor_behind(lab, names["scan"], "lidar", robot)
    camera = _sensor_behind(lab, names["image"], "camera", robot)
    driven = robot or lab.scene.robot
    view, lidar_names = camera.view if camera else None, lab.platform.sensor_models.lidar
    return Expected(
        types={topic.name: topic.type for topic in required if not topic.subscribed},
        domain=lab.ros.system.domain,
        commands=next(filter(None, (_named(required, kind) for kind in _COMMANDS)), ""),
        joint_commands=_named([topic for topic in required if topic.subscribed], _JOINTS),
        **names,
        root=(root if robot is not None or not lab.scene.robots[1:] else "") or tree.root,
        base=base or lab.frame_of(driven.base),
        scan_rate=_rate(lidar, lidar_names.rate),
        image_rate=_rate(camera, lidar_names.rate),
        limits=_limits(lab, robot),
        view=view.along if view else (0.0, 0.0, 0.0),
        upward=view.up if view else (0.0, 0.0, 0.0),
        turn_rate=_rate(lidar, lidar_names.turns),
        frames=tuple(child for _, child in tree.edges) if checkpoint.frames else (),
        roots=tree.roots if len(lab.scene.robots) > 1 else (),
        is_car=_has_controller(lab, robot, "wheelBase"),
        has_rollers=_has_controller(lab, robot, "mecanumAngles"),
        wheel_radius=_drive_settings(lab, robot, _RADIUS)[0],
        centre=driven.wheels.centre,
        profile={name: attribute.value for name, attribute in lidar.attributes.items()}
        if lidar
        else {},
        static=kept if tree is lab.frames else kept & {names["transforms"] + STATIC},
        restarts=_restarts(lab),
        goes_with_environment=_goes_with_environment(lab),
        has_ground=lab.scene.world.ground is None,
    )


def expected_of_each(lab: Lab, checkpoint: Checkpoint) -> dict[str, Expected]:
    """Return what is to be seen of each robot that shows something, by name; '' for the only one.

    Of several robots the body that is watched is the base.
    """
    if len(lab.scene.robots) <= 1:
        return {"": replace(expected_at(lab, checkpoint), place=lab.scene.robot.path)}
    each = {
        robot.title: replace(expected_at(lab, checkpoint, robot), robot=robot.base)
        for robot in lab.scene.robots
    }
    shown = {
        name: wanted
        for name, wanted in each.items()
        if wanted.commands or wanted.joint_commands or wanted.odometry or wanted.scan
    }
    return shown or dict(list(each.items())[:1])


def _robots_of(lab: Lab, graph: GraphSpec, role: str) -> set[str]:
    """Return the paths of the robots to which a node belongs: those of prims up or down its wires.

    What it shares with the nodes of other robots, as a tick, names no prim.
    """
    after = {role}
    for _ in graph.nodes:
        after |= {wire.target.role for wire in graph.wires if wire.source.role in after}
    prims = graph.named_prims(graph.behind(role) | after)
    prims |= {path for name in after for path in _named_robots(graph, graph.nodes[name])}
    robots = map(lab.scene.robot_of, prims)
    return {robot.path for robot in robots if robot is not None}


def _named_robots(graph: GraphSpec, node: NodeSpec) -> Iterator[str]:
    """Yield the paths of robots that a node is given as text, by itself or over a wire."""
    drives = node.type.drives
    if drives is None:
        return
    sources = [wire.source.role for wire in graph.wires if wire.target.role == node.role]
    settings = [s for s in node.settings if s.port == drives.path]
    settings += [s for role in sources for s in graph.nodes[role].settings]
    yield from (str(s.value) for s in settings if str(s.value).startswith("/"))


def _is_of(robot: RobotSpec | None, lab: Lab, graph: GraphSpec, role: str) -> bool:
    """Whether a node belongs to a robot, or to none."""
    robots = _robots_of(lab, graph, role) if robot is not None else set()
    return robot is None or not robots or robot.path in robots


def _topics_of_others(lab: Lab, robot: RobotSpec) -> set[str]:
    own, foreign = set[str](), set[str]()
    for topic in graph_topics(lab):
        is_own = _is_of(robot, lab, lab.graphs[topic.graph], topic.role)
        (own if is_own else foreign).add(topic.name)
    return foreign - own


def _sensor_behind(lab: Lab, topic: str, kind: str, robot: RobotSpec | None) -> SensorSpec | None:
    """Return the sensor of a kind whose data comes on a topic, else the first of the kind."""
    sensors = [sensor for sensor in lab.sensors.values() if sensor.kind == kind]
    for graph_topic in graph_topics(lab):
        graph = lab.graphs[graph_topic.graph]
        if graph_topic.name == topic and graph_topic.role in graph.nodes:
            prims = graph.named_prims(graph.behind(graph_topic.role))
            sensor_there = next((sensor for sensor in sensors if sensor.path in prims), None)
            if sensor_there is not None:
                return sensor_there
    of_robot = (s for s in sensors if robot is None or lab.scene.robot_of(s.path) is robot)
    return next(of_robot, None)


def _frames_of_odometry(lab: Lab, robot: RobotSpec | None) -> tuple[str, str]:
    """Return the frames that odometry is to name, by its graph, else by `ros.yaml`; '' for none."""
    for graph, node in _publishers(lab, _PARTS["odometry"]):
        if _is_of(robot, lab, graph, node.role):
            root, base = (str(spec_value(node, port) or "") for port in node.type.frames)
            return root, base
    foreign = _topics_of_others(lab, robot) if robot is not None else set()
    topics = (topic for topic in lab.topics.values() if topic.type == _PARTS["odometry"])
    topics = (topic for topic in topics if topic.name not in foreign)
    fields = next((topic.fields for topic in topics if topic.fields), {})
    return fields.get(_PARENT, ""), fields.get(_CHILD, "")


def _restarts(lab: Lab) -> bool:
    """Whether the lab's clock begins anew after Stop, by what it asks of the node that reads it."""
    port = f"{INPUT}{lab.policy.stamp_reset.agree}"
    for graph, node in _publishers(lab, _PARTS["clock"]):
        sources = (graph.nodes[wire.source.role] for wire in graph.wires_into(node.role))
        return any(spec_value(source, port) is True for source in sources)
    return False


def _goes_with_environment(lab: Lab) -> bool:
    """Whether no context of the lab names a domain of its own: ROS_DOMAIN_ID then moves them all.

    So do nodes without a context (RN/nodes/OgnROS2Context.cpp:41-120, the default of the port).
    """
    nodes = (node for graph in lab.graphs.values() for node in graph.nodes.values())
    switch = f"{INPUT}{lab.platform.ros.domain_by_environment}"
    return all(spec_value(node, switch) is not False for node in nodes)


def _publishers(lab: Lab, message: str) -> Iterator[tuple[GraphSpec, NodeSpec]]:
    """Yield the nodes of the lab's graphs that publish messages of one type."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            if node.type.role == "publisher" and node.type.message.get("") == message:
                yield graph, node


def reached_topics(lab: Lab, checkpoint: str) -> tuple[TopicSpec, ...]:
    """Return all topics of the running system from the first checkpoint to one of them."""
    reached = (FROM_THE_FIRST, *lab.reached(checkpoint))
    return tuple(topic for topic in lab.topics.values() if topic.since in reached)


def static_topics(lab: Lab) -> frozenset[str]:
    """Return the topics of transforms that are kept for those who come late."""
    kept = (topic for topic in lab.topics.values() if topic.durability == _KEPT)
    return frozenset(topic.name for topic in kept if topic.type == _PARTS["transforms"])


def map_topic(lab: Lab, checkpoint: str) -> tuple[str, str]:
    """Return the topic of the map and its frame; empty where no map is asked for."""
    for topic in reached_topics(lab, checkpoint):
        if topic.type == _MAP:
            return topic.name, (topic.fields or {}).get(_PARENT, "")
    return "", ""


def _named(topics: list[TopicSpec], kind: str) -> str:
    return next((topic.name for topic in topics if topic.type == kind), "")


def _rate(sensor: SensorSpec | None, name: str) -> float:
    """Return the rate that is required of a sensor, 0 where none is."""
    rate = None if sensor is None else sensor.attributes.get(name)
    return 0.0 if rate is None or not rate.required else float(rate.value)


def _limits(lab: Lab, robot: RobotSpec | None) -> tuple[float, float]:
    """Return how fast the lab's controllers let a robot go and turn; 0 where they do not say."""
    ahead, turning, radius, distance, rim = _drive_settings(
        lab, robot, *_LIMITS, _RADIUS, _DISTANCE, _RIM
    )
    by_wheels = (rim * radius, 2 * rim * radius / distance if distance else 0.0)
    limits = (
        min(filter(None, both), default=0.0)
        for both in zip((ahead, turning), by_wheels, strict=True)
    )
    return (next(limits), next(limits))


def _drive_settings(lab: Lab, robot: RobotSpec | None, *names: str) -> tuple[float, ...]:
    """Return the values that the lab asks of controllers, by input; 0 where it asks for none.

    Lengths are metres: a conversion before a controller makes units of metres.
    """
    settings: dict[str, Any] = {}
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            for setting in node.settings if _is_of(robot, lab, graph, node.role) else ():
                name = setting.port.rpartition(":")[2]
                if name in names:
                    feeding = (graph.nodes[role] for role in graph.behind(node.role))
                    converts = any(source.type.same_in_metres for source in feeding)
                    is_converted = converts and name in _LENGTHS
                    unit = lab.scene.stage.meters_per_unit if is_converted else 1.0
                    settings[name] = setting.value, unit
    values = (settings.get(name, (0.0, 1.0)) for name in names)
    # A controller of wheels with rollers has a list of radii.
    numbers = ((value if isinstance(value, (int, float)) else 0.0, unit) for value, unit in values)
    return tuple(float(value) * unit for value, unit in numbers)


def _has_controller(lab: Lab, robot: RobotSpec | None, name: str) -> bool:
    """Whether the lab asks for a node of a robot whose type has this input."""
    return any(
        node.type.port(f"{INPUT}{name}") is not None and _is_of(robot, lab, graph, node.role)
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
    )


def topics(trial: Trial) -> Iterator[RunFault]:
    """Each topic is there, of its type, from one node, in each session, on the lab's domain."""
    wanted, recording = trial.wanted, trial.recording
    sessions = range(len(trial.drive))
    for topic, kind in wanted.types.items():
        silent = [session for session in sessions if not recording.topic(topic, session)]
        if silent:
            text = f"nothing on {topic}{trial.when(silent)}"
            cause = trial.causes.of_silence(topic, kind) if trial.causes is not None else None
            yield caused(text, "silent-topic", cause)
        messages = recording.topic(topic)
        odd = next((message for message in messages if message.type != kind), None)
        if odd is not None:
            yield RunFault(f"{topic} is {odd.type}, not {kind}", "wrong-message-type", odd.node)
        senders = list(dict.fromkeys(message.node for message in messages))
        if kind != _PARTS["transforms"] and len(senders) > 1:
            yield RunFault(
                f"{len(senders)} nodes publish {topic}", "duplicate-publisher", senders[1]
            )


def clock(trial: Trial) -> Iterator[RunFault]:
    """The clock runs at the speed of the simulation, and back only after Stop, if at all."""
    messages, haste = trial.recording.topic(trial.wanted.clock), trial.wanted.haste
    for earlier, later in pairwise(messages):
        starts_anew = trial.wanted.restarts and later.session != earlier.session
        if later.stamp < earlier.stamp and not starts_anew:
            back = earlier.stamp - later.stamp
            text = f"{trial.wanted.clock} jumps back by {back:.2f} s"
            yield RunFault(text, "clock-jumps-back", later.node)
            return
    first = [message for message in messages if not message.session]
    if first:
        ran, passed = first[-1].stamp - first[0].stamp, first[-1].at - first[0].at
        runs = passed / haste < ran < passed * haste
        if not runs and abs(ran - passed) > trial.tolerance.lag:
            text = f"{trial.wanted.clock} runs {ran:.1f} s in {passed:.1f} s"
            yield RunFault(text, "wrong-clock-rate", first[0].node)


def stamps(trial: Trial) -> Iterator[RunFault]:
    """All stamps are of the clock; those of the sensors may start anew after Stop."""
    wanted = trial.wanted
    for topic in wanted.types:
        late = topic in {wanted.odometry, wanted.transforms}
        for session in range(len(trial.drive) if late else 1):
            fault = next(_late(trial, topic, session), None)
            if fault is not None:
                yield fault
                break


def _late(trial: Trial, topic: str, session: int) -> Iterator[RunFault]:
    clocks = {
        round(tick.at * RATE): tick.stamp
        for tick in trial.recording.topic(trial.wanted.clock, session)
    }
    for message in trial.recording.topic(topic, session):
        now = clocks.get(round(message.at * RATE))
        if (
            now is not None
            and not message.static
            and abs(now - message.stamp) > trial.tolerance.lag
        ):
            when = trial.when([session])
            text = f"{topic} is stamped {message.stamp:.1f} s at {now:.1f} s{when}"
            yield RunFault(text, "wrong-stamp", message.node)


STALE = 0.5  # seconds without a new transform
SLOW = 5.0  # times its usual pause, from which on one is missing


def tree(trial: Trial) -> Iterator[RunFault]:
    """One parent and publisher for each frame, one root, and every frame that is asked for."""
    for session in range(len(trial.drive)):
        faults = list(_tree_faults(trial, session))
        if faults:
            yield faults[0]
            return


def heard_transforms(trial: Trial, session: int) -> dict[SentTransform, float]:
    """Return the transforms of the tree, with the last time of each; of static ones for ever."""
    last: dict[SentTransform, float] = {}
    for message in trial.recording.topic(trial.wanted.transforms, session):
        for frames in message.frames:
            last[SentTransform(*frames, message.node)] = message.at
    for transform, node in trial.recording.static:
        last[SentTransform(transform.parent, transform.child, node)] = math.inf
    return last


def _tree_faults(trial: Trial, session: int) -> Iterator[RunFault]:
    messages = trial.recording.topic(trial.wanted.transforms, session)
    last = heard_transforms(trial, session)
    heard = build_tree(last)
    inside = [sent for sent in heard.edges if {sent.parent, sent.child} <= {*heard.cycle}]
    if inside:
        text = f"the frames {', '.join(heard.cycle)} form a cycle"
        yield RunFault(text, "frame-cycle", inside[-1].publisher)
    own = {sent.child: sent.publisher for sent in reversed(heard.self_parents)}
    twice = {child for _, child in heard.several_publishers}
    for child, several in heard.by_child.items():
        if child in own:
            yield RunFault(f"{child} is its own parent", "self-parent", own[child])
        if child in heard.several_parents or child in twice:
            is_reparented = child in heard.several_parents
            kind: FaultKind = "several-parents" if is_reparented else "several-publishers"
            text = f"{child} has {len(several)} parents or publishers"
            yield RunFault(text, kind, several[1].publisher)
        if messages and any(_ends(sent, messages, last[sent]) for sent in several):
            yield RunFault(f"the transform of {child} ends", "transform-ends", several[0].publisher)
    lost = [frame for frame in trial.wanted.frames if frame not in heard.by_child]
    if last:
        yield from _loose_frames(trial, heard, session)
        if lost:
            yield RunFault(f"the tree lacks {', '.join(lost)}", "missing-frame")


def _ends(sent: SentTransform, messages: Sequence[Message], last: float) -> bool:
    """Whether a transform no longer comes at the end, by how often it did."""
    silence = messages[-1].at - last
    if silence <= STALE:
        return False
    names = (sent.parent, sent.child)
    times = [m.at for m in messages if m.node == sent.publisher and names in m.frames]
    return silence > SLOW * (times[-1] - times[0]) / max(1, len(times) - 1)


def _loose_frames(trial: Trial, heard: Tree[SentTransform], session: int) -> Iterator[RunFault]:
    """Yield the first frame that is not below the root; without one, below that of the tree."""
    wanted = trial.wanted
    roots = wanted.roots or (wanted.root or heard.roots[0],)
    named = {wanted.base: ""}  # the frames that are spoken of, with a node that does so
    if wanted.trees:
        if len(heard.parts) <= wanted.trees:
            return
        roots, named = heard.roots[:1], {}
    tied = heard.below(*roots)
    for topic in trial.wanted.types:
        for message in trial.recording.topic(topic, session):
            if message.frame:
                named.setdefault(message.frame, message.node)
    for frame in (*heard.by_child, *sorted(named)):
        if frame not in tied:
            kind: FaultKind = "disconnected-frame" if frame in heard.by_child else "unknown-frame"
            text = f"{frame} is not below {' or '.join(roots)}"
            yield RunFault(text, kind, named.get(frame, ""))
            return
