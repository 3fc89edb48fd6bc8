"""Numbers, vectors and arrays. CN is core nodes; the others are Kit's own."""

from __future__ import annotations

from lab3_usd.sim.execution.registry import CONSTANT, computes
from lab3_usd.sim.execution.running import NO_VECTOR, Running
from lab3_usd.sim.execution.world import World

MOST = 1000  # elements of an array that is made


@computes("OgnIsaacScaleToFromStageUnit")
def scale(node: Running, world: World) -> bool:
    """CN/python/nodes/OgnIsaacScaleToFromStageUnit.py:37-51."""
    unit = world.scene.meters_per_unit
    factors = {"Convert to stage units": 1.0 / unit, "Convert to meters": unit}
    factor = factors.get(node.text("conversion", world))
    value = node.get("value", world)
    if factor is None:
        return node.fails("its conversion is none", "P01")
    if isinstance(value, tuple):
        node.outputs["result"] = tuple(x * factor for x in value)
    elif isinstance(value, (int, float)):
        node.outputs["result"] = value * factor
    else:
        return node.fails("no number reaches it", "W01")
    return True


@computes("BreakVector3")
def break_vector(node: Running, world: World) -> bool:
    """Kit's Break 3-Vector: one output for each component."""
    value = node.get("tuple", world)
    if not isinstance(value, tuple) or len(value) != len(NO_VECTOR):
        return node.fails("no vector reaches it", "W01")
    node.outputs["x"], node.outputs["y"], node.outputs["z"] = value
    return True


@computes(CONSTANT)
def constant(_: Running, __: World) -> bool:
    """Kit's constants: the value is an input, from which wires leave."""
    return True


@computes("ConstructArray")
def construct_array(node: Running, world: World) -> bool:
    """Kit's Make Array: as many elements as its size says, of the type of its array."""
    kind = node.text("arrayType", world) or "auto"
    size = min(int(node.number("arraySize", world)), MOST)
    values = [node.get(f"input{each}", world) for each in range(size)]
    texts = [isinstance(each, str) for each in values if each is not None]
    is_token = all(texts) if kind == "auto" else kind == "token[]"
    if not is_token and (kind != "auto" or any(texts)):
        node.outputs["array"] = ()
        return node.fails(f"its elements are no {kind}", "P01")
    empty = "" if is_token else 0.0
    node.outputs["array"] = tuple(empty if each is None else each for each in values)
    return True
