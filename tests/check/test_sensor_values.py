"""What the values of a lidar must be: by its schemas, and by what NVIDIA's checkers refuse."""

from __future__ import annotations

import json
import re
import runpy
from collections.abc import Mapping
from typing import Any

import pytest
from linting import said_by
from places import REPOSITORY, SHARED
from pxr import Sdf, Usd
from scene_stages import CASES, LIDAR, lidar_alone, told, whole, with_values

from lab3_usd.facts.formulas import NAMES
from lab3_usd.facts.sensor_faults import SensorFault, faults_of, sensor_faults
from lab3_usd.facts.sensor_values import sensor_values
from lab3_usd.isaac.sensor_models import INSTANCE, LongList
from lab3_usd.spec.load.loader import load_lab, load_platform
from lab3_usd.stage.read.stage_reader import read_model

Change = Mapping[str, Any]
SCHEMAS = SHARED / "isaac" / "sensor-schemas.json"


def faults(change: Change) -> tuple[SensorFault, ...]:
    platform = load_lab().platform
    stage = read_model(with_values(change, lidar_alone()), platform, "stage.usda")
    return faults_of(stage.prims[LIDAR], stage)


def test_what_the_checker_refuses_is_one_error() -> None:
    for name, change in CASES["refused"].items():
        found = [fault.severity for fault in faults(change) if fault.severity != "warning"]
        assert found == ["error"], name


def test_what_the_checker_takes_is_no_fault() -> None:
    assert {name: faults(change) for name, change in CASES["taken"].items()} == dict.fromkeys(
        CASES["taken"], ()
    )


def test_what_public_rules_refuse_is_told_at_its_attribute() -> None:
    for name, case in CASES["told"].items():
        found = faults(case["change"])
        written = {whole(name) for name in case["change"] if name != "apply"}
        assert [fault.severity for fault in found] == [case["expect"]], name
        assert not found[0].attributes or written & {*found[0].attributes}, name
        assert case.get("nearest", "") in found[0].message, name


@pytest.mark.parametrize(
    "case", ["count_2_lists_1", "channel_0", "ranges_missing", "tick_negative"]
)
def test_check_and_lint_say_the_same_of_a_lidar(case: str) -> None:
    change = CASES["refused"].get(case) or CASES["told"][case]["change"]
    stage = with_values(change)
    said = {f"{rule} {prim} {name}" for rule, prim, name in told(stage, "05") if rule[0] in "LD"}
    renamed = {each.replace("L09", "K72").replace("D08", "K89") for each in said}
    assert renamed
    assert renamed - {*said_by(stage)} <= {f"L05 {LIDAR} omni:sensor:tickRate"}


def test_an_unknown_name_is_a_warning_of_check() -> None:
    change = CASES["told"]["near_range"]["change"]
    assert told(with_values(change), "05") == [("D08", LIDAR, whole("nearRange"))]


def test_a_lidar_that_no_node_reads_is_a_warning() -> None:
    stage = with_values(CASES["refused"]["channel_0"])
    stage.RemovePrim(f"{LIDAR}/ROS_Lidar2D")
    assert f"K72 {LIDAR} {whole('s001:channelId')}" in said_by(stage, "warning")


def test_a_missing_asset_may_have_other_emitters() -> None:
    stage = with_values(
        {**CASES["refused"]["count_2_lists_1"], **CASES["told"]["near_range"]["change"]}
    )
    stage.GetPrimAtPath(LIDAR).GetReferences().AddReference("./nowhere.usd")
    assert not {each[:3] for each in said_by(stage)} & {"K72", "K73", "K89"}
    assert not {rule for rule, _, _ in told(stage, "05")} & {"L05", "L09", "L10", "D08"}


RADAR, ACOUSTIC = "OmniSensorGenericRadarWpmDmatAPI", "OmniSensorGenericAcousticWpmAPI"
CAMERA_API = "OmniSensorGenericCameraCoreAPI"
SCAN, ISP = "omni:sensor:WpmDmat:scan:s001:", "omni:sensor:core:"


@pytest.mark.parametrize(
    ("kind", "api", "name", "value_type", "value", "severity"),
    [
        ("OmniRadar", RADAR, "omni:sensor:WpmDmat:waveLengthMm", "int", 4, "error"),
        ("OmniRadar", RADAR, "omni:sensor:WpmDmat:scan:s001:rangeResM", "float", 0.0, "warning"),
        ("OmniRadar", RADAR, "omni:sensor:WpmDmat:cfarMode", "token", "3D", "warning"),
        ("OmniRadar", RADAR, "omni:sensor:tickRate", "float", 0.0, "warning"),
        ("OmniRadar", RADAR, f"{SCAN}maxAzAngDeg", "float", 91.0, "warning"),
        ("OmniRadar", RADAR, f"{SCAN}raysPerDeg", "float", 0.001, "warning"),
        ("OmniRadar", RADAR, f"{SCAN}cfarRnG", "uint", 1, "warning"),
        ("OmniRadar", RADAR, f"{SCAN}cfarRnT", "uint", 0, ""),
        ("OmniRadar", RADAR, f"{SCAN}cfarElnG", "uint", 1, ""),  # of the mode 4D alone
        ("OmniRadar", RADAR, f"{SCAN}rangeResM", "float", 0.003, "warning"),
        ("OmniRadar", RADAR, f"{SCAN}rangeResM", "float", 0.2, ""),
        ("OmniRadar", RADAR, f"{SCAN}maxVelMpsSequence", "float[]", [], "warning"),
        (
            "OmniRadar",
            RADAR,
            f"{SCAN}rcsTuningCoefficients",
            "float[]",
            [-12.0, 0.0, 0.0],
            "warning",
        ),
        ("Camera", CAMERA_API, f"{ISP}colorCorrectionWhiteBalance", "float[]", [1.0], "warning"),
        (
            "Camera",
            CAMERA_API,
            f"{ISP}compandingLinearCompandCoeff",
            "float2[]",
            [(0, 1)],
            "warning",
        ),
        (
            "Camera",
            CAMERA_API,
            f"{ISP}compandingLinearCompandCoeff",
            "float2[]",
            [(0, 0), (1, 1)],
            "",
        ),
        (
            "Camera",
            CAMERA_API,
            f"{ISP}noiseHdrCombinationData",
            "float2[]",
            [(1, 2), (1, 2)],
            "warning",
        ),
        ("OmniAcoustic", ACOUSTIC, "omni:sensor:WpmAcoustic:signalMode", "token", "FM", "error"),
        ("OmniAcoustic", ACOUSTIC, "omni:sensor:WpmAcoustic:signalMode", "token", "am", ""),
        ("Camera", CAMERA_API, "omni:sensor:core:compandingAlignment", "float", 1.0, "error"),
        ("Camera", "OmniSensorAPI", "omni:sensor:frameRate", "float", 1.0, "warning"),
        ("Camera", "OmniSensorAPI", "omni:sensor:tickRate", "float", 5.0, ""),
    ],
)
def test_other_sensors_are_judged_by_the_same_data(
    kind: str, api: str, name: str, value_type: str, value: object, severity: str
) -> None:
    stage, platform = Usd.Stage.CreateInMemory(), load_platform()
    prim = stage.DefinePrim("/sensor", kind)
    prim.AddAppliedSchema(api)
    prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(value_type)).Set(value)
    model = read_model(stage, platform, "stage.usda")
    found = faults_of(model.prims["/sensor"], model)
    assert [fault.severity for fault in found] == ([severity] if severity else [])


def test_defaults_of_schemas_break_no_rule() -> None:
    platform = load_platform()
    models = platform.sensor_models
    for schema in models.rules:
        known = models.attributes_of([schema])
        plain = {
            name: said.default
            for name, said in known.items()
            if said.default is not None and not isinstance(said.default, LongList)
        }
        assert sensor_faults(platform, sensor_values(platform, [schema], plain)) == ()


def test_formulas_are_about_the_attributes_that_they_name() -> None:
    rules = [rule for part in load_platform().sensor_models.rules.values() for rule in part.rules]
    for rule in rules:
        names = {name.rpartition(":")[2] for name in rule.of}
        words = set(re.findall(r"\b[a-z]\w*", rule.holds, re.IGNORECASE))
        assert not rule.holds or names == words - {*NAMES, "and", "or"}


def test_rules_name_attributes_that_schemas_have() -> None:
    models = load_platform().sensor_models
    known = {name for schema in models.schemas.values() for name in schema.attributes}
    named = {
        part.whole(name)
        for part in models.rules.values()
        for rule in part.rules
        for name in (*rule.of, *rule.when, *rule.when_above, rule.unless)
        if name
    }
    limits = {
        part.whole(limit)
        for part in models.rules.values()
        for rule in part.rules
        for limit in (rule.entries, rule.above, rule.least, rule.below, rule.most, rule.distinct)
        if isinstance(limit, str) and limit
    }
    assert INSTANCE in "".join(named)
    assert (named | limits | set(models.any_type)) - known == set()


@pytest.mark.skipif(not SCHEMAS.is_file(), reason="needs the facts beside the repository")
def test_the_schemas_are_those_of_isaac_sim() -> None:
    script = REPOSITORY / "docs" / "make_sensor_schemas.py"
    namespace = runpy.run_path(str(script))
    said = json.loads(SCHEMAS.read_text(encoding="utf-8"))["omniSensor"][namespace["RELEASE"]]
    kept = namespace["FILE"].read_text(encoding="utf-8")
    assert namespace["text"](namespace["schemas"](said)) == kept
