"""Whether a joint can follow a command to its position, by what USD says of the joint."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.model.physics import EXCLUDED, JOINT_ENABLED, LIMITS, REVOLUTE, limits, number

PRISMATIC = "PhysicsPrismaticJoint"
DRIVEN_AXES = {
    REVOLUTE: "angular",
    PRISMATIC: "linear",
}  # others have several drives
DRIVE = "PhysicsDriveAPI"


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
    joint: str, apis: Collection[str], values: Mapping[str, Any], *, by_drive: bool = True
) -> Hindrance | None:
    """Return why a joint of one axis cannot be moved to a position, None where it can be.

    `joint` is the type of its prim. Without `by_drive` the joint is moved by an effort, which
    needs no drive. A spring holds a joint at a position (UsdPhysics: PhysicsDriveAPI, force =
    stiffness * (targetPosition - position) + damping * (targetVelocity - velocity)).
    """
    kind = DRIVEN_AXES[joint]
    if values.get(JOINT_ENABLED) is False:
        return Hindrance("is switched off", JOINT_ENABLED, "true", "false")
    if values.get(EXCLUDED) is True:
        return Hindrance("is excluded from the articulation", EXCLUDED, "false", "true")
    low, high = limits(values)
    if low == high:
        text = f"has limits that leave it no way: {low:g} to {high:g}"
        return Hindrance(text, LIMITS[1], f"above {low:g}", f"{high:g}")
    return _of_drive(kind, apis, values) if by_drive else None


def _of_drive(kind: str, apis: Collection[str], values: Mapping[str, Any]) -> Hindrance | None:
    if f"{DRIVE}:{kind}" not in apis:
        other = next((api for api in sorted(apis) if api.startswith(f"{DRIVE}:")), None)
        if other is None:
            return Hindrance("has no drive", None, f"a drive of kind {kind}")
        found = other.partition(":")[2]
        text = f"has a drive of kind {found}, and its axis takes one of kind {kind}"
        return Hindrance(text, None, f"a drive of kind {kind}", found)
    start = drive_prefix(kind)
    force, stiffness = (number(values.get(start + name)) for name in ("maxForce", "stiffness"))
    if force is not None and force <= 0.0:
        return Hindrance("has a drive without force", f"{start}maxForce", "above 0", f"{force:g}")
    if stiffness is None or stiffness <= 0.0:
        return Hindrance(
            "has a drive without stiffness", f"{start}stiffness", "above 0", f"{stiffness or 0.0:g}"
        )
    return None
