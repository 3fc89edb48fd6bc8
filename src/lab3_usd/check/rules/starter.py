"""Rules about what the starter brought and the lab does not change (sections 2, 5.4 and A2).

They report only what the rules of the scene (S) do not. Those also work without the starter's
file, and name the effect on the robot. A comparison alone misses units, the pose of the robot, and
additions to supplied prims, such as a lock on a wheel.
"""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.changes import (
    KINDS,
    Activate,
    ApplySchema,
    Change,
    Difference,
    Edit,
    Kind,
    Restore,
    StarterSubject,
)
from lab3_usd.model.finding import Problem
from lab3_usd.model.traction import BINDING

_MISSING = "missing"  # and not deactivated, or an over
_SHOWN = 4  # differences that a message names


@rule("U01", "starter-prim-missing", scope="starter")
def starter_prim_missing(subject: StarterSubject) -> Iterator[Problem]:
    """A supplied prim is missing.

    Why: a missing link, joint or collider changes how the robot stands and moves. A missing wall
    changes what sensors see. Lights and visual prims are a warning.

    Fix: undo the deletion, or activate the prim (right-click in the Stage panel, Activate). If it
    was deleted long ago, open the supplied file again and repeat the steps from there.

    Example: a wall of the supplied scene deleted.
    """
    for change in subject.changes:
        if not change.absent or _is_absence_reported(change, subject):
            continue
        below = change.count - 1
        also = f", with {below} prim{'s' if below > 1 else ''} below it" if below else ""
        repair = Restore(change.prim) if change.absent == _MISSING else Activate(change.prim)
        yield Problem(
            change.prim,
            f"{change.type or 'prim'} of the starter is {change.absent}{also}",
            expected=change.type or None,
            actual=change.absent,
            handout=subject.rules.handout,
            severity="error" if change.physics else "warning",
            fix=(repair,) if change.prim in subject.supplied else (),
        )


@rule("U02", "starter-prim-retyped", scope="starter")
def starter_prim_retyped(subject: StarterSubject) -> Iterator[Problem]:
    """A supplied prim has another type.

    Why: the type determines the behaviour: a joint of another type moves differently, a collider of
    another shape touches elsewhere.

    Fix: undo the change, or open the supplied file again and repeat the steps from there.

    Example: `{joint}` changed to a `PhysicsFixedJoint`.
    """
    yield from _changed_prims(subject, "type")


@rule("U03", "starter-schema-removed", scope="starter")
def starter_schema_removed(subject: StarterSubject) -> Iterator[Problem]:
    """A supplied prim lost a schema.

    Why: schemas hold the physics. Without them a body has no mass, a shape has no collision, and a
    joint has no drive.

    Fix: undo the removal, or add the schema named here again (Add > Physics) with the values in the
    supplied file.

    Example: the collision removed from the ground.
    """
    yield from _changed_prims(subject, "schema")


@rule("U04", "starter-physics-changed", scope="starter")
def starter_physics_changed(subject: StarterSubject) -> Iterator[Problem]:
    """Physics of the supplied scene was changed.

    Why: masses, inertias, frictions, drives and collision shapes are tuned together. The robot
    slips, tips or moves differently from other submissions.

    Fix: enter the values named here in the Property panel. The handout says not to change the
    robot's physics.

    Example: `physics:staticFriction` of the tyres 0.1 instead of 1.0.
    """
    yield from _changed_prims(subject, "physics")


@rule("U05", "starter-prim-moved", scope="starter")
def starter_prim_moved(subject: StarterSubject) -> Iterator[Problem]:
    """A supplied prim was moved, turned or scaled.

    Why: a moved wall is not where sensors should see it. A moved shape touches the ground or
    another link. The poses of bodies are judged in the first checkpoint only, because a later stage
    may have been saved after a run. The robot root has its own rule. Lights and viewpoints are a
    warning.

    Fix: undo the move, or enter the transform of the supplied file in the Property panel.

    Example: a crate dragged by half a metre with the gizmo.
    """
    yield from _changed_prims(subject, "place")


@rule("U06", "starter-look-changed", scope="starter", severity="warning")
def starter_look_changed(subject: StarterSubject) -> Iterator[Problem]:
    """The appearance of the supplied scene was changed.

    Why: the robot's sensors see visible prims. The screenshots differ from the expected ones.

    Fix: undo the change, unless it was intended.

    Example: `visibility` of a wall set to `invisible`.
    """
    yield from _changed_prims(subject, "look")


@rule("U07", "starter-physics-added", scope="starter", severity="warning")
def starter_physics_added(subject: StarterSubject) -> Iterator[Problem]:
    """Added physics changes how the robot moves.

    Why: damping, friction, filters, mimic joints, and more joints, shapes and physics scenes change
    how the robot moves, although no supplied value was changed.

    Fix: remove what was added, or reset the property in the Property panel.

    Example: `physxRigidBody:linearDamping` 50 on `{robot}/{link}`.
    """
    yield from _changed_prims(subject, "added")


def _changed_prims(subject: StarterSubject, kind: Kind) -> Iterator[Problem]:
    """Yield one problem for each prim whose gravest difference is of this kind."""
    for change in subject.changes:
        left = _unreported(change, subject)
        if not left or left[0].kind != kind:
            continue
        named = "; ".join(_difference_text(difference) for difference in left[:_SHOWN])
        more = f"; and {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
        first, physics = left[0], any(difference.physics for difference in left)
        yield Problem(
            change.prim,
            f"not as in the starter: {named}{more}",
            first.property or None,
            first.was,
            first.now,
            subject.rules.handout,
            severity="error" if physics else "warning",
            fix=_repair(change.prim, first, subject),
            unmet=tuple(_unmet(change.prim, left, subject)),
        )


def _unmet(prim: str, left: list[Difference], subject: StarterSubject) -> Iterator[str]:
    """Yield what is asked of a wheel whose shape or joint is another than the supplied one."""
    for link, requirement in subject.shaped.items():
        if prim.startswith(f"{link}/") and any(
            difference.physics and not difference.property.startswith(BINDING)
            for difference in left  # how a shape grips without its material, S25 and dry runs tell
        ):
            yield requirement
    if prim in subject.placed and any(
        difference.property.startswith(("physics:localPos", "physics:localRot"))
        for difference in left
    ):
        yield subject.placed[prim]


def _repair(prim: str, difference: Difference, subject: StarterSubject) -> tuple[Edit, ...]:
    """Return what undoes the gravest difference of a prim; the next one is found after that."""
    if difference.kind != "added" and prim not in subject.supplied:
        return ()
    if difference.kind == "schema":
        return (ApplySchema(prim, difference.was),)
    if difference.property or difference.kind == "place":
        return (Restore(prim, difference.property or "xformOpOrder"),)
    return () if difference.kind == "added" else (Restore(prim),)


def _difference_text(difference: Difference) -> str:
    if difference.kind == "added":
        return difference.now
    if difference.kind == "schema":
        return f"{difference.was} was removed"
    if difference.kind == "type":
        return f"type is {difference.now}, was {difference.was}"
    if difference.kind == "place":
        return f"{difference.now}, was {difference.was}"
    if difference.now == difference.was:
        return f"{difference.property} was changed"
    return f"{difference.property} is {difference.now}, was {difference.was}"


def _unreported(change: Change, subject: StarterSubject) -> list[Difference]:
    """Return the differences that no other rule has reported, the gravest first."""
    sites = (change.prim, change.body)
    names = {name for prim, name in subject.faulty_sites if prim in sites}
    if (change.prim, None) in subject.faulty_sites:
        return []
    names |= {name for group in subject.rules.together if names & {*group} for name in group}
    left = [
        difference
        for difference in change.differences
        if not _is_reported(difference, names, subject)
    ]
    return sorted(left, key=lambda difference: KINDS.index(difference.kind))


def _is_reported(difference: Difference, names: set[str | None], subject: StarterSubject) -> bool:
    """Whether a finding about one of these properties of the prim, or its body, explains it."""
    if difference.kind in {"type", "schema", "added"}:
        return bool(names)
    if difference.kind == "place":
        return any(name is None or name.startswith("xformOp") for name in names)
    # A joint that ties another body leaves loose the one it had, or the one it now ties to itself.
    bodies = (difference.was, difference.now)
    is_body_faulty = any((body, None) in subject.faulty_sites for body in bodies)
    return is_body_faulty or difference.property in names


def _is_absence_reported(change: Change, subject: StarterSubject) -> bool:
    """Whether another rule has missed this prim, what it holds, or what needs it."""
    if change.absent == _MISSING and change.prim in subject.related_prims:
        return True
    for prim, name in subject.faulty_sites:
        is_below = f"{prim}/".startswith(f"{change.prim}/")
        is_above = f"{change.prim}/".startswith(f"{prim.rstrip('/')}/")
        if is_below or (is_above and prim != "/" and (name is None or prim == change.body)):
            return True
        if name is None and prim in change.related:
            return True
    return False
