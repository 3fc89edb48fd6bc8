"""Joints and wheels: what moves between two bodies, and how fast."""

from __future__ import annotations

import math

from msgspec import Struct

from lab3_usd.model.dry_run.affine import Affine
from lab3_usd.model.transform_math import Vector

HINGE, SLIDER = "PhysicsRevoluteJoint", "PhysicsPrismaticJoint"
FIXED = "PhysicsFixedJoint"
JOINTS = (HINGE, SLIDER, FIXED, "PhysicsSphericalJoint", "PhysicsJoint")
DRIVE = {HINGE: "drive:angular:physics:", SLIDER: "drive:linear:physics:"}


class Joint(Struct, eq=False):
    """A joint between two bodies ('' is the world), and where its motion has come to."""

    name: str
    kind: str
    bodies: tuple[str, str]
    frames: tuple[Affine, Affine]  # in the bodies, their scale included
    axis: Vector
    stiffness: float
    damping: float
    target_velocity: float  # rad/s
    target_position: float = 0.0
    position: float = 0.0
    locked: bool = False  # by another joint between its bodies
    excluded: bool = False  # from the articulation, whose controller does not know it
    authored: tuple[float, float] = (0.0, 0.0)  # the targets that the stage gives
    limits: tuple[float, float] = (-math.inf, math.inf)  # of its position

    @property
    def holds(self) -> bool:
        """Whether the drive says how fast the joint turns; else it turns freely."""
        return self.locked or self.stiffness > 0 or self.damping > 0

    @property
    def reach(self) -> float:
        """How far the joint turns at least one way."""
        return min(-self.limits[0], self.limits[1])

    def reset(self) -> None:
        """Turn back, with the targets of the stage."""
        self.target_velocity, self.target_position = self.authored
        self.position = 0.0

    def speed(self, dt: float) -> float:
        """Return the speed that the drive settles at, implicitly over a step, within the limits."""
        if self.locked or not self.damping:
            return 0.0
        pull = self.stiffness / self.damping
        wanted = self.target_velocity + pull * (self.target_position - self.position)
        speed = wanted / (1.0 + pull * dt)
        if not dt:
            return speed
        low, high = ((limit - self.position) / dt for limit in self.limits)
        return max(low, min(high, speed))


class Wheel(Struct, frozen=True):
    """A wheel that touches the ground: its joint, radius, and axle in the frame of the base."""

    joint: Joint
    sign: float
    radius: float
    along: tuple[float, float]  # where its contact goes when the joint turns forward
    contact: tuple[float, float]
