"""Where the robot and its links really stand in a stage, and the lab as it reads there.

That is a mistake of its own, reported once: what moved along is judged where it is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from msgspec.structs import replace

from lab3_usd.check.robot.sensors import is_named
from lab3_usd.model.physics import bodies_below, is_articulated
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import RobotSpec

_LEAST_LINKS = 0.5  # of the robot's links that a prim must hold to be taken for the robot


def robot_relocations(lab: Lab, stage: StageModel) -> dict[str, str]:
    """Map the paths of robots, and of links that have none, to where they stand instead."""
    relocations: dict[str, str] = {}
    for robot in lab.scene.robots:
        other_paths = {other.path for other in lab.scene.robots if other is not robot}
        taken = other_paths | {*relocations.values()}
        relocations |= _relocations_of(robot, stage, taken)
    return relocations


def _relocations_of(robot: RobotSpec, stage: StageModel, taken: Collection[str]) -> dict[str, str]:
    """Map the expected path of a robot or link that is not there to its actual path.

    The robot is the prim with the most of its links, at least half of them; or the prim of its
    name, if the asset with the links cannot be found. A link is the only prim of its name below the
    robot. If only one link is missing, it is the only other body among the robot's links. Paths of
    links are below the actual path of the robot. Prims at paths in `taken` are other robots.
    """
    expected = robot.path
    root = expected
    relocations: dict[str, str] = {}
    is_nowhere = expected not in stage.prims or not stage.unknown(expected)
    if stage.prim(expected) is None and is_nowhere:
        root = _root_by_links(robot, stage, taken) or expected
        if root == expected:
            # The robot may be a prim of its name whose links a missing asset may hold.
            name = expected.rpartition("/")[2]
            namesakes = stage.named(lambda leaf: is_named(leaf, [name]))
            paths = (prim.path for prim in namesakes if prim.active and prim.path not in taken)
            root = min((path for path in paths if stage.unknown_below(path)), default=expected)
        if root != expected:
            relocations[expected] = root
    if stage.prim(root) is not None:
        relocations |= _link_relocations(tuple(robot.links), root, stage)
    return relocations


def _root_by_links(robot: RobotSpec, stage: StageModel, taken: Collection[str]) -> str | None:
    links = robot.links
    name = robot.path.rpartition("/")[2]
    held: dict[str, int] = {}
    for link in links:
        for prim in stage.named(link.rpartition("/")[2]):
            root = prim.path.removesuffix(f"/{link}")
            if prim.present and root != prim.path and stage.prim(root) and root not in taken:
                held[root] = held.get(root, 0) + 1
    offers = sorted(
        (-count, path.rpartition("/")[2] != name, path)
        for path, count in held.items()
        if count >= _LEAST_LINKS * len(links)
    )
    return offers[0][2] if offers else None


def _link_relocations(links: tuple[str, ...], root: str, stage: StageModel) -> dict[str, str]:
    paths = {name: f"{root}/{name}" for name in links}
    missing = [
        name for name, path in paths.items() if path not in stage.prims and not stage.unknown(path)
    ]
    relocations: dict[str, str] = {}
    for name in missing:
        namesakes = same_named_prims(stage, root, name.rpartition("/")[2])
        if len(namesakes) == 1:
            relocations[f"{root}/{name}"] = namesakes[0]
    if len(missing) == 1 and not relocations:
        prims = (stage.prims[path] for path in bodies_below(stage, root))
        parent = paths[missing[0]].rpartition("/")[0]
        placed = paths.values()
        bodies = [prim.path for prim in prims if prim.parent == parent and prim.path not in placed]
        if len(bodies) == 1:
            relocations[f"{root}/{missing[0]}"] = bodies[0]
    return relocations


def same_named_prims(stage: StageModel, root: str, name: str) -> tuple[str, ...]:
    """Return the prims below the robot that have the name of a missing link."""
    prims = (prim for prim in stage.named(name) if prim.present)
    has_type = (prim.path for prim in prims if prim.type == "Xform")
    return tuple(sorted(path for path in has_type if is_at_or_below(path, root)))


def demanded_prims(lab: Lab) -> dict[str, str]:
    """Return the prims that every stage holds, with the sections that say so."""
    parent = lab.scene.world.graph_parent
    above = {} if parent is None else {parent.path: parent.handout}
    return above | {
        path: robot.handout
        for robot in lab.scene.robots
        for path in (robot.path, *robot.link_paths)
    }


def is_root_articulated(robot: RobotSpec, stage: StageModel) -> bool:
    """Whether the robot root carries the articulation, and the handout's prim does not."""
    if not robot.articulation.target:
        return False
    root, base = stage.prim(robot.path), stage.prim(robot.articulation.target)
    is_on_base = base is not None and is_articulated(base)
    return root is not None and is_articulated(root) and not is_on_base


def relocated_lab(lab: Lab, relocations: Mapping[str, str]) -> Lab:
    """Return the lab as it reads where a robot or a link stands elsewhere."""
    if not relocations:
        return lab
    graphs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    scene = lab.scene
    placed = tuple(
        replace(
            robot,
            path=relocated_path(robot.path, relocations),
            articulation=replace(
                robot.articulation, target=relocated_path(robot.articulation.target, relocations)
            ),
        )
        for robot in scene.robots
    )
    sensors = {
        name: replace(sensor, path=relocated_path(sensor.path, relocations))
        for name, sensor in scene.sensors.items()
    }
    return replace(lab, graphs=graphs, scene=replace(scene, robots=placed, sensors=sensors))


def relocated_spec(spec: GraphSpec, relocations: Mapping[str, str]) -> GraphSpec:
    """Return the spec as it reads where a sensor or the robot stands elsewhere than asked.

    `relocations` maps the path of such a prim to where it really is.
    """
    if not relocations:
        return spec
    nodes = {}
    for role, node in spec.nodes.items():
        targets = tuple(
            replace(target, prims=tuple(relocated_path(prim, relocations) for prim in target.prims))
            for target in node.targets
        )
        nodes[role] = replace(node, targets=targets)
    return replace(spec, path=relocated_path(spec.path, relocations), nodes=nodes)


def relocated_path(path: str, relocations: Mapping[str, str]) -> str:
    """Return where `path` is when the prims of `relocations` stand elsewhere.

    They are applied in their order. A prim below another that was moved is expected where the other
    one stands.
    """
    for expected, actual in relocations.items():
        if path == expected or path.startswith(f"{expected}/"):
            path = actual + path[len(expected) :]
    return path
