"""What a dry run does not know silences only what depends on it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from breaking import Step, broken, correct_stage
from dry_runs import SHORT, driven
from pxr import Sdf, Usd
from scene_stages import CASES, LIDAR, Change, clear, drive, put, several, with_values

from lab3_usd.model.dry_run import Check
from lab3_usd.sim.judge.checks import CHECKS, judge

SWAPPED: Step = {
    "swap": ["ROS_Drive/make_array.inputs:input0", "ROS_Drive/make_array.inputs:input1"]
}
DRIVE, CLOCK = "/turtlebot3_burger/ROS_Drive", "/World/ROS_Clock"
NOWHERE = "https://nowhere.invalid/thing.usd"


def checks(stage: Usd.Stage) -> dict[str, Check]:
    return {check.name: check for check in judge(driven(stage, SHORT), CHECKS)}


def faulty(stage: Usd.Stage, verdict: str = "bad") -> set[str]:
    return {name for name, check in checks(stage).items() if check.verdict == verdict}


def node_of(stage: Usd.Stage, path: str, kind: str) -> Usd.Prim:
    node = stage.DefinePrim(path, "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(kind)
    return node


def print_text(stage: Usd.Stage) -> None:
    node_of(stage, f"{DRIVE}/print", "omni.graph.ui_nodes.PrintText")


def chair(stage: Usd.Stage) -> None:
    stage.DefinePrim("/World/Chair", "Xform").GetReferences().AddReference(NOWHERE)


def unused_graph(stage: Usd.Stage) -> None:
    graph = stage.DefinePrim("/World/Spare", "OmniGraph")
    graph.CreateAttribute("evaluationMode", Sdf.ValueTypeNames.Token).Set("Instanced")


@pytest.mark.parametrize("unknown", [print_text, chair, unused_graph])
def test_what_nothing_depends_on_hides_no_fault(unknown: Callable[[Usd.Stage], None]) -> None:
    stage = broken("02", [SWAPPED])
    unknown(stage)
    assert checks(stage)["follows"].verdict == "bad"
    right = correct_stage("02")
    unknown(right)
    assert "follows" not in faulty(right)


def test_what_comes_out_of_an_unknown_node_is_no_fault() -> None:
    stage = correct_stage("02")
    node = node_of(stage, f"{DRIVE}/halved", "my.Half")
    node.CreateAttribute("outputs:half", Sdf.ValueTypeNames.Double)
    angular = stage.GetAttributeAtPath(f"{DRIVE}/differential_controller.inputs:angularVelocity")
    angular.SetConnections([f"{DRIVE}/halved.outputs:half"])
    found = checks(stage)
    assert (found["follows"].verdict, found["clock"].verdict) == ("not judged", "ok")
    stage = broken("02", [{"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"}])
    node_of(stage, f"{DRIVE}/halved", "my.Half")
    assert faulty(stage) == {"topics"}


def test_nothing_is_sent_under_a_name_that_is_not_known() -> None:
    stage = correct_stage("02")
    node_of(stage, f"{CLOCK}/name", "my.Name").CreateAttribute(
        "outputs:name", Sdf.ValueTypeNames.String
    )
    topic = stage.GetAttributeAtPath(f"{CLOCK}/ros2_publish_clock.inputs:topicName")
    topic.SetConnections([f"{CLOCK}/name.outputs:name"])
    sent = driven(stage, SHORT).recording.messages
    assert "/clock" not in {message.topic for message in sent}
    assert "topics" not in faulty(stage)


def test_which_of_two_sources_counts_is_not_known() -> None:
    speed = f"{DRIVE}/differential_controller.inputs:angularVelocity"
    stage = correct_stage("05")
    attribute = stage.GetAttributeAtPath(speed)
    sources = [*attribute.GetConnections(), f"{DRIVE}/differential_controller.inputs:wheelRadius"]
    attribute.SetConnections(sources)
    assert faulty(stage) == set()
    attribute.SetConnections(sources[::-1])
    assert checks(stage)["follows"].verdict == "not judged"
    told = driven(stage, SHORT).recording.not_simulated
    assert told == {speed: "which of its 2 sources counts is not public; the first is taken"}


def test_a_graph_that_runs_for_a_prim_runs_only_with_one() -> None:
    stage = broken("05", [{"set": ["ROS_Drive.evaluationMode", "Instanced"]}])
    found = checks(stage)
    assert (found["graphs"].kind, found["graphs"].prim) == ("graph-not-evaluated", DRIVE)
    robot = stage.GetPrimAtPath("/turtlebot3_burger")
    robot.CreateRelationship("omniGraphs").SetTargets([DRIVE])
    assert faulty(stage) == set()
    camera = stage.GetPrimAtPath("/World")
    camera.CreateRelationship("omniGraphs").SetTargets([DRIVE])
    assert faulty(stage) == set()
    assert checks(stage)["follows"].verdict == "not judged"


TICK, BY_KEY = "omni.graph.action.OnPlaybackTick", "omni.graph.action.OnKeyboardInput"
GRAPH = "/World/Extra"
# What these nodes do: the documentation of omni.graph.nodes, .action_nodes and .ui_nodes.
CHANGING: dict[str, dict[str, object]] = {
    "omni.graph.action.SetPrimActive": {"rel inputs:primTarget": "/turtlebot3_burger/base_link"},
    "omni.graph.nodes.SetTimeline": {"token inputs:propName": "Time"},
    "omni.graph.nodes.WriteSetting": {"string inputs:settingPath": "/app/player/playSimulations"},
    "omni.graph.nodes.BlendVariants": {"rel inputs:prim": "/turtlebot3_burger"},
    "omni.graph.ui_nodes.SetCameraTarget": {
        "token inputs:primPath": "/turtlebot3_burger/base_footprint/Camera_1"
    },
    "omni.graph.scriptnode.ScriptNode": {},
}
HARMLESS: dict[str, dict[str, object]] = {
    "omni.graph.ui_nodes.PrintText": {},
    "omni.graph.ui_nodes.SetCameraTarget": {"token inputs:primPath": "/OmniverseKit_Persp"},
    "omni.graph.nodes.WriteSetting": {"string inputs:settingPath": "/rtx/post/aa/op"},
}


def extra(stage: Usd.Stage, kind: str, ports: dict[str, object], event: str = TICK) -> None:
    graph = stage.DefinePrim(GRAPH, "OmniGraph")
    graph.CreateAttribute("evaluator:type", Sdf.ValueTypeNames.Token).Set("execution")
    node_of(stage, f"{GRAPH}/event", event)
    node = node_of(stage, f"{GRAPH}/changes", kind)
    output = {BY_KEY: "pressed", TICK: "tick"}.get(event, "execOut")
    signal = node.CreateAttribute("inputs:execIn", Sdf.ValueTypeNames.UInt)
    signal.SetConnections([f"{GRAPH}/event.outputs:{output}"])
    for name, value in ports.items():
        usd_type, _, port = name.partition(" ")
        if usd_type == "rel":
            node.CreateRelationship(port).SetTargets([value])
        else:
            node.CreateAttribute(port, Sdf.ValueTypeNames.Find(usd_type)).Set(value)


@pytest.mark.parametrize(("kind", "ports"), CHANGING.items(), ids=CHANGING)
def test_a_stage_is_not_right_while_a_node_that_may_change_it_is_not_played(
    kind: str, ports: dict[str, object]
) -> None:
    stage = correct_stage("05")
    extra(stage, kind, ports)
    found = checks(stage)
    assert {check.verdict for check in found.values()} == {"not judged"}
    assert f"{GRAPH}/changes" in found["topics"].message


@pytest.mark.parametrize(("kind", "ports"), HARMLESS.items(), ids=HARMLESS)
def test_what_a_node_changes_only_on_the_screen_is_no_doubt(
    kind: str, ports: dict[str, object]
) -> None:
    stage = correct_stage("05")
    extra(stage, kind, ports)
    assert faulty(stage, "not judged") == set()


def test_a_key_that_nobody_presses_stops_nothing() -> None:
    stage = correct_stage("05")
    extra(stage, "omni.graph.nodes.SetTimeline", {}, BY_KEY)
    assert faulty(stage, "not judged") == set()


def test_a_node_that_a_signal_which_is_not_played_reaches_may_stop_the_run() -> None:
    stage = correct_stage("05")
    extra(stage, "omni.graph.nodes.StopTimeline", {}, "omni.graph.action.OnStageEvent")
    assert {check.verdict for check in checks(stage).values()} == {"not judged"}


def test_nothing_is_sent_after_a_node_has_stopped_the_timeline() -> None:
    stage = correct_stage("05")
    extra(stage, "omni.graph.nodes.StopTimeline", {})
    found = checks(stage)
    assert (found["graphs"].kind, found["graphs"].prim) == (
        "simulation-stopped",
        f"{GRAPH}/changes",
    )
    assert {found[name].verdict for name in ("topics", "follows")} == {"bad"}


TIME = "ROS_Clock/ros2_publish_clock.inputs:timeStamp"


def test_a_wire_from_a_port_that_is_not_there_is_a_fault() -> None:
    stage = correct_stage("01")
    stamp = stage.GetAttributeAtPath(f"/World/{TIME}")
    right = [*stamp.GetConnections()]
    wrong = f"{CLOCK}/isaac_read_simulation_time.outputs:time"
    stamp.SetConnections([wrong])
    found = checks(stage)["graphs"]
    assert (found.kind, found.prim) == ("unknown-port", f"{CLOCK}/ros2_publish_clock")
    stamp.SetConnections([*right, wrong])  # Kit drops one and keeps the other
    assert "graphs" not in faulty(stage)


def test_a_wire_into_a_port_that_is_not_there_is_a_fault() -> None:
    stage = correct_stage("01")
    publisher = stage.GetPrimAtPath(f"{CLOCK}/ros2_publish_clock")
    extra = publisher.CreateAttribute("inputs:simTime", Sdf.ValueTypeNames.Double)
    extra.SetConnections([f"{CLOCK}/isaac_read_simulation_time.outputs:simulationTime"])
    assert "inputs:simTime" in checks(stage)["graphs"].message


def test_a_robot_that_cannot_be_found_is_not_judged() -> None:
    stage = correct_stage("05")
    for name in stage.GetPrimAtPath("/turtlebot3_burger").GetChildrenNames():
        if not name.startswith("ROS_"):
            stage.RemovePrim(f"/turtlebot3_burger/{name}")
    stage.GetPrimAtPath("/turtlebot3_burger").GetReferences().AddReference(NOWHERE)
    assert checks(stage)["follows"].verdict == "not judged"
    assert faulty(stage) == set()


def test_a_chassis_without_a_type_is_no_body() -> None:
    stage = correct_stage("05")
    stage.GetPrimAtPath("/turtlebot3_burger/base_footprint").SetTypeName("")
    assert checks(stage)["topics"].kind == "no-chassis-body"


CORE = "omni:sensor:Core:"


@pytest.mark.parametrize("name", ["scanRateBaseHz", "patternFiringRateHz", "farRangeM"])
def test_a_lidar_scans_with_what_it_leaves_to_the_schema(name: str) -> None:
    stage = correct_stage("05")
    stage.GetPrimAtPath(LIDAR).RemoveProperty(f"{CORE}{name}")
    trial = driven(stage, SHORT)
    verdicts = {check.name: check.verdict for check in judge(trial, CHECKS)}
    assert (verdicts["topics"], verdicts["scan"]) == ("ok", "ok")
    assert LIDAR not in trial.recording.assumed


def test_a_lidar_without_emitters_of_its_own_looks_up_and_down() -> None:
    stage = correct_stage("05")
    lidar = stage.GetPrimAtPath(LIDAR)
    for name in lidar.GetPropertyNames():
        if "emitterState" in name or "numberOf" in name:
            lidar.RemoveProperty(name)
    trial = driven(stage, SHORT)
    assert {check.name: check.verdict for check in judge(trial, CHECKS)}["scan"] == "not judged"
    assert "elevationDeg" in trial.recording.not_simulated[LIDAR]


@pytest.mark.parametrize("case", ["count_2_lists_1", "channel_0", "firing_rate_a_float"])
def test_a_lidar_that_the_checker_refuses_gives_no_scan(case: str) -> None:
    trial = driven(with_values(CASES["refused"][case], correct_stage("05")), SHORT)
    verdicts = {check.name: check.verdict for check in judge(trial, CHECKS)}
    assert (verdicts["topics"], verdicts["scan"]) == ("bad", "not judged")


ELSEWHERE: dict[str, Change] = {
    "up": put(LIDAR, f"{CORE}emitterState:s001:elevationDeg", [90.0]),
    "down": put(LIDAR, f"{CORE}emitterState:s001:elevationDeg", [-80.0]),
    "ten degrees": put(LIDAR, f"{CORE}validEndAzimuthDeg", 10.0),
    "nothing of the circle": put(LIDAR, f"{CORE}validEndAzimuthDeg", 0.0),
    "from a later start": several(
        put(LIDAR, f"{CORE}validStartAzimuthDeg", 90.0), clear(LIDAR, f"{CORE}validEndAzimuthDeg")
    ),
    "offset": put(LIDAR, f"{CORE}startAzimuthOffsetDeg", 45.0),
    "solid state": put(LIDAR, f"{CORE}scanType", "SOLID_STATE"),
    "no direction": put(LIDAR, f"{CORE}rotationDirection", "UP"),
}


@pytest.mark.parametrize("change", ELSEWHERE.values(), ids=ELSEWHERE)
def test_a_lidar_whose_rays_go_elsewhere_is_named_and_shows_no_walls(change: Change) -> None:
    stage = correct_stage("05")
    change(stage)
    trial = driven(stage, SHORT)
    verdicts = {check.name: check.verdict for check in judge(trial, CHECKS)}
    assert (verdicts["scan"], verdicts["map"]) == ("not judged", "not judged")
    assert CORE in trial.recording.not_simulated[LIDAR]
    assert {verdicts[name] for name in ("topics", "follows", "camera")} == {"ok"}


@pytest.mark.parametrize(
    "change",
    [
        put(LIDAR, f"{CORE}rotationDirection", "CW"),
        put(LIDAR, f"{CORE}emitterState:s001:elevationDeg", [0.5]),
        several(
            put(LIDAR, f"{CORE}validStartAzimuthDeg", -180.0),
            put(LIDAR, f"{CORE}validEndAzimuthDeg", 180.0),
        ),
        clear(LIDAR, f"{CORE}scanType"),
    ],
    ids=["the other way", "a little tilted", "a circle from behind", "not said"],
)
def test_a_profile_that_scans_the_same_circle_is_played(change: Change) -> None:
    stage = correct_stage("05")
    change(stage)
    trial = driven(stage, SHORT)
    assert {check.name: check.verdict for check in judge(trial, CHECKS)}["scan"] == "ok"
    assert trial.recording.not_simulated == {}


def test_a_rate_of_zero_is_not_left_to_the_schema() -> None:
    stage = correct_stage("05")
    stage.GetPrimAtPath(LIDAR).GetAttribute(f"{CORE}patternFiringRateHz").Set(0)
    assert checks(stage)["topics"].verdict == "bad"


def test_a_missing_asset_is_the_cause_of_what_it_could_hold() -> None:
    stage = correct_stage("02")
    left = "/turtlebot3_burger/wheel_left_link"
    stage.GetPrimAtPath(left).GetReferences().AddReference(NOWHERE)
    put("/turtlebot3_burger/joints/wheel_left_joint", drive("damping"), 0.0)(stage)
    check = checks(stage)["follows"]
    assert (check.verdict, check.prim, check.kind) == ("not judged", left, None)
    assert check.cause == f"{NOWHERE} cannot be found"
