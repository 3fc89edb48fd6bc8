"""Lets the writers publish what their sensors see."""

from __future__ import annotations

from lab3_usd.model.dry_run.affine import Affine
from lab3_usd.sim.execution.record import Message, Scan, View
from lab3_usd.sim.execution.ros import send
from lab3_usd.sim.execution.world import World, Writer
from lab3_usd.sim.lidar.rays import Beam, sweep
from lab3_usd.sim.nodes.camera import IMAGES
from lab3_usd.sim.nodes.frames import OPTICAL


def render(world: World) -> None:
    """Let each writer publish if its sensor has a new picture."""
    for writer in world.writers:
        if writer.rate > 0:
            if world.since_play + 1e-9 < writer.due:
                continue
            writer.due = (writer.due if writer.rendered else world.since_play) + 1.0 / writer.rate
            writer.due = max(writer.due, world.since_play)
        writer.rendered += 1
        if (writer.rendered - 1) % (writer.skip + 1) == 0:
            stamp = {"system": world.wall, "monotonic": world.simulated}.get(
                writer.clock, world.since_play
            )
            message = _picture(writer, world, stamp)
            if message is not None:
                send(writer.node, world, writer.endpoint, message)


def _picture(writer: Writer, world: World, stamp: float) -> Message | None:
    product = writer.product
    if writer.kind == "info":
        view = View(product.width, product.height, writer.matrix)
        return Message("sensor_msgs/msg/CameraInfo", stamp, writer.frame_id, view)
    if writer.kind == "lidar point_cloud":
        return Message("sensor_msgs/msg/PointCloud2", stamp, writer.frame_id)
    if writer.beam is None:
        if world.scene.prims[product.sensor].type != "Camera":
            return None
        place = world.machines.place(product.sensor).then(OPTICAL)
        view = View(product.width, product.height, place=_metres(place, world))
        return Message(IMAGES[writer.kind], stamp, writer.frame_id, view)
    return Message(
        "sensor_msgs/msg/LaserScan", stamp, writer.frame_id, _scan(writer, writer.beam, world)
    )


def _metres(place: Affine, world: World) -> Affine:
    x, y, z = place.origin
    unit = world.scene.meters_per_unit
    return Affine(place.rows, (x * unit, y * unit, z * unit))


def _scan(writer: Writer, seen_by: Beam, world: World) -> Scan:
    at = world.machines.place(writer.product.sensor)
    unit = world.scene.meters_per_unit
    beam = Beam(
        seen_by.start,
        seen_by.step,
        seen_by.count,
        seen_by.near / unit,
        seen_by.far / unit,
    )
    known, sensor = world.surroundings, writer.product.sensor
    own = [*known.carried(sensor, world.machines), *known.beside(sensor, world.machines)]
    seen = sweep(beam, (*known.around(at), *own))
    ranges = [each if each < 0 else each * unit for each in seen]
    if writer.covered < 1.0:
        first = int((writer.rendered - 1) * writer.covered * beam.count) % beam.count
        shown = {(first + k) % beam.count for k in range(int(writer.covered * beam.count))}
        ranges = [each if k in shown else -1.0 for k, each in enumerate(ranges)]
    return Scan(
        seen_by.start, seen_by.step, seen_by.near, seen_by.far, tuple(ranges), _metres(at, world)
    )
