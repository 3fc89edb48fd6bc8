"""Whether a starter can carry the lab: everything the graphs and sensors hang on is there."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pxr import Usd

from lab3_usd.spec.lab import Lab
from lab3_usd.stage.read.layers import layer_files

_BODY = "PhysicsRigidBodyAPI"
_SHOWN = 3  # prims that have a wanted name


def starter_problems(lab: Lab, stage: Usd.Stage) -> list[str]:
    """Say all that keeps the lab out of this stage, one line each; empty where nothing does.

    What hangs below a prim that is not there is not said again.
    """
    reasons = list(_reasons(lab, stage))
    units = list(_units(lab, stage))
    if reasons:
        missing = layer_files(stage).missing
        reasons += [f"{path} cannot be read; what is missing may be in it" for path in missing]
    return units + reasons


def _units(lab: Lab, stage: Usd.Stage) -> Iterator[str]:
    """Say in which units or with which axis up the stage is not what every number of the lab is."""
    spec = lab.scene.stage
    wanted: dict[str, str | float] = {
        "upAxis": spec.up_axis,
        "metersPerUnit": spec.meters_per_unit,
        "kilogramsPerUnit": spec.kilograms_per_unit,
    }
    for name, expected in wanted.items():
        # Kilograms have no default in usd-core.
        holder = stage.GetPseudoRoot() if name == "kilogramsPerUnit" else stage
        actual = holder.GetMetadata(name)
        if actual is None:
            continue
        limit = lab.scene.tolerance.number
        is_near = isinstance(expected, float) and math.isclose(actual, expected, rel_tol=limit)
        if actual != expected and not is_near:
            yield f"/ has {name} {_short(actual)}, expected {_short(expected)}; convert the starter"


def _short(value: float | str) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _reasons(lab: Lab, stage: Usd.Stage) -> Iterator[str]:
    added = [sensor.path for sensor in lab.sensors.values()]
    added += [graph.path for graph in lab.graphs.values()]
    blamed: list[str] = []
    for path in dict.fromkeys(_needed(lab)):
        if not any(path.startswith(f"{above}/") for above in blamed):
            reasons = list(_why_missing(stage, path))
            blamed += [path] if reasons else []
            yield from reasons
    for path in added:
        prim = stage.GetPrimAtPath(path)
        if prim:
            yield f"{path} is there already{_state(prim)}; the starter must not hold it"


def is_root_articulated(lab: Lab, stage: Usd.Stage) -> bool:
    """Whether the robot root carries the articulation, and the handout's prim does not."""
    robot = lab.scene.robot
    target = robot.articulation.target
    if not target:
        return False
    return _is_articulated(lab, stage, robot.path) and not _is_articulated(lab, stage, target)


def _is_articulated(lab: Lab, stage: Usd.Stage, path: str) -> bool:
    prim, spec = stage.GetPrimAtPath(path), lab.scene.robot.articulation
    if not prim or spec.api not in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        return False
    switch = prim.GetAttribute(spec.switch)
    return not switch or switch.Get() is not False


def deviations(lab: Lab, stage: Usd.Stage) -> Iterator[tuple[str, str]]:
    """Yield a prim and what is done otherwise than in the handout because of it."""
    if is_root_articulated(lab, stage):
        root, target = lab.scene.robot.path, lab.scene.robot.articulation.target
        message = f"the articulation root is on {root}; Isaac Sim finds no articulation at the"
        yield root, f"{message} handout's target {target}, so the graphs name {root} instead"


def _state(prim: Usd.Prim) -> str:
    """Say of a prim why the Stage panel may not show it."""
    if not prim.IsActive():
        return " (deactivated)"
    return "" if prim.IsDefined() else " (an over without a def)"


def _needed(lab: Lab) -> Iterator[str]:
    """Yield the prims that the lab hangs something on, outermost first."""
    made = {sensor.path for sensor in lab.sensors.values()}
    robot = lab.scene.robot
    yield lab.scene.world.graph_parent.path
    yield robot.path
    for sensor in lab.sensors.values():
        yield sensor.path.rpartition("/")[0]
    for graph in lab.graphs.values():
        parent = graph.path.rpartition("/")[0]
        if parent not in made:
            yield parent
        targets = (path for node in graph.nodes.values() for t in node.targets for path in t.prims)
        yield from (path for path in targets if path not in made)


def _why_missing(stage: Usd.Stage, path: str) -> Iterator[str]:
    prim = stage.GetPrimAtPath(path)
    if not prim:
        elsewhere = _namesakes(stage, path)
        where = f"; {elsewhere} {'has' if ' and ' not in elsewhere else 'have'} that name"
        also = where if elsewhere else ""
        yield f"{path} is missing; the lab adds to it or points at it{also}"
    elif not prim.IsActive():
        yield f"{path} is deactivated; activate it"
    elif not prim.IsDefined():
        yield f"{path} is only an over; what defines it cannot be found"
    elif prim.IsInstanceProxy() or prim.IsInstance():
        yield f"{path} is an instance, which can hold no graph; clear 'instanceable'"


def _namesakes(stage: Usd.Stage, path: str) -> str:
    """Return where prims of a wanted name do stand, bodies rather than what is only seen."""
    name = path.rpartition("/")[2]
    found = [prim for prim in stage.Traverse() if prim.GetName() == name]
    bodies = [prim for prim in found if _BODY in prim.GetPrimTypeInfo().GetAppliedAPISchemas()]
    return " and ".join(str(prim.GetPath()) for prim in (bodies or found)[:_SHOWN])
