"""The wheel joints of the robot: found by name or by what they connect, and how they stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from lab3_usd.check.absence import is_at_or_below, is_hidden
from lab3_usd.check.model import Prim, StageModel
from lab3_usd.check.physics import BODIES, BODY_API, REVOLUTE, below, bodies, is_joint, joints
from lab3_usd.check.poses import Vector, decompose, directed, moved, relative, scaled, spun
from lab3_usd.check.subject import StageSubject
from lab3_usd.spec.catalog import Value

_AXES: dict[Any, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
AXIS = "physics:axis"


@dataclass(frozen=True, slots=True, eq=False)
class WheelJoint:
    """One wheel joint that the handout names, and the prim that plays it.

    `path` is where the handout shows it, `link` the path of its wheel. `prim` may be absent from
    the scene or of a wrong type; None where nothing has the name.
    """

    name: str
    path: str
    link: str
    prim: Prim | None

    @property
    def site(self) -> str:
        """Where to report: the prim, else the path of the handout."""
        return self.path if self.prim is None else self.prim.path

    @property
    def related(self) -> tuple[str, ...]:
        """The path of the handout, where the joint stands elsewhere."""
        return () if self.site == self.path else (self.path,)

    @property
    def live(self) -> Prim | None:
        """The prim when it is a revolute joint of the scene, else None."""
        prim = self.prim
        return prim if prim is not None and prim.present and prim.type == REVOLUTE else None


def wheel_joints(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints in the order of the scene file."""
    robot = subject.lab.scene["robot"]
    root, wheels = robot["path"], robot["wheels"]
    found = []
    for name, link in wheels["joints"].items():
        path = f"{root}/{wheels['joints_below']}/{name}"
        prim = _find(subject.stage, root, name, f"{root}/{link}")
        found.append(WheelJoint(name, path, f"{root}/{link}", prim))
    return found


def _find(stage: StageModel, root: str, name: str, link: str) -> Prim | None:
    named = [prim for prim in below(stage, root) if prim.name == name]
    for prim in sorted(named, key=lambda prim: (not prim.present, not is_joint(prim), prim.path)):
        return prim
    for prim in joints(stage):
        if prim.type == REVOLUTE and any(is_at_or_below(body, link) for body in bodies(prim)):
            return prim
    return None


def could_hide_joints(subject: StageSubject) -> bool:
    """Whether a missing asset of the robot, other than those of its links, could hold joints."""
    robot = subject.lab.scene["robot"]
    links = [f"{robot['path']}/{name}" for name in robot["links"]]
    return is_hidden(subject.stage, robot["path"]) or any(
        is_at_or_below(missing.prim, robot["path"])
        and not any(is_at_or_below(missing.prim, link) for link in links)
        for missing in subject.stage.unresolved
    )


def wheel_side(joint: WheelJoint) -> int | None:
    """Return which of the two bodies is the wheel, None where neither or both are."""
    sides = [joint.prim is not None and is_at_or_below(body, joint.link) for body in _ends(joint)]
    return sides.index(True) if sides.count(True) == 1 else None


def _ends(joint: WheelJoint) -> tuple[str, str]:
    return ("", "") if joint.prim is None else bodies(joint.prim)


def base_side(joint: WheelJoint) -> int | None:
    """Return which of the two bodies is not the wheel."""
    side = wheel_side(joint)
    return None if side is None else 1 - side


def axle(joint: WheelJoint, subject: StageSubject) -> Vector | None:
    """Return the direction about which a positive velocity turns the wheel, in the robot's frame.

    The base's side of the joint is asked: how far the wheel has turned does not matter then.
    None where a body is missing.
    """
    side = base_side(joint)
    frame = None if side is None else _base_frame(joint, side, subject)
    if side is None or frame is None or joint.prim is None:
        return None
    attributes = joint.prim.attributes
    along = _AXES.get(attributes.get(AXIS, "X"))
    if along is None:
        return None
    local = spun(along, _quaternion(attributes.get(f"physics:localRot{side}")))
    # A joint turns its second body against its first.
    sign = 1.0 if side == 0 else -1.0
    return scaled(directed(local, decompose(frame).rotation), sign)


def anchor(joint: WheelJoint, subject: StageSubject) -> Vector | None:
    """Return where the joint sits, in the robot's frame and in metres; None without a base."""
    side = base_side(joint)
    frame = None if side is None else _base_frame(joint, side, subject)
    if frame is None or joint.prim is None:
        return None
    local = joint.prim.attributes.get(f"physics:localPos{side}")
    point = moved(_vector(local), frame)
    return scaled(point, subject.stage.meters_per_unit)


def _base_frame(joint: WheelJoint, side: int, subject: StageSubject) -> tuple[float, ...] | None:
    body = subject.stage.prim(_ends(joint)[side])
    root = subject.stage.prim(subject.lab.scene["robot"]["path"])
    if body is None or root is None or body.world is None or root.world is None:
        return None
    return relative(body.world, root.world)


def _numbers(value: Value | None) -> list[float]:
    items = value if isinstance(value, tuple) else ()
    return [float(item) for item in items if isinstance(item, (int, float))]


def _vector(value: Value | None) -> Vector:
    found = _numbers(value)
    return (found[0], found[1], found[2]) if len(found) == len(_AXES) else (0.0, 0.0, 0.0)


def _quaternion(value: Value | None) -> tuple[float, float, float, float]:
    found = _numbers(value)
    if len(found) != 4:  # noqa: PLR2004 - x, y, z, w
        return (0.0, 0.0, 0.0, 1.0)
    return (found[0], found[1], found[2], found[3])


def wrong_ends(joint: WheelJoint, subject: StageSubject) -> Iterator[tuple[str, str]]:
    """Yield the property of each body that the joint does not rightly connect, and what it is.

    One end is the wheel, the other a body of the robot that is no wheel. Ends that are right are
    left out; a link that is missing altogether is not the joint's fault.
    """
    robot = subject.lab.scene["robot"]
    plain = [f"{robot['path']}/{name}" for name in _plain_links(robot)]
    ends, side = _ends(joint), wheel_side(joint)
    if side is None:
        has_base = any(is_at_or_below(ends[1], link) for link in plain)
        wheel_end = 0 if has_base else 1
        yield BODIES[wheel_end], ends[wheel_end]
        return
    base = ends[1 - side]
    if not any(is_at_or_below(base, link) for link in plain) and not _is_body(base, subject):
        yield BODIES[1 - side], base


def _plain_links(robot: Any) -> list[str]:  # noqa: ANN401 - plain data of the scene file
    return [name for name in robot["links"] if name not in robot["wheels"]["joints"].values()]


def _is_body(path: str, subject: StageSubject) -> bool:
    """Whether a prim moves with a body of the robot that the handout does not name."""
    robot = subject.lab.scene["robot"]
    named = [f"{robot['path']}/{name}" for name in robot["links"]]
    if not is_at_or_below(path, robot["path"]) or any(is_at_or_below(path, n) for n in named):
        return False
    while is_at_or_below(path, robot["path"]):
        found = subject.stage.prim(path)
        if found is not None and BODY_API in found.apis:
            return True
        path = path.rpartition("/")[0]
    return False
