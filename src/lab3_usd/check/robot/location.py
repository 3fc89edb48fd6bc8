"""Where the robot and its links really stand in a stage, and the lab as it reads there.

That is a mistake of its own, reported once: what moved along is judged where it is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.check.robot.sensors import is_named
from lab3_usd.model.physics import bodies_below, is_articulated
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab

_LEAST_LINKS = 0.5  # of the robot's links that a prim must hold to be taken for the robot


def robot_relocations(lab: Lab, stage: StageModel) -> dict[str, str]:
    """Map the path of the robot, and of a link that has none, to where it stands instead.

    The robot is the prim that holds the most of its links, at least half of them, or that has its
    name while the asset with its links cannot be found. A link is the only prim of its name below
    the robot, or where no other is missing the only body beside the robot's links that is none of
    them. Paths of links are those below the robot where it stands.
    """
    expected = lab.scene.robot.path
    root = expected
    relocations: dict[str, str] = {}
    is_nowhere = expected not in stage.prims or not stage.unknown(expected)
    if stage.prim(expected) is None and is_nowhere:
        root = _root_by_links(lab, stage) or expected
        if root == expected:
            # The robot may be a prim of its name whose links a missing asset may hold.
            name = expected.rpartition("/")[2]
            namesakes = stage.named(lambda leaf: is_named(leaf, [name]))
            paths = (prim.path for prim in namesakes if prim.active)
            root = min((path for path in paths if stage.unknown_below(path)), default=expected)
        if root != expected:
            relocations[expected] = root
    if stage.prim(root) is not None:
        relocations |= _link_relocations(tuple(lab.scene.robot.links), root, stage)
    return relocations


def _root_by_links(lab: Lab, stage: StageModel) -> str | None:
    links = lab.scene.robot.links
    name = lab.scene.robot.path.rpartition("/")[2]
    held: dict[str, int] = {}
    for prim in stage.named(links.__contains__):
        if prim.present and stage.prim(prim.parent):
            held[prim.parent] = held.get(prim.parent, 0) + 1
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
        namesakes = same_named_prims(stage, root, name)
        if len(namesakes) == 1:
            relocations[f"{root}/{name}"] = namesakes[0]
    if len(missing) == 1 and not relocations:
        prims = (stage.prims[path] for path in bodies_below(stage, root))
        bodies = [prim.path for prim in prims if prim.parent == root and prim.name not in links]
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
    robot, parent = lab.scene.robot, lab.scene.world.graph_parent
    return {parent.path: parent.handout} | dict.fromkeys(
        (robot.path, *robot.link_paths), robot.handout
    )


def lost_graphs(
    specs: Mapping[str, GraphSpec],
    roles: Mapping[str, Roles],
    demanded: Collection[str],
    robot: str,
    stage: StageModel,
) -> dict[str, str]:
    """Map each graph that is missing together with a prim to that prim, whose finding names it.

    That is the topmost `demanded` prim above it that is not in the scene, or the robot at `robot`
    where it stands elsewhere ('' where it does not) and none of its graphs came along.
    """
    lost: dict[str, str] = {}
    on_robot = [name for name in roles if robot and is_at_or_below(specs[name].path, robot)]
    stayed_behind = all(roles[name].graph is None for name in on_robot)
    for name in (name for name, players in roles.items() if players.graph is None):
        missing = ""
        path = specs[name].path.rpartition("/")[0]
        while path:
            missing = path if path in demanded and stage.prim(path) is None else missing
            path = path.rpartition("/")[0]
        if name in on_robot and stayed_behind:
            lost[name] = robot
        elif missing and not stage.unresolved_above(missing):
            lost[name] = missing
    return lost


def is_root_articulated(lab: Lab, stage: StageModel) -> bool:
    """Whether the robot root carries the articulation, and the handout's prim does not."""
    robot = lab.scene.robot
    if not robot.articulation.target:
        return False
    root, base = stage.prim(robot.path), stage.prim(robot.articulation.target)
    is_on_base = base is not None and is_articulated(base)
    return root is not None and is_articulated(root) and not is_on_base


def relocated_lab(lab: Lab, relocations: Mapping[str, str]) -> Lab:
    """Return the lab as it reads where the robot or a link stands elsewhere."""
    if not relocations:
        return lab
    graphs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    scene, robot = lab.scene, lab.scene.robot
    target = relocated_path(robot.articulation.target, relocations)
    placed = replace(
        robot,
        path=relocated_path(robot.path, relocations),
        articulation=replace(robot.articulation, target=target),
    )
    sensors = {
        name: replace(sensor, path=relocated_path(sensor.path, relocations))
        for name, sensor in scene.sensors.items()
    }
    return replace(lab, graphs=graphs, scene=replace(scene, robot=placed, sensors=sensors))


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
