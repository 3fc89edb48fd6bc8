"""Whether a joint can follow a command, by what USD says of the joint."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Literal

from msgspec import Struct

from lab3_usd.model.physics import EXCLUDED, JOINT_ENABLED, LIMITS, REVOLUTE, joint_limits, number

PRISMATIC = "PhysicsPrismaticJoint"
DRIVEN_AXES = {
    REVOLUTE: "angular",
    PRISMATIC: "linear",
}  # others have several drives
DRIVE = "PhysicsDriveAPI"
JointCommand = Literal["position", "velocity", "effort"]


class Hindrance(Struct, frozen=True):
    """Why a joint does not follow: in words, the property, what that should be, and what it is."""

    text: str
    property: str | None
    expected: str
    actual: str | None = None


def drive_prefix(kind: str) -> str:
    """Return what the attributes of a joint's drive begin with; `kind` is angular or linear."""
    return f"drive:{kind}:physics:"


def hindrance(
    joint: str, apis: Collection[str], values: Mapping[str, Any], command: JointCommand
) -> Hindrance | None:
    """Return why a joint of one axis cannot follow a command of this kind, None where it can.

    `joint` is the type of its prim. An effort needs no drive. A spring holds a joint at a position
    and against a velocity, which its damper brings about (UsdPhysics: PhysicsDriveAPI, force =
    stiffness * (targetPosition - position) + damping * (targetVelocity - velocity)).
    """
    if values.get(JOINT_ENABLED) is False:
        return Hindrance("is switched off", JOINT_ENABLED, "true", "false")
    if values.get(EXCLUDED) is True:
        return Hindrance("is excluded from the articulation", EXCLUDED, "false", "true")
    low, high = joint_limits(values)
    if low == high:
        text = f"has limits that leave it no way: {low:g} to {high:g}"
        return Hindrance(text, LIMITS[1], f"above {low:g}", f"{high:g}")
    return None if command == "effort" else of_drive(joint, apis, values, command)


def of_drive(
    joint: str, apis: Collection[str], values: Mapping[str, Any], command: JointCommand
) -> Hindrance | None:
    """Return what of its drive keeps a joint from a position or velocity, None for nothing."""
    kind = DRIVEN_AXES[joint]
    if f"{DRIVE}:{kind}" not in apis:
        other = next((api for api in sorted(apis) if api.startswith(f"{DRIVE}:")), None)
        if other is None:
            return Hindrance("has no drive", None, f"a drive of kind {kind}")
        found = other.partition(":")[2]
        text = f"has a drive of kind {found}, and its axis takes one of kind {kind}"
        return Hindrance(text, None, f"a drive of kind {kind}", found)
    start = drive_prefix(kind)
    force = number(values.get(f"{start}maxForce"))
    if force is not None and force <= 0.0:
        return Hindrance("has a drive without force", f"{start}maxForce", "above 0", f"{force:g}")
    needed = "stiffness" if command == "position" else "damping"
    gains = {name: number(values.get(start + name)) or 0.0 for name in ("stiffness", "damping")}
    if gains[needed] <= 0.0:
        text = f"has a drive without {needed}"
        return Hindrance(text, f"{start}{needed}", "above 0", f"{gains[needed]:g}")
    spring = gains["stiffness"]
    if command == "velocity" and spring > 0.0:
        text = f"has a drive with stiffness {spring:g}"
        return Hindrance(text, f"{start}stiffness", "0", f"{spring:g}")
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
