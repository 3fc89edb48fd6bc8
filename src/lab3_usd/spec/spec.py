"""What a correct stage is, as data: graph specs, scene requirements and checkpoints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from lab3_usd.spec.catalog import Catalog, NodeType, Value
from lab3_usd.spec.ros_spec import RosSpec, TopicSpec
from lab3_usd.spec.submission_spec import SubmissionSpec


class Setting(Struct, frozen=True):
    """A value that the handout asks for at one input."""

    port: str
    value: Value
    handout: str


class Target(Struct, frozen=True):
    """The prims that one relationship of a node must name, in the order of the handout.

    `handout_prims` are those of the handout where they do not work in a stage and `prims` do.
    """

    port: str
    prims: tuple[str, ...]
    handout: str
    handout_prims: tuple[str, ...] = ()


class NodeSpec(Struct, frozen=True):
    """One node of a graph. `role` names it in the spec; prims may be named otherwise.

    `keep` are the inputs the handout says to leave alone, `grown` the dynamic inputs it adds,
    `frames_from` the relationships that are judged by the TF frames they give. `at` is the
    position in the graph editor, in its own units.
    """

    role: str
    type: NodeType
    at: tuple[float, float]
    handout: str
    settings: tuple[Setting, ...] = ()
    targets: tuple[Target, ...] = ()
    keep: tuple[tuple[str, str], ...] = ()
    grown: tuple[str, ...] = ()
    frames_from: tuple[str, ...] = ()


class PortRef(Struct, frozen=True):
    """A port of a role; `port` is the full name in a file (`inputs:execIn`)."""

    role: str
    port: str

    @property
    def short(self) -> str:
        """`role.port` as the specs write it."""
        return f"{self.role}.{self.port.partition(':')[2]}"


class Wire(Struct, frozen=True):
    """A connection from a source port to the input that it feeds."""

    source: PortRef
    target: PortRef
    handout: str

    def __str__(self) -> str:
        """Write the wire as the specs do."""
        return f"{self.source.short} -> {self.target.short}"


class GraphSpec(Struct, frozen=True):
    """One Action Graph: its path, its nodes by role, its wires in the order of the handout."""

    name: str
    path: str
    handout: str
    nodes: Mapping[str, NodeSpec]
    wires: tuple[Wire, ...]
    optional_wires: tuple[Wire, ...] = ()
    forbidden_wires: tuple[Wire, ...] = ()

    def wires_into(self, role: str) -> Iterator[Wire]:
        """Yield the wires that end at `role`."""
        return (wire for wire in self.wires if wire.target.role == role)


class Checkpoint(Struct, frozen=True):
    """One checkpoint: its number, file name without ending, and everything it must hold.

    `graphs` and `sensors` are cumulative; `new` names the graphs this checkpoint adds.
    """

    id: str
    file: str
    title: str
    part: str
    graphs: tuple[str, ...]
    new: tuple[str, ...]
    sensors: tuple[str, ...]
    new_sensors: tuple[str, ...]
    frames: bool = False
    topics: bool = False
    localization: bool = False


class Policy(Struct, frozen=True):
    """What holds for every graph: inputs that stay at their defaults, topics that may be shared."""

    keep_default: tuple[str, ...]
    namespace: str
    namespace_attribute: str
    stamp_ports: tuple[str, ...]
    stamp_with: str
    tree_topics: tuple[str, ...]
    tick: str


class FrameSpec(Struct, frozen=True):
    """The TF tree: edges as (parent, child), what is forbidden, and what localization adds."""

    handout: str
    edges: tuple[tuple[str, str], ...]
    deeper_under: str
    forbidden_edge: tuple[str, str]
    forbidden_nodes: tuple[str, ...]
    forbidden_handout: str
    localization_edge: tuple[str, str]
    localization_by: str
    localization_from: str
    localization_handout: str
    chain: tuple[str, ...]


class Lab(Struct, frozen=True, eq=False):
    """Everything that `graphs/` says, loaded once.

    `scene` is the scene file as plain, checked data; `ros` what the running system must show,
    `submission` what is handed in.
    """

    folder: Path
    catalog: Catalog
    graphs: Mapping[str, GraphSpec]
    checkpoints: Mapping[str, Checkpoint]
    policy: Policy
    frames: FrameSpec
    ros: RosSpec
    submission: SubmissionSpec
    scene: Mapping[str, Any] = field(default_factory=dict)

    @property
    def topics(self) -> Mapping[str, TopicSpec]:
        """The topics of the running system by name, with their message types and QoS."""
        return self.ros.topics
