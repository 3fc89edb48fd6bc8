"""The wheel joints of the robot: found by name or by what they connect, and how they stand."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.derived import once_per_stage
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import BODIES, BODY_API, REVOLUTE, bodies, is_joint, joints
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel


class WheelJoint(Struct, frozen=True, eq=False):
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


@once_per_stage
def wheel_joints(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints in the order of the scene file."""
    robot = subject.lab.scene.robot
    found = []
    for name, wheel in robot.wheels.joints.items():
        link = f"{robot.path}/{wheel}"
        prim = _find(subject.stage, robot.path, name, link)
        found.append(WheelJoint(name, robot.joint_path(name), link, prim))
    return found


def _find(stage: StageModel, root: str, name: str, link: str) -> Prim | None:
    named = [prim for prim in stage.named(name) if is_at_or_below(prim.path, root)]
    for prim in sorted(named, key=lambda prim: (not prim.present, not is_joint(prim), prim.path)):
        return prim
    for prim in joints(stage):
        if prim.type == REVOLUTE and any(is_at_or_below(body, link) for body in bodies(prim)):
            return prim
    return None


def could_hide_joints(subject: StageSubject) -> bool:
    """Whether a missing asset of the robot, other than those of its links, could hold joints."""
    robot = subject.lab.scene.robot
    return is_unresolved(subject.stage, robot.path) or any(
        is_at_or_below(missing.prim, robot.path)
        and not any(is_at_or_below(missing.prim, link) for link in robot.link_paths)
        for missing in subject.stage.unresolved
    )


def has_no_joints(subject: StageSubject) -> bool:
    """Whether the robot is there, and not one joint ties any of its links.

    A robot of one link has none.
    """
    robot, stage = subject.lab.scene.robot, subject.stage
    if len(robot.links) <= 1 or stage.prim(robot.path) is None or could_hide_joints(subject):
        return False
    return not any(
        is_at_or_below(body, robot.path) for joint in joints(stage) for body in bodies(joint)
    )


def wheel_side(joint: WheelJoint) -> int | None:
    """Return which of the two bodies is the wheel, None where neither or both are."""
    sides = [joint.prim is not None and is_at_or_below(body, joint.link) for body in ends_of(joint)]
    return sides.index(True) if sides.count(True) == 1 else None


def ends_of(joint: WheelJoint) -> tuple[str, str]:
    """Return the two prims that a joint connects; '' stands for the world."""
    return ("", "") if joint.prim is None else bodies(joint.prim)


def base_side(joint: WheelJoint) -> int | None:
    """Return which of the two bodies is not the wheel."""
    side = wheel_side(joint)
    return None if side is None else 1 - side


def is_stated(joint: WheelJoint, subject: StageSubject, *names: str) -> bool:
    """Whether these properties are as the file says, and none may be in a missing asset."""
    prim = joint.prim
    if prim is None or not is_unresolved(subject.stage, prim.path):
        return prim is not None
    return prim.attributes.keys() >= {*names}


def wrong_ends(joint: WheelJoint, subject: StageSubject) -> Iterator[tuple[str, str]]:
    """Yield the property of each body that the joint does not rightly connect, and what it is.

    One end is the wheel, the other a body of the robot that is no wheel. Ends that are right are
    left out; a link that is missing altogether is not the joint's fault.
    """
    robot = subject.lab.scene.robot
    wheels = [wheel.link for wheel in wheel_joints(subject)]
    plain = [path for path in robot.link_paths if path not in wheels]
    ends, side = ends_of(joint), wheel_side(joint)
    if side is None:
        has_base = any(is_at_or_below(ends[1], link) for link in plain)
        wheel_end = 0 if has_base else 1
        yield BODIES[wheel_end], ends[wheel_end]
        return
    base = ends[1 - side]
    if not any(is_at_or_below(base, link) for link in plain) and not _is_body(base, subject):
        yield BODIES[1 - side], base


def _is_body(path: str, subject: StageSubject) -> bool:
    """Whether a prim moves with a body of the robot that the handout does not name."""
    robot = subject.lab.scene.robot
    is_link = any(is_at_or_below(path, link) for link in robot.link_paths)
    if is_link or not is_at_or_below(path, robot.path):
        return False
    while is_at_or_below(path, robot.path):
        found = subject.stage.prim(path)
        if found is not None and BODY_API in found.apis:
            return True
        path = path.rpartition("/")[0]
    return False


def turning_joints(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints that can turn; the others are S07's."""
    return [
        joint
        for joint in wheel_joints(subject)
        if joint.live is not None and subject.stage.prim(joint.link) is not None
    ]


def tied_joints(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints that connect what they should; the others are S08's."""
    return [joint for joint in turning_joints(subject) if not any(wrong_ends(joint, subject))]
