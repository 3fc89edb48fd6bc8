"""Render products, camera and lidar helpers. CN is core nodes, RN ROS 2 nodes.

A helper attaches a writer to a product; from then on the writer publishes by itself, at the rate
of the sensor, until Stop.
"""

from __future__ import annotations

import math

from msgspec.structs import replace

from lab3_usd.facts.sensor_faults import known_faults
from lab3_usd.facts.sensor_values import SensorValues, entry_count, listed_entries, sensor_values
from lab3_usd.isaac.behaviour import SensorOf
from lab3_usd.isaac.sensor_models import LidarNames
from lab3_usd.model.dry_run import RENDER_PRODUCT, ScenePrim
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.physics import numbers
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.world import Product, World, Writer, open_endpoint
from lab3_usd.sim.lidar import Beam

RESOLUTION = "resolution"
_PRODUCT_SIZE = (2048, 1080)  # of UsdRender's schema


@computes("OgnIsaacRunOneSimulationFrame")
def run_one_frame(node: NodeInstance, _: World) -> bool:
    """CN/nodes/OgnIsaacRunOneSimulationFrame.cpp:35-45."""
    if not node.memory.get("done"):
        node.memory["done"] = True
        node.enabled.append("step")
    return True


@computes("IsaacCreateRenderProduct")
def create_render_product(node: NodeInstance, world: World) -> bool:
    """CN/python/nodes/OgnIsaacCreateRenderProduct.py:77-160."""
    camera = node.target("cameraPrim")
    if not node.flag("enabled", world):
        return node.fails("it is disabled", "switched-off")
    if camera not in world.scene.prims:
        kind: FaultKind = "missing-camera-prim" if camera else "no-camera-target"
        return node.fails("its camera prim does not exist", kind)
    width, height = (node.whole(name, world) for name in ("width", "height"))
    product = Product(camera, width, height)
    named = node.targets("renderProductPrim")
    prim = world.scene.prims.get(named[0]) if len(named) == 1 else None
    if prim is not None:  # it is used as it is, whatever it shows (:113-142)
        shown = _product_at(prim, world)
        if shown is None:
            return node.fails(f"{prim.path} shows no camera", "wrong-render-product")
        product = shown
    if product.width <= 0 or product.height <= 0:
        return node.fails("its picture has no size", "empty-image")
    name = next((name for name, rendered in world.products.items() if rendered == product), "")
    name = name or node.memory.get("path") or f"/Render/Product{len(world.products)}"
    world.products[name] = product
    node.memory["path"] = name
    node.outputs["renderProductPath"] = name
    return node.goes_on()


def product_of(node: NodeInstance, world: World) -> Product | None:
    """Return the product of a helper that is on and not yet at work."""
    if not node.flag("enabled", world):
        world.detach(node)
        node.memory.clear()
        node.fails("it is disabled", "switched-off")
        return None
    if node.memory.get("attached"):
        return None
    path = node.text("renderProductPath", world)
    prim = world.scene.prims.get(path)
    product = world.products.get(path) or (None if prim is None else _product_at(prim, world))
    if product is None and prim is None and path and world.platform.graph.ignores(path):
        world.not_simulated[node.path] = f"what the application makes at {path}"
    if product is None:
        node.fails("no render product reaches it", "no-render-product")
    return product


def _product_at(prim: ScenePrim, world: World) -> Product | None:
    """Return what a prim shows that is a render product of the stage, None for another one."""
    camera, pixels = next(iter(prim.targets.get("camera", ())), ""), prim.values.get(RESOLUTION)
    if prim.type != RENDER_PRODUCT or camera not in world.scene.prims:
        return None
    width, height = pixels if isinstance(pixels, tuple) and len(pixels) == 2 else _PRODUCT_SIZE  # noqa: PLR2004
    return Product(camera, width, height)


def attach(
    node: NodeInstance, world: World, product: Product, kind: str, rate: float, side: str = ""
) -> Writer | None:
    """Make a writer publish a product from now on, or return None where it cannot.

    `side` ends the names of the inputs for its topic and its frame (`Right`).
    """
    endpoint = open_endpoint(node, world, product.sensor, f"topicName{side}")
    node.memory["attached"] = True
    if endpoint is None:
        return None
    clock = "system" if node.flag("useSystemTime", world) else "monotonic"
    if clock == "monotonic" and node.flag("resetSimulationTimeOnStop", world):
        clock = "since play"
    writer = Writer(
        node,
        endpoint,
        product,
        rate,
        max(0, node.whole("frameSkipCount", world)),
        node.text(f"frameId{side}", world),
        clock,
        kind,
    )
    world.writers.append(writer)
    return writer


UNSEEN = ("instance_segmentation", "semantic_segmentation", "bbox_2d_tight", "bbox_2d_loose",
          "bbox_3d")  # fmt: skip


@computes("ROS2CameraHelper")
def camera_helper(node: NodeInstance, world: World) -> bool:
    """RN/python/nodes/OgnROS2CameraHelper.py:200-340."""
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    kind = node.text("type", world)
    if kind not in node.type.message:
        return node.fails(f"it publishes no {kind or 'type'}", "unknown-output")
    if kind in UNSEEN:
        world.not_simulated[node.path] = f"what camera type {kind} shows"
    writer = attach(node, world, product, kind, _camera_rate(world, product))
    return writer is not None


def _camera_rate(world: World, product: Product) -> float:
    prim, models = world.scene.prims[product.sensor], world.platform.sensor_models
    rate = values_in(world, prim).number(models.lidar.rate) if models.is_sensor(prim.apis) else 0.0
    return rate or 0.0


def values_in(world: World, prim: ScenePrim) -> SensorValues:
    """Return the values of a sensor, as written or by schema."""
    return sensor_values(world.platform, prim.apis, prim.values)


@computes("ROS2CameraInfoHelper")
def camera_info_helper(node: NodeInstance, world: World) -> bool:
    """RN/python/nodes/OgnROS2CameraInfoHelper.py:283-515: the lens is read once.

    Of a stereo pair the right one is sent too, on a topic of its own, and neither if their sizes
    differ (:350-354).
    """
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    path = node.text("renderProductPathRight", world)
    right = world.products.get(path)
    if path and right is None:
        return node.fails("the right render product does not reach it", "no-render-product")
    for each in filter(None, (product, right)):
        if world.scene.prims[each.sensor].type != "Camera":
            return node.fails(f"{each.sensor} is not a camera", "not-a-camera")
    if right is not None and _size(product) != _size(right):
        sizes = " and ".join("{} x {}".format(*_size(each)) for each in (product, right))
        return node.fails(f"the images of its pair differ: {sizes}", "image-info-sizes-differ")
    sides = (("", product), ("Right", right))
    return all(_publish_info(node, world, each, side) for side, each in sides if each is not None)


def _size(product: Product) -> tuple[int, int]:
    return product.width, product.height


def _publish_info(node: NodeInstance, world: World, product: Product, side: str) -> bool:
    prim = world.scene.prims[product.sensor]
    writer = attach(node, world, product, "info", _camera_rate(world, product), side)
    if writer is None:
        return False
    wide, tall = product.width, product.height
    focal = float(prim.values["focalLength"])
    aperture = float(prim.values["horizontalAperture"])
    fx = wide * focal / aperture if aperture else 0.0
    writer.matrix = (fx, 0.0, wide / 2, 0.0, fx, tall / 2, 0.0, 0.0, 1.0)
    return True


MOST = 100_000  # rays of a turn that are played
_TURN = 360.0
_WHOLE, _LEVEL = 359.0, 1.0  # degrees of a circle, and above or below it
KINDS = ("laser_scan", "point_cloud")


@computes("ROS2RtxLidarHelper")
def lidar_helper(node: NodeInstance, world: World) -> bool:
    """RN/python/nodes/OgnROS2RtxLidarHelper.py:93-360."""
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    needed = world.platform.sensors[node.type.type]
    prim = _with_profile(world.scene.prims[product.sensor], needed, world)
    if prim.type not in needed.types:
        return node.fails(f"{prim.path} is not a lidar", "not-a-lidar")
    if needed.needs not in prim.apis:
        return node.fails(f"{prim.path} has no lidar schema", "no-lidar-schema")
    return _publish(node, world, prim, product)


def _publish(node: NodeInstance, world: World, prim: ScenePrim, product: Product) -> bool:
    names, values = world.platform.sensor_models.lidar, values_in(world, prim)
    kind, beam = node.text("type", world), _beam(values, names)
    if kind not in KINDS:
        return node.fails(f"it publishes no {kind or 'type'}", "unknown-output")
    is_scan = kind == KINDS[0]
    refused = _refused(world, prim, is_scan=is_scan)
    if refused or (is_scan and beam is None):
        reason = refused or "it has no rate, no emitter, no ray in a turn, or too many"
        return node.fails(f"{prim.path}: {reason}", "invalid-scan-profile")
    rate = values.number(names.rate) or 0.0
    writer = attach(node, world, product, f"lidar {kind}", rate)
    if writer is None:
        return False
    writer.turns = values.number(names.turns) or 0.0
    if is_scan:
        writer.beam = beam
        _note_unplayed(node, world, prim, values)
    if rate > 0 and not values.get(names.whole):
        writer.covered = min(1.0, writer.turns / rate)
    return True


def _refused(world: World, prim: ScenePrim, *, is_scan: bool) -> str:
    """Return why a lidar does not start, '' where it does or a missing asset may say so."""
    is_there = prim.path not in world.scene.missing
    for fault in known_faults(world.platform, values_in(world, prim)):
        if fault.stops(is_scan=is_scan) and (is_there or not fault.is_open):
            return fault.message
    return ""


def _with_profile(prim: ScenePrim, needed: SensorOf, world: World) -> ScenePrim:
    """Return a lidar; what its asset would say is assumed."""
    missing = world.scene.missing.get(prim.path)
    if missing is None or prim.type not in needed.types:
        return prim
    world.assumed[prim.path] = f"{missing} cannot be found; a plain 2D profile is assumed"
    return replace(prim, values={**world.profile, **prim.values}, apis=prim.apis | {needed.needs})


def _note_unplayed(node: NodeInstance, world: World, prim: ScenePrim, values: SensorValues) -> None:
    """Note where the rays of a lidar go elsewhere than those that are played."""
    lidar = world.platform.sensor_models.lidar
    settings = [
        name
        for name, value in values.of_instances(lidar.elevations).items()
        if any(abs(angle) > _LEVEL for angle in numbers(listed_entries(value)))
    ]
    settings += [name for name, usual in lidar.played.items() if values.get(name) not in usual]
    circle = {name: values.number(name) or 0.0 for name in lidar.circle}
    start, end = circle.values()
    if (end - start if end >= start else (end - start) % _TURN) < _WHOLE:
        settings += [name for name, usual in lidar.circle.items() if circle[name] != usual]
    if settings:
        name = settings[0]
        reason = f"{name} is {prim.values.get(name, 'not set, and not level by schema')}"
        world.not_simulated[prim.path] = reason
        world.unplayed[node.path] = f"not simulated: {prim.path}: {reason}"


def _beam(values: SensorValues, names: LidarNames) -> Beam | None:
    """Read the scan (:93-148); without an emitter or a range nothing comes back."""
    turns, firings, near, far = (
        values.number(name) or 0.0 for name in (names.turns, names.firings, names.near, names.far)
    )
    azimuths = next(iter(values.of_instances(names.azimuths).values()), None)
    angles, count = numbers(listed_entries(azimuths)), entry_count(azimuths)
    if not 0 < count <= MOST:
        return None
    if values.get(names.kind) == names.still:  # (:110-118)
        start, end = math.radians(min(angles)), math.radians(max(angles))
        return Beam(start, (end - start) / count or 2 * math.pi, count, near, far)
    if not (0 < turns <= firings < math.inf and firings // turns <= MOST):
        return None
    step = 2 * math.pi * turns / firings
    return Beam(-math.pi, step, int(firings / turns), near, far)
