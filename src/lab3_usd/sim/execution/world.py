"""What nodes see while a stage plays: the scene, the robot, the network, the sensors, the time.

A render product has writers, which publish what its sensor sees.
"""

from __future__ import annotations

from typing import Any

from msgspec import Struct, field

from lab3_usd.model.dry_run.scene import Scene
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.ros import Endpoint, Network
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.lidar.rays import Beam
from lab3_usd.sim.lidar.surroundings import Surroundings
from lab3_usd.sim.robot.machines import Machines

LATE = 1.0e9  # seconds: what system time counts from


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


class World(Struct):
    """A stage that plays."""

    scene: Scene
    machines: Machines
    surroundings: Surroundings
    network: Network
    not_simulated: dict[str, str]
    profile: dict[str, Any]  # of a lidar whose own is not there
    assumed: dict[str, str] = field(default_factory=dict)
    products: dict[str, Product] = field(default_factory=dict)
    writers: list[Writer] = field(default_factory=list)
    dt: float = 1.0 / RATE
    frame: int = 0
    session: int = 0
    since_play: float = 0.0
    simulated: float = 0.0

    @property
    def wall(self) -> float:
        """System time."""
        return LATE + self.simulated

    def detach(self, node: Running) -> None:
        """Take the writers of a node off their products."""
        self.writers[:] = [each for each in self.writers if each.node is not node]

    def stop(self) -> None:
        """Put everything back, as on Stop; what counts on does so."""
        self.writers.clear()
        self.machines.reset()
        self.since_play = 0.0
        self.session += 1
        self.network.contexts.clear()


def world_of(scene: Scene, profile: dict[str, Any] | None = None) -> World:
    """Return a scene as it is before it plays."""
    machines = Machines(scene)
    surroundings = Surroundings.of(scene, machines)
    return World(scene, machines, surroundings, Network(""), {}, profile or {})
