"""Render products. CN is core nodes.

A helper attaches a writer to a product; from then on the writer publishes by itself, at the rate
of the sensor, until Stop.
"""

from __future__ import annotations

from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.ros import open_endpoint
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import Product, World, Writer


@computes("OgnIsaacRunOneSimulationFrame")
def run_one_frame(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacRunOneSimulationFrame.cpp:35-45."""
    del world
    if not node.memory.get("done"):
        node.memory["done"] = True
        node.enabled.append("step")
    return True


@computes("IsaacCreateRenderProduct")
def create_render_product(node: Running, world: World) -> bool:
    """CN/python/nodes/OgnIsaacCreateRenderProduct.py:77-160."""
    targets = node.targets("cameraPrim")
    if not node.flag("enabled", world):
        return node.fails("it is switched off", "P01")
    if not targets or targets[0] not in world.scene.prims:
        return node.fails("its camera prim is not there", "R02" if targets else "R01")
    width, height = (int(node.number(each, world)) for each in ("width", "height"))
    if width <= 0 or height <= 0:
        return node.fails("its picture has no size", "P01")
    product = Product(targets[0], width, height)
    name = next((name for name, each in world.products.items() if each == product), "")
    name = name or node.memory.get("path") or f"/Render/Product{len(world.products)}"
    world.products[name] = product
    node.memory["path"] = name
    node.outputs["renderProductPath"] = name
    node.enabled.append("execOut")
    return True


def product_of(node: Running, world: World) -> Product | None:
    """Return the product of a helper that is on and not yet at work."""
    if not node.flag("enabled", world):
        world.detach(node)
        node.memory.clear()
        node.fails("it is switched off", "P01")
        return None
    if node.memory.get("attached"):
        return None
    product = world.products.get(node.text("renderProductPath", world))
    if product is None:
        node.fails("no render product reaches it", "W01")
    return product


def attach(node: Running, world: World, product: Product, kind: str, rate: float) -> Writer | None:
    """Make a writer publish a product from now on, or return None where it cannot."""
    endpoint = open_endpoint(node, world, start=product.sensor)
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
        int(node.number("frameSkipCount", world)),
        node.text("frameId", world),
        clock,
        kind,
    )
    world.writers.append(writer)
    return writer
