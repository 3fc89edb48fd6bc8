"""A node by itself, and the world that it asks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from lab3_usd.model.dry_run import Scene, SceneNode
from lab3_usd.sim.execution.node_instance import NodeInstance, function_of
from lab3_usd.sim.execution.world import Network, RosEndpoint
from lab3_usd.spec.load.loader import load_platform


def node(name: str, values: dict[str, Any] | None = None, **targets: str) -> NodeInstance:
    """A node of a type, with values at its inputs and no wires; the others have their defaults."""
    node_type = load_platform().get(name)
    assert node_type is not None
    defaults = {port.short: port.default for port in node_type.ports.values()}
    given = values or {}
    bare = SceneNode(
        "/Graph/node",
        name,
        node_type.version,
        {f"inputs:{port}": given[port] for port in given if port not in defaults},  # added to it
        {f"inputs:{port}": (path,) for port, path in targets.items()},
    )
    function = function_of(node_type)
    assert function is not None
    return NodeInstance(bare.path, node_type, function, {}, bare, {**defaults, **given})


def world(**known: Any) -> Any:
    """What the functions ask of the world, with an empty stage."""
    given = {
        "scene": Scene(1.0, "Z", (), {}, {}),
        "platform": load_platform(),
        "network": Network("", commands=RosEndpoint(0, "/cmd_vel")),
        "frame": 1,
        "reading": 1,
        "unplayed": {},
        "dt": 0.5,
        "since_play": 2.0,
        "simulated": 7.0,
        "wall": 100.0,
        "session": 0,
        "products": {},
        "writers": [],
        "not_simulated": {},
        "gives": {},
    }
    return SimpleNamespace(**{**given, **known})
