"""Sensors and their outputs, and messages of one value, as recipes ask for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lab3_usd.author.choosing import stopping_fault
from lab3_usd.author.ros_holes import checked_topic
from lab3_usd.author.task import Hole, Task
from lab3_usd.errors import UsageError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.facts.robots import Sensor


def sensor(task: Task) -> Iterator[Hole]:
    """Yield the sensor and its frame."""
    sensor = task.sensor
    if sensor is None:
        raise UsageError(f"{task.recipe.kind} needs a sensor")
    prim, lacks = sensor.prim, _lacking_schema(task, sensor)
    if lacks and not task.force:
        raise UsageError(
            f"{prim.path} is no {task.recipe.kind} that Isaac Sim can read: it lacks {lacks}; "
            "apply it (apiSchemas of the prim), or --force"
        )
    if _lacks_body(task, sensor) and not task.force:
        raise UsageError(
            f"{prim.path} is not below a rigid body, so it measures nothing; move it below a "
            "link of the robot, or --force"
        )
    is_scan = "laser_scan" in (task.options.publish or task.recipe.publishes)
    fault = stopping_fault(prim, task.stage, is_scan=is_scan)
    if fault and not task.force:
        raise UsageError(f"{prim.path} gives nothing: {fault}; repair it, or --force")
    source = "given" if task.options.prim else f"the only {task.recipe.kind}"
    yield Hole("sensor", prim.path, task.recipe.kind, prim.path, source, "--prim")
    frame = task.options.frame
    why = "given" if frame else "the name of the prim"
    yield Hole("frame", frame or sensor.frame, "frame", frame or sensor.frame, why, "--frame")


def _lacking_schema(task: Task, sensor: Sensor) -> str:
    """Return the schema without which a sensor is not read, '' where it may have it."""
    wanted, prim = task.recipe.sensor, sensor.prim
    if wanted is None or wanted.needs in prim.apis or task.stage.unknown(prim.path) is not None:
        return ""
    return wanted.needs


def _lacks_body(task: Task, sensor: Sensor) -> bool:
    """Whether a sensor of a body stands in none."""
    wanted = task.recipe.sensor
    holder = task.stage.prim(sensor.carrier) if sensor.carrier else None
    inside = wanted.inside if wanted is not None else ""
    return bool(inside) and (holder is None or inside not in holder.apis)


def outputs(task: Task) -> Iterator[Hole]:
    """Yield what is published of a sensor, each on its topic."""
    recipe, options = task.recipe, task.options
    asked = options.publish if options.publish is not None else recipe.publishes
    for name in asked:
        if name not in recipe.outputs:
            near = did_you_mean(likely_name(name, list(recipe.outputs)))
            output_names = ", ".join(recipe.outputs)
            raise UsageError(f"--publish {name}: {recipe.kind} has {output_names}{near}")
    names = [name for name in dict.fromkeys(asked) if name not in _INFO]
    topics = _topics_by_output(task, names)
    if not asked:
        raise UsageError(f"--publish: names nothing; {recipe.kind} has {', '.join(recipe.outputs)}")
    items = []
    for name in names:
        usual = recipe.outputs[name]
        topic = topics.get(name, usual["topic"])
        labels = usual.get("labels")
        if labels is not None and name in topics:
            labels = f"{topic.rstrip('/')}_labels"
        items.append(
            {"name": name, "topic": topic, "labels": labels, "has_labels": True if labels else None}
        )
        source = "given" if name in topics else "usual name"
        yield Hole(f"topic of {name}", topic, name, topic, source, "--topic")
        if labels is not None:
            yield Hole(f"labels of {name}", labels, "labels", labels, f"beside {topic}")
    yield Hole("outputs", items)
    if "info_topic" in recipe.usual:
        usual_name = recipe.usual["info_topic"]
        info = next((topics[name] for name in _INFO if name in topics), usual_name)
        source = "usual name" if info == usual_name else "given"
        yield Hole("info_topic", info, "camera_info", info, source, "--topic")


_INFO = ("camera_info", "info")


def _topics_by_output(task: Task, names: Sequence[str]) -> Mapping[str, str]:
    topic = task.options.topic
    if topic is None:
        return {}
    if isinstance(topic, str):
        if len(names) != 1:
            listed = ",".join(f"{name}=/{name}" for name in names)
            raise UsageError(f"--topic {topic}: {len(names)} outputs need a topic each: {listed}")
        return {names[0]: checked_topic(topic, "--topic")}
    for name, given in topic.items():
        if name not in names and not (name in _INFO and "info_topic" in task.recipe.usual):
            raise UsageError(
                f"--topic {name}={given}: {name} is not published; add it to --publish"
            )
        checked_topic(given, "--topic")
    return topic


def size(task: Task) -> Iterator[Hole]:
    """Yield the size of the picture, none where it is the usual one."""
    for name in ("width", "height"):
        value = getattr(task.options, name)
        if value is not None and value <= 0:
            raise UsageError(f"--{name} {value}: is not a size in pixels")
        yield Hole(name, value)
    width, height = task.options.width, task.options.height
    if width or height:
        shown = f"{width or 'usual'} x {height or 'usual'}"
        yield Hole("size", None, "size", shown, "given", "--width")


def metadata(task: Task) -> Iterator[Hole]:
    """Yield what a point cloud has beside points, and the outputs with and without it."""
    recipe, asked = task.recipe, task.options.metadata
    items = next(hole.value for hole in outputs(task) if hole.name == "outputs")
    kinds = {
        value.rpartition(".")[2]: value
        for node in recipe.nodes.values()
        for value in node.set.values()
        if isinstance(value, str) and value.startswith("$metadata.")
    }
    by_lower = {name.lower(): name for name in kinds}
    chosen = {}
    for name in asked or ():
        if name.lower() not in by_lower:
            near = did_you_mean(likely_name(name, list(kinds)))
            raise UsageError(f"--metadata {name}: known are {', '.join(kinds)}{near}")
        chosen[by_lower[name.lower()]] = True
    described = [item for item in items if item["name"] == _CLOUD] if chosen else []
    if chosen and not described:
        raise UsageError(f"--metadata goes with a point cloud: add {_CLOUD} to --publish")
    yield Hole("metadata", chosen or None)
    yield Hole("described_outputs", described)
    yield Hole("plain_outputs", [item for item in items if item not in described])


_CLOUD = "point_cloud"


def message(task: Task) -> Iterator[Hole]:
    """Yield the message of a publisher."""
    outputs = task.recipe.outputs
    asked = (task.options.kind or task.recipe.usual["kind"]).lower()
    by_message = {entry["message"].lower(): name for name, entry in outputs.items()}
    name = asked if asked in outputs else by_message.get(asked, "")
    if not name and asked.startswith("rtf"):
        name = task.recipe.usual["kind"]
    if not name:
        raise UsageError(f"--kind {task.options.kind}: known are {', '.join(outputs)}")
    message = outputs[name]["message"]
    source = "given" if task.options.kind else "usual"
    yield Hole("message", message, "message", message, source, "--kind")
    yield Hole(name, value=True)
