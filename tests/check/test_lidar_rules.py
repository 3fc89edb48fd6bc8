"""What is said of the lidar, beyond one fault for each thing that is asked of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from other_labs import copied
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scene_stages import (
    CAMERA,
    CASES,
    LIDAR,
    ORIENT,
    ROBOT,
    TICK,
    TRANSLATE,
    TURNS,
    Change,
    aim,
    as_matrix,
    author,
    built,
    clear,
    deactivate,
    define,
    detach,
    found_after,
    model_of,
    move_prim,
    negated,
    put,
    refer,
    remove,
    retype,
    rotated,
    several,
    switch,
    told,
    told_after,
    turn,
    with_values,
    without_api,
)

from lab3_usd.check.checker import judge
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.spec.load.loader import load_lab

CORE = "omni:sensor:Core:"
ELEVATION = f"{CORE}emitterState:s001:elevationDeg"
API = "OmniSensorGenericLidarCoreAPI"
EMITTERS = ("azimuthDeg", "elevationDeg", "channelId", "fireTimeNs")
ELSEWHERE = "/World/Example_Rotary_2D"
OWN_API = "OmniSensorGenericLidarCoreEmitterStateAPI:s001"

EQUALS: dict[str, Change] = {
    "angles": rotated(LIDAR, (0, 0, 1e-5)),
    "matrix": as_matrix(LIDAR),
    "other sign": negated(LIDAR),
    "noise": put(LIDAR, TRANSLATE, Gf.Vec3d(3e-9, -1e-8, 5e-5)),
    "a little turn": put(LIDAR, ORIENT, turn(0.05)),
    "no pose": lambda stage: stage.GetPrimAtPath(LIDAR).RemoveProperty("xformOpOrder") and None,
    "other attributes": put(LIDAR, "omni:sensor:Core:farRangeM", 30.0),
    "no tick rate": clear(LIDAR, TICK),
    "a turned circle": several(
        put(LIDAR, f"{CORE}validStartAzimuthDeg", -180.0),
        put(LIDAR, f"{CORE}validEndAzimuthDeg", 180.0),
    ),
    "a little tilted": put(LIDAR, ELEVATION, [0.5]),
    "the sensor's own frame": author(LIDAR, f"{CORE}outputFrameOfReference", "Token", "SENSOR"),
    "nothing said of accumulation": clear(LIDAR, f"{CORE}accumulateOutputs"),
    **{
        f"no {name}": author(LIDAR, f"{CORE}emitterState:s001:{name}", kind, [])
        for name, kind in (("bank", "UIntArray"), ("horOffsetM", "FloatArray"))
    },
    "two beams a turn": put(LIDAR, f"{CORE}patternFiringRateHz", 20),
    "rates and ranges of the schema": several(
        clear(LIDAR, f"{CORE}patternFiringRateHz"),
        clear(LIDAR, f"{CORE}nearRangeM"),
        clear(LIDAR, f"{CORE}farRangeM"),
    ),
    "deactivated leftover": lambda stage: (
        define("/World/Lidar_01", "OmniLidar")(stage),
        deactivate("/World/Lidar_01")(stage),
        None,
    )[-1],
}


@pytest.mark.parametrize("change", EQUALS.values(), ids=EQUALS)
def test_what_means_the_same_is_no_fault(change: Change) -> None:
    assert told_after("03", change) == []


def test_a_lidar_with_its_world_place_below_another_parent_is_only_misplaced() -> None:
    stage = built("03")
    move_prim(LIDAR, "/World/Lidar2D")(stage)
    put("/World/Lidar2D", TRANSLATE, Gf.Vec3d(1.768, 0, 0.182))(stage)
    assert told(stage, "03") == [("L02", "/World/Lidar2D", None)]


def test_the_inside_of_a_misplaced_lidar_is_judged() -> None:
    stage = built("03")
    move_prim(LIDAR, ELSEWHERE)(stage)
    put(ELSEWHERE, TICK, 30.0)(stage)
    put(ELSEWHERE, TRANSLATE, Gf.Vec3d(0, 0, 7))(stage)
    assert told(stage, "03") == [
        ("L02", ELSEWHERE, None),
        ("L04", ELSEWHERE, TRANSLATE),
        ("L05", ELSEWHERE, TICK),
    ]


def test_what_is_said_of_a_misplaced_lidar_relates_to_its_path() -> None:
    found = found_after("03", move_prim(LIDAR, ELSEWHERE), put(ELSEWHERE, TICK, 30.0))
    assert [finding.related for finding in found] == [(LIDAR,)] * 2


def test_a_lidar_with_the_right_name_is_the_misplaced_one_of_two() -> None:
    stage = built("03")
    move_prim(LIDAR, "/World/Lidar2D")(stage)
    define("/World/Another", "OmniLidar")(stage)
    assert told(stage, "03") == [("L02", "/World/Lidar2D", None), ("L07", "/World/Another", None)]


def test_an_active_lidar_beside_a_deactivated_one_is_misplaced() -> None:
    found = told_after("03", deactivate(LIDAR), define(ELSEWHERE, "OmniLidar"))
    rules = [each[0] for each in found]
    assert rules == ["L02", "L05", "L05", "L06"]


def test_a_lidar_inside_an_xform_at_its_path_is_misplaced() -> None:
    stage = built("03")
    inner = f"{ROBOT}/base_scan/Example/Lidar2D"
    define(f"{ROBOT}/base_scan/Example", "Xform")(stage)
    move_prim(LIDAR, inner)(stage)
    move_prim(f"{ROBOT}/base_scan/Example", LIDAR)(stage)
    assert told(stage, "03") == [("L02", f"{LIDAR}/Lidar2D", None)]
    move_prim(f"{LIDAR}/Lidar2D/ROS_Lidar2D", f"{LIDAR}/ROS_Lidar2D")(stage)
    assert told(stage, "03") == [("L02", f"{LIDAR}/Lidar2D", None)]


def test_a_lidar_below_a_missing_link_is_not_told_again() -> None:
    assert told_after("03", remove(f"{ROBOT}/base_scan")) == [("S01", f"{ROBOT}/base_scan", None)]


def test_a_second_lidar_below_the_first_is_told() -> None:
    found = told_after("03", define(f"{LIDAR}/Lidar", "OmniLidar"))
    assert found == [("L07", f"{LIDAR}/Lidar", None)]


def test_a_named_leftover_is_told_once_with_the_lidar_in_it() -> None:
    found = told_after("03", define(ELSEWHERE, "Xform"), define(f"{ELSEWHERE}/sensor", "OmniLidar"))
    assert found == [("L07", ELSEWHERE, None)]


@pytest.mark.parametrize("checkpoint", ["01", "02"])
def test_an_early_lidar_is_a_warning(checkpoint: str) -> None:
    found = found_after(checkpoint, define(LIDAR, "OmniLidar"))
    assert [(each.rule, each.severity, each.prim) for each in found] == [("L08", "warning", LIDAR)]


def vendors(stage: object) -> None:
    """Leave of the lidar what a stage says of it whose asset is on a server."""
    for change in (
        without_api(LIDAR, API),
        without_api(LIDAR, OWN_API),
        refer(LIDAR, "https://assets.example/Example_Rotary_2D.usda"),
    ):
        change(stage)


def test_rates_and_schema_behind_a_missing_asset_are_not_verifiable() -> None:
    (found,) = found_after("03", vendors, clear(LIDAR, TICK), clear(LIDAR, TURNS))
    assert (found.rule, found.severity, found.prim) == ("F02", "note", LIDAR)


def test_a_wrong_rate_over_a_missing_asset_is_a_fault() -> None:
    assert ("L05", LIDAR, TICK) in told_after("03", vendors, put(LIDAR, TICK, 30.0))


def test_the_rate_may_be_a_whole_number() -> None:
    stage = built("03")
    clear(LIDAR, TICK)(stage)
    stage.GetPrimAtPath(LIDAR).CreateAttribute(TICK, Sdf.ValueTypeNames.Int).Set(10)
    assert told(stage, "03") == []


@pytest.mark.parametrize(("kind", "value"), [("String", "10"), ("Bool", True)])
def test_a_rate_that_is_no_number_is_a_fault(kind: str, value: object) -> None:
    stage = built("03")
    clear(LIDAR, TICK)(stage)
    stage.GetPrimAtPath(LIDAR).CreateAttribute(TICK, getattr(Sdf.ValueTypeNames, kind)).Set(value)
    assert told(stage, "03") == [("L05", LIDAR, TICK)]


def test_sensors_that_stand_elsewhere_are_mapped_to_where_they_are() -> None:
    stage = built("03")
    move_prim(LIDAR, ELSEWHERE)(stage)
    assert sensor_relocations(load_lab(), model_of(stage)) == {LIDAR: ELSEWHERE}


def test_a_lidar_duplicated_with_its_graph_is_one_mistake() -> None:
    stage = built("03")
    layer = stage.GetRootLayer()
    assert Sdf.CopySpec(layer, LIDAR, layer, f"{LIDAR}_01")
    lab = load_lab()
    found = judge(lab, lab.checkpoints["03"], model_of(stage)).findings
    assert [(f.rule, f.prim) for f in found if f.severity != "note"] == [("L07", f"{LIDAR}_01")]


def test_a_scan_rate_that_is_not_written_is_that_of_the_schema() -> None:
    assert found_after("03", clear(LIDAR, TURNS)) == []


def test_a_rate_that_is_asked_where_it_is_written_is_compared_with_that_of_the_schema(
    tmp_path: Path,
) -> None:
    folder = copied(tmp_path / "lab")
    scene = folder / "scene.yaml"
    asked = "{type: float, value: 10.0, required: true, handout: "
    there = asked.replace("10.0, required: true", "20.0, required: if authored")
    scene.write_text(scene.read_text().replace(f'"{TICK}": {asked}', f'"{TICK}": {there}'))
    lab, stage = load_lab(folder), built("03")
    clear(LIDAR, TICK)(stage)
    found = judge(lab, lab.checkpoints["03"], model_of(stage)).findings
    assert ("L05", TICK) in {(finding.rule, finding.property) for finding in found}


def test_rates_of_a_lidar_without_its_schema_have_no_values_of_their_own() -> None:
    found = told_after("03", without_api(LIDAR, API), clear(LIDAR, TICK))
    assert found == [("L05", LIDAR, TICK), ("L06", LIDAR, None)]


@pytest.mark.parametrize(("near", "far"), [(5.0, 5.0), (5.0, 1.0), (0.12, -1.0)])
def test_a_nearest_range_beyond_the_farthest_is_one_fault(near: float, far: float) -> None:
    stage = built("03")
    put(LIDAR, f"{CORE}nearRangeM", near)(stage)
    put(LIDAR, f"{CORE}farRangeM", far)(stage)
    assert [(each[0], each[1]) for each in told(stage, "03")] == [("L09", LIDAR)]


def test_fewer_beams_than_turns_are_no_scan() -> None:
    found = told_after("03", put(LIDAR, f"{CORE}patternFiringRateHz", 10))
    assert found == [("L09", LIDAR, f"{CORE}patternFiringRateHz")]


def test_a_value_that_gives_no_scan_is_a_fault_over_a_missing_asset() -> None:
    found = told_after("03", vendors, put(LIDAR, f"{CORE}farRangeM", 0.0))
    assert ("L09", LIDAR, f"{CORE}farRangeM") in found


def second_state(elevation: float) -> Change:
    case = CASES["taken"]["two_states"]
    return lambda stage: (
        with_values({**case, "s002:elevationDeg": ["float[]", [elevation]]}, stage) and None
    )


OTHERS: dict[str, tuple[Change, str]] = {
    "half a circle": (
        put(LIDAR, f"{CORE}validEndAzimuthDeg", 180.0),
        f"{CORE}validEndAzimuthDeg",
    ),
    "ahead": (
        several(
            put(LIDAR, f"{CORE}validStartAzimuthDeg", 270.0),
            put(LIDAR, f"{CORE}validEndAzimuthDeg", 90.0),
        ),
        f"{CORE}validEndAzimuthDeg",
    ),
    "nothing of the circle": (
        put(LIDAR, f"{CORE}validEndAzimuthDeg", 0.0),
        f"{CORE}validEndAzimuthDeg",
    ),
    "from a later start": (
        several(
            put(LIDAR, f"{CORE}validStartAzimuthDeg", 90.0),
            clear(LIDAR, f"{CORE}validEndAzimuthDeg"),
        ),
        f"{CORE}validStartAzimuthDeg",
    ),
    "up": (put(LIDAR, ELEVATION, [30.0]), ELEVATION),
    "down": (put(LIDAR, ELEVATION, [-5.0]), ELEVATION),
    "up in a second state": (
        second_state(15.0),
        f"{CORE}emitterState:s002:elevationDeg",
    ),
    "emitters of the schema": (
        several(
            *(clear(LIDAR, f"{CORE}emitterState:s001:{name}") for name in EMITTERS),
            clear(LIDAR, f"{CORE}numberOfEmitters"),
            clear(LIDAR, f"{CORE}numberOfChannels"),
        ),
        ELEVATION,
    ),
    "solid state": (put(LIDAR, f"{CORE}scanType", "SOLID_STATE"), f"{CORE}scanType"),
    "one frame alone": (
        switch(LIDAR, f"{CORE}accumulateOutputs"),
        f"{CORE}accumulateOutputs",
    ),
    "world frame": (
        author(LIDAR, f"{CORE}outputFrameOfReference", "Token", "WORLD"),
        f"{CORE}outputFrameOfReference",
    ),
}


@pytest.mark.parametrize(("change", "name"), OTHERS.values(), ids=OTHERS)
def test_another_scan_than_the_whole_circle_is_a_warning(change: Change, name: str) -> None:
    (found,) = found_after("03", change)
    assert (found.rule, found.severity) == ("L10", "warning")
    assert (found.prim, found.property) == (LIDAR, name)


@pytest.mark.parametrize(
    ("sensor", "rule", "place"),
    [(LIDAR, "L04", (1.768, 0, 0.182)), (CAMERA, "C04", (1.9, 0, 0.2))],
)
def test_a_sensor_that_stays_behind_in_its_place_is_one_fault(
    sensor: str, rule: str, place: tuple[float, float, float]
) -> None:
    (found,) = found_after("04", put(sensor, TRANSLATE, Gf.Vec3d(place)), detach(sensor))
    assert (found.rule, found.severity, found.property) == (rule, "error", "xformOpOrder")


def test_a_link_that_leaves_out_its_parents_moves_all_the_same() -> None:
    stage = built("04")
    put(f"{ROBOT}/base_scan", TRANSLATE, Gf.Vec3d(1.768, 0, 0.182))(stage)
    detach(f"{ROBOT}/base_scan")(stage)
    assert told(stage, "04") == []


def judged(stage: Usd.Stage) -> list[tuple[str, str]]:
    lab = load_lab()
    found = judge(lab, lab.checkpoints["04"], model_of(stage)).findings
    return [(each.rule, each.prim) for each in found if each.severity != "note"]


def test_of_two_lidars_the_one_that_holds_the_graph_is_the_labs() -> None:
    stage = built("04")
    move_prim(LIDAR, ELSEWHERE)(stage)
    define(LIDAR, "OmniLidar")(stage)
    assert judged(stage) == [("L02", ELSEWHERE), ("L07", LIDAR)]


def test_of_two_lidars_the_wired_one_is_the_labs() -> None:
    stage = built("04")
    move_prim(LIDAR, ELSEWHERE)(stage)
    define(LIDAR, "OmniLidar")(stage)
    move_prim(f"{ELSEWHERE}/ROS_Lidar2D", "/World/ROS_Lidar2D")(stage)
    assert judged(stage)[-2:] == [("L02", ELSEWHERE), ("L07", LIDAR)]


def test_of_two_unused_lidars_the_one_at_the_path_is_the_labs() -> None:
    found = told_after("04", remove(f"{LIDAR}/ROS_Lidar2D"), define(ELSEWHERE, "OmniLidar"))
    assert found == [("L07", ELSEWHERE, None)]


def test_a_lidar_at_the_path_with_the_graph_is_the_labs_whatever_the_graph_names() -> None:
    stage = built("04")
    define(ELSEWHERE, "OmniLidar")(stage)
    node = f"{LIDAR}/ROS_Lidar2D/isaac_create_render_product"
    aim(node, "inputs:cameraPrim", ELSEWHERE)(stage)
    assert judged(stage) == [("R02", node), ("L07", ELSEWHERE)]


@pytest.mark.parametrize(("sensor", "rule"), [(LIDAR, "L04"), (CAMERA, "C04")])
def test_a_sensor_that_is_a_body_of_its_own_does_not_move_with_its_link(
    sensor: str, rule: str
) -> None:
    stage = built("04")
    UsdPhysics.RigidBodyAPI.Apply(stage.GetPrimAtPath(sensor))
    assert told(stage, "04") == [(rule, sensor, "physics:rigidBodyEnabled")]
    lab = load_lab()
    requirements = judge(lab, lab.checkpoints["04"], model_of(stage)).requirements
    (lost,) = [requirement for requirement in requirements if not requirement.met]
    assert lost.id.endswith("/position")


@pytest.mark.parametrize("sensor", [LIDAR, CAMERA])
def test_a_body_that_is_switched_off_or_welded_to_its_link_moves_with_it(sensor: str) -> None:
    stage = built("04")
    prim = stage.GetPrimAtPath(sensor)
    body = UsdPhysics.RigidBodyAPI.Apply(prim)
    weld = UsdPhysics.FixedJoint.Define(stage, f"{ROBOT}/joints/weld")
    weld.CreateBody0Rel().SetTargets([prim.GetParent().GetPath()])
    weld.CreateBody1Rel().SetTargets([prim.GetPath()])
    assert told(stage, "04") == []
    stage.RemovePrim(weld.GetPath())
    body.CreateRigidBodyEnabledAttr(defaultValue=False)
    assert told(stage, "04") == []


def test_a_lidar_in_the_place_of_the_camera_is_one_mistake() -> None:
    assert told_after("04", retype(CAMERA, "OmniLidar")) == [("C03", CAMERA, None)]


@pytest.mark.parametrize(
    ("asset", "expected"),
    [
        ("https://assets.example/NVIDIA/Example_Rotary.usda", [("L11", LIDAR, None)]),
        ("Example_Rotary.usd", [("L11", LIDAR, None)]),
        ("https://assets.example/NVIDIA/Example_Rotary_2D.usda", []),
        ("SubUSDs/Example_Rotary_2D.usd", []),
        ("my_lidar.usda", []),
    ],
)
def test_another_lidar_of_the_vendor_is_known_by_its_name(
    asset: str, expected: list[tuple[str, str, None]]
) -> None:
    assert [each for each in told_after("04", refer(LIDAR, asset)) if each[0] != "F02"] == expected


@pytest.mark.parametrize(
    ("name", "metres"), [("farRangeM", 3.5), ("farRangeM", 1.0), ("nearRangeM", 0.5)]
)
def test_a_range_that_reaches_a_wall_gives_a_scan(name: str, metres: float) -> None:
    assert told_after("04", put(LIDAR, f"omni:sensor:Core:{name}", metres)) == []


def test_what_only_looks_like_a_wall_is_seen_as_well() -> None:
    stage = built("04")
    put(LIDAR, "omni:sensor:Core:farRangeM", 0.4)(stage)
    assert told(stage, "04") == [("L09", LIDAR, "omni:sensor:Core:farRangeM")]
    pole = UsdGeom.Cylinder.Define(stage, "/World/Pole")
    pole.CreateRadiusAttr(0.05)
    pole.AddTranslateOp().Set(Gf.Vec3d(2.0, 0, 0))
    assert told(stage, "04") == []


def test_in_a_room_that_cannot_be_found_no_range_is_judged() -> None:
    stage = built("04")
    put(LIDAR, "omni:sensor:Core:farRangeM", 0.2)(stage)
    refer("/Environment", "https://assets.example/room.usd")(stage)
    assert [rule for rule, _, _ in told(stage, "04") if rule == "L09"] == []


def test_a_range_is_not_judged_by_units_that_are_wrong() -> None:
    assert {
        rule
        for rule, _, _ in told_after("04", lambda stage: stage.SetMetadata("metersPerUnit", 0.01))
    } == {"S02"}


def ball(path: str, radius: float = 0.1) -> Change:
    def change(stage: Usd.Stage) -> None:
        UsdGeom.Sphere.Define(stage, path).CreateRadiusAttr(radius)

    return change


AROUND = {
    "at the lidar": (f"{LIDAR}/Ball", "L12"),
    "at its link": (f"{ROBOT}/base_scan/Ball", "L12"),
    "at the camera": (f"{CAMERA}/Ball", "C11"),
}


@pytest.mark.parametrize(("path", "rule"), AROUND.values(), ids=AROUND)
def test_a_shape_around_a_sensor_is_a_warning(path: str, rule: str) -> None:
    found = [(each.rule, each.prim, each.severity) for each in found_after("04", ball(path))]
    assert found == [(rule, path, "warning")]


HARMLESS = {
    "one that is not shown": several(
        ball(f"{LIDAR}/Ball"), author(f"{LIDAR}/Ball", "visibility", "Token", "invisible")
    ),
    "one that is a guide": several(
        ball(f"{LIDAR}/Ball"), author(f"{LIDAR}/Ball", "purpose", "Token", "guide")
    ),
    "the sky": ball("/Environment/Sky", 500.0),
    "how the robot looks": ball(f"{ROBOT}/base_scan/visuals_of_it/visuals/Ball"),
}


@pytest.mark.parametrize("change", HARMLESS.values(), ids=HARMLESS)
def test_a_shape_that_hides_nothing_is_no_matter(change: Change) -> None:
    assert told_after("04", change) == []


def second_reader(stage: Usd.Stage) -> None:
    """Read the second lidar by a copy of the lab's graph."""
    layer, graph = stage.GetRootLayer(), f"{ELSEWHERE}/ROS_Lidar2D"
    Sdf.CopySpec(layer, LIDAR, layer, ELSEWHERE)
    for prim in Usd.PrimRange(stage.GetPrimAtPath(graph)):
        for port in [*prim.GetAttributes(), *prim.GetRelationships()]:
            is_wire = isinstance(port, Usd.Attribute)
            found = port.GetConnections() if is_wire else port.GetTargets()
            moved = [path.ReplacePrefix(LIDAR, ELSEWHERE) for path in found]
            if moved:
                (port.SetConnections if is_wire else port.SetTargets)(moved)


def test_two_lidars_of_different_scan_rates_crash_isaac_sim() -> None:
    lab, stage = load_lab(), built("04")
    second_reader(stage)
    found = judge(lab, lab.checkpoints["04"], model_of(stage)).findings
    rules = [each.rule for each in found]
    assert "L07" in rules
    assert "L13" not in rules
    stage.GetPrimAtPath(ELSEWHERE).GetAttribute(TURNS).Set(20)
    found = judge(lab, lab.checkpoints["04"], model_of(stage)).findings
    assert [each.prim for each in found if each.rule == "L13"] == [ELSEWHERE]
