"""What the running ROS 2 system must show, and what localization and navigation need, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec import Struct

_FROM = {"since": "from"}  # which Python keeps for itself
FROM_THE_FIRST = ""  # what names no checkpoint holds from the first on


class MapFacts(Struct, frozen=True, forbid_unknown_fields=True):
    """The map that the handout asks for; lengths in metres, the size in cells."""

    yaml: str
    image: str
    mode: str
    resolution: float
    origin: tuple[float, float, float]
    negate: int
    occupied_thresh: float
    free_thresh: float
    width: int
    height: int
    handout: str

    @property
    def origin_x(self) -> float:
        """X of the lower left corner, in metres."""
        return self.origin[0]

    @property
    def origin_y(self) -> float:
        """Y of the lower left corner, in metres."""
        return self.origin[1]


class TopicSpec(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """A topic of the running system; None where the handout asks for nothing.

    `rate` is the section that asks for a rate above zero, `fields` what one message must say,
    `map_fields` the fields that repeat facts of the map. `source` says how to make it exist, where
    no graph publishes it; `subscribed`: the lab listens to it, and a publisher comes and goes.
    """

    name: str
    type: str
    handout: str
    since: str = FROM_THE_FIRST
    durability: str | None = None
    rate: str | None = None
    publishers: int | None = None
    fields: Mapping[str, str] | None = None
    map_fields: Mapping[str, str] | None = None
    source: str | None = None
    optional: bool = False
    subscribed: bool = False


class HandoutReference(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """Where the handout asks for something, and from which checkpoint on."""

    handout: str
    since: str = FROM_THE_FIRST


class EvidenceKind(Struct, frozen=True, forbid_unknown_fields=True):
    """One kind of diagnostic command: its words, the name of its output, its limit in seconds.

    Options of `narrowed_by` make it print something else than is read here.
    """

    name: str
    run: str
    file: str
    seconds: int
    narrowed_by: tuple[str, ...] = ()


class Command(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """One diagnostic command; `extra` ones are recorded although the handout does not ask."""

    kind: EvidenceKind
    handout: str
    since: str = FROM_THE_FIRST
    of: str = ""
    to: str = ""
    extra: bool = False

    @property
    def line(self) -> str:
        """The command as one types it."""
        return self.kind.run.format(of=self.of, to=self.to)

    @property
    def file(self) -> str:
        """The fixed name of the saved output."""
        return self.kind.file.format(name=file_word(f"{self.of} {self.to}"))

    @property
    def target(self) -> str:
        """What the command is about: a topic, a node, or two frames; empty when about all."""
        return f"{self.of} {self.to}".strip()


class GoalSpec(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """How a navigation goal shows: its topics, and what its status numbers and log lines mean.

    `names` are the names of the status numbers from 0 on.
    """

    handout: str
    status: str
    pose: str
    robot: str
    running: tuple[int, ...]
    succeeded: int
    names: tuple[str, ...]
    log: Mapping[str, str]
    since: str = FROM_THE_FIRST

    def name(self, status: int) -> str:
        """Name a status number; a number that has no name stands for itself."""
        return self.names[status] if 0 <= status < len(self.names) else str(status)


class ParameterNames(Struct, frozen=True, forbid_unknown_fields=True):
    """The names by which Nav2 calls the parameters that are judged."""

    sim_time: str
    base_frame: tuple[str, ...]
    scan: tuple[str, ...]
    map: tuple[str, ...]
    sources: str
    linear: tuple[str, ...]
    angular: tuple[str, ...]
    speeds: tuple[str, ...]
    stamped: str
    plugin: tuple[str, ...]
    rewritten: tuple[str, ...]
    laser: str


class FrameParameter(Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter of a Nav2 node that names a TF frame."""

    node: str
    name: str
    frame: str


class NavigationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """What Nav2 is told; metres, metres and radians per second, and per second squared.

    `behaviors` are plugins by name, `rviz` topics by display.
    `timed` are the nodes whose clock their own parameters decide, `types` the parameters' last
    names by what they are declared as, `plugins` all that the distribution has.
    """

    handout: str
    scan_topic: str
    wrong_scan_topic: str
    map_topic: str
    velocity_topic: str
    odom_topic: str
    robot_radius: float
    linear_speed: float
    angular_speed: float
    linear_acceleration: float
    angular_acceleration: float
    lidar_size: float
    parameters: ParameterNames
    frames: tuple[FrameParameter, ...]
    timed: tuple[str, ...]
    types: Mapping[str, Sequence[str]]
    plugins: tuple[str, ...]
    planner: str
    behaviors: Mapping[str, str]
    rviz: Mapping[str, str]


class SystemSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The software of 4.1 and where it lies; `packages` maps ROS packages to their usual names.

    `topics` are those that every ROS 2 system has.
    """

    handout: str
    distribution: str
    setup: str
    domain: int
    folder: str
    topics: tuple[str, ...]
    packages: Mapping[str, str]


class LifecycleSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The lifecycle nodes, and the state in which they must be."""

    state: str
    nodes: Mapping[str, HandoutReference]


class ForbiddenNodes(Struct, frozen=True, forbid_unknown_fields=True):
    """How the names of nodes end that must not run."""

    endings: tuple[str, ...]
    handout: str


class RosSpec(Struct, frozen=True):
    """Everything that `ros.yaml` says."""

    system: SystemSpec
    topics: Mapping[str, TopicSpec]
    lifecycle: LifecycleSpec
    nodes: Mapping[str, HandoutReference]
    forbidden_nodes: ForbiddenNodes
    goal: GoalSpec | None
    kinds: Mapping[str, EvidenceKind]
    commands: tuple[Command, ...]
    navigation: NavigationSpec | None


def file_word(name: str) -> str:
    """Write a topic, node or pair of frames as part of a file name (`camera_image_raw`)."""
    return "_".join("".join(c if c.isalnum() else " " for c in name).split())
