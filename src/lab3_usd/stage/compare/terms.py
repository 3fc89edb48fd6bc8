"""How prims of a starter are compared: what a property is about, and what of a prim matters."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from fnmatch import translate
from functools import cache, lru_cache
from typing import Literal

from msgspec import Struct
from pxr import Usd, UsdGeom

from lab3_usd.spec.submission import StarterRules

Class = Literal["never", "physics", "pose", "shape", "look", "other"]
_POSE = "xformOp"


class Terms(Struct, frozen=True):
    """How prims are compared.

    `classes` tells what a property is about, `limits` are a length in stage units, an angle in
    degrees and a relative scale. `root` is the robot, whose own place is not compared;
    `articulated` are the prims that may carry the articulation root instead of each other.
    """

    rules: StarterRules
    classes: Callable[[str], Class]
    number: float
    mass: float
    limits: tuple[float, float, float]
    root: str
    articulated: tuple[str, ...]
    bodies_rest: bool
    """Whether the bodies still stand where the starter has them."""
    unknown: tuple[str, ...] = ()
    """Prims of the starter that lack an asset: what a stage has there may be the asset's."""


@lru_cache(maxsize=4)
def classifier(rules: StarterRules) -> Callable[[str], Class]:
    """Return the function that says what a property is about."""
    never, physics = pattern(rules.never), pattern(rules.physics)
    looks = pattern(rules.looks)
    shapes = frozenset(rules.shapes)

    @cache
    def of(name: str) -> Class:
        if never.match(name):
            return "never"
        if name.startswith(_POSE):
            return "pose"
        if physics.match(name):
            return "physics"
        if name in shapes:
            return "shape"
        return "look" if looks.match(name) else "other"

    return of


def pattern(names: Iterable[str]) -> re.Pattern[str]:
    """Return what matches every name that fits one of the patterns with `*`."""
    return re.compile("|".join(map(translate, names)))


def applied_schemas(prim: Usd.Prim) -> list[str]:
    """Return every applied schema by its name, known to usd-core or not."""
    return [str(name) for name in Usd.Prim.GetPrimTypeInfo(prim).GetAppliedAPISchemas()]


def is_light_or_camera(prim: Usd.Prim) -> bool:
    """Whether the prim lights the scene or looks at it."""
    kind = str(prim.GetTypeName())
    return (
        kind.endswith("Light")
        or bool(prim.IsA(UsdGeom.Camera))
        or "LightAPI" in applied_schemas(prim)
    )


def is_physical(prim: Usd.Prim, rules: StarterRules) -> bool:
    """Whether the prim itself collides, moves, joins, or is otherwise one of physics."""
    named = (str(prim.GetTypeName()), *applied_schemas(prim))
    return any(name.startswith(rules.physics_names) for name in named)


def affects_physics(prim: Usd.Prim, rules: StarterRules) -> bool:
    """Whether the prim, or something below or above it, is one of physics."""
    below = Usd.PrimRange(prim, Usd.TraverseInstanceProxies())
    return any(is_physical(each, rules) for each in below) or is_collision_shape(prim, rules)


def is_collision_shape(prim: Usd.Prim, rules: StarterRules) -> bool:
    """Whether the prim is a collision shape, by itself or by a prim above it."""
    while prim and not prim.IsPseudoRoot():
        if rules.collision in applied_schemas(prim):
            return True
        prim = prim.GetParent()
    return False


def body_of(prim: Usd.Prim, rules: StarterRules) -> str:
    """Return the path of the rigid body that the prim belongs to, '' for none."""
    while prim and not prim.IsPseudoRoot():
        if rules.body in applied_schemas(prim):
            return str(prim.GetPath())
        prim = prim.GetParent()
    return ""
