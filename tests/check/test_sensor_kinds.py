"""Sensors as data: an IMU, which no rule knows by name, and a second lidar, in the lab's scene."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import quick_yaml
from pxr import Gf, Sdf, Usd
from scene_stages import (
    LIDAR,
    ORIENT,
    SCALE,
    TRANSLATE,
    Change,
    deactivate,
    define,
    detach,
    move_prim,
    put,
    remove,
    retype,
    turn,
    undefine,
    without_api,
)

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.model.changes import ApplySchema, Edit, MovePrim, Restore
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.graphs import author_sensor
from lab3_usd.stage.write.starter import starter_layer

BASE = "/turtlebot3_burger/base_link"
IMU, BACK = f"{BASE}/Imu", f"{BASE}/LidarBack"
PERIOD = "sensorPeriod"
SCHEMA = "IsaacSensorAPI"
POSE = {"rotate": [0.0, 0.0, 0.0], "scale": [1.0, 1.0, 1.0], "handout": "D4"}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """The bundled lab with an IMU from checkpoint 02 on, and a second lidar from 04 on."""
    folder = tmp_path_factory.mktemp("sensors") / "lab"
    shutil.copytree(data_folder("graphs"), folder, ignore=shutil.ignore_patterns("__pycache__"))
    scene = quick_yaml.load((folder / "scene.yaml").read_text())
    scene["sensors"]["imu"] = {
        "kind": "imu",
        "path": IMU,
        "type": "IsaacImuSensor",
        "handout": "D3",
        "pose": {"translate": [-0.032, 0.0, 0.068], **POSE},
        "apis": [SCHEMA],
        "required_apis": [SCHEMA],
        "attributes": {PERIOD: {"type": "float", "value": 0.01, "required": True, "handout": "D5"}},
    }
    back = {**scene["sensors"]["lidar"], "path": BACK, "handout": "E3"}
    scene["sensors"]["back"] = {**back, "pose": {"translate": [-0.1, 0.0, 0.1], **POSE}}
    (folder / "scene.yaml").write_text(quick_yaml.dump(scene))
    checkpoints = quick_yaml.load((folder / "checkpoints.yaml").read_text())
    checkpoints["checkpoints"]["02"]["adds"]["sensors"] = ["imu"]
    checkpoints["checkpoints"]["04"]["adds"]["sensors"].append("back")
    (folder / "checkpoints.yaml").write_text(quick_yaml.dump(checkpoints))
    return load_lab(folder)


@pytest.fixture(scope="module")
def starter() -> Sdf.Layer:
    """The starter of the lab: sensors are judged without the graphs."""
    return starter_layer(data_folder("graphs"))


Judge = Callable[..., RuleResults]


@pytest.fixture
def judged(lab: Lab, starter: Sdf.Layer) -> Judge:
    """Judge a stage with all sensors of a checkpoint, after some changes."""

    def after(checkpoint: str, *changes: Change) -> RuleResults:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(starter)
        for name in lab.checkpoints[checkpoint].sensors:
            author_sensor(layer, lab.sensors[name], 1.0)
        stage = Usd.Stage.Open(layer)
        for change in changes:
            change(stage)
        found = judge(
            lab, lab.checkpoints[checkpoint], read_model(stage, lab.platform, "stage.usda")
        )
        assert found.crashes == ()
        return found

    return after


def about_sensors(found: RuleResults) -> list[str]:
    """The findings about sensors, as rule and prim."""
    return [
        f"{finding.rule} {finding.prim}"
        for finding in found.findings
        if finding.rule[0] in "CDL" and finding.severity != "note"
    ]


def unmet(found: RuleResults) -> set[str]:
    groups = ("Imu", "Lidar2D", "LidarBack", "Camera_1")
    return {
        requirement.id
        for requirement in found.requirements
        if requirement.group in groups and not requirement.met
    }


def test_sensors_as_the_lab_describes_them_are_right(judged: Judge) -> None:
    found = judged("05")
    assert about_sensors(found) == []
    assert unmet(found) == set()


FAULTS: dict[str, tuple[Change, str, set[str]]] = {
    "removed": (remove(IMU), f"D01 {IMU}", {"position", "prim", "rotation", "scale"}),
    "deactivated": (deactivate(IMU), f"D01 {IMU}", {"prim"}),
    "only an over": (undefine(IMU), f"D01 {IMU}", {"prim"}),
    "renamed": (move_prim(IMU, f"{BASE}/Imu_Sensor"), f"D02 {BASE}/Imu_Sensor", {"prim"}),
    "an Xform": (retype(IMU, "Xform"), f"D03 {IMU}", {"prim"}),
    "moved": (put(IMU, TRANSLATE, Gf.Vec3d(0, 0, 0)), f"D04 {IMU}", {"position"}),
    "turned": (put(IMU, ORIENT, turn(90)), f"D04 {IMU}", {"rotation"}),
    "scaled": (put(IMU, SCALE, Gf.Vec3d(2, 2, 2)), f"D04 {IMU}", {"scale"}),
    "left behind": (detach(IMU), f"D04 {IMU}", {"position"}),
    "slow": (put(IMU, PERIOD, 0.1), f"D05 {IMU}", {PERIOD}),
    "without its schema": (without_api(IMU, SCHEMA), f"D06 {IMU}", {SCHEMA}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_sensor_of_any_kind_is_found(judged: Judge, fault: str) -> None:
    change, finding, lost = FAULTS[fault]
    found = judged("05", change)
    assert about_sensors(found) == [finding]
    assert {f"Imu/{each}" for each in lost} <= unmet(found)


REPAIRS: dict[str, Edit] = {
    "removed": Restore(IMU),
    "renamed": MovePrim(f"{BASE}/Imu_Sensor", IMU),
    "an Xform": Restore(IMU),
    "moved": Restore(IMU, TRANSLATE),
    "turned": Restore(IMU, ORIENT),
    "scaled": Restore(IMU, SCALE),
    "left behind": Restore(IMU, "xformOpOrder"),
    "slow": Restore(IMU, PERIOD),
    "without its schema": ApplySchema(IMU, SCHEMA),
}


@pytest.mark.parametrize("fault", REPAIRS)
def test_a_fault_of_a_sensor_of_any_kind_has_its_repair(judged: Judge, fault: str) -> None:
    findings = [finding for finding in judged("05", FAULTS[fault][0]).findings if finding.fix]
    edits = {finding.rule: finding.fix.edits for finding in findings if finding.fix}
    assert edits.get(FAULTS[fault][1][:3]) == (REPAIRS[fault],)


def test_a_sensor_before_its_checkpoint_is_early(judged: Judge) -> None:
    found = judged("01", define(IMU, "IsaacImuSensor"))
    assert about_sensors(found) == [f"D07 {IMU}"]


def test_a_second_lidar_that_the_lab_asks_for_is_right(judged: Judge) -> None:
    assert about_sensors(judged("04")) == []


def test_each_of_two_lidars_is_missed_by_itself(judged: Judge) -> None:
    assert about_sensors(judged("05", remove(BACK))) == [f"L01 {BACK}"]
    assert about_sensors(judged("05", remove(LIDAR))) == [f"L01 {LIDAR}"]


def test_a_third_lidar_is_one_too_many(judged: Judge) -> None:
    assert about_sensors(judged("05", define("/World/Lidar", "OmniLidar"))) == ["L07 /World/Lidar"]


def test_a_lidar_of_a_later_checkpoint_is_early_beside_one_that_is_asked_for(
    judged: Judge,
) -> None:
    assert about_sensors(judged("03", define(BACK, "OmniLidar"))) == [f"L08 {BACK}"]


def test_two_sensors_cannot_share_a_path(tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    shutil.copytree(data_folder("graphs"), folder)
    scene = quick_yaml.load((folder / "scene.yaml").read_text())
    scene["sensors"]["camera"]["path"] = LIDAR
    (folder / "scene.yaml").write_text(quick_yaml.dump(scene))
    with pytest.raises(SpecError, match=f"camera: '{LIDAR}' is the path of lidar"):
        load_lab(folder)
