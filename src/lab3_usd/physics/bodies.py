"""The bodies of a scene that move, and how joints tie them to machines."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import get_args

from lab3_usd.model.dry_run import AXES, HERE, Affine, Scene, ScenePrim, rotation
from lab3_usd.model.joint_drives import DRIVE, DRIVEN_AXES, JointCommand, hindrance, read_drive
from lab3_usd.model.physics import EXCLUDED, KINEMATIC, SCENE, joint_limits, number, still_by
from lab3_usd.physics.machine import FIXED, HINGE, JOINTS, Joint, Machine

OWNER = "physics:simulationOwner"
BODY, ROOT, COLLIDER = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI", "PhysicsCollisionAPI"


def is_kinematic(prim: ScenePrim) -> bool:
    """Whether a prim is a body that nothing moves."""
    return BODY in prim.apis and prim.values.get(KINEMATIC) is True


def has_drive(prim: ScenePrim) -> bool:
    """Whether a joint has a drive."""
    return any(api.startswith(f"{DRIVE}:") for api in prim.apis)


def has_collision(prim: ScenePrim) -> bool:
    """Whether a prim is a collision shape."""
    return COLLIDER in prim.apis and prim.values.get("physics:collisionEnabled") is not False


class Bodies:
    """The bodies of a scene that move; `shapes` are the colliders of each, '' for the world."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        bodies = (prim for prim in scene.prims.values() if BODY in prim.apis)
        self.prims = {prim.path: prim for prim in bodies if not still_by(prim.values)}
        self.shapes: dict[str, list[ScenePrim]] = {body: [] for body in ("", *self.prims)}
        for prim in filter(has_collision, scene.prims.values()):
            self.shapes[self.of(prim.path)].append(prim)

    def machines(self) -> list[Machine]:
        """Return what hangs together, each placed from its root over its joints."""
        joints = [joint for joint in map(self.joint, self.scene.prims.values()) if joint]
        return assembled(self.prims, joints)

    def of(self, path: str) -> str:
        """Return the body that a prim goes with; '' for the world."""
        for prim in self.scene.above(path):
            if prim.path in self.prims:
                return prim.path
            if prim.loose:
                break
        return ""

    def joint(self, prim: ScenePrim) -> Joint | None:
        """Return the joint of a prim, None where it makes none."""
        on = prim.values.get("physics:jointEnabled") is not False
        if prim.type not in JOINTS or not on:
            return None
        if any(end and end not in self.scene.prims for end in prim.ends):
            return None  # PhysX makes no joint to a prim that is not there
        first, second = map(self.of, prim.ends)
        still = map(self._kinematic, prim.ends)
        drive = read_drive(prim.type, prim.apis, prim.values)
        force = math.inf if drive.force is None else drive.force
        is_driven = prim.type in DRIVEN_AXES and drive.api != "" and force > 0
        stiffness, damping, velocity, position = (
            (value or 0.0) if is_driven else 0.0
            for value in (drive.stiffness, drive.damping, drive.velocity, drive.position)
        )
        unit = math.radians(1.0) if prim.type == HINGE else 1.0
        low, high = joint_limits(prim.values)
        # How the rollers of a wheel stand to its axle, and its radius: IsaacMecanumWheelAPI
        # (holonomic_robot_usd_setup.py:58-60).
        angle = number(prim.values.get("isaacmecanumwheel:angle"))
        radius = number(prim.values.get("isaacmecanumwheel:radius"))
        return Joint(
            prim.path.rpartition("/")[2],
            prim.type,
            (first, second),
            (self._frame(prim, 0, first), self._frame(prim, 1, second)),
            AXES[{"Y": 1, "Z": 2}.get(str(prim.values.get("physics:axis")), 0)],
            stiffness,
            damping,
            0.0,
            authored=(velocity * unit, position * unit),
            excluded=prim.values.get(EXCLUDED) is True,
            kinematic=next(filter(None, still), ""),
            force=force,
            is_acceleration=drive.is_acceleration,
            limits=(low * unit, high * unit),
            rollers=None if angle is None or radius is None else (math.radians(angle), radius),
            path=prim.path,
            hindrances=dict(_hindrances(prim)),
        )

    def authored_to_start(self, machine: Machine, body: str) -> Affine:
        """Return what moves a body from where it is authored to where it stands at the start.

        The base of its machine is in the origin then, and turned as it is.
        """
        standing = Affine(machine.start.rows).then(machine.rest[body])
        return standing.then(self.prims[body].world.rigid().inverse())

    def _kinematic(self, path: str) -> str:
        """Return the body that a prim goes with where that is kinematic."""
        if self.of(path):
            return ""
        bodies = (prim.path for prim in self.scene.above(path) if is_kinematic(prim))
        return next(bodies, "")

    def _frame(self, prim: ScenePrim, number: int, body: str) -> Affine:
        """Return the frame of a joint in its body, without scale."""
        at = prim.values.get(f"physics:localPos{number}") or (0.0, 0.0, 0.0)
        turn = rotation(prim.values.get(f"physics:localRot{number}") or (1.0, 0.0, 0.0, 0.0))
        end = prim.ends[number]
        target = self.scene.prims[end].world if end else HERE
        inside = target.then(Affine(turn, at))
        owner = self.prims[body].world.rigid() if body else HERE
        return owner.inverse().then(inside).rigid()


def _hindrances(prim: ScenePrim) -> Iterator[tuple[JointCommand, str]]:
    """Yield the kinds of commands that a joint cannot follow, each with the reason."""
    commands: tuple[JointCommand, ...] = get_args(JointCommand)
    for command in commands if prim.type in DRIVEN_AXES else ():
        why = hindrance(prim.type, prim.apis, prim.values, command)
        if why is not None:
            yield command, why.text


def assembled(bodies: dict[str, ScenePrim], joints: list[Joint]) -> list[Machine]:
    """Sort bodies into machines; each is placed from its root over its joints."""
    ends: dict[str, list[Joint]] = {body: [] for body in bodies}
    for joint in joints:
        for body in dict.fromkeys(filter(None, joint.bodies)):
            ends[body].append(joint)
    roots = [_carrying(body, ends) for body in bodies if ROOT in bodies[body].apis]
    second = {joint.bodies[1] for joint in joints if joint.bodies[0]}
    firsts = [body for body in bodies if body not in second]
    machines: list[Machine] = []
    taken: set[str] = set()
    for base in (*roots, *firsts, *bodies):
        if base not in taken:
            machine = _machine(base, bodies, ends)
            taken |= machine.rest.keys()
            machines.append(machine)
    return machines


def _carrying(root: str, ends: dict[str, list[Joint]]) -> str:
    """Return the body that a robot's others are placed from: no wheel, though it be the root.

    PhysX takes any link as the root of an articulation, and the robot moves the same. One that is
    tied to the world is placed from there.
    """
    carriers = {root: None}
    for body in (waiting := [root]):
        for joint in ends[body]:
            if "" in joint.bodies and not joint.kinematic:
                return body
            new = [other for other in joint.bodies if other and other not in carriers]
            carriers.update(dict.fromkeys(new))
            waiting += new
    joints = ends[root]
    if len(joints) == 1 and joints[0].kind != FIXED and joints[0].bodies[1] == root:
        carrier = joints[0].bodies[0]
        return carrier if len(ends.get(carrier, ())) > 1 else root
    return root


def _machine(base: str, bodies: dict[str, ScenePrim], ends: dict[str, list[Joint]]) -> Machine:
    rest, held = {base: HERE}, False
    # What is excluded from the articulation closes what the others tie (PhysX).
    waiting, excluded = deque((base, joint) for joint in ends[base]), deque[tuple[str, Joint]]()
    parents: dict[str, Joint] = {}
    moving: dict[str, Joint] = {}
    closing: list[Joint] = []
    kinematic = ""
    while waiting or excluded:
        is_last = not waiting
        body, joint = excluded.popleft() if is_last else waiting.popleft()
        if joint.excluded and not is_last:
            excluded.append((body, joint))
            continue
        number = joint.bodies.index(body)
        neighbour = joint.bodies[1 - number]
        held = held or not neighbour
        kinematic = kinematic or joint.kinematic
        if not neighbour or neighbour in rest:
            tree = (parents.get(body), parents.get(neighbour))
            closing += [joint] if joint.kind == FIXED and joint not in tree else []
            continue
        outer, inner = joint.frames[number], joint.frames[1 - number]
        rest[neighbour] = rest[body].then(outer).then(inner.inverse())
        parents[neighbour] = joint
        waiting += ((neighbour, each) for each in ends[neighbour])
        if joint.kind != FIXED:
            moving[joint.name] = joint
    machine = Machine(base, bodies[base].world.rigid(), rest, parents, moving, held, kinematic)
    machine.know(next((body for body in rest if ROOT in bodies[body].apis), base))
    for joint in closing:  # which holds its bodies together, so that none between them moves
        for between in machine.between(*joint.bodies):
            between.locked = True
    return machine


def of_another_scene(scene: Scene, bodies: Bodies) -> dict[str, str]:
    """Return the shapes that do not move and are in no scene of the robots', with the reason.

    PhysX simulates what names no scene in the first one.
    """
    scenes = [prim.path for prim in scene.prims.values() if prim.type == SCENE]
    owners = {
        prim.path: prim.targets[OWNER][0]
        for prim in scene.prims.values()
        if prim.targets.get(OWNER)
    }
    of_bodies = {owners.get(body, scenes[0] if scenes else "") for body in bodies.prims}
    reasons: dict[str, str] = {}
    for path in (shape.path for shape in bodies.shapes[""] if shape.path in owners):
        owner = owners[path]
        if owner not in scenes:
            reasons[path] = f"belongs to the scene {owner}, which is not there"
        elif len(of_bodies) == 1 and owner not in of_bodies:
            reasons[path] = f"belongs to the scene {owner}, and the robot to another"
    return reasons
