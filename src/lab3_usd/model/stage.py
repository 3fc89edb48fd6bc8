"""A stage as plain data: what the rules look at instead of USD."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from functools import wraps
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

from msgspec import Struct, field
from msgspec.structs import force_setattr

from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import SAVED, Margin, Value, are_alike, same_numbers
from lab3_usd.model.build import Build
from lab3_usd.model.prims import (
    Colliders,
    Details,
    NameFilter,
    Prim,
    Prims,
    is_at_or_below,
    of_any_name,
    upwards,
)

if TYPE_CHECKING:
    from lab3_usd.model.dry_run import Scene


def same_value(was: Value | None, now: Value | None, *, near_zero: float = 1e-12) -> bool:
    """Whether two values are the same up to float noise; `1` and `1.0` are, `1` and `True` not.

    `near_zero` is what two numbers may always differ by. Whole numbers have no noise.
    """
    if type(was) is type(now) is not tuple and was == now:
        return True
    if isinstance(was, tuple) and isinstance(now, tuple):
        return len(was) == len(now) and all(
            same_value(*pair, near_zero=near_zero) for pair in zip(was, now, strict=True)
        )
    if isinstance(was, bool) or isinstance(now, bool):
        return was is now
    if isinstance(was, (int, float)) and isinstance(now, (int, float)):
        is_whole = isinstance(was, int) and isinstance(now, int)
        return not is_whole and same_numbers([was], [now], Margin(SAVED.relative, near_zero))
    return was == now


class Unknown(Struct, frozen=True, gc=False):
    """A value that a script sets and that is not known before it runs: what it calls it, and where.

    `why` is the expression in short, as `args.topic`; `line` counts from 1.
    """

    why: str
    line: int


class PortState(Struct, frozen=True, gc=False):
    """One port as the composed stage holds it.

    `value` is the authored value, None if there is none, `Unknown` if it cannot be determined;
    `usd_type` the declared type of a port with a value (`rel` for a relationship). `sources` are
    the full property paths of its connections, `targets` the prim paths of a relationship.
    """

    name: str
    usd_type: str = ""
    value: Value | Unknown | None = None
    sources: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()


class Node(Struct, frozen=True, eq=False, gc=False):
    """A node prim that is active and defined; two are the same only when they are one.

    `type_name` is the name of its type in the release that the stage is checked for ('' if absent),
    `type` its entry of the platform or None. Names of ports are those of that release, too. If the
    file uses names of another release, `written_type` is its `node:type`, and `written_ports` are
    its names of ports. `namespaces` are the namespace attributes of the prim and its ancestors,
    outermost first, `own_namespace` is that of the prim alone. `is_local`: the stage's own layers,
    not an asset, define the node. `place` reads the position in the graph editor of the node with
    a path; only pictures and descriptions need it.
    """

    path: str
    type_name: str
    type: NodeType | None
    version: int | None
    ports: Mapping[str, PortState]
    place: Callable[[str], tuple[float, float] | None] | None = None
    namespaces: tuple[str, ...] = ()
    own_namespace: str = ""
    is_local: bool = True
    written_type: str = ""
    written_ports: Mapping[str, str] = {}

    @property
    def position(self) -> tuple[float, float] | None:
        """Where the graph editor shows the node, None where the file does not say."""
        return None if self.place is None else self.place(self.path)

    @property
    def saved_type(self) -> str:
        """`node:type` as the file has it."""
        return self.written_type or self.type_name

    @property
    def name(self) -> str:
        """The prim name."""
        return self.path.rpartition("/")[2]

    def state(self, port: str) -> PortState | None:
        """Return the state of the port with this full name, None where the file has none."""
        return self.ports.get(port)

    def sources(self, port: str) -> tuple[str, ...]:
        """Return the property paths wired into this input."""
        state = self.ports.get(port)
        return () if state is None else state.sources

    def targets(self, port: str) -> tuple[str, ...]:
        """Return the prim paths this relationship names."""
        state = self.ports.get(port)
        return () if state is None else state.targets

    def value(self, port: str) -> Value | None:
        """Return the effective value: the authored one, else the default of Isaac Sim 6.0.1.

        A value of a type that the port cannot have is ignored. One that is unknown is None.
        """
        state, kind = self.ports.get(port), self.type
        if state is not None and state.value is not None and not self.wrong_type(port):
            return None if isinstance(state.value, Unknown) else state.value
        return None if kind is None else kind.default(port, self.version)

    def is_unknown(self, port: str) -> bool:
        """Whether an input has a value that nobody can tell."""
        state = self.ports.get(port)
        return state is not None and isinstance(state.value, Unknown)

    def wrong_type(self, port: str) -> str | None:
        """Return the type that a file declares for an input whose values it cannot have, else None.

        The application gives the port its own type and ignores the value. A port without a value
        has no type.
        """
        state = self.ports.get(port)
        if state is None or not state.usd_type or self.type is None:
            return None
        declared = self.type.ports.get(port) or self.type.port(port)
        if declared is None or declared.usd_type == state.usd_type or declared.is_union:
            return None
        return None if are_alike(state.usd_type, declared.usd_type) else state.usd_type

    def has_port(self, port: str) -> bool:
        """Whether a wire can leave from or end at this port.

        The platform decides where the type is known: the application drops a wire to a port that
        the type does not have, whatever the file declares.
        """
        if self.type is None:
            return port in self.ports
        return self.type.port(port) is not None


DEACTIVATED, OVER, OUTSIDE = "deactivated", "an over without a def", "outside every graph"
ELSEWHERE = "in another graph"


class AbsentPrim(Struct, frozen=True):
    """A prim that is in the file but is not a node of the scene.

    `reason` says what it is instead: deactivated, an over without a def, outside every graph, of
    another type than a node's.
    """

    path: str
    type_name: str
    reason: str
    ports: Mapping[str, PortState] = field(default_factory=dict)


class GraphVariable(Struct, frozen=True):
    """A variable of a graph: its USD type, and its value at the start, None for none."""

    usd_type: str
    value: Value | None = None


class GraphModel(Struct, frozen=True, eq=False):
    """A graph prim with its nodes in the order of their paths; it is equal to itself alone.

    `instanced` is whether it belongs to an instance, of which Isaac Sim loads no graph. Of a
    deactivated graph only the number of its nodes is known, `hidden`. `inner` are the graphs of its
    compounds, whose nodes are among its own.
    """

    path: str
    active: bool
    attributes: Mapping[str, Value]
    nodes: tuple[Node, ...]
    variables: Mapping[str, GraphVariable] = {}
    absent: tuple[AbsentPrim, ...] = ()
    instanced: bool = False
    hidden: int = 0
    inner: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The prim name."""
        return self.path.rpartition("/")[2]


class OldType(Struct, frozen=True):
    """A node prim with a type from before Isaac Sim 4.5, '' for none; no instance has any.

    `in_asset` is whether a prim above it refers to an asset.
    """

    path: str
    written: str
    in_asset: bool


class UnresolvedAsset(Struct, frozen=True):
    """An asset that the stage asks for and that cannot be found from here.

    `prim` is where it would bring something: '/' for a sublayer of the stage itself, the prim that
    refers to the asset for a sublayer of an asset. `layer` is the layer that asks for it. What only
    a run of a `script` tells is one as well: `asset` is what the script calls it.
    """

    prim: str
    asset: str
    kind: Literal["reference", "payload", "sublayer", "sublayer of an asset", "script"]
    layer: str = ""


class MutedSublayer(Struct, frozen=True):
    """A sublayer that Isaac Sim opens muted, and the prims that it defines or changes."""

    asset: str
    prims: tuple[str, ...]


class RenderProduct(Struct, frozen=True):
    """A render product that the file holds: its prim, the camera that it shows, and its size."""

    prim: str
    camera: str
    size: tuple[int, ...]


class Script(Struct, frozen=True):
    """Code in the file: the prim that carries it, and by which node type or schema."""

    prim: str
    carrier: str


class AnimatedAttribute(Struct, frozen=True):
    """An attribute whose time samples change it while the timeline plays.

    `time` is the first time code at which it is no longer as at the start, in words both times.
    """

    prim: str
    property: str
    time: float
    first: str
    then: str


class StageModel(Struct, frozen=True, eq=False):
    """Everything the rules know of one stage.

    `platform` is the release of Isaac Sim by which the stage was read. Two models are the same only
    when they are one. `derived` holds what was worked out from this one (`once_per_stage`), so that
    it goes when the model goes. `judged` holds what was worked out of the inputs of rules, which
    hold the model, while it is judged. `instances` are the paths of the outermost instances,
    `products` the render products that nodes name, by path. `overridden` are prims that look like
    nodes, which the stage only overrides; they are read where an asset is missing.
    `old_types` are in the order in which Isaac Sim opens the stage. `build` is how a script made
    the stage, None for a file; `scene` reads a file as a dry run does.
    `details` tells of prims what few rules ask.
    """

    platform: Platform
    up_axis: str
    meters_per_unit: float
    kilograms_per_unit: float
    graphs: tuple[GraphModel, ...]
    prims: Mapping[str, Prim]
    orphans: tuple[Node, ...] = ()
    absent: tuple[AbsentPrim, ...] = ()
    unresolved: tuple[UnresolvedAsset, ...] = ()
    colliders: Colliders = field(default_factory=Colliders)
    muted: tuple[MutedSublayer, ...] = ()
    default_prim: str = ""
    instances: frozenset[str] = frozenset()
    overridden: tuple[str, ...] = ()
    scripts: tuple[Script, ...] = ()
    moving: tuple[AnimatedAttribute, ...] = ()
    products: Mapping[str, RenderProduct] = field(default_factory=dict)
    old_types: tuple[OldType, ...] = ()
    build: Build | None = None
    scene: Callable[[], Scene] | None = None
    details: Details = field(default_factory=Details)
    derived: dict[Hashable, Any] = field(default_factory=dict)
    judged: dict[Hashable, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Let a model that is made of another start without anything derived."""
        force_setattr(self, "derived", {})
        force_setattr(self, "judged", {})

    def nodes(self) -> Iterator[Node]:
        """Yield every live node, graph by graph, then those outside every graph."""
        for graph in self.graphs:
            if graph.active:
                yield from graph.nodes
        yield from self.orphans

    def prim(self, path: str) -> Prim | None:
        """Return the prim at `path` when it is part of the scene."""
        prim = self.prims.get(path)
        return prim if prim is not None and prim.present else None

    @property
    def _asked(self) -> Prims:
        return self.prims if isinstance(self.prims, Prims) else Prims(self.prims)

    def of_type(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims of the types asked for, in the scene or not."""
        return self._asked.of_type(asked)

    def with_api(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims that carry a schema asked for, in the scene or not."""
        return self._asked.with_api(asked)

    def named(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims whose own name is asked for, in the scene or not."""
        return self._asked.named(asked)

    def below(
        self, top: str, asked: NameFilter = of_any_name, left_out: frozenset[str] = frozenset()
    ) -> Iterable[Prim]:
        """Return those at and below a prim that are of the types asked for, in the scene or not.

        Parents come first. What stands at or below a prim with one of the names `left_out` is not
        among them.
        """
        return self._asked.below(top, asked, left_out)

    def instance_above(self, path: str) -> str | None:
        """Return the instance that a prim is or belongs to, None where it belongs to none."""
        return next((above for above in upwards(path) if above in self.instances), None)

    def unresolved_above(self, path: str) -> UnresolvedAsset | None:
        """Return the missing asset that could hold the prim at `path`, None where none could."""
        return next((asset for asset in self.unresolved if is_at_or_below(path, asset.prim)), None)

    def unknown(self, *paths: str) -> UnresolvedAsset | None:
        """Return the missing asset that could say what the stage does not of one of these prims.

        A prim that was deactivated on purpose is absent whatever the asset holds.
        """
        for path in paths if self.unresolved else ():
            above = _nearest_prim(self, path)
            asset = self.unresolved_above(path)
            if asset is not None and (not above or self.prims[above].active):
                return asset
        return None

    def unknown_node(self, path: str) -> UnresolvedAsset | None:
        """Return the missing asset that could hold a node at `path`.

        A graph that is there holds the nodes that are there: an asset above it could only make
        nodes of overs in it.
        """
        for graph in self.graphs:
            if graph.active and is_at_or_below(path, graph.path):
                inside = (
                    asset for asset in self.unresolved if is_at_or_below(asset.prim, graph.path)
                )
                overs = (prim.path for prim in graph.absent if prim.reason == OVER)
                may_be = path in overs or any(is_at_or_below(path, gap.prim) for gap in inside)
                return self.unknown(path) if may_be else None
        return self.unknown(path)

    def unknown_inputs(self, node: Node) -> UnresolvedAsset | None:
        """Return the missing asset that could set inputs of a node.

        A node that the stage's own layers define is judged as it stands there.
        """
        return None if node.is_local else self.unknown(node.path)

    def unknown_below(self, path: str, beside: Iterable[str] = ()) -> UnresolvedAsset | None:
        """Return the missing asset that could hold something at or below `path`.

        Assets at and below one of the prims `beside` do not count.
        """
        inside = (
            asset
            for asset in self.unresolved
            if is_at_or_below(asset.prim, path)
            and not any(is_at_or_below(asset.prim, top) for top in beside)
        )
        return self.unknown(path) or next(inside, None)

    def unknown_outside(self, path: str) -> UnresolvedAsset | None:
        """Return an asset that is missing elsewhere than at or below `path`."""
        outside = (asset for asset in self.unresolved if not is_at_or_below(asset.prim, path))
        return next(outside, None)

    def unknown_value(self, prim: Prim, *properties: str) -> UnresolvedAsset | None:
        """Return the missing asset that could give a value to one of these attributes."""
        asset = self.unknown(prim.path)
        return None if asset is None or prim.attributes.keys() >= {*properties} else asset

    def unknown_pose(self, *prims: Prim) -> UnresolvedAsset | None:
        """Return the missing asset that could say where one of the prims stands."""
        if not self.unresolved:
            return None
        return self.unknown(*(prim.path for prim in prims if prim.local is None))


_MISSING: Any = object()
_P = ParamSpec("_P")
_T = TypeVar("_T")


def once_per_stage(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let a function of a stage, or of what has a `stage`, keep its results in the stage's model.

    A stage is the first argument or the last one, what has a `stage` the first. Nothing outlives
    the model, which may hold an open file.
    """

    @wraps(function)
    def kept(*about: Any) -> _T:
        first, last = about[0], about[-1]
        if type(last) is StageModel:
            results, key = last.derived, (function, *about[:-1])
        elif type(first) is StageModel:
            results, key = first.derived, (function, *about[1:])
        else:
            results, key = first.stage.judged, (function, *about)
        result: _T = results.get(key, _MISSING)
        if result is _MISSING:
            results[key] = result = function(*about)  # type: ignore[call-arg]  # all are positional
        return result

    return kept  # type: ignore[return-value]  # nobody names an argument


def listed_once(function: Callable[_P, Iterator[_T]]) -> Callable[_P, tuple[_T, ...]]:
    """Let what a function of a stage yields be kept in the stage's model, as `once_per_stage`."""

    @wraps(function)
    def listed(*args: _P.args, **kwargs: _P.kwargs) -> tuple[_T, ...]:
        return tuple(function(*args, **kwargs))

    return once_per_stage(listed)


def absence_reason(stage: StageModel, path: str) -> str:
    """Say why there is no prim at `path`, as the end of a sentence about it."""
    prim = stage.prims.get(path)
    if prim is None:
        above = _nearest_prim(stage, path)
        if above and not stage.prims[above].present:
            return f"is missing: {above} {absence_reason(stage, above)}"
        return "is missing"
    if not prim.active:
        return "is deactivated"
    return "is only an over without a def"


def _nearest_prim(stage: StageModel, path: str) -> str:
    """Return the path itself or the nearest one above it that holds a prim, '' for none."""
    while path and path not in stage.prims:
        path = path.rpartition("/")[0]
    return path


def nodes_outside_graphs(stage: StageModel) -> Iterator[Node]:
    """Yield the nodes outside every graph.

    Left out are those below an over that may be a graph in an asset which cannot be found.
    """
    for node in stage.orphans:
        above = _nearest_prim(stage, node.path.rpartition("/")[0])
        over = stage.prims.get(above)
        if over is None or not over.active or over.defined or not stage.unknown(above):
            yield node
