"""Rules about frames, and about the bodies and sensors that nodes publish in them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameter, rule
from lab3_usd.check.rules.lint_motion import misnamed
from lab3_usd.facts.endpoints import running_endpoints
from lab3_usd.facts.execution_order import is_switched_on, nodes_of
from lab3_usd.facts.feeding import commanded_robots, feeding_nodes, misnamed_poses, robot_spaces
from lab3_usd.facts.frame_targets import listed_targets, parent_prim, tf_ports
from lab3_usd.facts.frames import Edge, HeardTree, all_edges, heard_trees, shared_tf_topics
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.message_frames import odometry_pairs
from lab3_usd.facts.render_products import Shown, has_two_sizes, stereo_products
from lab3_usd.facts.sensor_topics import SensorTopic, frame_prims, resting_frames, sensor_topics
from lab3_usd.model.finding import Place, Problem
from lab3_usd.model.physics import ARTICULATION_API
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel, once_per_stage
from lab3_usd.model.transforms import (
    Vector,
    decompose,
    distance,
    length,
    minus,
    rotation_difference,
    scaled,
)


@rule("K88", "another-robot", severity="warning")
def another_robot(subject: LintSubject) -> Iterator[Problem]:
    """A node publishes a part of another robot.

    Why: odometry, transforms or scans of one robot show how another one moves. Isaac Sim reports
    nothing. A robot is what joints connect; its topics are those in the namespace of its commands,
    its frames those of its prims.

    Fix: choose the prim of the right robot again. In a copy of a graph, every target is still that
    of the first robot.

    Example: Isaac Compute Odometry for `/robot1/odom` names `/World/robot2/base_link`.
    """
    told: set[Place] = set()
    for problem in (*_by_namespace(subject), *_by_frame(subject), *_by_parent(subject)):
        place = (problem.prim, problem.property)
        if place not in told:
            told.add(place)
            yield problem


def _by_namespace(subject: LintSubject) -> Iterator[Problem]:
    """Yield what shows another robot than the one that is commanded in the namespace."""
    spaces = robot_spaces(subject.stage)
    bodies = joined_bodies(subject.stage)
    robots = set(commanded_robots(subject.stage).values())
    robots |= {bodies.owner(root.path) for root in subject.stage.with_api(ARTICULATION_API)} - {""}
    parents = _parent_prims(subject)
    for end in running_endpoints(subject.stage, "publishes"):
        around = ((end.domain.name, space) for space in upwards(end.topic or ""))
        robot = next((spaces[space] for space in around if space in spaces), "")
        for node, port, prim in _shown(end.node, subject) if robot else ():
            owner = bodies.owner(prim)
            if owner not in robots or owner == robot:
                continue
            # A transform of another robot's root may say where that is.
            if not (tf_ports(node).prims and _is_root(prim, parents, subject)):
                yield Problem(
                    node.path,
                    f"{port} is {prim}, and {end.topic} is in the namespace of the commands of "
                    f"{robot}",
                    property=port,
                    expected=f"a prim of the robot of {robot}",
                    actual=prim,
                    related=() if node is end.node else (end.node.path,),
                    rests_on=subject.stage.unknown(prim, robot),
                )


def _shown(publisher: Node, subject: LintSubject) -> Iterator[tuple[Node, str, str]]:
    """Yield the prims that a node publishes about: who names them, where, and which."""
    for node in feeding_nodes(publisher, subject.live):
        ports = tf_ports(node).prims
        for port, state in node.ports.items():
            if port not in ports[:1]:  # what the others are relative to
                yield from ((node, port, path) for path in state.targets)


def _by_frame(subject: LintSubject) -> Iterator[Problem]:
    """Yield odometry that names the frame of another robot."""
    bodies = joined_bodies(subject.stage)
    for pose in misnamed_poses(subject.stage):
        path = pose.followed.prim.path
        if bodies.owner(pose.prim) not in {"", bodies.owner(path)}:
            yield misnamed(pose, "another robot", subject.stage.unknown(pose.prim, path))


def _by_parent(subject: LintSubject) -> Iterator[Problem]:
    """Yield transforms of links that hang below the frame of another robot.

    Those of another robot's root may be meant: they say where it is.
    """
    bodies, prims_above = joined_bodies(subject.stage), _parent_prims(subject)
    makers = dict.fromkeys(edge.cause for edge in all_edges(subject.stage) if edge.prim)
    parents = {path: parent_prim(subject.live[path]) for path in makers}
    owners = {path: bodies.owner(prim) for path, prim in parents.items() if prim}
    for path, owner in owners.items():
        node = subject.live[path]
        owner_of = {target: bodies.owner(target) for target in listed_targets(node)}
        foreign = {
            target: robot
            for target, robot in owner_of.items()
            if robot not in {"", owner}
            and bodies.sizes[robot] > 1
            and not _is_root(target, prims_above, subject)
        }
        is_whole = len(foreign) == sum(bool(robot) for robot in owner_of.values())
        wrong = [
            target for target, robot in foreign.items() if is_whole or robot in owners.values()
        ]
        if owner and bodies.sizes[owner] > 1 and wrong:
            port = tf_ports(node).prims[1]
            yield Problem(
                path,
                f"{port} has {', '.join(wrong)} of another robot than {parents[path]}, below "
                "which they hang",
                property=port,
                expected=f"prims of the robot of {parents[path]}",
                actual=", ".join(wrong),
                rests_on=subject.stage.unknown(parents[path], *wrong),
            )


def _parent_prims(subject: LintSubject) -> frozenset[str]:
    """Return the prims below whose frames nodes hang others."""
    makers = nodes_of(lambda kind: kind.tf, subject.stage)
    return frozenset(map(parent_prim, makers))


def _is_root(path: str, parents: frozenset[str], subject: LintSubject) -> bool:
    """Whether a prim stands for all of a robot: the links of some tree hang below it."""
    prim = subject.stage.prim(path)
    is_articulation = prim is not None and ARTICULATION_API in prim.apis
    return is_articulation or path in parents or not joined_bodies(subject.stage).carrier(path)


@rule("K59", "shared-tf-topic", severity="warning")
def shared_tf_topic(subject: LintSubject) -> Iterator[Problem]:
    """A namespace above several robots joins their transforms.

    Why: of several `isaac:namespace` above a TF publisher only the outermost counts, where all of
    them count for other topics. The robots' topics are separate, but their transforms are not: a
    listener in the namespace of one robot receives no TF, and equal frame names of several robots
    collide.

    Fix: set Node Namespace on each TF publisher, or remove the namespace from the common prim.

    Example: `isaac:namespace` is `fleet` on `/World` and `robot1` and `robot2` on the robots: both
    publish on `/fleet/tf`.
    """
    name = subject.platform.ros.namespace_attribute
    for shared in shared_tf_topics(subject.stage):
        yield Problem(
            shared.prim,
            f"{name} puts the transforms of {' and '.join(shared.publishers)} on {shared.topic}",
            property=name,
            related=tuple(path for paths in shared.publishers.values() for path in paths),
            severity="error" if shared.clashes else None,
        )


@rule("K58", "tree-on-two-topics", severity="warning")
def tree_on_two_topics(subject: LintSubject) -> Iterator[Problem]:
    """One TF tree is spread over two topics.

    Why: a tf2 listener subscribes to one topic for moving transforms. A namespace, such as
    `isaac:namespace` on the robot, moves some of them to another topic, and the tree is
    disconnected.

    Fix: publish all transforms of a robot on the same topic: give all nodes the same namespace.

    Example: `odom -> base_link` on `/tf`, and `base_link -> wheel` on `/robot1/tf`.
    """
    trees = heard_trees(subject.stage)
    carriers: dict[tuple[str, str], dict[int, Edge]] = {}  # by domain and frame: where it is placed
    for number, other in enumerate(trees):
        for edge in other.tree.edges:
            if edge.parent != edge.child:
                carriers.setdefault((other.domain, edge.child), {})[number] = edge
    for heard in trees:
        tops, own = frozenset(heard.tree.roots), _frames(heard)
        hanging = [edge for edge in heard.tree.edges if edge.parent in tops]
        lost_in: dict[int, tuple[Edge, Edge]] = {}
        for lost in hanging:
            for number, carrier in carriers.get((heard.domain, lost.parent), {}).items():
                lost_in.setdefault(number, (lost, carrier))
        for number, (lost, carrier) in sorted(lost_in.items(), key=lambda each: each[0]):
            # Trees with a transform of the same frames are those of robots of their own.
            is_other = trees[number].topic != heard.topic
            if is_other and own.isdisjoint(_frames(trees[number])):
                yield Problem(
                    lost.cause,
                    f"publishes {lost.parent} -> {lost.child} on {lost.topic}, but "
                    f"{carrier.publisher} publishes {carrier.parent} -> {carrier.child} on "
                    f"{carrier.topic}",
                    expected=carrier.topic,
                    actual=lost.topic,
                    related=(carrier.publisher,),
                )


def _frames(heard: HeardTree) -> set[tuple[str, str]]:
    """Return the frames of the transforms of a tree."""
    return {(edge.parent, edge.child) for edge in heard.tree.edges}


@rule("K56", "odometry-tf-mismatch", severity="warning", formerly="odometry-and-transform-differ")
def odometry_tf_mismatch(subject: LintSubject) -> Iterator[Problem]:
    """Odometry message and transform name different frames.

    Why: both give the pose of the robot. With different names they describe different frames, and
    localization can use neither.

    Fix: use the same two frames in both nodes.

    Example: the message has `odom` and `base_link`, the transform `odom -> base_footprint`.
    """
    for message, transform in odometry_pairs(subject.stage):
        if message.sent and message.frames != transform.frames:
            actual, expected = (" -> ".join(pose.frames) for pose in (message, transform))
            tree = transform.node.path
            yield Problem(
                message.node.path,
                f"the message names {actual}, but {tree} publishes {expected}",
                property=message.ports[1],
                expected=expected,
                actual=actual,
                related=(tree,),
                assumes=(*message.names, *transform.names),
            )


_NEAR, _ALIKE = 0.001, 0.5  # metres and degrees between places that are one
_BASELINE = Parameter(
    "K77", "baseline", 0.5, "metres between the cameras of a stereo pair, at most"
)
_APART = Parameter("K87", "distance", 0.02, "metres that points may be shifted")
_TURNED = Parameter("K87", "angle", 5.0, "degrees that points may be turned")
_POINTS = ("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan")
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_INFO, _INFO_NAME = "sensor_msgs/msg/CameraInfo", "camera_info"


@once_per_stage
def _named(stage: StageModel, domain: str, frame: str) -> tuple[tuple[Prim, ...], frozenset[str]]:
    """Return the prims whose place a frame has, and the bodies that they move with."""
    paths = frame_prims(stage).get((domain, frame), ())
    prims = tuple(prim for path in paths if (prim := stage.prim(path)) is not None)
    return prims, frozenset(joined_bodies(stage).rigid_of(prim.path) for prim in prims)


def _is_sensor(prim: Prim, subject: LintSubject) -> bool:
    return any(prim.type in reads.types for reads in subject.platform.sensors.values())


def _axes(prim: Prim, subject: LintSubject) -> tuple[Vector, tuple[Vector, Vector, Vector]] | None:
    """Return where a frame stands and its axes, as TF has them; None where nothing tells it."""
    if prim.world is None:
        return None
    pose = decompose(prim.world)
    x, y, z = pose.rotation
    kinds = subject.platform.sensors.values()
    is_turned = any(prim.type in reads.types and reads.turned for reads in kinds)
    return pose.translation, (x, scaled(y, -1.0), scaled(z, -1.0)) if is_turned else (x, y, z)


@rule("K77", "frame-of-another-sensor", severity="warning", parameters=(_BASELINE,))
def frame_of_another_sensor(subject: LintSubject) -> Iterator[Problem]:
    """A message names the frame of another sensor.

    Why: the message gets the position and direction of the other sensor. The right camera of a
    stereo pair may be in the frame of the left one, as may a sensor at the same place.

    Fix: use the frame of the sensor itself, or of the link that carries it. If the frame is right,
    connect the render product of its sensor.

    Example: a lidar helper with the frame of the camera, or with that of the other lidar.
    """
    for topic in sensor_topics(subject.stage):
        named, _ = _named(subject.stage, topic.endpoint.domain.name, topic.frame)
        is_own = not named or topic.sensor in named
        if is_own or not all(_is_another(prim, topic, subject) for prim in named):
            continue
        other = named[0]
        yield Problem(
            topic.endpoint.node.path,
            f"{topic.port} is '{topic.frame}', the frame of {other.path}, but it publishes "
            f"{topic.sensor.path}",
            property=topic.port,
            expected="the frame of its own sensor",
            actual=topic.frame,
            related=(other.path, topic.sensor.path),
            rests_on=subject.stage.unknown_pose(other, topic.sensor),
        )


def _is_another(prim: Prim, topic: SensorTopic, subject: LintSubject) -> bool:
    """Whether a prim is another sensor than that of a topic, and stands elsewhere."""
    if not _is_sensor(prim, subject):
        return False
    frame, data = _axes(prim, subject), _axes(topic.sensor, subject)
    if frame is None or data is None:
        return prim.type != topic.sensor.type
    (start, axes), (end, other_axes) = frame, data
    unit = subject.stage.meters_per_unit
    is_alike = rotation_difference(axes, other_axes) <= _ALIKE
    if is_alike and unit * distance(start, end) <= _NEAR:
        return False
    # The right camera of a stereo pair looks the same way, and stands beside the left one.
    between = scaled(minus(end, start), unit)
    along = sum(a * b for a, b in zip(between, axes[0], strict=True))
    is_right = 0 < along <= subject.value(_BASELINE) and length(between) - along <= _NEAR
    is_pair = topic.reads.turned and prim.type == topic.sensor.type and is_alike and is_right
    return not (is_pair or prim.path in topic.others)


@rule("K87", "frame-off-sensor", severity="warning", parameters=(_APART, _TURNED))
def frame_off_sensor(subject: LintSubject) -> Iterator[Problem]:
    """A sensor's frame does not move with it, is elsewhere, or is turned against it.

    Why: listeners place the data by its frame. In `odom` or in the frame of a wheel it moves away
    from the robot. The points of a depth image are in the axes of REP 103 for cameras, z ahead: in
    the frame of a link, x ahead, the cloud lies on its side. Points in a frame 2 cm and more from
    their sensor are shifted by as much.

    Fix: use the frame of the sensor itself, or of a link that moves with it and has its axes.

    Example: a scan in `odom`; the `depth_pcl` of a camera in `base_link`.
    """
    for topic in sensor_topics(subject.stage):
        fits = topic.reads.in_frame.items()
        if any(topic.sensor.attributes.get(name, value) != value for name, value in fits):
            continue
        named, rigid = _named(subject.stage, topic.endpoint.domain.name, topic.frame)
        if any(_is_sensor(prim, subject) for prim in named):
            continue
        fault = _moving(topic, named, rigid, subject) or _shifted(topic, named, subject)
        paths = (topic.sensor.path, *(prim.path for prim in named[:1]))
        if fault:
            yield Problem(
                topic.endpoint.node.path,
                f"{topic.port} is '{topic.frame}', {fault}",
                property=topic.port,
                expected="the frame of its own sensor",
                actual=topic.frame,
                related=paths,
                rests_on=subject.stage.unknown(*paths),
            )


def _moving(
    topic: SensorTopic, named: Sequence[Prim], rigid: Container[str], subject: LintSubject
) -> str:
    """Say that a frame stands still or moves against its sensor, '' where it does not."""
    key, sensor = (topic.endpoint.domain.name, topic.frame), topic.sensor.path
    bodies = joined_bodies(subject.stage)
    if key in resting_frames(subject.stage) and not bodies.move_together(sensor, "/"):
        return f"which does not move, while {sensor} moves with {bodies.carrier(sensor)}"
    if named and bodies.rigid_of(sensor) not in rigid:
        return f"the frame of {named[0].path}, against which {sensor} moves"
    return ""


def _shifted(topic: SensorTopic, named: Sequence[Prim], subject: LintSubject) -> str:
    """Say that points are turned in a frame, or stand away from it, '' where they do not."""
    data = _axes(topic.sensor, subject)
    places = [place for prim in named if (place := _axes(prim, subject)) is not None]
    if topic.endpoint.type not in _POINTS or data is None or len(places) < max(1, len(named)):
        return ""
    sensor, unit = topic.sensor.path, subject.stage.meters_per_unit
    turn = min(rotation_difference(axes, data[1]) for _, axes in places)
    if turn > subject.value(_TURNED):
        return f"which is turned by {turn:.0f} degrees against the points of {sensor}"
    away = unit * min(distance(start, data[0]) for start, _ in places)
    return f"which is {away:.2g} m from {sensor}" if away > subject.value(_APART) else ""


@rule("K78", "image-info-mismatch", severity="warning")
def image_info_mismatch(subject: LintSubject) -> Iterator[Problem]:
    """An image and its camera info differ.

    Why: subscribers take the `camera_info` beside an image, in its namespace, for that of the
    image. With another camera, size or frame, what they compute is elsewhere.

    Fix: connect both helpers to one render product, and set one Frame Id.

    Example: `/front/image_raw` of 1280 x 720, beside `/front/camera_info` of 640 x 480.
    """
    topics = sensor_topics(subject.stage)
    beside: dict[tuple[str, str], list[SensorTopic]] = {}  # by domain and namespace
    for topic in topics:
        if topic.endpoint.type in _IMAGES:
            space = (topic.endpoint.topic or "").rpartition("/")[0]
            beside.setdefault((topic.endpoint.domain.name, space), []).append(topic)
    for info in topics:
        space, _, name = (info.endpoint.topic or "").rpartition("/")
        if info.endpoint.type != _INFO or name != _INFO_NAME:
            continue
        images = beside.get((info.endpoint.domain.name, space), [])
        same = [image for image in images if image.sensor.path == info.sensor.path]
        if images and not same:
            fault = f"shows {info.sensor.path}, and {images[0].endpoint.topic} shows "
            fault += images[0].sensor.path
            yield _mismatch(info, images[0], fault, (info.product, images[0].product))
        frames = [image for image in same if image.frame != info.frame]
        if frames:
            odd, right = (info, frames[0]) if len(frames) == len(same) else (frames[0], info)
            fault = f"is in '{odd.frame}', and {right.endpoint.topic} in '{right.frame}'"
            yield _mismatch(odd, right, fault, (odd.port, right.port))
        sized = [image for image in same if image.shown.size and info.shown.size]
        if sized and all(image.shown.size != info.shown.size for image in sized):
            image = sized[0]
            fault = f"is of {_size(info.shown)}, and {image.endpoint.topic} of {_size(image.shown)}"
            yield _mismatch(info, image, fault, (info.product, image.product))


def _mismatch(
    topic: SensorTopic, other: SensorTopic, fault: str, ports: tuple[str, str]
) -> Problem:
    nodes = (topic.endpoint.node.path, other.endpoint.node.path)
    return Problem(
        nodes[0],
        f"{topic.endpoint.topic} {fault}",
        property=ports[0],
        related=nodes[1:],
        assumes=tuple(zip(nodes, ports, strict=True)),
    )


def _size(shown: Shown) -> str:
    return "{} x {}".format(*(shown.size or ()))


@rule("K79", "stereo-pair")
def stereo_pair(subject: LintSubject) -> Iterator[Problem]:
    """A stereo pair differs in size, or shows one camera.

    Why: the ROS2 Camera Info Helper computes one rectification for both cameras. With two sizes it
    logs a warning and sends neither camera info. One camera twice has no baseline: a warning.

    Fix: set the same Width and Height on both render products, each with a camera of its own.

    Example: left 1280 x 720, right 640 x 480.
    """
    for node in nodes_of(lambda kind: len(kind.topics) > 1, subject.stage):
        pair = stereo_products(node, subject.stage, subject.live)
        if pair is None or not (subject.runs(node.path) and is_switched_on(node, subject.live)):
            continue
        left, right = pair
        related = tuple(dict.fromkeys((left.maker, right.maker)))
        if has_two_sizes(pair):
            one, other = _size(left), _size(right)
            text = f"the left image is of {one}, the right one of {other}: no camera info is sent"
            yield Problem(node.path, text, expected=one, actual=other, related=related)
        elif left.sensor == right.sensor:
            text = f"the left and the right image are both of {left.sensor}"
            yield Problem(node.path, text, related=related, severity="warning")
