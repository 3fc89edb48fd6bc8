"""Quaternions at ports: OGN writes x, y, z, w, a file w first."""

from __future__ import annotations

from lab3_usd.model.dry_run.affine import Affine, Quaternion
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World
from lab3_usd.spec.catalog import INPUT

NO_TURN = (0.0, 0.0, 0.0, 1.0)


def xyzw(place: Affine) -> Quaternion:
    """Return the rotation of a place in OGN's order."""
    w, x, y, z = place.quaternion()
    return (x, y, z, w)


def wxyz(node: Running, name: str, world: World) -> Quaternion:
    """Return the rotation that reaches an input, w first; a file's literal has w first already."""
    value = node.items(name, world)
    saved = node.node.inputs.get(INPUT + name)
    if len(value) != len(NO_TURN):
        value = NO_TURN
    elif name not in node.wires and saved is not None and saved.value == value:
        return (value[0], value[1], value[2], value[3])
    x, y, z, w = value
    return (w, x, y, z)
