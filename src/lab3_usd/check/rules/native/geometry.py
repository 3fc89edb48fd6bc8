"""OpenUSD's validators of geometry and physics."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.native import NativeErrors


@rule("UV10", "no-units", scope="native")
def no_units(subject: NativeErrors) -> Iterator[Problem]:
    """The stage does not say its units or its up axis.

    Why: readers take centimetres and Y up, so that a robot in metres is a hundredth of its
    size. OpenUSD's validator: `usdGeomValidators:StageMetadataChecker`.

    Fix: write `metersPerUnit` and `upAxis` in the first lines of the file, as the stage was
    made.

    Example: `upAxis` is missing.
    """
    yield from subject.problems("UV10")


@rule("UV11", "nested-shapes", scope="native")
def nested_shapes(subject: NativeErrors) -> Iterator[Problem]:
    """A shape stands below another shape.

    Why: renderers and physics may leave the inner one out: a gprim is a leaf. OpenUSD's
    validator: `usdGeomValidators:EncapsulationChecker`.

    Fix: put an Xform above both.

    Example: a Sphere below a Cube.
    """
    yield from subject.problems("UV11")


@rule("UV12", "subset-family", scope="native")
def subset_family(subject: NativeErrors) -> Iterator[Problem]:
    """The subsets of a mesh are not what their family says.

    Why: in a partition each face belongs to one subset. Faces in none or in two have no clear
    material. OpenUSD's validator: `usdGeomValidators:SubsetFamilies`.

    Fix: correct the indices, or the type of the family.

    Example: a family of type `partition` leaves out a face.
    """
    yield from subject.problems("UV12")


@rule("UV13", "subset-without-mesh", scope="native")
def subset_without_mesh(subject: NativeErrors) -> Iterator[Problem]:
    """A subset of geometry does not stand directly below a shape.

    Why: it is a subset of nothing and counts for nobody. OpenUSD's validator:
    `usdGeomValidators:SubsetParentIsImageable`.

    Fix: move it below the mesh that it is about.

    Example: a GeomSubset below a prim without a type.
    """
    yield from subject.problems("UV13")


@rule("UV20", "body-that-cannot-move", scope="native")
def body_that_cannot_move(subject: NativeErrors) -> Iterator[Problem]:
    """A rigid body is where physics cannot move it.

    Why: the body stays where it is, or falls out of the simulation. OpenUSD's validator:
    `usdPhysicsValidators:RigidBodyChecker`.

    Fix: apply the schema to an Xform or a shape that is neither below an instance nor scaled
    with a rotation of its own.

    Example: PhysicsRigidBodyAPI on a Scope.
    """
    yield from subject.problems("UV20")


@rule("UV21", "collider-shape", scope="native")
def collider_shape(subject: NativeErrors) -> Iterator[Problem]:
    """A collider has a shape or scale that physics does not have.

    Why: the engine takes another shape, or none. OpenUSD's validator:
    `usdPhysicsValidators:ColliderChecker`.

    Fix: scale spheres, capsules and cones alike in all directions, or use a mesh.

    Example: a Sphere scaled by (1, 2, 3) with PhysicsCollisionAPI.
    """
    yield from subject.problems("UV21")


@rule("UV22", "articulation-in-another", scope="native")
def articulation_in_another(subject: NativeErrors) -> Iterator[Problem]:
    """An articulation root is below another, or on a body that does not move.

    Why: the engine keeps one articulation, and a controller for the other finds nothing.
    OpenUSD's validator: `usdPhysicsValidators:ArticulationChecker`.

    Fix: leave PhysicsArticulationRootAPI on one prim of the robot.

    Example: robot and gripper both have an articulation root.
    """
    yield from subject.problems("UV22")


@rule("UV23", "joint-without-bodies", scope="native")
def joint_without_bodies(subject: NativeErrors) -> Iterator[Problem]:
    """A joint does not join bodies.

    Why: the engine leaves it out, or holds nothing by it. OpenUSD's validator:
    `usdPhysicsValidators:PhysicsJointChecker`.

    Fix: choose the bodies of the joint again; at least one has to be a rigid body that is
    switched on.

    Example: `physics:body0` names an Xform without PhysicsRigidBodyAPI.
    """
    yield from subject.problems("UV23")
