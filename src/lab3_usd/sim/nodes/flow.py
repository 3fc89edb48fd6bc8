"""Kit's nodes that pass a signal on: sequences, loops, branches, writers of attributes.

After NVIDIA's published documentation of the nodes, as those of arithmetic.
"""

from __future__ import annotations

import math

from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.world import World


@computes("PrintText")
def print_text(node: NodeInstance, _: World) -> bool:
    """omni-graph-ui-nodes/printtext-1.html: nothing comes of it but a line in the log."""
    return node.goes_on()


@computes("Sequence", "Multisequence")
def sequence(node: NodeInstance, _: World) -> bool:
    """omni-graph-action/multisequence-2.html: a signal goes on at each output in turn."""
    node.enabled += sorted(node.follows, key=lambda port: (len(port), port))
    return True


@computes("Once")
def once(node: NodeInstance, _: World) -> bool:
    """OgnOnce.html: the first signal goes on at one output, those after it at the other."""
    node.enabled.append("after" if "signalled" in node.memory else "once")
    node.memory["signalled"] = True
    return True


@computes("Branch")
def branch(node: NodeInstance, world: World) -> bool:
    """omni-graph-action/branch-1.html: a signal goes on at one of two outputs."""
    node.enabled.append("execTrue" if node.flag("condition", world) else "execFalse")
    return True


@computes("ForLoop")
def for_loop(node: NodeInstance, world: World) -> bool:
    """omni-graph-action/forloop-2.html: a signal for each number of a range without its end."""
    step = node.whole("step", world)
    if step == 0:
        return node.fails("its step is 0", "no-number-input")
    start, stop = node.whole("start", world), node.whole("stop", world)
    index = node.memory.get("index", 0)
    value = start + index * step
    if (value >= stop) if step > 0 else (value <= stop):
        node.memory.pop("index", None)
        node.enabled.append("finished")
        return True
    node.outputs.update(index=index, value=value)
    node.memory["index"] = index + 1
    node.enabled.append("loopBody")
    node.again = True
    return True


FAR = 2.0  # metres from a robot at which a moving surface does not carry it


@computes("WritePrimAttribute")
def write_prim_attribute(node: NodeInstance, world: World) -> bool:
    """OgnWritePrimAttribute.html: an attribute of a prim.

    What it changes is not simulated, except for what one only sees, and conveyors far from robots.
    """
    named = (node.text("primPath", world),) if node.flag("usePath", world) else node.targets("prim")
    name, path = node.text("name", world), next(iter(named), "")
    if path in world.platform.application_prims:
        return node.goes_on()  # a view, which the application makes in every stage
    prim = world.scene.prims.get(path)
    if prim is None or not name:
        return node.fails(f"there is no {path or 'prim'} to write to", "no-target-prim")
    if not (name.startswith(world.platform.appearance) or _is_far_surface(path, name, world)):
        reason = f"not simulated: {node.path} changes {name} of {path}"
        world.unplayed.setdefault("", reason)
    return node.goes_on()


def _is_far_surface(path: str, name: str, world: World) -> bool:
    """Whether an attribute moves the surface of a prim that no robot is near to."""
    if not name.startswith(world.platform.surfaces):
        return False
    at = world.scene.prims[path].world.origin
    unit = world.scene.meters_per_unit
    robots = [machine.base for machine in world.machines.machines if machine.wheels]
    places = (world.machines.place(base).origin for base in robots)
    return all(math.dist(at, place) * unit > FAR for place in places)
