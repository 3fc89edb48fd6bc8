"""How prims of two stages are compared.

Which properties matter, whether two values are the same, and two places.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from fnmatch import translate
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct
from pxr import Gf, Sdf, Usd, UsdGeom

from lab3_usd.isaac.values import Margin, Value, same_numbers
from lab3_usd.model.changes import Difference
from lab3_usd.model.finding import display
from lab3_usd.model.physics import LIMITS
from lab3_usd.model.prims import Matrix, is_at_or_below
from lab3_usd.model.transforms import (
    Part,
    PlaceTolerance,
    decompose,
    euler_angles,
    is_scaled_alike,
    parts_apart,
    scale_of,
    vector_text,
)
from lab3_usd.spec.scene import Tolerances
from lab3_usd.spec.submission import StarterRules
from lab3_usd.stage.read.prim_transforms import ORDER, RESET, TransformCache, local_transform
from lab3_usd.stage.read.properties import plain_value

Class = Literal["never", "physics", "pose", "shape", "look", "other"]
POSE = "xformOp"


class Terms(Struct, frozen=True):
    """How prims are compared.

    `classes` tells what a property is about. Lengths of `place` are in units of the stage. `roots`
    are the robots, whose own places are not compared; of each, `articulated` are the prims that may
    carry the articulation root.
    """

    rules: StarterRules
    classes: Callable[[str], Class]
    place: PlaceTolerance
    tolerances: Tolerances
    roots: tuple[str, ...]
    articulated: tuple[tuple[str, ...], ...]
    bodies_rest: bool
    """Whether the bodies still stand where the starter has them."""
    unknown: tuple[str, ...] = ()
    """Prims of the starter that lack an asset: what a stage has there may be the asset's."""

    def margin(self, name: str) -> Margin:
        """Return what the numbers of a property may differ by."""
        if name in self.rules.masses:
            return self.tolerances.margin("mass")
        is_of_joint = name in LIMITS or name.startswith("drive:")
        return self.tolerances.margin("joint" if is_of_joint else "number")


def is_on_robot(path: str, terms: Terms) -> bool:
    """Whether a prim is a robot, or a part of one."""
    return any(is_at_or_below(path, root) for root in terms.roots)


@lru_cache(maxsize=4)
def classifier(rules: StarterRules) -> Callable[[str], Class]:
    """Return the function that says what a property is about."""
    never, physics = pattern(rules.never), pattern(rules.physics)
    appearance = pattern(rules.appearance)
    shapes = frozenset(rules.shapes)

    @cache
    def of(name: str) -> Class:
        if never.match(name):
            return "never"
        if name.startswith(POSE):
            return "pose"
        if physics.match(name):
            return "physics"
        if name in shapes:
            return "shape"
        return "look" if appearance.match(name) else "other"

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
    return any(is_physical(part, rules) for part in below) or is_collision_shape(prim, rules)


def is_collision_shape(prim: Usd.Prim, rules: StarterRules) -> bool:
    """Whether the prim is a collision shape, by itself or by a prim above it."""
    return _holder(prim, rules.collision) is not None


def body_of(prim: Usd.Prim, rules: StarterRules) -> str:
    """Return the path of the rigid body that the prim belongs to, '' for none."""
    body = _holder(prim, rules.body)
    return "" if body is None else str(body.GetPath())


def _holder(prim: Usd.Prim, api: str) -> Usd.Prim | None:
    """Return the nearest prim, itself or above, to which a schema is applied."""
    while prim and not prim.IsPseudoRoot():
        if api in applied_schemas(prim):
            return prim
        prim = prim.GetParent()
    return None


_LONGEST = 60  # characters of a value in a message
_QUATERNIONS = (Gf.Quatd, Gf.Quatf, Gf.Quath)
_LARGEST = 3.4028234e38  # that a float holds: as a limit it is none, as infinity is


def same_usd_value(was: Any, now: Any, margin: Margin) -> bool:
    """Whether two values are the same up to a margin of their numbers.

    A rotation and its negative are the same; assets are compared by what they resolve to.
    """
    if was == now:
        return True
    if now is None or isinstance(was, (bool, str)) or isinstance(now, (bool, str)):
        return False
    if isinstance(was, Sdf.AssetPathArray):
        is_array = isinstance(now, Sdf.AssetPathArray) and len(was) == len(now)
        return is_array and all(map(same_asset, was, now))
    if isinstance(was, Sdf.AssetPath):
        return isinstance(now, Sdf.AssetPath) and same_asset(was, now)
    before, after = _numbers(was), _numbers(now)
    if before is None or after is None:
        return False
    if isinstance(was, _QUATERNIONS) and sum(map(operator.mul, before, after)) < 0:
        after = [-part for part in after]
    return same_numbers(before, after, margin)


def _numbers(value: Any) -> list[float] | None:
    """Return every number of a value, None where it holds something else."""
    if isinstance(value, (int, float)):
        number = math.copysign(math.inf, value) if abs(value) >= _LARGEST else float(value)
        return [number]
    if isinstance(value, _QUATERNIONS):
        return [float(value.GetReal()), *map(float, value.GetImaginary())]
    if isinstance(value, (str, Sdf.AssetPath)):
        return None
    try:
        parts = [_numbers(part) for part in value]
    except TypeError:
        return None
    lists = [part for part in parts if part is not None]
    return [number for part in lists for number in part] if len(lists) == len(parts) else None


def same_asset(was: Sdf.AssetPath, now: Sdf.AssetPath) -> bool:
    """Whether two asset paths lead to the same file, to equal ones, or cannot be distinguished.

    Saving a stage in another folder rewrites its relative paths, and an asset that is not here
    cannot be judged.
    """
    paths = str(was.resolvedPath), str(now.resolvedPath)
    if not all(paths):
        return bool(was.path) == bool(now.path)
    if paths[0] == paths[1]:
        return True
    before, after = map(Path, paths)
    try:
        if not (before.is_file() and after.is_file()):
            return before.name == after.name
        same_size = before.stat().st_size == after.stat().st_size
        return same_size and before.read_bytes() == after.read_bytes()
    except OSError:
        return before.name == after.name


def display_value(value: Any) -> str:
    """Return a value for a message: short numbers, and long arrays by their length."""
    text = display(_short(plain_value(value)))
    if len(text) <= _LONGEST:
        return text
    return f"{text[:_LONGEST]}..." if isinstance(value, str) else f"{len(value)} values"


def _short(value: Value | None) -> Value | None:
    """Cut the noise of single precision."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, tuple):
        return tuple(item for item in map(_short, value) if item is not None)
    return value


What = Literal["moved", "scaled", "turned"]
_PARTS: Mapping[Part, What] = {"translate": "moved", "scale": "scaled", "rotate": "turned"}


def how_apart(was: Matrix, now: Matrix, tolerance: PlaceTolerance) -> What | None:
    """Say how two transforms differ, None where they do not."""
    parts = [*parts_apart(decompose(was), decompose(now), tolerance)]
    return next((what for part, what in _PARTS.items() if part in parts), None)


_SCALE = "xformOp:scale"


def place_differences(
    prim: Usd.Prim, twin: Usd.Prim, terms: Terms, *, same_parent: bool
) -> Iterator[Difference]:
    """Yield how the place of a prim differs; what a run moves may have moved."""
    was, now = (matrix_of(either, local=same_parent) for either in (prim, twin))
    if terms.bodies_rest or terms.rules.body not in applied_schemas(prim):
        what = how_apart(was, now, terms.place)
    else:  # a run moves bodies, and scales none
        is_alike = is_scaled_alike(scale_of(was), scale_of(now), terms.place.scale)
        what = None if is_alike else "scaled"
    if what is None:
        return
    names = [name for name in twin.GetAuthoredPropertyNames() if terms.classes(name) == "pose"]
    pairs = [(name, prim.GetAttribute(name), twin.GetAttribute(name)) for name in names]
    changed = [name for name, old, new in pairs if not old or not new or old.Get() != new.Get()]
    before, after = (shown_place(what, matrix) for matrix in (was, now))
    physics = affects_physics(prim, terms.rules) and not is_light_or_camera(prim)
    yield Difference("place", next(iter(changed), ""), before, after, physics)


def authored_place_differences(
    prim: Usd.Prim, twin: Usd.Prim, names: list[str], terms: Terms
) -> Iterator[Difference]:
    """Compare places where layers say all of the place, else operation by operation."""
    order = twin.GetAttribute(ORDER).Get() or ()
    operations = [name.rpartition("!")[2] for name in order if not name.startswith(RESET)]
    if len(order) and all(is_authored(twin, name) for name in (ORDER, *operations)):
        yield from place_differences(prim, twin, terms, same_parent=True)
        return
    moves = not terms.bodies_rest and terms.rules.body in applied_schemas(prim)
    for name in names:
        was, now = prim.GetAttribute(name), twin.GetAttribute(name)
        may_differ = name == ORDER or (moves and not name.startswith(_SCALE))
        if may_differ or not was or same_usd_value(was.Get(), now.Get(), Margin(terms.place.scale)):
            continue
        physics = affects_physics(prim, terms.rules) and not is_light_or_camera(prim)
        yield Difference("place", name, display_value(was.Get()), display_value(now.Get()), physics)


def is_authored(prim: Usd.Prim, name: str) -> bool:
    """Whether a layer at hand gives the property a value, or takes it away."""
    attribute = prim.GetAttribute(name)
    if attribute:
        return bool(attribute.HasAuthoredValueOpinion())
    relationship = prim.GetRelationship(name)
    return bool(relationship and relationship.HasAuthoredTargets())


def matrix_of(prim: Usd.Prim, *, local: bool) -> Matrix:
    """Return the transform of a prim to its parent, or to the world."""
    # UsdGeom raises where the value of an operation is of a type that the operation does not take.
    matrix, is_reset = local_transform(prim)
    return matrix if local and not is_reset else TransformCache().world(prim)


def shown_place(what: What, matrix: Matrix) -> str:
    """Say of a transform where it places a prim, how it turns or how it scales one."""
    pose = decompose(matrix)
    if what == "moved":
        return f"at {vector_text(pose.translation)}"
    if what == "scaled":
        return f"scale {vector_text(pose.scale)}"
    return f"turned {vector_text(euler_angles(pose.rotation))} degrees"
