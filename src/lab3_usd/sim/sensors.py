"""Render products, and the writers that publish what a sensor sees."""

from __future__ import annotations

from msgspec import Struct, field

from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.lidar.rays import Beam
from lab3_usd.sim.ros import Endpoint


class Product(Struct, frozen=True):
    """A render product: its sensor and its size."""

    sensor: str
    width: int
    height: int


class Writer(Struct):
    """What publishes the pictures of a product, by itself until Stop."""

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
