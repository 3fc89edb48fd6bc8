"""Node types: their ports and defaults, and what a type does with topics and frames."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.isaac.values import Value

INPUT = "inputs:"
OUTPUT = "outputs:"
KIND = "inputs:type"  # which of several messages a node sends
# OmniGraph casts between numbers of one shape by itself; a union takes what it is given.
NUMBERS = ("bool", "uchar", "int", "uint", "int64", "uint64", "half", "float", "double")


class Port(Struct, frozen=True):
    """One port of a node type.

    `name` is the name in a file (`inputs:topicName`); `ogn_type` OGN's own type word; `usd_type`
    how a file declares it (`rel` for a relationship). `default` is the value of a port that
    is not set, None if it has none; `former` is that value in files of an older version of the node
    type, None if it is the same. `accepts` lists the types of a union port, or groups of
    them. One that is `literal_only` is to be set, not wired.
    """

    name: str
    ogn_type: str
    usd_type: str
    default: Value | None = None
    allowed: tuple[str, ...] = ()
    accepts: tuple[str, ...] = ()
    output_only: bool = False
    deprecated: bool = False
    former: Value | None = None
    literal_only: bool = False

    @property
    def short(self) -> str:
        """The name without `inputs:` or `outputs:`, as specs and people write it."""
        return self.name.partition(":")[2]

    @property
    def is_execution(self) -> bool:
        """Whether the port carries a signal instead of data."""
        return self.ogn_type == "execution"

    @property
    def is_target(self) -> bool:
        """Whether the port is a relationship to prims."""
        return self.ogn_type == "target"

    @property
    def is_union(self) -> bool:
        """Whether the port takes the type of what is wired to it."""
        return self.ogn_type in {"union", "any"}

    @property
    def is_source(self) -> bool:
        """Whether a wire may leave from here (an output, or an input drawn as one)."""
        return self.name.startswith(OUTPUT) or self.output_only


def can_connect(source: Port, target: Port) -> bool:
    """Whether a wire can run from `source` to `target`.

    Signals go to signals, targets to targets, unions take any data, other ports their
    own type or a number of the same shape.
    """
    if source.is_execution or target.is_execution:
        return source.is_execution and target.is_execution
    if source.is_target or target.is_target:
        return source.is_target and target.is_target
    types = {source.ogn_type, target.ogn_type}
    if source.is_union or target.is_union or len(types) == 1 or types == {"string", "token"}:
        return True
    source_element, source_shape = _plain(source.ogn_type)
    target_element, target_shape = _plain(target.ogn_type)
    are_numbers = source_element in NUMBERS and target_element in NUMBERS
    return are_numbers and source_shape == target_shape


def _plain(ogn_type: str) -> tuple[str, str]:
    """Split a type as `shape_of`; a timecode is a double in every use."""
    element, shape = shape_of(ogn_type)
    return ("double" if element == "timecode" else element), shape


def shape_of(ogn_type: str) -> tuple[str, str]:
    """Split a type into the name of its element and its shape (`[3]`, `[]`, ...)."""
    base, bracket, rest = ogn_type.partition("[")
    return base, bracket + rest


def differ_in_role(source: Port, target: Port) -> bool:
    """Whether two types hold the same for another purpose, as a vector and three numbers do.

    OmniGraph can compare types without their roles; which wires it takes so, no public source says.
    """
    (one, shape), (other, other_shape) = (without_role(port.ogn_type) for port in (source, target))
    are_numbers = one in NUMBERS and other in NUMBERS
    are_texts = {one, other} <= {"string", "token"}
    return shape == other_shape and (are_numbers or are_texts)


_ROLES = r"(color|normal|point|texcoord|vector|quat|matrix|frame|transform)([dfh]?)"
_PRECISIONS = {"d": "double", "f": "float", "h": "half", "": "double"}


def without_role(ogn_type: str) -> tuple[str, str]:
    """Split a type as `shape_of`, with numbers for a role: `vectord[3]` is `double[3]`."""
    element, shape = shape_of(ogn_type)
    match = re.fullmatch(_ROLES, element)
    if match is None:
        return "string" if element == "path" else element, shape
    if match[1] in {"matrix", "frame", "transform"}:
        rows = int(shape[1])
        shape = f"[{rows * rows}]{shape[3:]}"
    return _PRECISIONS[match[2]], shape


def drops_wire(source: Port, target: Port) -> bool:
    """Whether OmniGraph surely drops a wire from `source` to `target` when it opens a stage."""
    return not can_connect(source, target) and not differ_in_role(source, target)


@lru_cache(maxsize=1024)
def _fits(name: str, pattern: str) -> bool:
    """Whether a port has a name like `inputs:input[0-9]+`, or `outputs:*` for any."""
    return re.fullmatch(pattern.replace("*", ".*"), name) is not None


class NodeType(Struct, frozen=True, dict=True, eq=False):
    """One node type of Isaac Sim; two are the same only when they are one.

    `message` maps the value of the port `type` to a message type; the key '' holds where the
    type has one message only, and `moved` maps former values to the types that have them now. A
    topic of `only_of` is there for these values of that port alone, and one of `other_messages` has
    messages of a type of its own.
    `role` is publisher, subscriber, helper (publishes as well), service, or '' for types that do
    not talk to ROS. `articulation` names the relationships at and below whose prims an articulation
    is looked for; `step_limits` the inputs that must be 0 while the input of `time_step` is;
    `sizes` how long the arrays of some outputs always are. In a stage in metres a node gives what
    comes into its inputs `same_in_metres` as it is. It reads or, with a signal, sets a `variable`:
    the inputs that name it, its graph, and the path of that. It signals at one of two outputs after
    its `choice`. What it makes of values is in `pure_nodes.py`. One that
    `grows_by_message` has its fields as ports, too, and one that `grows` has each port whose name
    fits one of these patterns, in full.
    Of one that `is_open` only some ports are known. What is known of one that `is_documented` is
    from pages of a neighbouring release, which do not say whether signals go on.
    """

    type: str
    version: int
    ui_name: str
    handout_name: str
    prim_name: str
    ports: Mapping[str, Port]
    dynamic: Dynamic | None = None
    role: Literal["", "publisher", "subscriber", "helper", "service"] = ""
    topics: tuple[str, ...] = ()
    only_of: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    other_messages: Mapping[str, str] = field(default_factory=dict)
    services: tuple[str, ...] = ()
    frames: tuple[str, ...] = ()
    message: Mapping[str, str] = field(default_factory=dict)
    moved: Mapping[str, str] = field(default_factory=dict)
    tf: TfPorts | None = None
    articulation: tuple[str, ...] = ()
    time_step: tuple[str, ...] = ()
    step_limits: tuple[str, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)
    drives: DrivePorts | None = None
    lists_joints: JointList | None = None
    product: ProductPorts | None = None
    same_in_metres: tuple[str, ...] = ()
    variable: tuple[str, ...] = ()
    choice: Choice | None = None
    grows_by_message: bool = False
    grows: Mapping[str, Port] = field(default_factory=dict)
    is_open: bool = False
    is_documented: bool = False

    @cached_property
    def execution_inputs(self) -> tuple[str, ...]:
        """The names of the inputs that take signals."""
        signals = (port.name for port in self.ports.values() if port.is_execution)
        return tuple(name for name in signals if name.startswith(INPUT))

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """The outputs that give signals, without `outputs:`."""
        ports = (port for port in self.ports.values() if port.is_execution)
        return tuple(port.short for port in ports if port.name.startswith(OUTPUT))

    def input(self, short: str) -> Port | None:
        """Return the input `short`; a dynamic input that this type can grow counts."""
        return self.ports.get(INPUT + short) or self._grown(short)

    def source(self, short: str) -> Port | None:
        """Return the port a wire named `short` leaves from: an output, or an output-only input."""
        port = self.ports.get(OUTPUT + short) or self.ports.get(INPUT + short)
        return port if port is not None and port.is_source else None

    @property
    def may_have_more(self) -> bool:
        """Whether the type may have ports that are not known."""
        return self.is_open or self.is_documented

    def port(self, name: str) -> Port | None:
        """Return the port with this full name (`inputs:execIn`), dynamic ones included.

        One that is not known comes back as a port for anything, where the type may have more.
        """
        port = self.ports.get(name) or self._made(name)
        return Port(name, "any", "token") if port is None and self.may_have_more else port

    def listed(self, name: str) -> Port | None:
        """Return the port with this full name that the type is known to have."""
        return self.ports.get(name) or self._made(name)

    def _made(self, name: str) -> Port | None:
        """Return a port that only some nodes of the type have."""
        if not (self.grows or self.grows_by_message or self.dynamic):
            return None
        for pattern, grown in self.grows.items():
            if _fits(name, pattern):
                return replace(grown, name=name)
        if self.grows_by_message and ":" in name:
            return Port(name, "any", "token")
        return self._grown(name[len(INPUT) :]) if name.startswith(INPUT) else None

    def is_known_port(self, name: str) -> bool:
        """Whether it is known what goes through the port with this full name."""
        if not self.may_have_more:
            return True
        port = self.listed(name)
        return port is not None and not port.is_union

    def default(self, name: str, version: int | None) -> Value | None:
        """Return what a port without a value means in a file with this version of the type."""
        port = self.ports.get(name) or self.port(name)
        if port is None:
            return None
        if port.former is None or version is None or version >= self.version:
            return port.default
        return port.former

    def _grown(self, short: str) -> Port | None:
        if self.dynamic is None or not short.startswith(self.dynamic.prefix):
            return None
        first = self.ports.get(f"{INPUT}{self.dynamic.prefix}0")
        if first is None or not short.removeprefix(self.dynamic.prefix).isdecimal():
            return None
        return Port(INPUT + short, first.ogn_type, first.usd_type, accepts=first.accepts)


class Dynamic(Struct, frozen=True, forbid_unknown_fields=True):
    """Ports that exist on request: `prefix` + number, as many as `count` says.

    `type` is OGN's word for their type, `metadata` the types that a file lists. The input `array`
    names the type of the array that the node makes of them, or `auto` for that of the first.
    """

    prefix: str
    count: str
    metadata: str
    array: str = ""
    type: str = ""


class Choice(Struct, frozen=True, forbid_unknown_fields=True):
    """Two outputs of which one passes each signal on.

    The first does so while the input `by` is False, the second while it is True.
    """

    by: str
    outputs: tuple[str, str]


class TfPorts(Struct, frozen=True, forbid_unknown_fields=True):
    """The ports of a type that carry TF frames.

    `names`: parent and child frame ids. `arrays`: parents and children by wire. `prims`: parent
    prim and target prims. `gives`: outputs that pass frames on.
    """

    names: tuple[str, ...] = ()
    arrays: tuple[str, ...] = ()
    prims: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()
    static: str | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs by which frames come in."""
        return (*self.names, *self.prims, *self.arrays)


class ProductPorts(Struct, frozen=True, forbid_unknown_fields=True):
    """Which ports of a type make a render product.

    `named` is the prim of a product that is used as it is, where there is one; `camera` and `size`
    make one otherwise.
    """

    named: str
    camera: str
    size: tuple[str, str]


class JointList(Struct, frozen=True, forbid_unknown_fields=True):
    """The output of a type that lists joints of a robot: those with an attribute, in stage order.

    `prim` names the robot, and `path` where the switch `by_path` is on.
    """

    output: str
    prim: str
    path: str
    by_path: str
    attribute: str


class DrivePorts(Struct, frozen=True, forbid_unknown_fields=True):
    """Which ports of a type move joints.

    `robot`: its path, which wins where it is set, and its prim. `joints`: the names of the joints,
    `indices` their numbers, all where both are empty. `commands`: their positions, velocities and
    efforts.
    """

    robot: tuple[str, str]
    joints: str
    indices: str
    commands: tuple[str, str, str]

    @property
    def path(self) -> str:
        """The input with the path of the robot."""
        return self.robot[0]

    @property
    def target(self) -> str:
        """The relationship to the prim of the robot."""
        return self.robot[1]
