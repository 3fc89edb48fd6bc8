"""Lidar and camera. RN is isaacsim.ros2.nodes, CN isaacsim.core.nodes.

A helper attaches a writer to a render product; from then on the writer publishes by itself, at the
rate of the sensor, until Stop.
"""

from __future__ import annotations

import math
from typing import Any

from msgspec import Struct, field

from executor.affine import Affine
from executor.execution import Running, computes
from executor.frames import OPTICAL
from executor.rays import Beam, sweep
from executor.record import Message, Scan, View
from executor.ros import Endpoint, open_endpoint, send
from executor.scene import Prim

CORE = "omni:sensor:Core:"
RATE = "omni:sensor:tickRate"
LIDAR_API = "OmniSensorGenericLidarCoreAPI"
LIDAR_RATE = 10.0  # of the schema (test_lidar.py:68, 107)
IMAGES = {
    "rgb": "sensor_msgs/msg/Image",
    "depth": "sensor_msgs/msg/Image",
    "rgb_h264": "sensor_msgs/msg/CompressedImage",
    "depth_pcl": "sensor_msgs/msg/PointCloud2",
}
SEMANTIC = (
    "instance_segmentation", "semantic_segmentation",
    "bbox_2d_tight", "bbox_2d_loose", "bbox_3d",
)  # fmt: skip


class Product(Struct, frozen=True):
    """A render product: its sensor and its size."""

    sensor: str
    width: int
    height: int


class Writer(Struct):
    """What publishes the pictures of a product."""

    node: Running
    endpoint: Endpoint
    product: Product
    rate: float  # 0 is every frame
    skip: int
    frame_id: str
    clock: str  # which time stamps it
    kind: str
    beam: Beam | None = None
    covered: float = 1.0  # the part of a turn that one picture shows
    rendered: int = 0
    due: float = 0.0
    matrix: tuple[float, ...] = field(default_factory=tuple)


@computes("isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame")
def run_one_frame(node: Running, world: Any) -> bool:
    """CN/nodes/OgnIsaacRunOneSimulationFrame.cpp:35-45."""
    del world
    if not node.memory.get("done"):
        node.memory["done"] = True
        node.enabled.append("step")
    return True


@computes("isaacsim.core.nodes.IsaacCreateRenderProduct")
def create_render_product(node: Running, world: Any) -> bool:
    """CN/python/nodes/OgnIsaacCreateRenderProduct.py:77-160."""
    targets = node.targets("cameraPrim")
    if not node.get("enabled", world) or not targets:
        return False
    if targets[0] not in world.scene.prims:
        return False
    width, height = (int(node.get(each, world) or 0) for each in ("width", "height"))
    if width <= 0 or height <= 0:
        return False
    product = Product(targets[0], width, height)
    name = next((name for name, each in world.products.items() if each == product), "")
    name = name or node.memory.get("path") or f"/Render/Product{len(world.products)}"
    world.products[name] = product
    node.memory["path"] = name
    node.outputs["renderProductPath"] = name
    node.enabled.append("execOut")
    return True


@computes("isaacsim.ros2.bridge.ROS2RtxLidarHelper")
def lidar_helper(node: Running, world: Any) -> bool:
    """RN/python/nodes/OgnROS2RtxLidarHelper.py:93-360."""
    product = _product(node, world)
    if product is None:
        return bool(node.memory)
    prim: Prim = world.scene.prims[product.sensor]
    kind = str(node.get("type", world))
    if prim.type != "OmniLidar" or LIDAR_API not in prim.apis:
        return False
    beam = _beam(prim)
    if kind not in {"laser_scan", "point_cloud"} or (kind == "laser_scan" and beam is None):
        return False
    rate = prim.values.get(RATE)
    rate = LIDAR_RATE if rate is None else float(rate)
    writer = _attach(node, world, product, f"lidar {kind}", rate)
    if writer is None:
        return False
    turns = float(prim.values.get(f"{CORE}scanRateBaseHz") or 0)
    writer.beam = beam
    if rate > 0 and not prim.values.get(f"{CORE}accumulateOutputs"):
        writer.covered = min(1.0, turns / rate)
    return True


def _beam(prim: Prim) -> Beam | None:
    """Read the scan (:93-148); without an emitter or a range nothing comes back."""

    def number(name: str) -> float:
        value = prim.values.get(f"{CORE}{name}")
        return float(value) if isinstance(value, (int, float)) else 0.0

    turns, firings = number("scanRateBaseHz"), int(number("patternFiringRateHz"))
    if turns <= 0 or firings <= 0:
        return None
    emitters = prim.values.get(f"{CORE}numberOfEmitters", 1)
    angles = prim.values.get(f"{CORE}emitterState:s001:azimuthDeg", (0.0,))
    if not emitters or not angles:
        return None
    step = 2 * math.pi * turns / firings
    return Beam(-math.pi, step, int(firings / turns), number("nearRangeM"), number("farRangeM"))


def _product(node: Running, world: Any) -> Product | None:
    """Return the product of a helper that is on and not yet at work."""
    if not node.get("enabled", world):
        world.detach(node)
        node.memory.clear()
        return None
    if node.memory.get("attached"):
        return None
    product: Product | None = world.products.get(str(node.get("renderProductPath", world) or ""))
    return product


def _attach(node: Running, world: Any, product: Product, kind: str, rate: float) -> Writer | None:
    endpoint = open_endpoint(node, world, start=product.sensor)
    node.memory["attached"] = True
    if endpoint is None:
        return None
    clock = "system" if node.get("useSystemTime", world) else "monotonic"
    if clock == "monotonic" and node.get("resetSimulationTimeOnStop", world):
        clock = "since play"
    writer = Writer(
        node,
        endpoint,
        product,
        rate,
        int(node.get("frameSkipCount", world) or 0),
        str(node.get("frameId", world) or ""),
        clock,
        kind,
    )
    world.writers.append(writer)
    return writer


@computes("isaacsim.ros2.bridge.ROS2CameraHelper")
def camera_helper(node: Running, world: Any) -> bool:
    """RN/python/nodes/OgnROS2CameraHelper.py:200-340."""
    product = _product(node, world)
    if product is None:
        return bool(node.memory)
    kind = str(node.get("type", world))
    if kind not in IMAGES:
        if kind in SEMANTIC:
            world.not_simulated[node.path] = f"camera type {kind}"
        return False
    writer = _attach(node, world, product, kind, _camera_rate(world, product))
    return writer is not None


def _camera_rate(world: Any, product: Product) -> float:
    prim: Prim = world.scene.prims[product.sensor]
    return float(prim.values.get(RATE) or 0.0) if "OmniSensorAPI" in prim.apis else 0.0


@computes("isaacsim.ros2.bridge.ROS2CameraInfoHelper")
def camera_info_helper(node: Running, world: Any) -> bool:
    """RN/python/nodes/OgnROS2CameraInfoHelper.py:283-460: the lens is read once."""
    product = _product(node, world)
    if product is None:
        return bool(node.memory)
    prim: Prim = world.scene.prims[product.sensor]
    if prim.type != "Camera":
        return False
    writer = _attach(node, world, product, "info", _camera_rate(world, product))
    if writer is None:
        return False
    wide, tall = product.width, product.height
    focal = float(prim.values["focalLength"])
    fx = wide * focal / float(prim.values["horizontalAperture"])
    writer.matrix = (fx, 0.0, wide / 2, 0.0, fx, tall / 2, 0.0, 0.0, 1.0)
    return True


def render(world: Any) -> None:
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


def _picture(writer: Writer, world: Any, stamp: float) -> Message | None:
    product = writer.product
    if writer.kind == "info":
        view = View(product.width, product.height, writer.matrix)
        return Message("sensor_msgs/msg/CameraInfo", stamp, writer.frame_id, view)
    if writer.kind == "lidar point_cloud":
        return Message("sensor_msgs/msg/PointCloud2", stamp, writer.frame_id)
    if writer.kind != "lidar laser_scan":
        if world.scene.prims[product.sensor].type != "Camera":
            return None
        place = world.machines.place(product.sensor).then(OPTICAL)
        view = View(product.width, product.height, place=_metres(place, world))
        return Message(IMAGES[writer.kind], stamp, writer.frame_id, view)
    return Message("sensor_msgs/msg/LaserScan", stamp, writer.frame_id, _scan(writer, world))


def _metres(place: Affine, world: Any) -> Affine:
    x, y, z = place.origin
    unit = world.scene.meters_per_unit
    return Affine(place.rows, (x * unit, y * unit, z * unit))


def _scan(writer: Writer, world: Any) -> Scan:
    assert writer.beam is not None
    at: Affine = world.machines.place(writer.product.sensor)
    unit = world.scene.meters_per_unit
    beam = Beam(
        writer.beam.start,
        writer.beam.step,
        writer.beam.count,
        writer.beam.near / unit,
        writer.beam.far / unit,
    )
    known, sensor = world.surroundings, writer.product.sensor
    own = [*known.carried(sensor, world.machines), *known.beside(sensor, world.machines)]
    seen = sweep(beam, [*known.around(at), *own])
    ranges = [each if each < 0 else each * unit for each in seen]
    if writer.covered < 1.0:
        first = int((writer.rendered - 1) * writer.covered * beam.count) % beam.count
        shown = {(first + k) % beam.count for k in range(int(writer.covered * beam.count))}
        ranges = [each if k in shown else -1.0 for k, each in enumerate(ranges)]
    start = writer.beam
    return Scan(start.start, start.step, start.near, start.far, tuple(ranges))
