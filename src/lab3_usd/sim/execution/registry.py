"""Which function a node type computes, by the last part of the type's name.

Whole names, and which old names mean the same, are the catalog's.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

from lab3_usd.spec.catalog import NodeType

if TYPE_CHECKING:
    from lab3_usd.sim.execution.running import Running
    from lab3_usd.sim.execution.world import World

Function = Callable[["Running", "World"], bool]
MODULES = (  # below sim/nodes, that hold the functions
    "articulation",
    "camera",
    "drive",
    "events",
    "lidar",
    "odometry",
    "products",
    "transforms",
    "values",
)
_FUNCTIONS: dict[str, Function] = {}
_EVENTS: dict[str, str] = {}  # of the types that start an execution: what they wait for
FRAME, STEP = "frame", "physics step"
CONSTANT = "Constant"  # how the names of all constants begin


def computes(*names: str, on: str = "") -> Callable[[Function], Function]:
    """Make a function the compute of node types; it says whether it succeeded.

    `on` names what starts an execution at such nodes.
    """

    def register(function: Function) -> Function:
        for each in names:
            _FUNCTIONS[each] = function
            if on:
                _EVENTS[each] = on
        return function

    return register


def last_name(node_type: str) -> str:
    """Return a type's name without what stands before it; all constants are one."""
    name = node_type.rpartition(".")[2]
    return CONSTANT if name.startswith(CONSTANT) else name


@cache
def functions() -> Mapping[str, Function]:
    """Return all functions by the last part of the type's name."""
    for module in MODULES:
        importlib.import_module(f"lab3_usd.sim.nodes.{module}")
    return _FUNCTIONS


def function_of(node_type: NodeType) -> Function | None:
    """Return what a type computes, None where nobody wrote it down."""
    return functions().get(last_name(node_type.type))


def event_of(node_type: NodeType) -> str | None:
    """Return what a type waits for to start an execution, None where it starts none."""
    functions()
    return _EVENTS.get(last_name(node_type.type))
