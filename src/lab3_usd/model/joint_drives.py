"""What USD says of a joint: its drive, and whether it can follow a command."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from msgspec import Struct

from lab3_usd.model.physics import EXCLUDED, JOINT_ENABLED, LIMITS, REVOLUTE, joint_limits, number

PRISMATIC = "PhysicsPrismaticJoint"
DRIVEN_AXES = {
    REVOLUTE: "angular",
    PRISMATIC: "linear",
}  # others have several drives
DRIVE = "PhysicsDriveAPI"
JointCommand = Literal["position", "velocity", "effort"]


class JointFault(Struct, frozen=True):
    """What is wrong with a joint: in words, the property, what that should be, and what it is."""

    text: str
    property: str | None
    expected: str
    actual: str | None = None


class Drive(NamedTuple):
    """The drive of a joint as its file has it, in degrees where the joint turns.

    `api` is its schema, '' for none, and `start` what its attributes begin with. What is not
    written is as in UsdPhysics; what is no number is None.
    """

    api: str
    start: str
    stiffness: float | None
    damping: float | None
    force: float | None
    position: float | None
    velocity: float | None
    is_acceleration: bool


def read_drive(joint: str, apis: Collection[str], values: Mapping[str, Any]) -> Drive:
    """Return the drive of a joint of this type; of one with several axes, that of the first."""
    kind = DRIVEN_AXES.get(joint, "")
    api = min((api for api in apis if api.startswith(f"{DRIVE}:{kind}")), default="")
    start = drive_prefix(kind or api.partition(":")[2])
    return Drive(
        api,
        start,
        number(values.get(f"{start}stiffness", 0.0)),
        number(values.get(f"{start}damping", 0.0)),
        number(values.get(f"{start}maxForce", math.inf)),
        number(values.get(f"{start}targetPosition", 0.0)),
        number(values.get(f"{start}targetVelocity", 0.0)),
        values.get(f"{start}type") == "acceleration",
    )


def number_text(value: float | None) -> str:
    """Write a value of a drive, None for one that is no number."""
    return "no number" if value is None else f"{value:g}"


def drive_prefix(kind: str) -> str:
    """Return what the attributes of a joint's drive begin with; `kind` is angular or linear."""
    return f"drive:{kind}:physics:"


def hindrance(
    joint: str, apis: Collection[str], values: Mapping[str, Any], command: JointCommand
) -> JointFault | None:
    """Return why a joint of one axis cannot follow a command of this kind, None where it can.

    `joint` is the type of its prim. An effort needs no drive. A spring holds a joint at a position
    and against a velocity, which its damper brings about (UsdPhysics: PhysicsDriveAPI, force =
    stiffness * (targetPosition - position) + damping * (targetVelocity - velocity)).
    """
    off = next(left_out(values), None)
    if off is not None:
        return off
    low, high = joint_limits(values)
    if low == high:
        text = f"has limits that leave it no way: {low:g} to {high:g}"
        return JointFault(text, LIMITS[1], f"above {low:g}", f"{high:g}")
    return None if command == "effort" else of_drive(joint, apis, values, command)


def left_out(values: Mapping[str, Any]) -> Iterator[JointFault]:
    """Yield why a joint does not work, and why it is in no articulation."""
    if values.get(JOINT_ENABLED) is False:
        yield JointFault("is disabled", JOINT_ENABLED, "True", "False")
    if values.get(EXCLUDED) is True:
        yield JointFault("is excluded from the articulation", EXCLUDED, "False", "True")


def of_drive(
    joint: str, apis: Collection[str], values: Mapping[str, Any], command: JointCommand
) -> JointFault | None:
    """Return what of its drive keeps a joint from a position or velocity, None for nothing."""
    kind, drive = DRIVEN_AXES[joint], read_drive(joint, apis, values)
    if not drive.api:
        other = next((api for api in sorted(apis) if api.startswith(f"{DRIVE}:")), None)
        if other is None:
            return JointFault("has no drive", None, f"drive:{kind}")
        other_kind = other.partition(":")[2]
        text = f"has a drive:{other_kind} in place of drive:{kind}"
        return JointFault(text, None, f"drive:{kind}", other_kind)
    force, stiffness, damping = drive.force, drive.stiffness or 0.0, drive.damping or 0.0
    if force is not None and force <= 0.0:
        name = f"{drive.start}maxForce"
        return JointFault("has a drive without force", name, "above 0", f"{force:g}")
    needed, gain = ("stiffness", stiffness) if command == "position" else ("damping", damping)
    if gain <= 0.0:
        text = f"has a drive without {needed}"
        return JointFault(text, f"{drive.start}{needed}", "above 0", f"{gain:g}")
    if command == "velocity" and stiffness > 0.0:
        text = f"has a drive with stiffness {stiffness:g}"
        return JointFault(text, f"{drive.start}stiffness", "0", f"{stiffness:g}")
    return None


def moving_command(
    given: Sequence[JointCommand], gains: Collection[tuple[float, float]]
) -> JointCommand | None:
    """Return by which of the given kinds joints are moved, whose drives have these gains.

    Each joint has its stiffness and damping. Where all drives are dampers, it is by speeds.
    """
    if "position" in given and any(stiffness > 0 for stiffness, _ in gains):
        return "position"
    if "velocity" in given and any(d > 0 for _, d in gains) and not any(s > 0 for s, _ in gains):
        return "velocity"
    return "effort" if "effort" in given else next(iter(given), None)
