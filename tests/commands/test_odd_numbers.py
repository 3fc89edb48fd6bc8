"""Whatever values stand in a right stage, no command fails itself: what odd_values.py found."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from benchmark import load_benchmark
from linting import add_failing_rule

LIDAR = "/turtlebot3_burger/base_scan/Lidar2D"
# Which failed once.
KNOWN = (
    f"05: {LIDAR}/ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:type = point_cloud",
    f"05: {LIDAR}.omni:sensor:Core:scanRateBaseHz = 4.29497e+09",
    "05: /turtlebot3_burger/joints/caster_back_joint.physics:localRot0 = -inf",
    "truck: /Fleet/Truck/Steering/ackermann.inputs:wheelBase = its default",
    "05: metersPerUnit = 1.79769e+308",
)


@pytest.fixture(scope="module")
def odd() -> ModuleType:
    return load_benchmark("odd_values")


@pytest.fixture(scope="module")
def cases(odd: ModuleType) -> dict[str, Any]:
    return {case.name: case for case in odd.cases()}


def failed(odd: ModuleType, case: Any, folder: Path) -> list[str]:
    return [f"{failure.command}: {failure.said}" for failure in odd.failures(case, folder)]


@pytest.mark.parametrize("name", KNOWN)
def test_what_failed_once_does_not_fail_again(
    odd: ModuleType, cases: dict[str, Any], tmp_path: Path, name: str
) -> None:
    assert failed(odd, cases[name], tmp_path) == []


@pytest.mark.usefixtures("own_rules")
def test_a_failure_is_found_and_told(
    odd: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    add_failing_rule("K199", "lint", KeyError, "odd")
    monkeypatch.setattr(sys, "argv", ["odd_values.py", "--match", KNOWN[0]])
    assert odd.main() == 1
    said = capsys.readouterr().out
    assert f"{KNOWN[0]}: lint\n" in said
    assert "KeyError" in said


def test_each_kind_of_number_has_its_odd_values(odd: ModuleType) -> None:
    whole = [value for _, value in odd.odd_numbers("int")]
    assert {0, -1, 2**31 - 1, -(2**31)} <= {*whole}
    assert 2**64 - 1 in [value for _, value in odd.odd_numbers("uint64")]
    real = [value for _, value in odd.odd_numbers("double")]
    assert math.inf in real
    assert any(math.isnan(value) for value in real)
    for usd_type in ("vector3d", "quatd", "matrix4d", "token", "bool"):
        assert bool([*odd.odd_numbers(usd_type)]) == (usd_type not in {"token", "bool"})
    assert len([*odd.odd_numbers("float[]")]) == 2 * len(real) + 1
