"""What runs while the timeline plays, and how surely."""

from __future__ import annotations

import models as m
import pytest
from msgspec.structs import replace

from lab3_usd.facts.execution_order import (
    live_nodes,
    run_states,
    running_nodes,
    severity_if_uncertain,
)
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.releases import BASE
from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import GraphModel, Node, PortState, StageModel
from lab3_usd.pipeline.any_stage import lint_platform

TICK = "omni.graph.action.OnPlaybackTick"
STEP = "isaacsim.core.nodes.OnPhysicsStep"
OLD_STEP = "omni.isaac.core_nodes.OnPhysicsStep"
CUSTOM = "omni.graph.action.OnCustomEvent"
ODOMETRY = "isaacsim.ros2.bridge.ROS2PublishOdometry"
BRANCH = "omni.graph.action.Branch"
GATE = "isaacsim.core.nodes.IsaacCreateRenderProduct"
PLACE = "/Graph/more"
SENDER = f"{PLACE}/sender"
ON_DEMAND = {"pipelineStage": "pipelineStageOnDemand"}


def graph(event: str | None, *more: Node, **attributes: Value) -> GraphModel:
    """A graph with one event and one publisher behind it."""
    sender = m.node(SENDER, ODOMETRY)
    if event is None:
        return m.graph(PLACE, sender, *more, **attributes)  # type: ignore[arg-type]
    root = m.node(f"{PLACE}/root", event)
    root = replace(root, ports={"outputs:go": PortState("outputs:go")})
    known = () if root.type is None else root.type.ports.values()
    out = next((port.short for port in known if port.is_execution), "go")
    sender = m.wired(sender, "inputs:execIn", f"{PLACE}/root.outputs:{out}")
    return m.graph(PLACE, sender, root, *more, **attributes)  # type: ignore[arg-type]


def state_of(stage: StageModel, path: str = SENDER) -> str:
    return run_states(stage).get(path, "does not run")


def state(event: str | None, **attributes: Value) -> str:
    return state_of(m.only(graph(event, **attributes)))


@pytest.mark.parametrize(
    ("event", "attributes", "expected"),
    [
        (TICK, {}, "runs"),
        (TICK, {"evaluationMode": "Standalone"}, "runs"),
        (TICK, {"evaluationMode": "Instanced"}, "does not run"),
        (TICK, ON_DEMAND, "does not run"),
        (TICK, {"pipelineStage": "pipelineStagePreRender"}, "may run"),
        ("omni.graph.action.OnTick", {}, "runs"),
        ("omni.graph.action.OnTick", ON_DEMAND, "does not run"),
        (STEP, ON_DEMAND, "runs"),
        (STEP, {}, "does not run"),
        (STEP, {"pipelineStage": "pipelineStagePostRender"}, "does not run"),
        (OLD_STEP, ON_DEMAND, "runs"),
        (CUSTOM, {}, "may run"),
        (CUSTOM, ON_DEMAND, "does not run"),
        (CUSTOM, {"evaluationMode": "Instanced"}, "does not run"),
        ("omni.graph.action.OnKeyboardInput", {}, "may run"),
        (None, {}, "does not run"),
    ],
)
def test_an_event_fires_in_its_stage_of_the_pipeline(
    event: str | None, attributes: dict[str, Value], expected: str
) -> None:
    assert state(event, **attributes) == expected


@pytest.mark.parametrize("evaluator", ["push", "dirty_push"])
@pytest.mark.parametrize(
    ("event", "attributes", "expected"),
    [
        (None, {}, "runs"),
        (TICK, {}, "runs"),
        (None, ON_DEMAND, "does not run"),
        (STEP, ON_DEMAND, "runs"),
        (None, {"evaluationMode": "Instanced"}, "does not run"),
        (None, {"pipelineStage": "pipelineStagePostRender"}, "may run"),
    ],
)
def test_a_push_graph_computes_every_node(
    evaluator: str, event: str | None, attributes: dict[str, Value], expected: str
) -> None:
    assert state(event, evaluator__type=evaluator, **attributes) == expected


def test_a_prim_that_refers_to_an_instanced_graph_has_it_evaluated() -> None:
    target = Prim("/World/carrier", "Xform", (), relationships={"omniGraphs": (PLACE,)})
    stage = m.only(graph(TICK, evaluationMode="Instanced"))
    assert state_of(replace(stage, prims={**stage.prims, target.path: target})) == "runs"
    gone = replace(target, active=False)
    assert state_of(replace(stage, prims={**stage.prims, gone.path: gone})) == "does not run"


def test_a_sure_event_beats_a_doubtful_one() -> None:
    custom = replace(
        m.node(f"{PLACE}/custom", CUSTOM), ports={"outputs:go": PortState("outputs:go")}
    )
    given = graph(TICK, custom)
    sender = m.wired(
        given.nodes[0], "inputs:execIn", f"{PLACE}/custom.outputs:go", f"{PLACE}/root.outputs:tick"
    )
    stage = m.only(replace(given, nodes=(sender, *given.nodes[1:])))
    assert state_of(stage) == "runs"
    assert severity_if_uncertain(stage, SENDER) is None
    assert severity_if_uncertain(stage, SENDER, custom.path) == "warning"


def test_another_event_may_fire_in_a_graph_that_the_physics_evaluates() -> None:
    stage = m.only(graph(TICK, m.node(f"{PLACE}/step", STEP), **ON_DEMAND))
    assert state_of(stage) == "may run"


def test_what_waits_for_an_event_that_never_fires_is_no_event_itself() -> None:
    unknown = m.wired(
        m.node(f"{PLACE}/if", "some.Branch"), "inputs:execIn", f"{PLACE}/root.outputs:step"
    )
    unknown = replace(unknown, ports={**unknown.ports, "outputs:yes": PortState("outputs:yes")})
    given = graph(STEP, unknown)
    sender = m.wired(given.nodes[0], "inputs:execIn", f"{unknown.path}.outputs:yes")
    assert state_of(m.only(replace(given, nodes=(sender, *given.nodes[1:])))) == "does not run"


def test_a_value_triggers_nothing() -> None:
    unknown = m.wired(
        m.node(f"{PLACE}/if", "some.Branch"), "inputs:x", f"{PLACE}/root.outputs:deltaSeconds"
    )
    stage = m.only(graph(TICK, unknown))
    assert state_of(stage, unknown.path) == "may run"


def test_a_node_of_the_catalog_without_signal_starts_nothing() -> None:
    gate = m.node(f"{PLACE}/gate", GATE)
    given = graph(None, gate)
    sender = m.wired(given.nodes[0], "inputs:execIn", f"{gate.path}.outputs:execOut")
    assert run_states(m.only(replace(given, nodes=(sender, gate)))) == {}


def test_the_lab_runs_for_sure() -> None:
    stage = m.stage()
    assert set(run_states(stage).values()) == {"runs"}
    assert list(running_nodes(stage)) == list(run_states(stage))


@pytest.mark.parametrize(
    "kind", ["omni.graph.nodes.ConstantString", "omni.graph.nodes.ConstantToken", ODOMETRY]
)
def test_an_input_brings_its_value_to_another(kind: str) -> None:
    port = "inputs:odomFrameId" if kind == ODOMETRY else "inputs:value"
    constant = m.valued(m.node(f"{PLACE}/constant", kind), port, "map")
    sender = m.wired(m.node(SENDER, ODOMETRY), "inputs:odomFrameId", f"{constant.path}.{port}")
    live = live_nodes(m.only(m.graph(PLACE, constant, sender)))
    assert effective_value(live[SENDER], "inputs:odomFrameId", live) == "map"


def test_what_a_node_computes_nobody_knows() -> None:
    unknown = m.node(f"{PLACE}/join", "omni.graph.nodes.Concatenate")
    unknown = replace(unknown, ports={"outputs:value": PortState("outputs:value")})
    sender = m.wired(
        m.node(SENDER, ODOMETRY), "inputs:odomFrameId", f"{unknown.path}.outputs:value"
    )
    live = live_nodes(m.only(m.graph(PLACE, unknown, sender)))
    assert effective_value(live[SENDER], "inputs:odomFrameId", live) is None


def test_a_push_graph_of_an_instance_may_run() -> None:
    push = replace(graph(None, evaluator__type="push"), instanced=True)
    assert state_of(m.only(push)) == "may run"


# ---- what signals once


ONCE = "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame"
KIT_ONCE = "omni.graph.action.Once"
CONTROLLER = "isaacsim.core.nodes.IsaacArticulationController"
TWIST = "isaacsim.ros2.bridge.ROS2SubscribeTwist"


def node_behind(kind: str, path: str, source: str, *outputs: str) -> Node:
    """A node that one output triggers, with outputs of its own that no catalog tells."""
    made = m.wired(m.node(path, kind), "inputs:execIn", source)
    more = {f"outputs:{name}": PortState(f"outputs:{name}") for name in outputs}
    return replace(made, ports={**made.ports, **more})


def behind(kind: str, output: str, *sources: str, then: str = ODOMETRY) -> str:
    """The state of a node behind an output of a node that the tick triggers."""
    gate = node_behind(kind, f"{PLACE}/gate", f"{PLACE}/root.outputs:tick", "once", "after")
    given = graph(TICK, gate)
    ports = (f"{gate.path}.outputs:{output}", *sources)
    sender = m.wired(m.node(SENDER, then), "inputs:execIn", *ports)
    return state_of(m.only(replace(given, nodes=(sender, *given.nodes[1:]))))


@pytest.mark.parametrize(
    ("kind", "output", "then", "expected"),
    [
        (ONCE, "step", ODOMETRY, "does not run"),
        ("omni.isaac.core_nodes.OgnIsaacRunOneSimulationFrame", "step", TWIST, "does not run"),
        (ONCE, "step", GATE, "runs"),
        (ONCE, "step", CONTROLLER, "runs"),
        (ONCE, "step", "isaacsim.ros2.bridge.ROS2RtxLidarHelper", "runs"),
        (KIT_ONCE, "once", ODOMETRY, "does not run"),
        (KIT_ONCE, "after", ODOMETRY, "runs"),
        (KIT_ONCE, "once", "some.Node", "runs"),
        (GATE, "execOut", ODOMETRY, "runs"),
    ],
)
def test_what_is_signalled_once_opens_a_topic_and_sends_nothing(
    kind: str, output: str, then: str, expected: str
) -> None:
    assert behind(kind, output, then=then) == expected


def test_a_second_source_that_signals_with_every_frame_is_enough() -> None:
    assert behind(ONCE, "step", f"{PLACE}/root.outputs:tick") == "runs"


def test_a_publisher_at_the_end_of_a_chain_of_single_signals_sends_nothing() -> None:
    once = node_behind(ONCE, f"{PLACE}/once", f"{PLACE}/root.outputs:tick")
    between = node_behind(GATE, f"{PLACE}/between", f"{once.path}.outputs:step")
    given = graph(TICK, once, between)
    sender = m.wired(given.nodes[0], "inputs:execIn", f"{between.path}.outputs:execOut")
    stage = m.only(replace(given, nodes=(sender, *given.nodes[1:])))
    assert (state_of(stage), state_of(stage, between.path)) == ("does not run", "runs")


def test_a_single_signal_that_can_be_had_again_is_no_single_one() -> None:
    once = node_behind(KIT_ONCE, f"{PLACE}/once", f"{PLACE}/root.outputs:tick", "once")
    once = m.wired(once, "inputs:reset", f"{PLACE}/root.outputs:tick")
    given = graph(TICK, once)
    sender = m.wired(given.nodes[0], "inputs:execIn", f"{once.path}.outputs:once")
    assert state_of(m.only(replace(given, nodes=(sender, *given.nodes[1:])))) == "runs"


def test_a_single_signal_of_a_doubtful_event_makes_nothing_surer() -> None:
    root = m.node(f"{PLACE}/custom", CUSTOM)
    once = node_behind(ONCE, f"{PLACE}/once", f"{PLACE}/root.outputs:tick")
    given = graph(TICK, root, once)
    signals = (f"{once.path}.outputs:step", f"{root.path}.outputs:execOut")
    sender = m.wired(given.nodes[0], "inputs:execIn", *signals)
    assert state_of(m.only(replace(given, nodes=(sender, *given.nodes[1:])))) == "may run"


def test_a_push_graph_signals_nothing_once() -> None:
    once = m.node(f"{PLACE}/once", ONCE)
    given = graph(None, once, evaluator__type="push")
    sender = m.wired(given.nodes[0], "inputs:execIn", f"{once.path}.outputs:step")
    assert state_of(m.only(replace(given, nodes=(sender, *given.nodes[1:])))) == "runs"


def test_what_is_behind_a_branch_may_run() -> None:
    platform = lint_platform(BASE)
    branch = replace(m.node(f"{PLACE}/branch", BRANCH), type=platform.types[BRANCH])
    branch = m.wired(branch, "inputs:execIn", f"{PLACE}/root.outputs:tick")
    branch = m.wired(branch, "inputs:condition", f"{PLACE}/root.outputs:isPlaying")
    first = graph(TICK, branch)
    sender = m.wired(first.nodes[0], "inputs:execIn", f"{PLACE}/branch.outputs:execTrue")
    stage = m.only(replace(first, nodes=(sender, *first.nodes[1:])))
    states = run_states(stage)
    assert (states[branch.path], states[SENDER]) == ("runs", "may run")
