"""The catalog of node types.

Ports, defaults, how graphs are saved, and what a type does with topics and frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache
from typing import Any, Literal

from msgspec import Struct, field

from lab3_usd.spec.values import Value, typed_value


class GraphAttribute(Struct, frozen=True):
    """An attribute of a graph prim: how it is saved, and which values are as good.

    `unwritten` is what it means that a file leaves it out, None where it must be there.
    """

    name: str
    usd_type: str
    value: Value
    accepted: tuple[Value, ...] = ()
    required: bool = False
    unwritten: Value | None = None
    handout: str | None = None


class Evaluation(Struct, frozen=True, forbid_unknown_fields=True):
    """The graphs that Isaac Sim evaluates, and the nodes that compute.

    `mode`, `stage` and `evaluator` are attributes of a graph. A graph whose mode is in
    `by_reference` needs a prim whose relationship `reference` names it; one whose stage is in
    `on_demand` needs an event of that stage. With an evaluator of `all_nodes` every node computes,
    otherwise those that a signal reaches.
    """

    mode: str
    reference: str
    stage: str
    evaluator: str
    by_reference: tuple[str, ...]
    on_demand: tuple[str, ...]
    all_nodes: tuple[str, ...]


class GraphForm(Struct, frozen=True):
    """How Isaac Sim saves graph and node prims."""

    type: str
    node_type: str
    gui_api: str
    attributes: tuple[GraphAttribute, ...]
    evaluation: Evaluation
    ignored_below: tuple[str, ...]

    def ignores(self, path: str) -> bool:
        """Whether the application made what stands at this path, for itself."""
        is_near = path.startswith(self.ignored_below)  # which most paths are not
        return is_near and any(f"{path}/".startswith(f"{top}/") for top in self.ignored_below)

    def value(self, name: str) -> Value | None:
        """Return the value with which an Action Graph is saved."""
        return next(
            (attribute.value for attribute in self.attributes if attribute.name == name), None
        )


class _AttributeEntry(Struct, forbid_unknown_fields=True):
    type: str
    value: Any
    accepted: tuple[Any, ...] | None = None
    required: bool = False
    unwritten: Any = None
    handout: str | None = None


class GraphEntry(Struct, forbid_unknown_fields=True):
    """The attributes of a graph."""

    type: str
    node_type: str
    gui_api: str
    attributes: dict[str, _AttributeEntry]
    evaluation: Evaluation
    ignored_below: tuple[str, ...]


def graph_form(entry: GraphEntry, where: str) -> GraphForm:
    """Return the form of graphs.

    Raises:
        SpecError: a value is not of its type; the line opens with `where`.
    """
    attributes = []
    for name, attribute in entry.attributes.items():
        usd_type, place, unwritten = attribute.type, f"{where}: {name}", attribute.unwritten
        accepted = (attribute.value,) if attribute.accepted is None else attribute.accepted
        attributes.append(
            GraphAttribute(
                name=name,
                usd_type=usd_type,
                value=typed_value(attribute.value, usd_type, place),
                accepted=tuple(typed_value(value, usd_type, place) for value in accepted),
                required=attribute.required,
                unwritten=None if unwritten is None else typed_value(unwritten, usd_type, place),
                handout=attribute.handout,
            )
        )
    return GraphForm(
        type=entry.type,
        node_type=entry.node_type,
        gui_api=entry.gui_api,
        attributes=tuple(attributes),
        evaluation=entry.evaluation,
        ignored_below=entry.ignored_below,
    )


INPUT = "inputs:"
OUTPUT = "outputs:"
# OmniGraph casts between numbers of one shape by itself; a union takes what it is given.
NUMBERS = ("bool", "uchar", "int", "uint", "int64", "uint64", "half", "float", "double")


class Port(Struct, frozen=True):
    """One port of a node type.

    `name` is the name in a file (`inputs:topicName`); `ogn_type` OGN's own type word; `usd_type`
    how a file declares it (`rel` for a relationship). `default` is what a port without a value
    means, None where there is none, and `former` what it means in a file of a lower version of the
    node type, None where that is the same. `accepts` lists the types of a union port.
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

    Signals go to signals, relationships are never wired, unions take any data, other ports their
    own type or a number of the same shape.
    """
    if source.is_execution or target.is_execution:
        return source.is_execution and target.is_execution
    if source.is_target or target.is_target:
        return False
    types = {source.ogn_type, target.ogn_type}
    if source.is_union or target.is_union or len(types) == 1 or types == {"string", "token"}:
        return True
    source_element, source_shape = shape_of(source.ogn_type)
    target_element, target_shape = shape_of(target.ogn_type)
    are_numbers = source_element in NUMBERS and target_element in NUMBERS
    return are_numbers and source_shape == target_shape


def shape_of(ogn_type: str) -> tuple[str, str]:
    """Split a type into the name of its element and its shape (`[3]`, `[]`, ...)."""
    base, bracket, rest = ogn_type.partition("[")
    return base, bracket + rest


class NodeType(Struct, frozen=True, dict=True):
    """One node type of Isaac Sim 6.0.1.

    `message` maps the value of the port `type` to a message type; the key '' holds where the
    type has one message only, and `moved` maps former values to the types that have them now. A
    topic of `only_of` is there for these values of that port alone.
    `role` is publisher, subscriber, helper (publishes as well), service, or '' for types that do
    not talk to ROS. `articulation` names the relationships at and below whose prims an articulation
    is looked for; `step_limits` the inputs that must be 0 while the input of `time_step` is;
    `sizes` how long the arrays of some outputs always are. In a stage in metres a node gives what
    comes into its inputs `same_in_metres` as it is. One that `grows_by_message` has its fields as
    ports, too. Of one that `is_open` only some ports are known, and not whether signals go on.
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
    product: ProductPorts | None = None
    same_in_metres: tuple[str, ...] = ()
    grows_by_message: bool = False
    is_open: bool = False

    @cached_property
    def execution_inputs(self) -> tuple[str, ...]:
        """The names of the inputs that take signals."""
        signals = (port.name for port in self.ports.values() if port.is_execution)
        return tuple(name for name in signals if name.startswith(INPUT))

    def input(self, short: str) -> Port | None:
        """Return the input `short`; a dynamic input that this type can grow counts."""
        return self.ports.get(INPUT + short) or self._grown(short)

    def source(self, short: str) -> Port | None:
        """Return the port a wire named `short` leaves from: an output, or an output-only input."""
        port = self.ports.get(OUTPUT + short) or self.ports.get(INPUT + short)
        return port if port is not None and port.is_source else None

    def port(self, name: str) -> Port | None:
        """Return the port with this full name (`inputs:execIn`), dynamic ones included."""
        port = self.ports.get(name)
        if port is not None:
            return port
        if (self.grows_by_message or self.is_open) and ":" in name:
            return Port(name, "any", "token")
        return self._grown(name[len(INPUT) :]) if name.startswith(INPUT) else None

    def is_known_port(self, name: str) -> bool:
        """Whether it is known what goes through the port with this full name."""
        port = self.ports.get(name)
        return not self.is_open or (port is not None and not port.is_union)

    def default(self, name: str, version: int | None) -> Value | None:
        """Return what a port without a value means in a file with this version of the type."""
        port = self.port(name)
        if port is None:
            return None
        is_old = version is not None and version < self.version
        return port.former if is_old and port.former is not None else port.default

    def _grown(self, short: str) -> Port | None:
        if self.dynamic is None or not short.startswith(self.dynamic.prefix):
            return None
        first = self.ports.get(f"{INPUT}{self.dynamic.prefix}0")
        if first is None or not short.removeprefix(self.dynamic.prefix).isdecimal():
            return None
        return Port(INPUT + short, first.ogn_type, first.usd_type, accepts=first.accepts)


@lru_cache(maxsize=1024)
def _is_one_of(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


class Scripts(Struct, frozen=True, forbid_unknown_fields=True):
    """Node types (patterns) and schemas that run code from the file."""

    types: tuple[str, ...]
    apis: tuple[str, ...]

    def runs(self, node_type: str) -> bool:
        """Whether a node of this type runs code that the file holds."""
        return _is_one_of(node_type, self.types)

    def among(self, apis: Iterable[str]) -> str | None:
        """Return the first of these schemas by which a prim runs code, None where there is none."""
        return next((api for api in apis if api in self.apis), None)


class SingleSignal(Struct, frozen=True, forbid_unknown_fields=True):
    """Outputs that signal once, unless a wire reaches `again`."""

    outputs: tuple[str, ...]
    again: str = ""


class WriterPorts(Struct, frozen=True, forbid_unknown_fields=True):
    """The inputs of a type that say what it changes in the scene.

    `prims` are relationships, `paths` texts; `wires` lead to the node whose work is changed.
    `property` is what is written, '' for the prims themselves. A prim without one of the `schemas`
    does not change.
    """

    prims: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    wires: tuple[str, ...] = ()
    property: str = ""
    schemas: tuple[str, ...] = ()


class Catalog(Struct, frozen=True):
    """Every node type the lab knows, by its name in 6.0.1, and the names that mean another.

    `events` maps each type that starts an execution by itself to the pipeline stage of the graphs
    in which it does, '' where a stage does not tell whether it will; `deltas` name their outputs
    that give the length of a step. `once` are the types with
    outputs that signal a single time after Play, `gates` those that pass no signal on while the
    input named there is 0. Below `world_frame` hangs what has no parent prim. `writers` change the
    scene; what begins with one of the `looks` is a property that only changes what one sees.
    """

    types: Mapping[str, NodeType]
    graph: GraphForm
    prefixes: Mapping[str, str]
    renamed: Mapping[str, str]
    lookalikes: Mapping[str, str]
    events: Mapping[str, str]
    deltas: Mapping[str, str]
    once: Mapping[str, SingleSignal]
    gates: Mapping[str, str]
    scripts: Scripts
    world_frame: str
    writers: Mapping[str, WriterPorts] = field(default_factory=dict)
    looks: tuple[str, ...] = ()

    def modern(self, name: str) -> str:
        """Return the 6.0.1 name of a type saved before 4.5; other names come back unchanged."""
        if name in self.renamed:
            return self.renamed[name]
        prefix, _, rest = name.rpartition(".")
        return f"{self.prefixes[prefix]}.{rest}" if prefix in self.prefixes else name

    def get(self, name: str) -> NodeType | None:
        """Return the type that a file's `node:type` means, old names included."""
        return self.types.get(name) or self.types.get(self.modern(name))


class Dynamic(Struct, frozen=True, forbid_unknown_fields=True):
    """Ports that exist on request: `prefix` + number, as many as `count` says.

    `type` is OGN's word for their type, `metadata` the types that a file lists.
    """

    prefix: str
    count: str
    metadata: str
    type: str = ""


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


class ProductPorts(Struct, frozen=True):
    """Which ports of a type make a render product.

    `named` is the prim of a product that is used as it is, where there is one; `camera` and `size`
    make one otherwise.
    """

    named: str
    camera: str
    size: tuple[str, str]


class DrivePorts(Struct, frozen=True):
    """Which ports of a type move joints.

    `path` names the robot and wins where it is set, `target` is its prim otherwise. `joints`: the
    names of the joints, `indices` their numbers, all where both are empty. `commands`: their
    commands.
    """

    path: str
    target: str
    joints: str
    indices: str
    commands: tuple[str, ...]
