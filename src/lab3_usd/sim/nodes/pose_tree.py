"""Which frames a publisher makes of target prims of its own, the way that 6.0 calls deprecated.

All lines are those of PoseTree.h in core.includes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.sim.execution.world import World
from lab3_usd.sim.nodes.frames import BODY, ROOT, Pair, Tree, frame_name
from lab3_usd.sim.robot.machine import Machine

_WORLD = "world"


def pose_tree(world: World, parent: str, targets: Sequence[str]) -> Tree:
    """Expand the targets: an articulation stands for its links, all else for itself (:177-357)."""
    return Tree(tuple(_pairs(world, parent, targets)))


def _pairs(world: World, parent: str, targets: Sequence[str]) -> Iterator[Pair]:
    prims, names = world.scene.prims, dict[str, str]()
    parent = parent if parent in prims else ""

    def named(path: str) -> str:
        """Who comes first keeps a name, the next one goes by its path (:412-443)."""
        if path and path not in names:
            name = frame_name(prims[path])
            names[path] = path[1:].replace("/", "_") if name in names.values() else name
        return names[path] if path else _WORLD

    named(parent)
    for target in targets:
        prim = prims[target]
        machine = world.machines.articulation(target) if ROOT in prim.apis else None
        links = {target: ""} if machine is None else _links(machine)
        for path, above in links.items():
            pair = Pair(
                named(above or parent),
                named(path),
                above or parent,
                path,
                prim.type == "Camera",
            )
            if above or pair.parent != pair.child or BODY not in prims[path].apis:  # :280, :324
                yield pair


def _links(machine: Machine) -> dict[str, str]:
    """Return the links of an articulation, each with the one that its joint hangs it on."""
    links = {machine.base: ""}
    for path in machine.rest:
        joint = machine.parents.get(path)
        if joint is not None and not joint.excluded:
            above = joint.bodies[0] if joint.bodies[1] == path else joint.bodies[1]
            if above in links:
                links[path] = above
    return links
