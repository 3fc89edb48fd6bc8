"""Rules about the frames of sensors, and about images and camera infos that belong together."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameter, rule
from lab3_usd.facts.execution_order import is_switched_on, nodes_of
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.render_products import Shown, has_two_sizes, stereo_products
from lab3_usd.facts.sensor_topics import SensorTopic, frame_prims, resting_frames, sensor_topics
from lab3_usd.model.finding import Problem
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import (
    Vector,
    decompose,
    distance,
    length,
    minus,
    rotation_difference,
    scaled,
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
