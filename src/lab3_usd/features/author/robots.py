"""`lab3 robots`: print the robots of a stage, as `lab3 add` knows them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import assets_option, isaac_option, text_or_json
from lab3_usd.commands.shared.paths import Input

if TYPE_CHECKING:
    from lab3_usd.facts.robots import Robot, RobotJoint, Sensor, Wheel
    from lab3_usd.model.stage import StageModel


@click.command("robots")
@click.argument("stage", type=Input(path_type=Path))
@isaac_option
@text_or_json
@assets_option
def command(stage: Path, form: str, release: str | None, assets: tuple[str, ...]) -> None:
    """Print the robots of a stage: root, base, wheels, joints, sensors, frames and graphs.

    A robot is what joints hold together. Wheels are round links that unlimited revolute joints turn
    about level axles, castors and rollers left out; where they are is said by place (metres ahead,
    to the left and above the base), not by name. Graphs are those that name one of its prims. The
    same facts fill in what lab3 add adds.
    """
    from lab3_usd.facts.robots import robots, sensors
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import lint_platform
    from lab3_usd.report.safe_text import visible
    from lab3_usd.stage.read.stage_reader import read_stage

    use_config(stage, assets)
    model = read_stage(stage, lint_platform(release or BASE))
    own_robots = robots(model)
    own = {sensor.prim.path for robot in own_robots for sensor in robot.sensors}
    free_sensors = [sensor for sensor in sensors(model) if sensor.prim.path not in own]
    missing = list(dict.fromkeys(asset.asset for asset in model.unresolved))
    if form == "json":
        document = {
            "stage": str(stage),
            "robots": [_document(robot, model) for robot in own_robots],
            "sensors": [_sensor(sensor) for sensor in free_sensors],
            "missing": missing,
        }
        click.echo(json.dumps(document, indent=2, ensure_ascii=False))
        return
    count = len(own_robots)
    click.echo(visible(f"{stage}: {count or 'no'} robot{'s' * (count != 1)}"))
    for robot in own_robots:
        click.echo("")
        for line in _lines(robot, model):
            click.echo(visible(line.rstrip()))
    if free_sensors:
        click.echo("\nsensors of no robot")
        for sensor in free_sensors:
            click.echo(visible(_sensor_line("", sensor)))
    for asset in missing:
        click.echo(visible(f"? {asset} cannot be found, and could hold more"))


def _lines(robot: Robot, model: StageModel) -> Iterator[str]:
    from lab3_usd.facts.frame_targets import frame_of_prim

    yield robot.path
    yield _line("root", robot.root or "none: apply Articulation Root to the base")
    yield _line("base", robot.base, f"frame {frame_of_prim(robot.base, model)}")
    tied = "fixed to the world" if robot.is_fixed else ""
    yield _line("links", str(len(robot.links)), tied)
    if robot.namespace:
        yield _line("namespace", robot.namespace)
    for wheel in robot.wheels:
        yield _line("wheel", wheel.joint.name, _wheel_words(wheel))
    rolling = {wheel.joint.prim.path for wheel in robot.wheels}
    for joint in robot.joints:
        if joint.prim.path not in rolling:
            yield _line("joint", joint.name, _joint_words(joint))
    for sensor in robot.sensors:
        yield _sensor_line("sensor", sensor)
    for graph, words in _graphs(robot, model).items():
        yield _line("graph", graph, words)


def _line(label: str, value: str, more: str = "") -> str:
    return f"  {label:<10}{value:<26}  {more}"


def _sensor_line(label: str, sensor: Sensor) -> str:
    return _line(label, f"{sensor.kind} {sensor.prim.path}", f"frame {sensor.frame}")


def _wheel_words(wheel: Wheel) -> str:
    x, y, z = wheel.place
    size = f"radius {wheel.radius:.3f} m" if wheel.radius else "no round collider"
    words = [f"{wheel.side}, {x:+.2f} {y:+.2f} {z:+.2f} m", size]
    if wheel.roller_angle is not None:
        words.append(f"rollers at {wheel.roller_angle:g} degrees")
    if wheel.steering is not None:
        words.append(f"steered by {wheel.steering.name}")
    return ", ".join([*words, _drive_words(wheel.joint)])


def _joint_words(joint: RobotJoint) -> str:
    unit = "degrees" if joint.is_angular else "units"
    kind = joint.prim.type.removeprefix("Physics").removesuffix("Joint").lower()
    way = "unlimited"
    if math.isfinite(joint.low) and math.isfinite(joint.high):
        way = f"{joint.low:g} to {joint.high:g} {unit}"
    return f"{kind}, {way}, {_drive_words(joint)}"


def _drive_words(joint: RobotJoint) -> str:
    if not joint.has_drive:
        return "no drive"
    return f"drive: stiffness {joint.stiffness:g}, damping {joint.damping:g}"


def _graphs(robot: Robot, model: StageModel) -> dict[str, str]:
    """Return what each graph that names prims of a robot does, in words."""
    from lab3_usd.facts.endpoints import endpoints
    from lab3_usd.facts.planned_graphs import names_any

    own = {robot.path, robot.root, *robot.links} - {""}
    own |= {sensor.prim.path for sensor in robot.sensors}
    topics_of = {}
    ends = endpoints(model)
    for graph in model.graphs:
        if not names_any(graph.nodes, own):
            continue
        paths = {node.path for node in graph.nodes}
        words = dict.fromkeys(
            f"{end.direction} {end.topic}"
            for end in ends
            if end.node.path in paths and end.topic and end.runs
        )
        topics_of[graph.path] = ", ".join(words) or ("no topic" if graph.active else "deactivated")
    return topics_of


def _document(robot: Robot, model: StageModel) -> dict[str, Any]:
    from lab3_usd.facts.frame_targets import frame_of_prim

    return {
        "path": robot.path,
        "root": robot.root or None,
        "base": robot.base,
        "fixed": robot.is_fixed,
        "namespace": robot.namespace,
        "frames": {link: frame_of_prim(link, model) for link in robot.links},
        "wheels": [
            {
                "joint": wheel.joint.name,
                "link": wheel.joint.link,
                "side": wheel.side,
                "place": [round(part, 6) for part in wheel.place],
                "radius": None if wheel.radius is None else round(wheel.radius, 6),
                "roller_angle": wheel.roller_angle,
                "steered_by": wheel.steering.name if wheel.steering else None,
            }
            for wheel in robot.wheels
        ],
        "joints": [
            {
                "name": joint.name,
                "prim": joint.prim.path,
                "type": joint.prim.type,
                "near": joint.near,
                "link": joint.link,
                "low": joint.low if math.isfinite(joint.low) else None,
                "high": joint.high if math.isfinite(joint.high) else None,
                "drive": {
                    "stiffness": joint.stiffness,
                    "damping": joint.damping,
                    "max_force": joint.force if math.isfinite(joint.force or 0) else None,
                }
                if joint.has_drive
                else None,
            }
            for joint in robot.joints
        ],
        "sensors": [_sensor(sensor) for sensor in robot.sensors],
        "graphs": _graphs(robot, model),
    }


def _sensor(sensor: Sensor) -> dict[str, str]:
    return {"prim": sensor.prim.path, "kind": sensor.kind, "frame": sensor.frame}
