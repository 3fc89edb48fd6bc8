"""What layers say of a prim is what usd-core tells of it with all its schemas."""

from __future__ import annotations

from typing import Any

import pytest
from pxr import Sdf, Usd

from lab3_usd.stage.read.properties import (
    AuthoredProperties,
    AuthoredProperty,
    authored_data,
    plain_value,
)
from lab3_usd.stage.write.builder import build_checkpoint

ODD = """#usda 1.0
(
    expressionVariables = {
        string PLACE = "here"
    }
)
def Xform "weak" {
    int shared = 1 (
        customData = {
            dictionary omni = {
                dictionary graph = {
                    int weak = 1
                }
            }
        }
    )
    double only_weak = 2
    token retyped = "a"
}
over "later" (
    references = </a>
) {
    rel shared = </a>
    rel wired = </weak>
}
def Sphere "a" (
    prepend references = </weak>
    prepend apiSchemas = ["PhysicsCollisionAPI"]
    variants = { string v = "on" }
    prepend variantSets = "v"
) {
    int shared = 3 (
        customData = {
            dictionary omni = {
                dictionary graph = {
                    int strong = 2
                }
            }
        }
    )
    string retyped = "b"
    int declared
    asset file = @`"./${PLACE}/a.usda"`@
    asset[] files = [@`"./${PLACE}/a.usda"`@]
    int blocked = None
    int wired.connect = </a.shared>
    int both = 4
    int both.connect = </a.shared>
    int sampled.timeSamples = {
        0: 1,
        2: 3,
    }
    rel empty
    rel nothing = None
    rel led = [</weak>, </a>]
    variantSet "v" = {
        "on" {
            int varied = 5
            rel led_too = </weak>
        }
    }
    def "below" {
        int deep = 7
    }
}
def "one" (
    instanceable = true
    prepend references = </a>
) {
    int own = 6
}
"""


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> list[Usd.Stage]:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(ODD)
    built = build_checkpoint(None, "05", tmp_path_factory.mktemp("built") / "Lab3_05_x.usda")
    return [Usd.Stage.Open(layer), Usd.Stage.Open(str(built))]


@pytest.fixture(scope="module")
def properties(stages: list[Usd.Stage]) -> list[Usd.Property]:
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    found = [
        authored
        for stage in stages
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), everything)
        for authored in prim.GetAuthoredProperties()
    ]
    assert len(found) > 500
    return found


def test_the_names_are_those_that_layers_hold(properties: list[Usd.Property]) -> None:
    prims = {each.GetPrim().GetPath(): each.GetPrim() for each in properties}.values()
    assert [AuthoredProperties(prim).names() for prim in prims] == [
        sorted(prim.GetAuthoredPropertyNames()) for prim in prims
    ]


def authored(found: Usd.Property) -> AuthoredProperty:
    return AuthoredProperties(found.GetPrim())[found.GetName()]


def value_of(found: Usd.Property) -> Any:
    return found.Get() if isinstance(found, Usd.Attribute) else None


def type_of(found: Usd.Property) -> str:
    return str(found.GetTypeName()) if isinstance(found, Usd.Attribute) else "rel"


def targets_of(found: Usd.Property) -> tuple[str, ...]:
    is_attribute = isinstance(found, Usd.Attribute)
    return () if is_attribute else tuple(map(str, found.GetTargets()))


def test_the_values_are_those_of_the_composed_prim(properties: list[Usd.Property]) -> None:
    attributes = [each for each in properties if isinstance(each, Usd.Attribute)]
    told = [
        (attribute, authored_data(attribute.GetPrim(), attribute.GetName()))
        for attribute in attributes
    ]
    assert [str(each.GetPath()) for each, value in told if value != value_of(each)] == []


def test_plain_values_are_those_of_the_composed_prim(properties: list[Usd.Property]) -> None:
    told = [(each, authored(each).value()) for each in properties]
    assert [
        str(each.GetPath()) for each, value in told if value != plain_value(value_of(each))
    ] == []


def sources_of(found: Usd.Property) -> tuple[str, ...]:
    is_attribute = isinstance(found, Usd.Attribute)
    return tuple(map(str, found.GetConnections())) if is_attribute else ()


def test_the_sources_are_those_of_the_composed_prim(properties: list[Usd.Property]) -> None:
    told = [(each, authored(each).sources()) for each in properties]
    assert [str(each.GetPath()) for each, paths in told if paths != sources_of(each)] == []


def test_the_types_are_those_of_the_strongest_layer(properties: list[Usd.Property]) -> None:
    told = [(each, authored(each).type) for each in properties]
    assert [str(each.GetPath()) for each, kind in told if kind != type_of(each)] == []


def test_the_targets_are_those_of_the_composed_prim(properties: list[Usd.Property]) -> None:
    told = [(each, authored(each).targets()) for each in properties]
    assert [str(each.GetPath()) for each, paths in told if paths != targets_of(each)] == []


def test_a_value_that_only_the_schema_has_is_none(stages: list[Usd.Stage]) -> None:
    sphere = stages[0].GetPrimAtPath("/a")
    assert sphere.GetAttribute("radius").Get() == 1.0
    assert authored_data(sphere, "radius") is None


@pytest.mark.parametrize(("key", "value"), [("strong", 2), ("weak", 1), ("neither", None)])
def test_custom_data_is_of_the_strongest_layer_that_has_it(
    stages: list[Usd.Stage], key: str, value: int | None
) -> None:
    prim = stages[0].GetPrimAtPath("/a")
    assert AuthoredProperties(prim)["shared"].custom_data("omni", "graph", key) == value
