"""Whether one prim of a stage stands where the starter has it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pxr import Gf, Usd

from lab3_usd.model.changes import Difference
from lab3_usd.stage.compare.terms import Terms, affects_physics, applied_schemas, is_light_or_camera
from lab3_usd.stage.compare.values import display_value, same_place, same_scale, same_value
from lab3_usd.stage.read.transforms import ORDER, RESET, TransformCache, local_transform

_SCALE = "xformOp:scale"


def place_differences(
    prim: Usd.Prim, twin: Usd.Prim, terms: Terms, *, same_parent: bool
) -> Iterator[Difference]:
    """Yield how the place of a prim differs; what a run moves may have moved."""
    was, now = (matrix_of(each, local=same_parent) for each in (prim, twin))
    if terms.bodies_rest or terms.rules.body not in applied_schemas(prim):
        what = same_place(was, now, terms.limits)
    else:  # a run moves bodies, and scales none
        what = "" if same_scale(was, now, terms.limits[2]) else "scaled"
    if not what:
        return
    names = [n for n in twin.GetAuthoredPropertyNames() if terms.classes(n) == "pose"]
    changed = [name for name in names if not _same_pose_value(prim, twin, name)]
    before, after = (shown_place(what, matrix) for matrix in (was, now))
    physics = affects_physics(prim, terms.rules) and not is_light_or_camera(prim)
    yield Difference("place", next(iter(changed), ""), before, after, physics)


def authored_place_differences(
    prim: Usd.Prim, twin: Usd.Prim, names: list[str], terms: Terms
) -> Iterator[Difference]:
    """Compare places where layers say all of the place, else operation by operation."""
    order = twin.GetAttribute(ORDER).Get() or ()
    if len(order) and all(is_authored(twin, name) for name in (ORDER, *_operations(order))):
        yield from place_differences(prim, twin, terms, same_parent=True)
        return
    moves = not terms.bodies_rest and terms.rules.body in applied_schemas(prim)
    for name in names:
        was, now = (each.GetAttribute(name) for each in (prim, twin))
        may_differ = name == ORDER or (moves and not name.startswith(_SCALE))
        if may_differ or not was or same_value(was.Get(), now.Get(), terms.limits[2]):
            continue
        physics = affects_physics(prim, terms.rules) and not is_light_or_camera(prim)
        yield Difference("place", name, display_value(was.Get()), display_value(now.Get()), physics)


def _operations(order: Iterable[str]) -> list[str]:
    return [name.rpartition("!")[2] for name in order if not name.startswith(RESET)]


def is_authored(prim: Usd.Prim, name: str) -> bool:
    """Whether a layer at hand gives the property a value, or takes it away."""
    attribute = prim.GetAttribute(name)
    if attribute:
        return bool(attribute.HasAuthoredValueOpinion())
    relationship = prim.GetRelationship(name)
    return bool(relationship and relationship.HasAuthoredTargets())


def _same_pose_value(prim: Usd.Prim, twin: Usd.Prim, name: str) -> bool:
    one, other = prim.GetAttribute(name), twin.GetAttribute(name)
    return bool(one) and bool(other) and one.Get() == other.Get()


def matrix_of(prim: Usd.Prim, *, local: bool) -> Gf.Matrix4d:
    """Return the transform of a prim to its parent, or to the world."""
    # UsdGeom raises where the value of an operation is of a type that the operation does not take.
    matrix, is_reset = local_transform(prim)
    return Gf.Matrix4d(*(matrix if local and not is_reset else TransformCache().world(prim)))


def shown_place(what: str, matrix: Gf.Matrix4d) -> str:
    """Say of a transform where it places a prim, how it turns or how it scales one."""
    if what == "moved":
        return "at " + _text(matrix.ExtractTranslation())
    if what == "scaled":
        return "scale " + _text([matrix.GetRow3(row).GetLength() for row in range(3)])
    turn = matrix.GetOrthonormalized().ExtractRotation()
    axes = (Gf.Vec3d.ZAxis(), Gf.Vec3d.YAxis(), Gf.Vec3d.XAxis())
    return f"turned {_text(reversed(list(turn.Decompose(*axes))))} degrees"


def _text(numbers: Iterable[float]) -> str:
    return "(" + ", ".join(f"{round(number, 6) + 0.0:.6g}" for number in numbers) + ")"
