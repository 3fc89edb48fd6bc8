"""Do lidar and camera show the scene from their TF poses?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.model.dry_run import AXES, Affine, about
from lab3_usd.model.transforms import length, minus
from lab3_usd.sim.execution.recording import Message, Scan, View
from lab3_usd.sim.judge.expectations import RunFault, Trial, agree, in_root

WALL = 0.03  # metres between a scan and the walls
SHORT = 2.0  # seconds of a recording in which a stream may come once
AHEAD = 0.5  # between directions of length 1
MISSED = 0.1  # the part of a scan that may be elsewhere
TURNS = 0.01  # part by which a lidar may turn faster or slower


def mounted(trial: Trial) -> Iterator[RunFault]:
    """Lidar and camera move with the robot."""
    wanted = trial.wanted
    for messages in (trial.recording.topic(topic, 0) for topic in (wanted.scan, wanted.image)):
        if messages and not moves_with_base(trial, messages):
            text = f"{messages[0].frame} does not move with {wanted.base}"
            yield RunFault(text, "loose-sensor", messages[0].node)


def moves_with_base(trial: Trial, messages: Sequence[Message]) -> bool:
    """Whether the frame of a sensor stays where it is as seen from the base, by TF."""
    places = []
    for message in (messages[:2][-1], messages[-1]):
        sensor_place = in_root(trial, message.frame, message)
        base_place = in_root(trial, trial.wanted.base, message)
        if sensor_place is not None and base_place is not None:
            places.append(base_place.inverse().then(sensor_place))
    return len(places) <= 1 or agree(*places)


def rate_of(messages: Sequence[Message]) -> float:
    """Return how many messages come in a second."""
    passed = messages[-1].at - messages[0].at if len(messages) > 1 else 0.0
    return (len(messages) - 1) / passed if passed else 0.0


def scans(trial: Trial) -> list[Message]:
    """Return the scans of the first session, whatever else comes on their topic."""
    sent = trial.recording.topic(trial.wanted.scan, 0)
    return [message for message in sent if isinstance(message.data, Scan)]


def scan(trial: Trial) -> Iterator[RunFault]:
    """Scans come at their rate, and show the walls where TF puts the lidar."""
    wanted, messages = trial.wanted, scans(trial)
    if not messages:
        return
    rate = rate_of(messages)
    is_long = _lasts(trial, messages)
    if is_long and wanted.scan_rate and abs(rate - wanted.scan_rate) > 0.2 * wanted.scan_rate:
        text = f"{rate:.1f} scans a second, not {wanted.scan_rate}"
        yield RunFault(text, "wrong-scan-rate", messages[0].node)
    turn, turns = messages[-1].data.scan_time, wanted.turn_rate
    if turn > 0 and turns and abs(turn * turns - 1.0) > TURNS:
        text = f"the lidar turns {1.0 / turn:g} times a second, not {turns:g}"
        yield RunFault(text, "wrong-turn-rate", messages[-1].node)
    if all(distance < 0 for each in reversed(messages) for distance in each.data.ranges):
        text, is_empty = "no ray returns", trial.walls is not None and not trial.room
        text += ", and nothing stands still at the height of the lidar" if is_empty else ""
        yield RunFault(text, "no-ray-returns", messages[-1].node, sure=not is_empty)
    for message in (messages[:2][-1], messages[len(messages) // 2], messages[-1]):
        place = in_root(trial, message.frame, message)
        if place is None or trial.walls is None:
            continue
        seen = message.data.ranges
        expected = trial.walls(trial.start.then(place), message.data)
        off = sum(
            abs(measured - wall) > WALL + 0.02 * abs(wall)
            for measured, wall in zip(seen, expected, strict=True)
        )
        if off > MISSED * len(seen):
            text = f"{off} of {len(seen)} rays do not show the walls"
            yield RunFault(text, "scan-off-walls", message.node)
            return


def _lasts(trial: Trial, *streams: Sequence[Message]) -> bool:
    """Whether streams show their rates: of one message in a short recording nothing is known."""
    return trial.recording.seconds > SHORT or all(len(stream) > 1 for stream in streams)


def camera(trial: Trial) -> Iterator[RunFault]:
    """Image and info belong together, in the frame of the camera, which looks as the lab asks."""
    wanted = trial.wanted
    images, infos = (trial.recording.topic(topic, 0) for topic in (wanted.image, wanted.info))
    if images and infos:
        least = wanted.image_rate if _lasts(trial, images, infos) else 0.0
        yield from _pairs(images, infos, least)
        yield from _view(trial, images[-1])


def _pairs(images: Sequence[Message], infos: Sequence[Message], least: float) -> Iterator[RunFault]:
    image, info = images[-1], infos[-1]
    yield from apart_from_images(info, [image])
    rates = rate_of(images), rate_of(infos)
    if min(rates) < 0.8 * least:
        yield RunFault(
            f"{min(rates):.1f} images a second, not {least}", "low-image-rate", image.node
        )
    if abs(rates[0] - rates[1]) > 0.1 * max(rates):
        text = f"{rates[0]:.1f} images and {rates[1]:.1f} infos a second"
        yield RunFault(text, "image-info-rates-differ", info.node)


def apart_from_images(info: Message, images: Sequence[Message]) -> Iterator[RunFault]:
    """A camera info is in the frame of the images of its camera, and has the size of one."""
    frames = [image for image in images if image.frame != info.frame]
    if frames:
        site = info if len(frames) == len(images) else frames[0]
        text = f"{info.topic} is in {info.frame}, and {frames[0].topic} in {frames[0].frame}"
        yield RunFault(text, "image-info-frames-differ", site.node)
    views = [each.data for each in (info, *images) if isinstance(each.data, View)]
    sizes = [(view.width, view.height) for view in views]
    if len(sizes) > len(images) > 0 and sizes[0] not in sizes[1:]:
        text = f"{info.topic} and {images[0].topic} differ in size"
        yield RunFault(text, "image-info-sizes-differ", info.node)


def _view(trial: Trial, image: Message) -> Iterator[RunFault]:
    if not isinstance(image.data, View) or image.data.place is None:
        return
    place, actual = in_root(trial, image.frame, image), trial.start.inverse().then(image.data.place)
    if place is not None and not agree(place, actual):
        text = f"TF does not have {image.frame} where the camera is"
        yield RunFault(text, "misplaced-camera-frame", image.node)
    wanted = trial.wanted
    base = in_root(trial, wanted.base, image)
    if base is None and trial.recording.path:  # without TF, the run itself tells
        turned = Affine(about(AXES[2], trial.pose(image).heading))
        base = trial.start.inverse().then(turned)
    if base is not None and any(wanted.view):
        view = base.inverse().then(actual)
        if length(minus(view.turn((0.0, 0.0, 1.0)), wanted.view)) > AHEAD:
            yield RunFault("the camera looks in a wrong direction", "camera-not-ahead", image.node)
        elif length(minus(view.turn((0.0, -1.0, 0.0)), wanted.upward)) > AHEAD:
            yield RunFault("the camera is not upright", "camera-not-upright", image.node)
    elif any(wanted.view):
        text = f"nothing tells where {wanted.base} is, and so where the camera looks"
        yield RunFault(text, "camera-not-ahead", image.node, sure=False)
