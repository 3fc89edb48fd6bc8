"""Ports of a node type that serve one purpose together."""

from __future__ import annotations

from msgspec import Struct


class Dynamic(Struct, frozen=True, forbid_unknown_fields=True):
    """Ports that exist only once asked for: `prefix` + number, as many as `count` says.

    `type` is OGN's own word for their type, `metadata` how a file lists the types they take.
    """

    prefix: str
    count: str
    metadata: str
    type: str = ""


class TfPorts(Struct, frozen=True, forbid_unknown_fields=True):
    """Which ports of a type carry TF frames.

    `names`: parent and child frame ids. `arrays`: parents and children that come by wire.
    `prims`: parent prim and target prims. `gives`: the outputs that carry the frames on.
    """

    names: tuple[str, ...] = ()
    arrays: tuple[str, ...] = ()
    prims: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()
    static: str | None = None


class DrivePorts(Struct, frozen=True):
    """Which ports of a type move joints.

    `path` names the robot and wins where it is set, `target` is its prim otherwise. `joints`: the
    names of the joints, all where it is empty. `commands`: what they are told.
    """

    path: str
    target: str
    joints: str
    commands: tuple[str, ...]
