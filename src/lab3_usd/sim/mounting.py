"""Does every sensor of a robot have a frame of its own, and every image its own camera info?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.isaac.topics import CAMERA_INFO, POINTS
from lab3_usd.model.dry_run import Affine, Scene
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.physics import BODY_API
from lab3_usd.physics.machine import Machine
from lab3_usd.sim.execution.program import is_within
from lab3_usd.sim.execution.recording import Message, Points, Scan, View
from lab3_usd.sim.judge.expectations import RunFault, Trial, agree, in_root
from lab3_usd.sim.judge.sensors import apart_from_images, moves_with_base
from lab3_usd.sim.nodes.transforms import frame_name

_SENSORS = ("Camera", "OmniLidar", "OmniRadar")
_AXES, _OWN = "omni:sensor:Core:outputFrameOfReference", "SENSOR"
CLOCKS_APART = 0.5  # seconds, from which on two messages are not of one clock
_TURNED = 0.996  # the half angle's cosine of 10 degrees by which points may be turned
_BASELINE, _ASIDE = 0.5, 0.005  # metres between the cameras of a stereo pair, and off their line

_Seen = Scan | View | Points


def streams(messages: Sequence[Message]) -> dict[tuple[int | None, str], list[Message]]:
    """Return what placed sensors sent in the first session, by domain and topic."""
    by_topic: dict[tuple[int | None, str], list[Message]] = {}
    for message in messages:
        data = message.data
        is_placed = isinstance(data, _Seen) and data.sensor and data.place is not None
        if not message.session and is_placed:
            by_topic.setdefault((message.away, message.topic), []).append(message)
    return by_topic


def carried_streams(trial: Trial, scene: Scene, machine: Machine) -> list[list[Message]]:
    """Return the messages of each sensor of a robot whose points, if any, are in its own axes."""
    carried = []
    for messages in streams(trial.recording.messages).values():
        sensor = messages[0].data.sensor
        is_carried = any(is_within(sensor, (path,)) for path in machine.rest)
        in_own_axes = scene.prims[sensor].values.get(_AXES, _OWN) == _OWN
        if is_carried and in_own_axes and messages[0].away is None:
            carried.append(messages)
    return carried


def own_frames(trial: Trial, scene: Scene, machine: Machine) -> Iterator[RunFault]:
    """Every sensor of a robot is in a frame that moves with it, and is not that of another one."""
    for messages in carried_streams(trial, scene, machine):
        first = messages[:2][-1]
        if not moves_with_base(trial, messages):
            text = f"{first.frame} does not move with {trial.wanted.base}, and {first.topic} shows"
            yield RunFault(f"{text} {first.data.sensor}", "loose-sensor", first.node)
            continue
        frame = in_root(trial, first.frame, first)
        place = trial.start.inverse().then(first.data.place)
        off = None if frame is None else frame.inverse().then(place)
        yield from _misplaced(first, off, scene, machine)


def held_frames(trial: Trial, scene: Scene, machine: Machine) -> Iterator[RunFault]:
    """Every sensor on links that joints move is in a frame of its own that moves with it.

    It is looked at where legs of joint commands end, as seen from the first link that TF has.
    """
    for messages in carried_streams(trial, scene, machine):
        first, offsets = messages[0], list(_offsets(trial, scene, messages))
        if all(agree(offsets[0], off) for off in offsets):
            yield from _misplaced(first, next(iter(offsets), None), scene, machine)
            continue
        text = f"{first.frame} does not move with {first.data.sensor}, which {first.topic} shows"
        yield RunFault(text, "loose-sensor", first.node)


def _misplaced(
    first: Message, off: Affine | None, scene: Scene, machine: Machine
) -> Iterator[RunFault]:
    """Yield what is wrong where a sensor is `off` its frame, None where TF does not have that."""
    sensor = first.data.sensor
    if off is None:
        yield from _of_another_robot(first, sensor, scene, machine)
        return
    fault = _of_another(first, sensor, off, scene) or _turned(first, sensor, off)
    if fault is not None:
        yield fault


def _offsets(trial: Trial, scene: Scene, messages: Sequence[Message]) -> Iterator[Affine]:
    """Yield where a sensor is in the frame of its messages, at the ends of legs."""
    for held in trial.recording.held:
        shown = [message for message in messages if message.at <= held.at]
        if held.session or not shown:
            continue
        place = shown[-1].data.place
        frame = in_root(trial, shown[-1].frame, held)
        for link, stands in held.links.items():
            published = in_root(trial, frame_name(scene.prims[link]), held)
            if published is not None and frame is not None:
                seen = published.inverse().then(frame)
                yield seen.inverse().then(stands.inverse().then(place))
                break


def _of_another(message: Message, sensor: str, off: Affine, scene: Scene) -> RunFault | None:
    """Return the fault of a frame that is that of another sensor, elsewhere than its own."""
    named = [
        prim
        for prim in scene.prims.values()
        if prim.type in _SENSORS and frame_name(prim) == message.frame
    ]
    if not named or any(prim.path == sensor for prim in named) or agree(off, Affine()):
        return None
    camera = scene.prims[sensor].type == "Camera"
    if camera and any(prim.type == "Camera" for prim in named):
        x, y, z = off.origin
        is_beside = 0 < x <= _BASELINE and abs(y) + abs(z) < _ASIDE
        # To the right of the camera whose frame it has, as in a stereo pair.
        if is_beside and agree(Affine(off.rows), Affine()):
            return None
    text = f"{message.topic} is in {message.frame}, the frame of {named[0].path}, and shows"
    return _off_frame(f"{text} {sensor}", message, is_camera=camera)


def _off_frame(text: str, message: Message, *, is_camera: bool) -> RunFault:
    kind: FaultKind = "misplaced-camera-frame" if is_camera else "scan-off-walls"
    return RunFault(text, kind, message.node)


def _of_another_robot(
    message: Message, sensor: str, scene: Scene, machine: Machine
) -> Iterator[RunFault]:
    """Yield the fault of a frame that a robot's TF does not have, and that is that of another's."""
    named = [
        path
        for path, prim in scene.prims.items()
        if (prim.type in _SENSORS or BODY_API in prim.apis) and frame_name(prim) == message.frame
    ]
    if named and not any(is_within(path, machine.rest) for path in named):
        text = f"{message.topic} is in {message.frame}, the frame of {named[0]}, and shows {sensor}"
        yield _off_frame(text, message, is_camera=scene.prims[sensor].type == "Camera")


def _turned(message: Message, sensor: str, off: Affine) -> RunFault | None:
    """Return the fault of points in a frame that is turned against them."""
    is_cloud = message.type == POINTS or isinstance(message.data, Scan)
    if not is_cloud or abs(off.rigid().quaternion()[0]) > _TURNED:
        return None
    text = f"{message.frame} is turned against the points of {message.topic}, which {sensor} sees"
    return _off_frame(text, message, is_camera=isinstance(message.data, View))


def pairs(trial: Trial) -> Iterator[RunFault]:
    """Each camera info agrees with the images beside it in camera, frame and size."""
    last = {key: messages[-1] for key, messages in streams(trial.recording.messages).items()}
    infos = {key: message for key, message in last.items() if message.type == CAMERA_INFO}
    shown: dict[tuple[str, str], str] = {}  # the topic of each camera info, by node and camera
    for (_, topic), info in infos.items():
        first = shown.setdefault((info.node, info.data.sensor), topic)
        if first != topic:
            text = f"{first} and {topic} of a stereo pair both show {info.data.sensor}"
            yield RunFault(text, "wrong-render-product", info.node)
    for (domain, topic), info in infos.items():
        space, _, name = topic.rpartition("/")
        if name != "camera_info":
            continue
        images = [
            message
            for (other, path), message in last.items()
            if (other, path.rpartition("/")[0]) == (domain, space)
            and isinstance(message.data, View)
            and message.type not in {CAMERA_INFO, POINTS}
        ]
        yield from _unlike(info, images)


def _unlike(info: Message, images: Sequence[Message]) -> Iterator[RunFault]:
    same = [image for image in images if image.data.sensor == info.data.sensor]
    if images and not same:
        text = f"{info.topic} shows {info.data.sensor}, and {images[0].topic} "
        text += images[0].data.sensor
        yield RunFault(text, "wrong-render-product", info.node)
    yield from apart_from_images(info, same)
    clocks = [image.stamp - image.at for image in same if image.session == info.session]
    if clocks and all(abs(clock - (info.stamp - info.at)) > CLOCKS_APART for clock in clocks):
        text = f"{info.topic} and {same[0].topic} have the times of two clocks: none ever match"
        yield RunFault(text, "wrong-stamp", info.node)
