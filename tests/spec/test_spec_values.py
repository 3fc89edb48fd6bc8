"""Values and wires of a spec: what fits which type, and what can be wired to what."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lab3_usd.errors import SpecError
from lab3_usd.isaac.node_types import Port, can_connect
from lab3_usd.isaac.values import fits_type, is_known_type, typed_value
from lab3_usd.spec.load.loader import load_lab

CATALOG = load_lab().platform
PORTS = [port for node_type in CATALOG.types.values() for port in node_type.ports.values()]

FITTING: list[tuple[Any, str]] = [
    (True, "bool"),
    (0, "uchar"),
    (255, "uchar"),
    (-(2**31), "int"),
    (2**32 - 1, "uint"),
    (-(2**63), "int64"),
    (2**64 - 1, "uint64"),
    (1, "float"),
    (0.025, "double"),
    ("", "string"),
    ("token[]", "token"),
    ([1, 9], "int2"),
    ((0.01, 100), "float2"),
    ([0, 0.0, 1], "vector3d"),
    ([0, 0, 0, 1], "quatd"),
    ([], "token[]"),
    (["a", "b"], "token[]"),
    ([[1, 2, 3], [4, 5, 6]], "double3[]"),
    ([], "double4[]"),
]
WRONG: list[tuple[Any, str]] = [
    (1, "bool"),
    ("false", "bool"),
    (None, "bool"),
    (256, "uchar"),
    (-1, "uchar"),
    (True, "int"),
    (2.0, "int"),
    (2**31, "int"),
    (-1, "uint64"),
    (2**64, "uint64"),
    ("0.025", "double"),
    (True, "double"),
    (None, "double"),
    (5, "string"),
    (["a"], "token"),
    ([1], "int2"),
    ([1, 2.5], "int2"),
    ([1, 2, 3], "float2"),
    ("xyz", "vector3d"),
    ([0, 0, 1], "quatd"),
    ("ab", "token[]"),
    (["a", 1], "token[]"),
    ([1, 2, 3], "double3[]"),
    (1, "no such type"),
    ([], "no such type"),
]


@pytest.mark.parametrize(("value", "usd_type"), WRONG)
def test_a_value_that_does_not_fit_is_refused_with_its_place(value: Any, usd_type: str) -> None:
    assert not fits_type(value, usd_type)
    with pytest.raises(SpecError) as refused:
        typed_value(value, usd_type, "file: role: port")
    assert str(refused.value).startswith(f"file: role: port is {value!r}")
    assert usd_type in str(refused.value)


@pytest.mark.parametrize(("value", "usd_type"), FITTING)
def test_a_typed_value_is_what_was_written(value: Any, usd_type: str) -> None:
    assert fits_type(value, usd_type)
    assert typed_value(value, usd_type, "") == deep_tuple(value)


def deep_tuple(value: Any) -> Any:
    return tuple(map(deep_tuple, value)) if isinstance(value, (list, tuple)) else value


@pytest.mark.parametrize("usd_type", ["float", "double"])
def test_a_whole_number_becomes_a_real_one(usd_type: str) -> None:
    value = typed_value(1, usd_type, "")
    assert isinstance(value, float)
    assert typed_value([1], f"{usd_type}[]", "") == (1.0,)


def test_elements_of_a_vector_become_real_numbers() -> None:
    vector = typed_value([1, 2, 3], "vector3d", "")
    assert isinstance(vector, tuple)
    assert [type(part) for part in vector] == [float] * 3


def test_a_typed_value_is_hashable_and_cannot_change() -> None:
    hash(typed_value([[1, 2, 3]], "double3[]", ""))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_does_not_fit(value: float) -> None:
    assert not fits_type(value, "double")
    assert not fits_type([value, 0.0], "float2")


def test_every_port_of_the_catalog_has_a_type_that_values_can_be_written_in() -> None:
    assert [
        port for port in PORTS if port.usd_type != "rel" and not is_known_type(port.usd_type)
    ] == []


@pytest.mark.parametrize("name", ["uint65", "token[][]", "", "rel", "vector"])
def test_other_names_are_no_types(name: str) -> None:
    assert not is_known_type(name)


def port(ogn_type: str) -> Port:
    return Port("inputs:x", ogn_type, "")


WIRED = [
    ("target", "target"),
    ("execution", "execution"),
    ("double", "double"),
    ("float", "double"),
    ("uint64", "double"),
    ("int", "bool"),
    ("float[3]", "double[3]"),
    ("int[]", "double[]"),
    ("string", "token"),
    ("token", "string"),
    ("token[]", "token[]"),
    ("union", "double"),
    ("vectord[3]", "union"),
    ("any", "token[]"),
]
NEVER_WIRED = [
    ("execution", "uint"),
    ("uint", "execution"),
    ("execution", "union"),
    ("union", "execution"),
    ("token", "target"),
    ("target", "token"),
    ("union", "target"),
    ("double", "string"),
    ("token", "double"),
    ("token[]", "token"),
    ("token", "token[]"),
    ("double", "double[3]"),
    ("double[3]", "double[4]"),
    ("double[3][]", "double[4][]"),
    ("vectord[3]", "quatd[4]"),
    ("double[]", "double[3][]"),
]


@pytest.mark.parametrize(("source", "target"), WIRED + NEVER_WIRED)
def test_only_what_fits_can_be_wired(source: str, target: str) -> None:
    assert can_connect(port(source), port(target)) is ((source, target) in WIRED)


def test_every_port_can_be_wired_to_its_own_kind(
    subtests: pytest.Subtests,
) -> None:
    for each in PORTS:
        with subtests.test(each=each):
            assert can_connect(each, each)


def test_a_port_is_called_short_without_its_side() -> None:
    port_of = CATALOG.types["isaacsim.ros2.bridge.ROS2Context"].ports
    assert [each.short for each in port_of.values()] == [
        "domain_id",
        "useDomainIDEnvVar",
        "context",
    ]


def test_unknown_types_keep_their_name_and_have_no_entry() -> None:
    assert CATALOG.type_name("acme.Filter") == "acme.Filter"
    assert CATALOG.get("acme.Filter") is None
    assert CATALOG.get("") is None
