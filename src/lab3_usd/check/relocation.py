"""The lab as it reads in a stage where the robot, a link or a sensor stands elsewhere than asked.

That is a mistake of its own, reported once: what moved along is judged where it is.
"""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from lab3_usd.spec.graph import GraphSpec, Target
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import SceneSpec


def relocated_lab(lab: Lab, relocations: Mapping[str, str]) -> Lab:
    """Return the lab as it reads where the robot or a link stands elsewhere."""
    if not relocations:
        return lab
    graphs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    return replace(lab, graphs=graphs, scene=_relocated_scene(lab.scene, relocations))


def _relocated_scene(scene: SceneSpec, relocations: Mapping[str, str]) -> SceneSpec:
    robot = scene.robot
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
    return replace(scene, robot=placed, sensors=sensors)


def relocated_spec(spec: GraphSpec, relocations: Mapping[str, str]) -> GraphSpec:
    """Return the spec as it reads where a sensor or the robot stands elsewhere than asked.

    `relocations` maps the path of such a prim to where it really is.
    """
    if not relocations:
        return spec
    nodes = {
        role: replace(
            node, targets=tuple(_relocated_target(target, relocations) for target in node.targets)
        )
        for role, node in spec.nodes.items()
    }
    return replace(spec, path=relocated_path(spec.path, relocations), nodes=nodes)


def _relocated_target(target: Target, relocations: Mapping[str, str]) -> Target:
    return replace(target, prims=tuple(relocated_path(prim, relocations) for prim in target.prims))


def relocated_path(path: str, relocations: Mapping[str, str]) -> str:
    """Return where `path` is when the prims of `relocations` stand elsewhere.

    They are applied in their order. A prim below another that was moved is expected where the other
    one stands.
    """
    for expected, actual in relocations.items():
        if path == expected or path.startswith(f"{expected}/"):
            path = actual + path[len(expected) :]
    return path
