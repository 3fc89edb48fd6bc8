"""Events, gates, time and contexts: CN is core nodes, RN ROS 2 nodes."""

from __future__ import annotations

from lab3_usd.sim.execution.registry import FRAME, STEP, computes
from lab3_usd.sim.execution.ros import domain_number
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World


@computes("OnPlaybackTick", "OnTick", on=FRAME)
def on_tick(node: Running, world: World) -> bool:
    """Kit's playback tick: once an update while the timeline plays."""
    node.outputs.update(deltaSeconds=world.dt, time=world.since_play, frame=float(world.frame))
    node.enabled.append("tick")
    return True


@computes("OnPhysicsStep", on=STEP)
def on_physics_step(node: Running, world: World) -> bool:
    """CN/nodes/OgnOnPhysicsStep.cpp:72-149."""
    node.outputs.update(deltaSimulationTime=world.dt)
    node.enabled.append("step")
    return True


@computes("IsaacSimulationGate")
def simulation_gate(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacSimulationGate.cpp:46-66: every so many signals; it counts on over Stop."""
    step = int(node.number("step", world))
    if step <= 0:
        return node.fails("its step is 0", "P01")
    if node.count % step == 0:
        node.enabled.append("execOut")
    return True


@computes("IsaacReadSimulationTime")
def read_simulation_time(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacReadSimulationTime.cpp:52-74."""
    reset = node.flag("resetOnStop", world)
    node.outputs["simulationTime"] = world.since_play if reset else world.simulated
    return True


@computes("IsaacReadSystemTime")
def read_system_time(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacReadSystemTime.cpp."""
    node.outputs["systemTime"] = world.wall
    return True


@computes("ROS2Context")
def context(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2Context.cpp:41-120."""
    if "handle" not in node.memory:
        domain = int(node.number("domain_id", world))
        if node.flag("useDomainIDEnvVar", world):
            from_outside = domain_number(world.network.environment)
            domain = domain if from_outside is None else from_outside
        handle = len(world.network.contexts) + 1
        world.network.contexts[handle] = domain
        node.memory["handle"] = handle
    node.outputs["context"] = node.memory["handle"]
    return True
