"""Each change of `release_changes.yaml` on the smallest stage that meets it, in both directions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import Any

import pytest
from foreign_robots import add_api, empty_stage, lidar
from linting import broken_robot, found_by, linted
from pxr import Sdf, Usd

from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.isaac.release_changes import ANY, Meaning
from lab3_usd.isaac.releases import order
from lab3_usd.model.finding import Finding
from lab3_usd.spec.load.loader import load_platform

PLATFORM = load_platform()
CHANGES = PLATFORM.changes
RELEASES = PLATFORM.known_releases
PAIRS = tuple(pairwise(RELEASES))
GRAPH, NODE, LIDAR = "/World/Graph", "/World/Graph/node", "/World/lidar"
TYPES = {release: PLATFORM.in_release(release).types for release in RELEASES}
PORTS = [(kind, port) for kind, ports in CHANGES.ports.items() for port in ports]


def prim_of(stage: Usd.Stage, name: str, kind: str) -> Usd.Prim:
    prim = stage.DefinePrim(f"{GRAPH}/{name}", "OmniGraphNode")
    prim.CreateAttribute("node:type", Sdf.ValueTypeNames.Token, custom=False).Set(kind)
    return prim


def write(prim: Usd.Prim, port: str, usd_type: str, value: Any = None) -> Usd.Attribute:
    attribute = prim.CreateAttribute(port, Sdf.ValueTypeNames.Find(usd_type), custom=True)
    if value is not None:
        is_array = attribute.GetTypeName().isArray
        attribute.Set(attribute.GetTypeName().type.pythonClass(value) if is_array else value)
    return attribute


def stage_with(kind: str, release: str, values: Mapping[str, Any] | None = None) -> Usd.Stage:
    """Return a stage with one node that runs, as a release saved it; a prim is its targets."""
    stage = empty_stage("Z", 1.0)
    stage.DefinePrim(GRAPH, "OmniGraph").CreateAttribute(
        "evaluator:type", Sdf.ValueTypeNames.Token
    ).Set("execution")
    prim_of(stage, "tick", "omni.graph.action.OnPlaybackTick")
    clock = prim_of(stage, "clock", "isaacsim.ros2.bridge.ROS2PublishClock")
    node, known = prim_of(stage, "node", kind), TYPES[release].get(kind)
    runs = [(clock, "inputs:execIn")]
    runs += [(node, port) for port in (() if known is None else known.execution_inputs)]
    for prim, port in runs:
        write(prim, port, "uint").AddConnection(f"{GRAPH}/tick.outputs:tick")
    outputs = [port for port in ([*known.ports] if known else []) if port.startswith("outputs:")]
    for port in outputs[:1]:  # a node of data works where another one uses its values
        write(clock, "inputs:timeStamp", "double").AddConnection(f"{NODE}.{port}")
    for port, value in (values or {}).items():
        declared = None if known is None else known.port(port)
        if declared is not None and declared.is_target:
            node.CreateRelationship(port, custom=True).SetTargets([value])
        else:
            write(node, port, "token" if declared is None else declared.usd_type, value)
    return stage


def at_node(results: RuleResults, *rules: str) -> list[Finding]:
    assert not results.crashes
    return [
        found for found in results.findings if found.rule in rules and found.prim.startswith(GRAPH)
    ]


def words(findings: Iterable[Finding]) -> str:
    return " ".join(f"{found.property} {found.message} {found.expected}" for found in findings)


def kinds_of(patterns: Iterable[str]) -> list[str]:
    known = {kind for types in TYPES.values() for kind in types}
    return sorted(kind for kind in known if any(fnmatchcase(kind, each) for each in patterns))


GONE = [
    (kind, release)
    for successor in CHANGES.successors
    for kind in kinds_of(successor.types)
    for release in RELEASES
    if kind not in TYPES[release] and successor.of(kind) in TYPES[release]
]


@pytest.mark.parametrize("kind", sorted({kind for kind, _ in GONE}))
def test_a_type_that_is_gone_names_its_successor_there_alone(kind: str) -> None:
    for release in RELEASES:
        found = at_node(found_by("K30", stage_with(kind, release), release), "K30")
        assert bool(found) is (kind not in TYPES[release]), release
        if (kind, release) in GONE:
            (successor,) = (each.of(kind) for each in CHANGES.successors if each.of(kind))
            assert [each.expected for each in found] == [successor], release


@pytest.mark.parametrize("kind", CHANGES.folds)
def test_a_node_that_a_publisher_makes_needless_is_folded_where_it_is_unknown(kind: str) -> None:
    fold = CHANGES.folds[kind]
    (new,) = (
        after for before, after in PAIRS if kind in TYPES[after] and kind not in TYPES[before]
    )
    old = RELEASES[RELEASES.index(new) - 1]
    stage = stage_with(kind, new, {f"inputs:{own}": "/World" for own in fold.targets})
    reader = prim_of(stage, "reader", fold.into)
    write(reader, "inputs:execIn", "uint").AddConnection(f"{NODE}.outputs:execOut")
    stage.RemovePrim(f"{GRAPH}/clock")
    (found,) = at_node(found_by("K30", stage, old), "K30")
    assert found.fix is not None
    assert not found_by("K30", stage, new).findings


@pytest.mark.parametrize(("kind", "port"), PORTS)
def test_a_port_that_is_gone_is_said_where_it_is_gone(kind: str, port: str) -> None:
    had = [each for each in RELEASES if kind in TYPES[each] and _has_more(kind, port, each)]
    (old, new) = next(
        pair for pair in PAIRS if pair[0] in had and pair[1] not in had and kind in TYPES[pair[1]]
    )
    names = [port] if port != ANY else [_has_more(kind, port, old)[0]]
    (name,) = names
    declared = TYPES[old][kind].ports[name]
    if name.startswith("outputs:"):
        stage = stage_with(kind, old)
        taker = stage.GetPrimAtPath(f"{GRAPH}/clock").GetAttribute("inputs:timeStamp")
        taker.SetConnections([f"{NODE}.{name}"])
    else:
        known = CHANGES.ports[kind][port]
        lost = _other_value(declared.usd_type, declared.default)
        values = {name: False if known.off_for else lost}
        values |= {known.off_for: "/World"} if known.off_for else {}
        stage = stage_with(kind, old, values)
        if known.drop or known.to:  # it is the wire that is lost
            write(stage.GetPrimAtPath(NODE), name, declared.usd_type).AddConnection(
                f"{GRAPH}/tick.outputs:time"
            )
    rules = ("K21", "K29", "K39")
    told = at_node(linted(stage, new, old), *rules)
    assert name in words(told) or any(name in str(each.covers) for each in told)
    assert name not in words(at_node(linted(stage, old, old), *rules))


def _has_more(kind: str, port: str, release: str) -> list[str]:
    """Return the ports of a type that a release has and 6.0 lacks: this one, or all inputs."""
    ports, now = TYPES[release][kind].ports, TYPES["6.0"].get(kind)
    lost = [each for each in ports if now is not None and each not in now.ports]
    return [each for each in lost if each == port or (port == ANY and each.startswith("inputs:"))]


def _other_value(usd_type: str, default: Any) -> Any:
    if usd_type == "bool":
        return not default
    if usd_type in {"token", "string"}:
        return "/World"
    return (1.0, 2.0, 3.0) if "3" in usd_type or "[]" in usd_type else 7


TOKENS = [
    (kind, port, token)
    for kind, ports in CHANGES.tokens.items()
    for port, tokens in ports.items()
    for token in tokens
]


@pytest.mark.parametrize(("kind", "port", "token"), TOKENS)
def test_a_token_is_wrong_in_releases_that_lack_it(kind: str, port: str, token: str) -> None:
    for release in (each for each in RELEASES if kind in TYPES[each]):
        allowed = TYPES[release][kind].ports[port].allowed
        found = at_node(found_by("K35", stage_with(kind, release, {port: token}), release), "K35")
        assert bool(found) is (token not in allowed), release


DEFAULTS = [
    (kind, port, old, new)
    for old, new in PAIRS
    for kind in TYPES[old].keys() & TYPES[new].keys()
    for port in TYPES[old][kind].ports.keys() & TYPES[new][kind].ports.keys()
    if port in CHANGES.defaults
    and TYPES[old][kind].ports[port].default != TYPES[new][kind].ports[port].default
]


@pytest.mark.parametrize(("kind", "port", "old", "new"), sorted(DEFAULTS))
def test_a_changed_default_says_what_it_does(kind: str, port: str, old: str, new: str) -> None:
    for before, after in ((old, new), (new, old)):
        stage = stage_with(kind, before)
        found = at_node(found_by("K39", stage, after, before), "K39")
        (told,) = (each for each in found if each.property == port and each.prim == NODE)
        is_on = TYPES[after][kind].ports[port].default
        assert CHANGES.defaults[port][0 if is_on else 1] in told.message
    assert {port for _, port, _, _ in DEFAULTS} == {*CHANGES.defaults}


IGNORED = [(kind, *each) for kind, ports in CHANGES.ignored.items() for each in ports.items()]


@pytest.mark.parametrize(("kind", "port", "since"), IGNORED)
def test_a_changed_default_that_does_nothing_is_not_said(kind: str, port: str, since: str) -> None:
    before = RELEASES[RELEASES.index(since) - 1]
    ports = [TYPES[each][kind].ports[port].default for each in (before, since)]
    assert ports[0] != ports[1]
    found = at_node(found_by("K39", stage_with(kind, before), since, before), "K39")
    assert port not in {each.property for each in found}


def test_whole_turns_of_clouds_alone_are_a_choice_of_5_1() -> None:
    kind, port = "isaacsim.ros2.bridge.ROS2RtxLidarHelper", "inputs:fullScan"
    said = {
        sent: [
            each.property
            for each in found_by(
                "K39", stage_with(kind, "6.2", {"inputs:type": sent}), "5.1", "6.2"
            ).findings
            if each.property == port
        ]
        for sent in ("laser_scan", "point_cloud")
    }
    assert said == {"laser_scan": [], "point_cloud": [port]}


def stage_for(meaning: Meaning, kind: str, release: str) -> Usd.Stage:
    """Return the smallest stage that means another thing from the release of a change on."""
    if meaning.asset:
        stage = empty_stage("Z", 1.0)
        asset = f"omniverse://server/{meaning.asset}robot.usd"
        stage.DefinePrim("/World/robot").GetReferences().AddReference(asset)
        return stage
    if meaning.schema:
        stage = empty_stage("Z", 1.0)
        add_api(stage.DefinePrim("/World/robot", "Xform"), meaning.schema)
        return stage
    ports = dict.fromkeys((*TYPES[release][kind].ports, *TYPES[RELEASES[-1]][kind].ports))
    values = {port: True if value == ANY else value for port, value in meaning.value.items()}
    if meaning.port:
        named = [port for port in ports if fnmatchcase(port, meaning.port)]
        values[next(port for port in named if port not in meaning.but)] = "/World"
    stage = stage_with(kind, release, values)
    if meaning.attributes:
        lidar(stage, LIDAR).CreateAttribute(
            meaning.attributes[0], Sdf.ValueTypeNames.Float, custom=False
        ).Set(30.0)
        product = prim_of(stage, "product", "isaacsim.core.nodes.IsaacCreateRenderProduct")
        product.CreateRelationship("inputs:cameraPrim", custom=True).SetTargets([LIDAR])
        write(product, "inputs:execIn", "uint").AddConnection(f"{GRAPH}/tick.outputs:tick")
        write(stage.GetPrimAtPath(NODE), "inputs:renderProductPath", "token").AddConnection(
            f"{GRAPH}/product.outputs:renderProductPath"
        )
    for number in range(1, meaning.least):
        layer = stage.GetRootLayer()
        Sdf.CopySpec(layer, NODE, layer, f"{NODE}{number}")
    for port in values:
        attribute = stage.GetAttributeAtPath(f"{NODE}.{port}")
        if attribute and meaning.port:  # it is a wire that counts
            attribute.SetConnections([f"{GRAPH}/tick.outputs:time"])
    return stage


MEANINGS = [
    pytest.param(meaning, kind, id=f"{meaning.id} {kind.rpartition('.')[2]}".strip())
    for meaning in CHANGES.meanings
    for kind in (meaning.types or ("",))
]


@pytest.mark.parametrize(("meaning", "kind"), MEANINGS)
def test_another_meaning_is_said_on_the_way_to_it_and_back(meaning: Meaning, kind: str) -> None:
    earlier = [each for each in RELEASES if order(each) < order(meaning.since)]
    before = next(each for each in reversed(earlier) if not kind or kind in TYPES[each])
    stage = stage_for(meaning, kind, before)

    def said(then: str, now: str) -> list[str]:
        found = found_by("K39", stage, now, then).findings
        return [each.message for each in found if each.identity == meaning.id]

    assert [meaning.up in message for message in said(before, meaning.since)] == [True]
    back = [meaning.down in message for message in said(meaning.since, before)]
    assert back == ([True] if meaning.down else [])
    assert said(meaning.since, RELEASES[-1]) == []


def test_gravity_of_an_imu_is_read_everywhere_and_nothing_is_said_of_it() -> None:
    kind, port = "isaacsim.sensors.physics.IsaacReadIMU", "inputs:readGravity"
    for before, now in (("6.0", "6.2"), ("6.2", "6.0")):
        found = linted(stage_with(kind, before, {port: False}), now, before).findings
        assert not [each for each in found if port in words([each])]


@pytest.mark.parametrize(("release", "is_said"), [("6.0", True), ("6.1", False), ("6.2", False)])
def test_lidars_of_other_rates_end_6_0_alone(release: str, *, is_said: bool) -> None:
    # github.com/isaac-sim/IsaacSim/issues/718
    laser = "/World/Robot/base/rear_laser.omni:sensor"
    steps = [
        {"declare": [f"{laser}:Core:scanRateBaseHz", "uint", 20]},
        {"declare": [f"{laser}:tickRate", "float", 20.0]},
    ]
    stage = broken_robot("two lidars", [dict(step) for step in steps])
    assert bool(found_by("K93", stage, release).findings) is is_said
