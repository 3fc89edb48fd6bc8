"""All public node types of Isaac Sim, held against facts that were read off its source."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.isaac.load.platform import assemble_platform
from lab3_usd.isaac.node_types import Port
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.spec.load.compiled import compiled_or_loaded
from lab3_usd.spec.load.loader import assemble, load_lab, load_platform

TYPES = load_platform()
TIME = "isaacsim.core.nodes.IsaacReadSimulationTime"
TREE = "isaacsim.ros2.bridge.ROS2PublishTransformTree"


@pytest.fixture(scope="module")
def facts(shared: Path) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((shared / "isaac" / "nodes-all-6.0.1.json").read_text())
    return data["nodes"]  # type: ignore[no-any-return]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copy = tmp_path / "graphs"
    shutil.copytree(data_folder("graphs"), copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy / "isaac"


def test_every_public_type_is_known(facts: dict[str, Any]) -> None:
    assert set(facts) <= set(TYPES.types)


def test_every_port_has_the_type_of_the_source(facts: dict[str, Any]) -> None:
    wrong = [
        f"{name} {side}:{short}"
        for name, fact in facts.items()
        for side in ("inputs", "outputs")
        for short, port in fact[side].items()
        if _declared(TYPES.types[name].ports[f"{side}:{short}"].ogn_type, port["type"])
    ]
    assert wrong == []


def _declared(known: str, fact: Any) -> bool:
    return known != ("union" if isinstance(fact, list) else fact)


def test_what_is_said_of_bodies_units_targets_and_gates_names_ports_that_are_there(
    subtests: pytest.Subtests,
) -> None:
    types = TYPES.types
    for name, body in TYPES.bodies.items():
        with subtests.test(name=name, body=body):
            assert types[name].port(f"inputs:{body.prim}") is not None
            assert {f"outputs:{give}" for give in body.gives} <= set(types[name].ports)
    for name, unit in TYPES.units.items():
        with subtests.test(name=name, unit=unit):
            inputs, outputs = filter(None, (unit.passes, unit.by)), unit.metres
            ports = {
                *(f"inputs:{each}" for each in inputs),
                *(f"outputs:{output}" for output in outputs),
            }
            assert ports <= set(types[name].ports)
            allowed = types[name].ports[f"inputs:{unit.by}"].allowed if unit.by else ()
            assert {unit.to_stage, unit.to_metres} - {""} <= set(allowed)
    for name, quantity in TYPES.quantities.items():
        with subtests.test(name=name, quantity=quantity):
            outputs, inputs = (
                {f"{side}:{short}" for short in ports}
                for side, ports in (("outputs", quantity.gives), ("inputs", quantity.takes))
            )
            assert outputs | inputs <= set(types[name].ports)
    for name, target in TYPES.targets.items():
        with subtests.test(name=name, target=target):
            assert types[name].ports[f"inputs:{target.input}"].is_target
    assert set(TYPES.joints) <= set(types)
    for name, port in TYPES.gates.items():
        with subtests.test(name=name, port=port):
            assert f"inputs:{port}" in types[name].ports


def test_every_default_is_that_of_the_source(
    facts: dict[str, Any], shared: Path, subtests: pytest.Subtests
) -> None:
    closer = json.loads((shared / "isaac" / "nodes-6.0.1.json").read_text())  # test_catalog.py
    for name, fact in facts.items():
        with subtests.test(name=name):
            if name in closer["nodes"] or name in closer["other_ros2_nodes"]:
                continue
            for short, port in fact["inputs"].items():
                default = TYPES.types[name].ports[f"inputs:{short}"].default
                if port["type"] != "target" and "default" in port:
                    assert json.loads(json.dumps(default)) == port["default"], f"{name} {short}"


def test_the_types_of_the_lab_win() -> None:
    lab = load_lab().platform
    assert {name: TYPES.types[name] for name in lab.types} == dict(lab.types)


def test_every_need_names_its_source() -> None:
    needs = [need for entries in TYPES.needs.values() for need in entries]
    source = re.compile(r"\S+\.(cpp|py)(:[0-9]+(-[0-9]+)?)?|isaac-sim/IsaacSim#[0-9]+")
    assert all(source.fullmatch(need.source) and need.effect for need in needs)


def test_an_earlier_release_has_its_own_defaults_and_ports() -> None:
    earlier = TYPES.in_release("5.1")
    assert earlier.types[TIME].default("inputs:resetOnStop", 1) is False
    assert TYPES.types[TIME].default("inputs:resetOnStop", 1) is True
    assert "inputs:parentFrames" not in earlier.types[TREE].ports
    assert earlier.types[TREE].tf is not None
    assert earlier.types[TREE].tf.arrays == ()


def test_the_release_of_the_lab_is_the_catalog_itself() -> None:
    assert TYPES.in_release("6.0") is TYPES


@pytest.mark.parametrize(
    ("name", "release"), [("6.0.1", "6.0"), ("2023.1.1", "2023.1"), ("5.1", "5.1")]
)
def test_the_repair_of_a_release_is_the_release(name: str, release: str) -> None:
    assert lint_platform(name).release == release


def test_a_port_that_is_gone_tells_the_release() -> None:
    helper = "isaacsim.ros2.bridge.ROS2CameraHelper"
    assert TYPES.releases_with(helper, "inputs:viewport") == (
        *("2022.2", "2023.1", "4.2", "4.5"),
        *("5.0", "5.1"),
    )
    assert TYPES.releases_with(helper, "inputs:topicName") == ()


def test_a_type_tells_the_releases_that_have_it() -> None:
    assert TYPES.releases_of(TIME)[4:9] == ("5.0", "5.1", "6.0", "6.1", "6.2")
    assert TYPES.releases_of("isaacsim.core.nodes.IsaacMapScalarsToColors")[:2] == ("6.1", "6.2")
    assert TYPES.releases_of("isaacsim.robot.wheeled_robots.AckermannSteering")[-2:] == (
        *("5.0", "5.1"),
    )
    assert TYPES.releases_of("somebody.elses.Node") == ()


def test_a_type_tells_its_versions() -> None:
    versions = {"5.0": 2, "5.1": 2, "6.0": 3, "6.1": 4, "6.2": 4}
    assert TYPES.versions("isaacsim.ros2.bridge.ROS2CameraHelper").items() >= versions.items()


def test_later_releases_have_what_their_pages_tell(shared: Path, subtests: pytest.Subtests) -> None:
    pages = json.loads((shared / "isaac" / "nodes-6.1-6.2.json").read_text())
    for release in ("6.1", "6.2"):
        with subtests.test(release=release):
            types = TYPES.in_release(release).types
            for name, fact in pages[release]["added"].items():
                assert ports_of(types[name].ports) == ports_of_page(fact)
                assert types[name].version == fact["version"]
            for name, fact in pages[release]["changed"].items():
                ports = {
                    side: {short: change["then"] for short, change in fact.get(side, {}).items()}
                    for side in ("inputs", "outputs")
                }
                assert ports_of_page(ports).items() <= ports_of(types[name].ports).items()
                assert types[name].version == fact.get("version", (None, types[name].version))[1]


def test_the_types_of_physics_graphs_are_known_in_all_releases(
    shared: Path, subtests: pytest.Subtests
) -> None:
    pages = json.loads((shared / "isaac" / "nodes-6.1-6.2.json").read_text())
    for name, fact in pages["physx_graph_types_of_6.0.1"].items():
        with subtests.test(name=name):
            assert ports_of(TYPES.types[name].ports) == ports_of_page(fact)
            assert TYPES.releases_of(name) == TYPES.known_releases


def ports_of(ports: Mapping[str, Port]) -> dict[str, str]:
    return {name: port.ogn_type for name, port in ports.items()}


def ports_of_page(fact: Mapping[str, Any]) -> dict[str, str]:
    return {
        f"{side}:{short}": "union" if port["type"].startswith("[") else port["type"]
        for side in ("inputs", "outputs")
        for short, port in fact.get(side, {}).items()
    }


@pytest.mark.parametrize(("release", "milliseconds"), [("6.1", 0), ("6.2", 100)])
def test_a_later_release_has_its_own_defaults(release: str, milliseconds: int) -> None:
    clock = TYPES.in_release(release).types["isaacsim.ucx.nodes.UCXPublishClock"]
    assert clock.default("inputs:timeoutMs", 1) == milliseconds


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("IsaacReadIMU:", "IsaacReadMUI:", "is not a node type"),
        ("[imuPrim]", "[imPrim]", "has no input 'imPrim'"),
    ],
)
def test_a_slip_in_the_needs_is_one_clear_line(
    folder: Path, old: str, new: str, message: str
) -> None:
    needs = folder / "needs.yaml"
    needs.write_text(needs.read_text().replace(old, new))
    with pytest.raises(SpecError, match=message):
        assemble_platform(folder)


@pytest.mark.parametrize(
    ("kind", "output"),
    [
        ("omni.graph.action.OnTick", "time"),
        ("omni.graph.nodes.BreakVector3", "x"),
        ("isaacsim.core.nodes.IsaacReadSimulationTime", "simulationTime"),
    ],
)
def test_a_role_is_given_to_a_type_of_any_file(folder: Path, kind: str, output: str) -> None:
    roles = folder / "roles.yaml"
    roles.write_text(f"{roles.read_text()}\n{kind}: {{sizes: {{{output}: 3}}}}\n")
    assert assemble_platform(folder).types[kind].sizes == {f"outputs:{output}": 3}


def test_a_change_of_the_labs_types_is_read_anew(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    compiled_or_loaded(folder.parent, assemble)
    lab = folder.parent / "node_types.yaml"
    lab.write_text(lab.read_text().replace('"Break 3 Vector"', '"Another"'))
    types = compiled_or_loaded(folder.parent, assemble).platform.types
    assert types["omni.graph.nodes.BreakVector3"].handout_name == "Another"


def test_every_documented_type_of_kit_is_known_with_its_ports(shared: Path) -> None:
    library = json.loads((shared / "isaac" / "kit-nodes.json").read_text())["types"]
    scripts = {name for name in library if TYPES.scripts.runs(name)}
    missing = [
        f"{name} {side}:{short}"
        for name, fact in library.items()
        if name not in scripts
        for side in ("inputs", "outputs")
        for short in fact[side]
        if TYPES.types[name].listed(f"{side}:{short}") is None
    ]
    assert missing == []
    assert len(library) - len(scripts) == 424


def test_what_is_to_be_set_and_not_wired_is_known(shared: Path) -> None:
    library = json.loads((shared / "isaac" / "kit-nodes.json").read_text())["types"]
    for name, fact in library.items():
        kind = TYPES.types.get(name)
        for short, port in fact["inputs"].items() if kind and kind.is_documented else ():
            assert kind.ports[f"inputs:{short}"].literal_only == port.get("literalOnly", False)
