"""Which name a misspelt topic or node type is said to have been meant for."""

from __future__ import annotations

import pytest

from lab3_usd.facts.likely_names import likely_name, likely_type

TYPES = ["acme.Filter", "omni.graph.action.OnTick", "omni.graph.nodes.Break3Vector"]


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("Filter", "acme.Filter"),
        ("acme.filters.Filter", "acme.Filter"),
        ("omni.graph.OgnOnTick", "omni.graph.action.OnTick"),
        ("omni.graph.action.OnTik", "omni.graph.action.OnTick"),
        ("somebody.Filter", None),
        ("omni.graph.nodes.Break2Vector", None),
        ("", None),
    ],
)
def test_a_type_is_meant_by_its_last_name_in_a_known_package(
    written: str, meant: str | None
) -> None:
    assert likely_type(written, TYPES) == meant


def test_a_last_name_that_two_types_have_tells_neither() -> None:
    assert likely_type("omni.OnTick", [*TYPES, "omni.graph.ui.OnTick"]) is None


@pytest.mark.parametrize(
    ("written", "meant"),
    [("Scan", "scan"), ("scann", "scan"), ("lidar", None), ("cmdvel", "cmd_vel")],
)
def test_a_name_is_meant_by_one_alike(written: str, meant: str | None) -> None:
    assert likely_name(written, ["scan", "cmd_vel"]) == meant
