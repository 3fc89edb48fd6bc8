"""Describes the robot of a stage: its root, its links, its wheels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.robot.axles import anchor_in_metres, axles
from lab3_usd.check.robot.wheels import tied_joints
from lab3_usd.facts.frame_targets import articulation_links
from lab3_usd.model.joint_drives import DRIVE, DRIVEN_AXES, drive_prefix
from lab3_usd.model.physics import (
    ARTICULATION_API,
    AXIS,
    BODY_API,
    FIXED,
    LIMITS,
    MASS,
    MASS_API,
    PLANE,
    REVOLUTE,
    SCENE,
    USUAL_AXIS,
    bodies,
    bodies_below,
    is_articulated,
    is_joint,
    joints,
    number,
    still_by,
)
from lab3_usd.model.prims import Matrix, Prim, is_at_or_below, upwards
from lab3_usd.model.stage import StageModel
from lab3_usd.model.transforms import (
    IDENTITY,
    decompose,
    distance,
    dot,
    euler_angles,
    relative_transform,
)
from lab3_usd.new_lab.yaml_text import as_typed
from lab3_usd.spec.graph import GraphSpec

PART = "A1"
_PAIR = 2  # wheels that are a distance apart
_STIFFNESS, _DAMPING = "drive:angular:physics:stiffness", "drive:angular:physics:damping"


def describe_robots(
    stage: StageModel, graphs: Iterable[GraphSpec], until: str
) -> dict[str, dict[str, Any]]:
    """Describe each robot by name, without its wheels; `until` is the last checkpoint."""
    graphs = tuple(graphs)
    robots: dict[str, dict[str, Any]] = {}
    for target, is_articulation in _articulations(stage, graphs):
        root = _root(stage, target)
        if root in (described["path"] for described in robots.values()):
            continue
        prim = stage.prims.get(root)
        base = _base(stage, target, root, graphs)
        articulation = {"articulation": {"target": target, "handout": PART}}
        placed = pose(None if prim is None else prim.local, stage.meters_per_unit)
        name = root.rpartition("/")[2]
        count = sum(described["path"].rpartition("/")[2] == name for described in robots.values())
        robots[f"{name}_{count + 1}" if count else name] = {
            "path": root,
            "handout": PART,
            "pose": {**placed, "handout": PART},
            "pose_is_error_until": until,
            **(articulation if is_articulation else {}),
            "base_frame": base,
            "links": {
                link.path.removeprefix(f"{root}/"): _link(link, stage, root, base)
                for link in _links(stage, root)
            },
        }
    return robots


def has_robot(stage: StageModel, graphs: Iterable[GraphSpec]) -> bool:
    """Whether a stage has a robot that can be described."""
    return any(True for _ in _articulations(stage, graphs))


def _articulations(stage: StageModel, graphs: Iterable[GraphSpec]) -> Iterator[tuple[str, bool]]:
    """Yield the prim with each articulation, and whether it may have one.

    Those that graphs move come first. A robot that nothing moves need not be an articulation: where
    there is none, it is the rigid body that the graphs name, or a prim of a missing asset.
    """
    targets = [
        (target.port in node.type.articulation, prim)
        for graph in graphs
        for node in graph.nodes.values()
        for target in node.targets
        for prim in target.prims
    ]
    # The prims that graphs move, then all others that they name.
    named = [prim for _, prim in sorted(targets, key=lambda target: not target[0])]
    roots = [prim.path for prim in stage.with_api(ARTICULATION_API) if is_articulated(prim)]
    moved = [
        root
        for path in named
        for root in roots
        if is_at_or_below(root, path) or is_at_or_below(path, root)
    ]
    paths = [path for path in named if path in stage.prims or stage.unresolved_above(path)]
    yield from ((root, True) for root in dict.fromkeys([*moved, *roots]))
    for path in [] if roots else paths:
        if stage.unresolved_above(path) is not None:
            yield path, True
            return
        carriers = (stage.prims.get(above) for above in upwards(path))
        body = next((prim for prim in carriers if prim is not None and BODY_API in prim.apis), None)
        if body is not None:
            yield body.path, False
            return


def _root(stage: StageModel, target: str) -> str:
    """Return the prim that holds the whole robot."""
    missing = stage.unresolved_above(target)
    if missing is not None and missing.prim != "/":
        return missing.prim
    parent = target.rpartition("/")[0]
    if len(bodies_below(stage, target)) > 1 and (not parent or _is_root(stage, target, parent)):
        return target
    return parent or target


def _is_root(stage: StageModel, target: str, parent: str) -> bool:
    """Whether a prim with links below it is the robot itself, and no link that holds the others.

    A link below the world is the robot's root: what holds the world's ground is no robot.
    """
    prim = stage.prim(target)
    if prim is None or BODY_API not in prim.apis:
        return True
    roots = sum(is_at_or_below(root.path, parent) for root in stage.with_api(ARTICULATION_API))
    world = (*stage.of_type(SCENE), *stage.of_type(PLANE))
    return roots > 1 or any(is_at_or_below(part.path, parent) for part in world)


def _base(stage: StageModel, target: str, root: str, graphs: Iterable[GraphSpec]) -> str:
    """Return the frame of the robot's base: the one below which the graphs hang the others.

    Where they name none, it is the articulation root, or of the links below it the first one that
    hangs below no other.
    """
    for graph in graphs:
        for node in graph.nodes.values():
            ports = () if node.type.tf is None else node.type.tf.prims
            for prim_target in node.targets:
                first = next(iter(prim_target.prims), "")
                if ports and prim_target.port == ports[0] and first.startswith(f"{root}/"):
                    return first.removeprefix(f"{root}/")
    carrier = stage.prims.get(target)
    if carrier is not None and is_joint(carrier):  # of an arm that is fixed to the world
        held = next(filter(None, reversed(bodies(carrier))), target)
        return _below(held, root)
    prim = stage.prims.get(root)
    links = None if prim is None or target != root else articulation_links(prim, stage)
    first = next((path for path, parent in (links or {}).items() if not parent), target)
    return _below(first, root)


def _below(path: str, root: str) -> str:
    """Return the name of a link, '' for the robot itself."""
    return "" if path == root else path.removeprefix(f"{root}/")


def _links(stage: StageModel, root: str) -> Iterator[Prim]:
    """Yield the bodies below the root that move and are tied to the robot."""
    for path in bodies_below(stage, root):
        prim = stage.prims[path]
        is_still = still_by(prim.attributes) != ""
        is_tied = any(is_at_or_below(end, path) for joint in joints(stage) for end in bodies(joint))
        if path != root and not is_still and is_tied and BODY_API in prim.apis:
            yield prim


def _link(prim: Prim, stage: StageModel, root: str, base: str) -> dict[str, Any]:
    """Describe a link: its mass, and its place on the root where it is the base or fixed to it.

    A place is written of a link that is not turned. A base that a joint fixes to the world is held.
    """
    mass = number(prim.attributes.get(MASS)) if MASS_API in prim.apis else None
    name, ends = prim.path.removeprefix(f"{root}/"), {prim.path, f"{root}/{base}"}
    is_fixed = any(joint.type == FIXED and set(bodies(joint)) == ends for joint in joints(stage))
    top, on_root = stage.prims.get(root), prim.local
    if top is not None and prim.parent != top.path and top.world and prim.world:
        on_root = relative_transform(prim.world, top.world)
    stands = pose(on_root, stage.meters_per_unit)
    has_place = (name == base or is_fixed) and not any(stands["rotate"])
    place = stands["translate"] if has_place else ()
    weight = {"mass": as_typed(mass)} if mass else {}
    to_world = any(
        joint.type == FIXED and sorted(bodies(joint)) == ["", prim.path] for joint in joints(stage)
    )
    held = {"held": True} if name == base and to_world else {}
    return {**weight, **({"offset": place} if any(place) else {}), **held, "handout": PART}


def pose(local: Matrix | None, metres: float) -> dict[str, Any]:
    """Return a transform as files write it: metres, degrees about X, Y and Z, and a scale."""
    parts = decompose(local or IDENTITY)
    x, y, z = parts.translation
    return {
        "translate": without_noise((x * metres, y * metres, z * metres)),
        "rotate": without_noise(euler_angles(parts.rotation)),
        "scale": without_noise(parts.scale),
    }


def without_noise(vector: Sequence[float]) -> list[float]:
    """Return numbers without float noise."""
    return [round(number, 6) + 0.0 for number in vector]


def moved_joints(
    stage: StageModel, root: str, links: Iterable[str], graphs: Iterable[GraphSpec]
) -> dict[str, str]:
    """Return the links of the joints with velocity drives that the graphs name, by joint."""
    links = tuple(links)
    words = {
        word
        for graph in graphs
        for node in graph.nodes.values()
        for setting in node.settings
        for word in (setting.value if isinstance(setting.value, tuple) else (setting.value,))
    }
    moved = {}
    for joint in joints(stage):
        link = _link_at(bodies(joint)[1], root, links)
        stiffness = number(joint.attributes.get(_STIFFNESS, 0.0))
        damping = number(joint.attributes.get(_DAMPING, 0.0))
        is_driven = stiffness == 0 and damping is not None and damping > 0
        if joint.type == REVOLUTE and joint.name in words and link and is_driven:
            moved[joint.name] = link
    return moved


def describe_joints(
    stage: StageModel, root: str, links: Iterable[str], wheels: Iterable[str]
) -> dict[str, dict[str, Any]]:
    """Describe the joints by which links move, by name; those of wheels are left out."""
    links, described = tuple(links), dict[str, dict[str, Any]]()
    for joint in joints(stage):
        first, second = (_link_at(end, root, links) for end in bodies(joint))
        is_tied = bool(second) and first is not None
        if joint.type != FIXED and is_tied and joint.name not in (*wheels, *described):
            described[joint.name] = {
                "type": joint.type,
                "links": [first, second],
                **dict(_motion(joint, stage.meters_per_unit)),
                "handout": PART,
            }
    return described


def _link_at(end: str, root: str, links: Iterable[str]) -> str | None:
    """Return the link to which an end of a joint belongs, '' for the world, None for none."""
    holding = (link for link in links if is_at_or_below(end, f"{root}/{link}"))
    return max(holding, key=len, default=None) if end else ""


def _motion(joint: Prim, metres: float) -> Iterator[tuple[str, Any]]:
    """Yield the axis of a joint of one axis, its limits, and what is set of its drive.

    Limits are degrees, or units of the stage, which are so many `metres`.
    """
    kind = DRIVEN_AXES.get(joint.type)
    if kind is None:
        return
    yield "axis", str(joint.attributes.get(AXIS, USUAL_AXIS))
    low, high = (number(joint.attributes.get(name)) for name in LIMITS)
    if low is not None and high is not None:
        unit = metres if kind == "linear" else 1.0
        yield "limits", [as_typed(low * unit), as_typed(high * unit)]
    for key, name in (
        ("stiffness", "stiffness"),
        ("damping", "damping"),
        ("max_force", "maxForce"),
    ):
        value = number(joint.attributes.get(f"{drive_prefix(kind)}{name}"))
        if f"{DRIVE}:{kind}" in joint.apis and value is not None and math.isfinite(value):
            yield key, as_typed(value)


def describe_wheels(subject: RobotSubject) -> dict[str, Any]:
    """Describe the two wheels of a robot, whose joints the subject's scene names.

    The result is empty unless there are two, which turn about one axle.
    """
    wheels = tied_joints(subject)
    places = [place for wheel in wheels if (place := anchor_in_metres(wheel, subject))]
    turns = [*axles(subject).values()]
    if not len(wheels) == len(places) == len(turns) == _PAIR or distance(*turns) > 1e-3:  # noqa: PLR2004
        return {}
    robot = subject.robot
    sides = [dot(turns[0], place) for place in places]
    centre = [(a + b) / 2 for a, b in zip(*places, strict=True)][:2]
    folder = wheels[0].site.rpartition("/")[0].removeprefix(robot.path).lstrip("/")
    return {
        "handout": PART,
        "joints": dict(robot.wheels.joints),
        "joints_below": folder,
        "distance": round(distance(*places), 6),
        "axle": without_noise(turns[0]),
        "left": wheels[sides.index(max(sides))].name,
        **({"centre": without_noise(centre)} if any(without_noise(centre)) else {}),
    }
