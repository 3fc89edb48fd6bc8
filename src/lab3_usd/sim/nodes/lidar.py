"""The lidar helper. RN is ROS 2 nodes."""

from __future__ import annotations

import math

from msgspec.structs import replace

from lab3_usd.model.dry_run.scene import Prim
from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import Product, World
from lab3_usd.sim.lidar.rays import Beam
from lab3_usd.sim.nodes.products import attach, product_of

CORE = "omni:sensor:Core:"
RATE = "omni:sensor:tickRate"
LIDAR_API = "OmniSensorGenericLidarCoreAPI"
LIDAR_RATE = 10.0  # of the schema (test_lidar.py:68, 107)
MOST = 100_000  # rays of a turn that are played
KINDS = ("laser_scan", "point_cloud")


@computes("ROS2RtxLidarHelper")
def lidar_helper(node: Running, world: World) -> bool:
    """RN/python/nodes/OgnROS2RtxLidarHelper.py:93-360."""
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    prim = _with_profile(world.scene.prims[product.sensor], world)
    if prim.type != "OmniLidar":
        return node.fails(f"{prim.path} is no lidar", "L03")
    if LIDAR_API not in prim.apis:
        return node.fails(f"{prim.path} has no lidar schema", "L06")
    return _publish(node, world, prim, product)


def _publish(node: Running, world: World, prim: Prim, product: Product) -> bool:
    kind, beam = node.text("type", world), _beam(prim)
    if kind not in KINDS:
        return node.fails(f"it publishes no {kind or 'type'}", "P01")
    if kind == KINDS[0] and beam is None:
        return node.fails(f"{prim.path} has no rate, no emitter, or too many rays", "L09")
    rate = prim.values.get(RATE)
    rate = LIDAR_RATE if rate is None else float(rate)
    writer = attach(node, world, product, f"lidar {kind}", rate)
    if writer is None:
        return False
    turns = float(prim.values.get(f"{CORE}scanRateBaseHz") or 0)
    writer.beam = beam
    if rate > 0 and not prim.values.get(f"{CORE}accumulateOutputs"):
        writer.covered = min(1.0, turns / rate)
    return True


def _with_profile(prim: Prim, world: World) -> Prim:
    """Return a lidar; one whose asset cannot be found gets the profile that is to be assumed."""
    missing = world.scene.missing.get(prim.path)
    if missing is None or prim.type != "OmniLidar":
        return prim
    world.assumed[prim.path] = f"{missing} cannot be found; a plain 2D profile is assumed"
    return replace(prim, values={**world.profile, **prim.values}, apis=prim.apis | {LIDAR_API})


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
    if firings / turns > MOST:
        return None
    step = 2 * math.pi * turns / firings
    return Beam(-math.pi, step, int(firings / turns), number("nearRangeM"), number("farRangeM"))
