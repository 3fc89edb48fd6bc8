"""A running node, and the compute function of its type.

Whole names, and which old names mean the same, are the platform's.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from msgspec import Struct, field

from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType
from lab3_usd.isaac.pure_nodes import are_numbers, last_part
from lab3_usd.model.dry_run import SceneNode
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.transforms import Vector
from lab3_usd.sim.execution.recording import Later

if TYPE_CHECKING:
    from lab3_usd.sim.execution.world import World


Function = Callable[["NodeInstance", "World"], bool]
MODULES = ("robot", "wheels", "joints", "sensors", "core", "transforms", "messages", "flow")
_FUNCTIONS: dict[str, Function] = {}
_EVENTS: dict[str, str] = {}  # of the types that start an execution: what they wait for
FRAME, STEP = "frame", "physics step"
CONSTANT = "Constant"  # how the names of all constants begin


def computes(*names: str, on: str = "") -> Callable[[Function], Function]:
    """Make a function the compute of node types; it says whether it succeeded.

    `on` names what starts an execution at such nodes.
    """

    def register(function: Function) -> Function:
        for name in names:
            _FUNCTIONS[name] = function
            if on:
                _EVENTS[name] = on
        return function

    return register


def last_name(node_type: str) -> str:
    """Return a type's name without what stands before it; all constants are one."""
    name = last_part(node_type)
    return CONSTANT if name.startswith(CONSTANT) else name


@cache
def functions() -> Mapping[str, Function]:
    """Return all functions by the last part of the type's name."""
    for module in MODULES:
        importlib.import_module(f"lab3_usd.sim.nodes.{module}")
    return _FUNCTIONS


def function_of(node_type: NodeType) -> Function | None:
    """Return the function of a type, None if it has none."""
    by_name, name = functions(), last_part(node_type.type)
    return by_name.get(name) or by_name.get(last_name(name))


def event_of(node_type: NodeType) -> str | None:
    """Return what a type waits for to start an execution, None where it starts none."""
    functions()
    return _EVENTS.get(last_name(node_type.type))


NO_VECTOR = (0.0, 0.0, 0.0)


class Failure(Struct, frozen=True):
    """Why a node did not do its work, and of what kind that fault is."""

    reason: str
    kind: FaultKind


class NodeInstance(Struct):
    """A node that runs. One without execution inputs is `pulled`: computed when it is read."""

    path: str
    type: NodeType
    function: Function
    outputs: dict[str, Any]
    node: SceneNode
    values: dict[str, Any] = field(default_factory=dict)
    wires: dict[str, tuple[NodeInstance, str]] = field(default_factory=dict)
    follows: dict[str, list[NodeInstance]] = field(default_factory=dict)
    fed: set[str] = field(default_factory=set)  # inputs into which a wire leads that Kit keeps
    memory: dict[str, Any] = field(default_factory=dict)
    enabled: list[str] = field(default_factory=list)
    again: bool = False  # whether it computes once more when what it enabled has been followed
    pulled: bool = False
    computed: int = -1  # the reading in which it was pulled last
    busy: bool = False
    count: int = 0  # how often it computed
    failure: Failure | None = None  # of the last time, if it failed
    unknown_name: str = ""  # the input of a topic or frame of which no function tells the name

    def get(self, name: str, world: World) -> object:
        """Return what reaches an input, by its name without `inputs:`."""
        wire = self.wires.get(name)
        if wire is None:
            return self.values.get(name)
        source, port = wire
        if source.pulled and source.computed != world.reading and not source.busy:
            source.computed = world.reading
            source.compute(world)
        value = source.outputs.get(port)
        return value.all() if type(value) is Later else value

    def number(self, name: str, world: World) -> float:
        """Return the number that reaches an input, 0 where none does."""
        value = self.get(name, world)
        if type(value) is float:  # as a rule it is
            return value
        return float(value) if isinstance(value, (float, int)) else 0.0

    def whole(self, name: str, world: World) -> int:
        """Return the whole number that reaches an input, 0 where none does."""
        value = self.number(name, world)
        return int(value) if math.isfinite(value) else 0

    def text(self, name: str, world: World) -> str:
        """Return the text that reaches an input, '' where none does."""
        return str(self.get(name, world) or "")

    def flag(self, name: str, world: World) -> bool:
        """Return the switch that reaches an input."""
        return bool(self.get(name, world))

    def items(self, name: str, world: World) -> tuple[Any, ...]:
        """Return the array that reaches an input, an empty one where none does."""
        value = self.get(name, world)
        return value if isinstance(value, tuple) else ()

    def numbers(self, name: str, world: World) -> tuple[float, ...]:
        """Return the array of numbers that reaches an input, an empty one where none does."""
        value = self.items(name, world)
        return value if are_numbers(value) else ()

    def vectors(self, name: str, world: World, size: int) -> tuple[tuple[float, ...], ...]:
        """Return the array of vectors that reaches an input, an empty one where none does."""
        value = self.items(name, world)
        for each in value:
            if not isinstance(each, tuple) or len(each) != size or not are_numbers(each):
                return ()
        return value

    def vectors_later(self, name: str, world: World, size: int) -> Sequence[tuple[float, ...]]:
        """Return the same; what comes from an output of this name need not be computed yet."""
        source, port = self.wires.get(name) or (self, "")
        value = source.outputs.get(name) if port == name and not source.pulled else None
        return value if isinstance(value, Later) else self.vectors(name, world, size)

    def vector(self, name: str, world: World) -> Vector:
        """Return the three numbers that reach an input, zeros where they do not."""
        value = self.get(name, world)
        if not isinstance(value, tuple) or len(value) != len(NO_VECTOR) or not are_numbers(value):
            return NO_VECTOR
        return value

    def targets(self, name: str) -> tuple[str, ...]:
        """Return the prims that an input refers to."""
        return self.node.targets.get(INPUT + name, ())

    def target(self, name: str) -> str:
        """Return the first prim that an input refers to, '' where it refers to none."""
        return next(iter(self.targets(name)), "")

    @property
    def feeding(self) -> list[NodeInstance]:
        """This node, and those from which values come to it."""
        nodes = {self.path: self}
        waiting = [self]
        while waiting:
            sources = {source.path: source for source, _ in waiting.pop().wires.values()}
            waiting += [source for path, source in sources.items() if path not in nodes]
            nodes |= sources
        return [*nodes.values()]

    def unit(self, meters_per_unit: float) -> float:
        """Return how many metres are 1 in what comes here: a conversion makes units of metres."""
        converts = any(node.type.same_in_metres for node in self.feeding)
        return meters_per_unit if converts else 1.0

    def compute(self, world: World) -> bool:
        """Compute once; execution outputs that are enabled stay so for the caller to follow."""
        self.enabled.clear()
        self.again = False
        self.busy = True
        self.count += 1
        done = self.function(self, world)
        if done:
            self.failure = None
        self.busy = False
        return done

    def fails(self, reason: str, kind: FaultKind) -> bool:
        """Say why the node does not do its work."""
        self.failure = Failure(reason, kind)
        return False

    def goes_on(self) -> bool:
        """Signal at the execution outputs of a type that signals at all of them."""
        self.enabled += self.type.signals
        return True

    def reset(self) -> None:
        """Reset the state of the node, as on Stop."""
        self.memory.clear()
        self.outputs.clear()
        self.outputs.update(initial(self.type))
        self.computed = -1


def initial(node_type: NodeType) -> dict[str, Any]:
    """Return the outputs of a node that never computed."""
    return {
        port.short: port.default
        for port in node_type.ports.values()
        if port.name.startswith(OUTPUT) and not port.is_execution
    }


MOST_ROUNDS = 10_000  # of loops, in what one event starts


def push(node: NodeInstance, world: World, most: int) -> None:
    """Compute a node and what follows it over enabled execution outputs, depth first.

    No node computes more than `most` times in a round of a loop: execution wires may run in a ring.
    """
    waiting = [node]
    seen: dict[int, int] = {}
    rounds = 0
    while waiting:
        current = waiting.pop()
        number = id(current)
        again = seen.get(number, 0)
        if again > most:
            continue
        seen[number] = again + 1
        if current.compute(world):
            if current.again:
                rounds += 1
                world.reading += 1  # what was read in the round before is read anew
                seen.clear()
                waiting.append(current)
                if rounds > MOST_ROUNDS:
                    reason = f"{current.path} loops more than {MOST_ROUNDS} times in an update"
                    world.unplayed.setdefault("", f"not simulated: {reason}")
                    return
            for port in reversed(current.enabled):
                followers = current.follows.get(port)
                if followers is not None:
                    waiting += followers[::-1]
