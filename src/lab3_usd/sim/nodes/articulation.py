"""Commands to joints. CN is core nodes."""

from __future__ import annotations

from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World
from lab3_usd.sim.robot.joints import Joint
from lab3_usd.sim.robot.machine import Machine


@computes("IsaacArticulationController")
def articulation_controller(node: Running, world: World) -> bool:
    """CN/python/nodes/OgnIsaacArticulationController.py:41-300."""
    known = node.memory
    if "machine" not in known:
        targets = node.targets("targetPrim")
        path = node.text("robotPath", world) or (targets[0] if targets else "")
        known["machine"] = world.machines.articulation(path)
        known["names"], known["joints"] = None, None
        if known["machine"] is None:
            known.clear()  # it is looked for again at the next tick
            where = f"at or below {path}" if path else "without a target"
            return node.fails(f"there is no articulation with joints {where}", "R02")
    joints = _joints(node, world, known["machine"])
    return joints is not None and _command(node, world, joints)


def _joints(node: Running, world: World, machine: Machine) -> list[Joint] | None:
    known = node.memory
    names = node.items("jointNames", world)
    if names and names != known["names"]:
        known["names"] = names
        found = [machine.articulated.get(str(each)) for each in names]
        known["joints"] = None if None in found else found
        if known["joints"] is None:
            _say_unknown(node, machine, str(names[found.index(None)]))
    every = list(machine.articulated.values())
    indices = node.items("jointIndices", world)
    if any(indices) and not known["names"]:
        known["joints"] = [every[int(each)] for each in indices if int(each) < len(every)]
    joints: list[Joint] | None = known["joints"]
    return every if joints is None and not known["names"] else joints


def _say_unknown(node: Running, machine: Machine, name: str) -> None:
    if name in machine.joints:
        node.fails(f"'{name}' is excluded from the articulation", "S07")
    else:
        node.fails(f"the robot has no joint '{name}' that turns", "P01")


def _command(node: Running, world: World, joints: list[Joint]) -> bool:
    position, velocity, effort = (
        node.items(f"{each}Command", world) for each in ("position", "velocity", "effort")
    )
    for each in (position, velocity, effort):
        if each and len(each) != len(joints):
            return node.fails(f"{len(each)} commands come for {len(joints)} joints", "P01")
        if not all(isinstance(value, (int, float)) for value in each):
            return node.fails("its commands are no numbers", "W02")
    for joint, value in zip(joints, position, strict=False):
        joint.target_position = float(value)
    for joint, value in zip(joints, velocity, strict=False):
        joint.target_velocity = float(value)
    return True
