"""What the running ROS 2 system must show, and what localization and navigation need, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal

from msgspec import Struct

_FROM = {"since": "from"}  # which Python keeps for itself
FROM_THE_FIRST = ""  # what names no checkpoint holds from the first on


class MapFacts(Struct, frozen=True, forbid_unknown_fields=True):
    """The map of the lab; `origin` is its lower left corner in metres, and its turn."""

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
        """X of the lower left corner, which topics of a lab name (`map_fields`)."""
        return self.origin[0]

    @property
    def origin_y(self) -> float:
        """Y of the lower left corner."""
        return self.origin[1]


class TopicSpec(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """A topic of the running system.

    `rate` is the section that asks for a rate above zero. `fields` are the frames of a message,
    `content` other values of it, `map_fields` those that repeat facts of the map. Of the fields of
    `time` one is above 0; those of `circle` are the first and the last angle of a whole circle, and
    of the numbers in the fields of `measured` one is above 0. `source` says how to start a
    publisher that is no graph. A publisher of a `subscribed` topic is outside the stage.
    """

    name: str
    type: str
    handout: str
    since: str = FROM_THE_FIRST
    durability: Literal["volatile", "transient_local"] | None = None
    rate: str | None = None
    publishers: int | None = None
    fields: Mapping[str, str] | None = None
    map_fields: Mapping[str, str] | None = None
    content: Mapping[str, str | int] = {}
    time: tuple[str, ...] = ()
    circle: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()
    source: str | None = None
    optional: bool = False
    subscribed: bool = False


class HandoutReference(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """A section of the handout, and its first checkpoint."""

    handout: str
    since: str = FROM_THE_FIRST


class EvidenceKind(Struct, frozen=True, forbid_unknown_fields=True):
    """A kind of command: its words, its output file, its time limit.

    With an option of `narrowed_by` the output is not judged.
    """

    name: str
    run: str
    file: str
    seconds: int
    narrowed_by: tuple[str, ...] = ()


class Command(Struct, frozen=True, forbid_unknown_fields=True, rename=_FROM):
    """A diagnostic command; the handout does not ask for `extra` ones."""

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
    """A navigation goal: its topics, status numbers and log lines.

    `names` are the names of the status numbers, from 0.
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
    """Nav2's names of the parameters that are judged."""

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


class PluginList(Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter of some nodes that names plugins, each with a `plugin` in a block of its name.

    The node itself knows those of the lists `known`.
    """

    nodes: tuple[str, ...]
    name: str
    known: tuple[tuple[str, ...], ...] = ()


class ParameterDemand(Struct, frozen=True, forbid_unknown_fields=True):
    """What parameters of these last names must be in some nodes, and what happens if they are not.

    `nodes` are all where none is named. Each number of a list is meant; `ends_above` means the
    first and the last. `like` names the value here that a topic must be, `at_most_of` a parameter
    of the same node, `unless` one that counts instead if it is not empty. With `unset`, the default
    of the node is wrong, too.
    """

    names: tuple[str, ...]
    effect: str
    source: str
    nodes: tuple[str, ...] = ()
    above: float | None = None
    below: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    ends_above: float | None = None
    never: float | None = None
    equals: bool | None = None
    like: Literal["", "map_topic", "odom_topic"] = ""
    at_most_of: str = ""
    unless: str = ""
    unset: bool = False


class NavigationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Nav2's parameters, in metres, radians and seconds.

    `behaviors` are plugins by name, `rviz` topics by display, `timed` nodes with a clock of their
    own; `types` lists the last names of parameters by type, `plugins` all of the distribution, and
    `former_plugins` gives those of earlier ones by their names there. `scan_height` is that of the
    lidar above the ground.
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
    former_plugins: Mapping[str, str] = {}
    plugin_lists: tuple[PluginList, ...] = ()
    demands: tuple[ParameterDemand, ...] = ()
    scan_height: float = 0.0


class SystemSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The software; `packages` maps ROS packages to their usual names.

    `topics` exist in every ROS 2 system.
    """

    handout: str
    distribution: str
    setup: str
    domain: int
    folder: str
    topics: tuple[str, ...]
    packages: Mapping[str, str]


class LifecycleSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Lifecycle nodes, and their required state."""

    state: str
    nodes: Mapping[str, HandoutReference]


class ForbiddenNodes(Struct, frozen=True, forbid_unknown_fields=True):
    """Ends of the names of nodes that must not run."""

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


@lru_cache(maxsize=1024)
def file_word(name: str) -> str:
    """Write a topic, node or pair of frames as part of a file name (`camera_image_raw`)."""
    return "_".join("".join(c if c.isalnum() else " " for c in name).split())
