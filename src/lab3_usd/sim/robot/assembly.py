"""Bodies and joints out of a scene, sorted into machines."""

from __future__ import annotations

import math
from collections import deque

from lab3_usd.model.dry_run.affine import AXES, HERE, Affine, rotation
from lab3_usd.model.dry_run.scene import Prim, Scene
from lab3_usd.model.physics import EXCLUDED, limits, number
from lab3_usd.sim.robot.joints import DRIVE, FIXED, HINGE, JOINTS, Joint
from lab3_usd.sim.robot.machine import Machine

BODY, ROOT, COLLIDER = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI", "PhysicsCollisionAPI"


def is_dynamic(prim: Prim) -> bool:
    """Whether a prim is a body that moves."""
    on = prim.values.get("physics:rigidBodyEnabled") is not False
    return BODY in prim.apis and on and not prim.values.get("physics:kinematicEnabled")


def collides(prim: Prim) -> bool:
    """Whether a prim is a collision shape."""
    return COLLIDER in prim.apis and prim.values.get("physics:collisionEnabled") is not False


class Bodies:
    """The bodies of a scene that move."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.prims = {each.path: each for each in scene.prims.values() if is_dynamic(each)}

    def machines(self) -> list[Machine]:
        """Return what hangs together, each placed from its root over its joints."""
        joints = [joint for joint in map(self.joint, self.scene.prims.values()) if joint]
        return assembled(self.prims, joints)

    def of(self, path: str) -> str:
        """Return the body that a prim goes with; '' for the world."""
        for each in self.scene.above(path):
            if each.path in self.prims:
                return each.path
            if each.loose:
                break
        return ""

    def joint(self, prim: Prim) -> Joint | None:
        """Return the joint of a prim, None where it makes none."""
        on = prim.values.get("physics:jointEnabled") is not False
        if prim.type not in JOINTS or not on:
            return None
        ends = [prim.targets.get(f"physics:body{each}", ()) for each in (0, 1)]
        if any(each and each[0] not in self.scene.prims for each in ends):
            return None  # PhysX makes no joint to a prim that is not there
        bodies = [self.of(each[0]) if each else "" for each in ends]
        drive = DRIVE.get(prim.type, "")
        kind = drive.split(":")[1] if drive else ""
        force = number(prim.values.get(f"{drive}maxForce"))
        driven = f"PhysicsDriveAPI:{kind}" in prim.apis and (force is None or force > 0)

        def said(name: str) -> float:
            return (number(prim.values.get(drive + name)) or 0.0) if driven else 0.0

        unit = math.radians(1.0) if prim.type == HINGE else 1.0
        low, high = limits(prim.values)
        return Joint(
            prim.path.rpartition("/")[2],
            prim.type,
            (bodies[0], bodies[1]),
            (self._frame(prim, 0, ends[0], bodies[0]), self._frame(prim, 1, ends[1], bodies[1])),
            AXES[{"Y": 1, "Z": 2}.get(str(prim.values.get("physics:axis")), 0)],
            said("stiffness"),
            said("damping"),
            0.0,
            authored=(said("targetVelocity") * unit, said("targetPosition") * unit),
            excluded=prim.values.get(EXCLUDED) is True,
            limits=(low * unit, high * unit),
        )

    def _frame(self, prim: Prim, number: int, ends: tuple[str, ...], body: str) -> Affine:
        """Return the frame of a joint in its body, without scale."""
        at = prim.values.get(f"physics:localPos{number}") or (0.0, 0.0, 0.0)
        turn = rotation(prim.values.get(f"physics:localRot{number}") or (1.0, 0.0, 0.0, 0.0))
        target = self.scene.prims[ends[0]].world if ends else HERE
        inside = target.then(Affine(turn, at))
        owner = self.prims[body].world.rigid() if body else HERE
        return owner.inverse().then(inside).rigid()


def assembled(bodies: dict[str, Prim], joints: list[Joint]) -> list[Machine]:
    """Sort bodies into machines; each is placed from its root over its joints."""
    ends: dict[str, list[Joint]] = {each: [] for each in bodies}
    for joint in joints:
        for body in dict.fromkeys(filter(None, joint.bodies)):
            ends[body].append(joint)
    roots = [each for each in bodies if ROOT in bodies[each].apis]
    second = {joint.bodies[1] for joint in joints if joint.bodies[0]}
    firsts = [each for each in bodies if each not in second]
    found: list[Machine] = []
    taken: set[str] = set()
    for base in (*roots, *firsts, *bodies):
        if base not in taken:
            machine = _machine(base, bodies, ends)
            taken |= machine.rest.keys()
            found.append(machine)
    return found


def _machine(base: str, bodies: dict[str, Prim], ends: dict[str, list[Joint]]) -> Machine:
    rest, waiting, held = {base: HERE}, deque([base]), False
    parents: dict[str, Joint] = {}
    moving: dict[str, Joint] = {}
    closing: list[Joint] = []
    while waiting:
        body = waiting.popleft()
        for joint in ends[body]:
            number = joint.bodies.index(body)
            other = joint.bodies[1 - number]
            held = held or not other
            if not other or other in rest:
                tree = (parents.get(body), parents.get(other))
                closing += [joint] if joint.kind == FIXED and joint not in tree else []
                continue
            outer, inner = joint.frames[number], joint.frames[1 - number]
            rest[other] = rest[body].then(outer).then(inner.inverse())
            parents[other] = joint
            waiting.append(other)
            if joint.kind != FIXED:
                moving[joint.name] = joint
    _lock(closing, parents)
    return Machine(base, bodies[base].world.rigid(), rest, parents, moving, held)


def _lock(closing: list[Joint], parents: dict[str, Joint]) -> None:
    """Lock the joints of bodies that another, fixed joint holds as well."""
    for joint in closing:
        for body in joint.bodies:
            if body in parents and parents[body] is not joint:
                parents[body].locked = True
