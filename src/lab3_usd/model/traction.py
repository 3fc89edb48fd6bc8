"""Whether drives can move a robot over the ground: friction, force limits and damping.

After the formulas of PhysX 5. A drive turns its joint with damping times the difference of the
speeds; one of type acceleration with that times the inertia which the articulation has in the air:
about that of the wheel. The ground lets a wheel push with friction times the weight on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from lab3_usd.model.physics import number

MATERIAL_API = "PhysicsMaterialAPI"
FRICTIONS = ("physics:staticFriction", "physics:dynamicFriction")
COMBINED = "physxMaterial:frictionCombineMode"
DRIVE_TYPE = "drive:angular:physics:type"
GRAVITY = 9.81  # metres a second squared
BINDING = "material:binding"
_BINDINGS = (f"{BINDING}:physics", BINDING)
_MODES = ("average", "min", "multiply", "max")  # of the modes of two surfaces the later one counts
_NO_GRIP = 1e-4  # a friction below which nothing is pushed


class Surface(NamedTuple):
    """The friction of a shape, and how it is combined with another's."""

    friction: float = 0.5  # of Isaac Sim's default material
    mode: str = _MODES[0]

    def combined(self, other: Surface) -> float:
        """Return the friction between two surfaces."""
        mode = max((self.mode, other.mode), key=_MODES.index)
        pair = (self.friction, other.friction)
        both = {
            "average": sum(pair) / 2,
            "min": min(pair),
            "multiply": pair[0] * pair[1],
            "max": max(pair),
        }
        return both[mode]

    def grips(self, other: Surface) -> bool:
        """Whether one surface is pushed by the other."""
        return self.combined(other) > _NO_GRIP


def surface_of(material: Mapping[str, Any] | None) -> Surface:
    """Return the surface of a shape with a material of these values, or without one.

    A friction that is not written is 0 (UsdPhysics). Of the two frictions the larger counts.
    """
    if material is None:
        return Surface()
    mode = str(material.get(COMBINED, _MODES[0]))
    frictions = (number(material.get(name)) or 0.0 for name in FRICTIONS)
    return Surface(max(frictions), mode if mode in _MODES else _MODES[0])


def bound_material(shape: str, targets: Callable[[str], Mapping[str, Sequence[str]]]) -> str:
    """Return the material of a shape: of the nearest prim above it that is bound to one, or ''."""
    for name in _BINDINGS:
        path = shape
        while path:
            bound = targets(path).get(name)
            if bound:
                return bound[0]
            path = path.rpartition("/")[0]
    return ""


class Pull(NamedTuple):
    """How a drive moves its part of a robot.

    `most` is what its wheel accelerates it by at most, in lengths a second squared, and `lag` the
    seconds in which it comes up to most of its speed.
    """

    most: float = math.inf
    lag: float = 0.0


class Load(NamedTuple):
    """What a wheel has to move: its part of the robot's mass, its own mass, and its radius."""

    mass: float
    wheel: float
    radius: float


def pull_of(load: Load, force: float, damping: float, *, is_acceleration: bool) -> Pull:
    """Return how a drive moves a load; force and damping are those of the joint, in radians."""
    own = load.wheel * load.radius**2 / 2  # of a disc
    whole = load.mass * load.radius**2 + own
    damping *= own if is_acceleration else 1.0
    if whole <= 0:
        return Pull()
    return Pull(force / whole * load.radius, whole / damping if damping > 0 else math.inf)
