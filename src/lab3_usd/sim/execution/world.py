"""The world that nodes read and write while a stage plays: time, bodies, sensors, network.

The scene, the robot, the ROS network, the sensors, the time.

A render product has writers, which publish what its sensor sees.
"""

from __future__ import annotations

import re
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.facts.domains import LAST_DOMAIN
from lab3_usd.facts.endpoints import read_profile
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import Scene
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.qos import Direction, Qos
from lab3_usd.model.transforms import Vector
from lab3_usd.physics.machines import Machines
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.node_instance import NodeInstance
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.lidar import Beam, Surroundings

SUBSCRIBER = "subscriber"
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
NOT_OPENED: tuple[FaultKind, ...] = (
    "invalid-context", "invalid-qos-profile", "invalid-topic-name",
)  # fmt: skip
DEFAULT_CONTEXT = 0
# Of static transforms, whatever their node says.
STATIC = Qos(depth=1, durability="transient_local")
Twist = tuple[Vector, Vector]  # linear and angular velocity


class RosEndpoint(Struct, frozen=True):
    """A publisher or subscriber: its domain and the full name of its topic."""

    domain: int
    topic: str
    profile: Qos = Qos()


class Network(Struct):
    """The simulated DDS network: incoming commands, outgoing messages."""

    environment: str  # ROS_DOMAIN_ID of the process
    contexts: dict[int, int] = field(default_factory=dict)  # domain by handle
    sent: list[Message] = field(default_factory=list)
    commands: RosEndpoint = RosEndpoint(0, "")  # where commands come
    is_open: bool = False  # whether they come elsewhere as well, as on a network with others
    count: int = 0  # of all commands
    # The last command, with its number, by domain and topic.
    inbox: dict[tuple[int, str], tuple[int, Any]] = field(default_factory=dict)

    def tell(self, command: Any, at: tuple[int, str] | None = None) -> None:
        """Let a command come in a domain on a topic, by default where commands do.

        It is in metres and radians a second, or says where joints are to go.
        """
        self.count += 1
        self.inbox[at or (self.commands.domain, self.commands.topic)] = (self.count, command)

    def heard(self, endpoint: RosEndpoint) -> tuple[int, Any]:
        """Return the number of the last command for a subscriber, and the command."""
        return self.inbox.get((endpoint.domain, endpoint.topic), (0, None))

    def domain(self, handle: int) -> int | None:
        """Return the domain of a context; None where the handle means nothing."""
        if handle == DEFAULT_CONTEXT:
            return domain_number(self.environment) or 0
        return self.contexts.get(handle)


def domain_number(text: str) -> int | None:
    """Return a domain that is written as a number."""
    return int(text) if text.isdecimal() else None


def trimmed(name: str) -> str:
    """Strip what is neither letter nor digit from both ends (Ros2Node.h:304-325)."""
    return re.sub(r"^[^A-Za-z0-9]+|[^A-Za-z0-9]+$", "", name)


def namespace_of(node: NodeInstance, world: World, start: str = "") -> str:
    """Return the namespace of a node (Ros2Node.h:227-275); TF publishers take the outermost.

    Sensor helpers begin at their sensor instead of at themselves.
    """
    ros = world.platform.ros
    given = node.text(ros.namespace, world)
    if given:
        return given
    names = [] if start else [node.node.namespace]
    above = world.scene.above(start or node.path)
    names += [str(prim.values.get(ros.namespace_attribute) or "") for prim in above]
    names = [name for name in reversed(names) if name]
    outermost = node.type.tf is not None
    return names[0] if outermost and names else "/".join(names)


def open_endpoint(
    node: NodeInstance, world: World, start: str = "", port: str = ""
) -> RosEndpoint | None:
    """Open a publisher or subscriber as its inputs say now, or return None where it fails.

    `port` names the topic; without one it is the first of the type.
    """
    domain = world.network.domain(node.whole("context", world))
    space = trimmed(namespace_of(node, world, start))  # Ros2Node.h:139
    name = node.text(port or node.type.topics[0].removeprefix(INPUT), world)
    topic = f"{'/' + space if space else ''}/{trimmed(name)}" if name else ""
    # A static publisher does not read its profile (RN/nodes/OgnROS2PublishTransformTree.cpp:167).
    is_static = node.flag("staticPublisher", world)
    text = "" if is_static else node.text("qosProfile", world)
    direction: Direction = "subscribes" if SUBSCRIBER in node.type.role else "publishes"
    profile = profile_of(text, node.whole("queueSize", world), direction)
    if domain is None:
        node.fails("its context is invalid", "invalid-context")
    elif domain > LAST_DOMAIN:
        node.fails(f"ROS 2 has no domain {domain}", "invalid-context")
    elif node.unknown_name:
        node.fails(f"what gives its {node.unknown_name} is not simulated", "invalid-topic-name")
    elif profile is None:
        node.fails("its QoS profile is invalid", "invalid-qos-profile")
    elif _NAME.fullmatch(topic) is None:
        node.fails(f"{topic or 'an empty name'} is not a topic", "invalid-topic-name")
    else:
        return RosEndpoint(domain, topic, profile)
    return None


def profile_of(text: str, queue_size: int, direction: Direction = "publishes") -> Qos | None:
    """Return the profile of `qosProfile`, which is JSON, or None where it is none (Ros2QoS.h).

    Of a policy `unknown` ROS 2 makes no endpoint.
    """
    if not text:
        return Qos(depth=queue_size or Qos().depth)
    profile = read_profile(text)
    if profile is None or not profile.is_known:
        return None
    return replace(profile.opened(direction), depth=profile.depth or 1)


def opened_endpoint(node: NodeInstance, world: World) -> tuple[RosEndpoint | None, bool]:
    """Return the endpoint of a publisher, and whether it was there before this compute.

    The first compute only opens it (OgnROS2PublishClock.cpp:40-90).
    """
    endpoint: RosEndpoint | None = node.memory.get("endpoint")
    if endpoint is not None:
        return endpoint, True
    node.memory["endpoint"] = endpoint = open_endpoint(node, world)
    return endpoint, False


def send(node: NodeInstance, world: World, endpoint: RosEndpoint, message: Message) -> None:
    """Hand a message to the network."""
    if endpoint.domain != world.network.commands.domain:
        message.away = endpoint.domain
    message.topic, message.node = endpoint.topic, node.path
    message.profile = STATIC if message.static else endpoint.profile
    message.session, message.at = world.session, world.since_play
    world.network.sent.append(message)


LATE = 1.0e9  # seconds: what system time counts from


class Product(Struct, frozen=True):
    """A render product: its sensor and its size."""

    sensor: str
    width: int
    height: int


class Writer(Struct):
    """A writer of Replicator: publishes the pictures of a product until Stop."""

    node: NodeInstance
    endpoint: RosEndpoint
    product: Product
    rate: float  # 0 is every frame
    skip: int
    frame_id: str
    clock: str  # which time stamps it
    kind: str
    beam: Beam | None = None
    covered: float = 1.0  # the part of a turn that one picture shows
    turns: float = 0.0  # of a lidar, a second
    rendered: int = 0
    due: float = 0.0
    matrix: tuple[float, ...] = field(default_factory=tuple)


class World(Struct):
    """A stage that plays."""

    scene: Scene
    platform: Platform
    machines: Machines
    surroundings: Surroundings
    network: Network
    not_simulated: dict[str, str]
    profile: dict[str, Any]  # of a lidar whose own is not there
    assumed: dict[str, str] = field(default_factory=dict)
    # By node why it sends something else, by check why it shows nothing, "" for all checks.
    unplayed: dict[str, str] = field(default_factory=dict)
    # What motion controllers give for 1 m/s ahead and to the left and for 1 rad/s, by their paths.
    gives: dict[str, tuple[Vector, ...]] = field(default_factory=dict)
    products: dict[str, Product] = field(default_factory=dict)
    writers: list[Writer] = field(default_factory=list)
    dt: float = 1.0 / RATE
    frame: int = 0
    reading: int = 0  # grows when what nodes without execution inputs gave is out of date
    session: int = 0
    stopped_by: str = ""  # the node that stopped the timeline in this session
    since_play: float = 0.0
    simulated: float = 0.0

    @property
    def wall(self) -> float:
        """System time."""
        return LATE + self.simulated

    def detach(self, node: NodeInstance) -> None:
        """Take the writers of a node off their products."""
        self.writers[:] = [writer for writer in self.writers if writer.node is not node]

    def stop(self) -> None:
        """Put everything back, as on Stop; what counts on does so."""
        self.writers.clear()
        self.machines.reset()
        self.since_play = 0.0
        self.stopped_by = ""
        self.session += 1
        self.network.contexts.clear()


class Standing(Struct, frozen=True):
    """What stands on a stage, which plays of it, one after another, have in common."""

    machines: Machines
    surroundings: Surroundings


def standing_of(scene: Scene, *, has_ground: bool = False) -> Standing:
    """Return what stands on a stage, if asked for with ground below robots that have none."""
    machines = Machines(scene, has_ground=has_ground)
    return Standing(machines, Surroundings.of(scene, machines))


def world_of(
    scene: Scene,
    platform: Platform,
    profile: dict[str, Any] | None = None,
    *,
    has_ground: bool = False,
    standing: Standing | None = None,
) -> World:
    """Return a scene before it plays; what stands there may be that of a play that is over."""
    there = standing or standing_of(scene, has_ground=has_ground)
    there.machines.reset()
    machines, around = there.machines, there.surroundings
    return World(scene, platform, machines, around, Network(""), {}, profile or {})
