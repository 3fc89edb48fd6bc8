"""Image and camera info. RN is ROS 2 nodes."""

from __future__ import annotations

from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import Product, World
from lab3_usd.sim.nodes.lidar import RATE
from lab3_usd.sim.nodes.products import attach, product_of

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


@computes("ROS2CameraHelper")
def camera_helper(node: Running, world: World) -> bool:
    """RN/python/nodes/OgnROS2CameraHelper.py:200-340."""
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    kind = node.text("type", world)
    if kind not in IMAGES:
        if kind in SEMANTIC:
            world.not_simulated[node.path] = f"camera type {kind}"
        return node.fails(f"it publishes no {kind or 'type'}", "P01")
    writer = attach(node, world, product, kind, _camera_rate(world, product))
    return writer is not None


def _camera_rate(world: World, product: Product) -> float:
    prim = world.scene.prims[product.sensor]
    return float(prim.values.get(RATE) or 0.0) if "OmniSensorAPI" in prim.apis else 0.0


@computes("ROS2CameraInfoHelper")
def camera_info_helper(node: Running, world: World) -> bool:
    """RN/python/nodes/OgnROS2CameraInfoHelper.py:283-460: the lens is read once."""
    product = product_of(node, world)
    if product is None:
        return bool(node.memory)
    prim = world.scene.prims[product.sensor]
    if prim.type != "Camera":
        return node.fails(f"{prim.path} is no camera", "C03")
    writer = attach(node, world, product, "info", _camera_rate(world, product))
    if writer is None:
        return False
    wide, tall = product.width, product.height
    focal = float(prim.values["focalLength"])
    aperture = float(prim.values["horizontalAperture"])
    fx = wide * focal / aperture if aperture else 0.0
    writer.matrix = (fx, 0.0, wide / 2, 0.0, fx, tall / 2, 0.0, 0.0, 1.0)
    return True
