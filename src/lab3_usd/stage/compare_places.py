"""Whether one prim of a stage stands where the starter has it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pxr import Gf, Usd

from lab3_usd.check.changes import Difference
from lab3_usd.stage.compare_terms import Terms, applied, is_light_or_camera, matters
from lab3_usd.stage.compare_values import same_place, same_scale, same_value, show
from lab3_usd.stage.places import Places
from lab3_usd.stage.transforms import ORDER, RESET, local_transform

_SCALE = "xformOp:scale"


def place_differences(
    prim: Usd.Prim, twin: Usd.Prim, terms: Terms, *, same_parent: bool
) -> Iterator[Difference]:
    """Yield how the place of a prim differs; what a run moves may have moved."""
    was, now = (_matrix(each, local=same_parent) for each in (prim, twin))
    if terms.bodies_rest or terms.rules.body not in applied(prim):
        what = same_place(was, now, terms.limits)
    else:  # a run moves bodies, and scales none
        what = "" if same_scale(was, now, terms.limits[2]) else "scaled"
    if not what:
        return
    names = [n for n in twin.GetAuthoredPropertyNames() if terms.classes(n) == "pose"]
    changed = [name for name in names if not _same_pose_value(prim, twin, name)]
    before, after = (_shown(what, matrix) for matrix in (was, now))
    physics = matters(prim, terms.rules) and not is_light_or_camera(prim)
    yield Difference("place", next(iter(changed), ""), before, after, physics)


def spoken_place_differences(
    prim: Usd.Prim, twin: Usd.Prim, names: list[str], terms: Terms
) -> Iterator[Difference]:
    """Compare places where layers say all of the place, else operation by operation."""
    order = twin.GetAttribute(ORDER).Get() or ()
    if len(order) and all(is_said(twin, name) for name in (ORDER, *_operations(order))):
        yield from place_differences(prim, twin, terms, same_parent=True)
        return
    moves = not terms.bodies_rest and terms.rules.body in applied(prim)
    for name in names:
        was, now = (each.GetAttribute(name) for each in (prim, twin))
        may_differ = name == ORDER or (moves and not name.startswith(_SCALE))
        if may_differ or not was or same_value(was.Get(), now.Get(), terms.limits[2]):
            continue
        physics = matters(prim, terms.rules) and not is_light_or_camera(prim)
        yield Difference("place", name, show(was.Get()), show(now.Get()), physics)


def _operations(order: Iterable[str]) -> list[str]:
    return [name.rpartition("!")[2] for name in order if not name.startswith(RESET)]


def is_said(prim: Usd.Prim, name: str) -> bool:
    """Whether a layer at hand gives the property a value, or takes it away."""
    attribute = prim.GetAttribute(name)
    if attribute:
        return bool(attribute.HasAuthoredValueOpinion())
    relationship = prim.GetRelationship(name)
    return bool(relationship and relationship.HasAuthoredTargets())


def _same_pose_value(prim: Usd.Prim, twin: Usd.Prim, name: str) -> bool:
    one, other = prim.GetAttribute(name), twin.GetAttribute(name)
    return bool(one) and bool(other) and one.Get() == other.Get()


def _matrix(prim: Usd.Prim, *, local: bool) -> Gf.Matrix4d:
    # UsdGeom raises where the value of an operation is of a type that the operation does not take.
    matrix, is_reset = local_transform(prim)
    return Gf.Matrix4d(*(matrix if local and not is_reset else Places().world(prim)))


def _shown(what: str, matrix: Gf.Matrix4d) -> str:
    if what == "moved":
        return "at " + _text(matrix.ExtractTranslation())
    if what == "scaled":
        return "scale " + _text([matrix.GetRow3(row).GetLength() for row in range(3)])
    turn = matrix.GetOrthonormalized().ExtractRotation()
    axes = (Gf.Vec3d.ZAxis(), Gf.Vec3d.YAxis(), Gf.Vec3d.XAxis())
    return f"turned {_text(reversed(list(turn.Decompose(*axes))))} degrees"


def _text(numbers: Iterable[float]) -> str:
    return "(" + ", ".join(f"{round(number, 6) + 0.0:.6g}" for number in numbers) + ")"
