"""The loader: a wrong spec file is refused in one line that says where it is wrong."""

from __future__ import annotations

import copy
import shutil
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from other_labs import MINI

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.isaac.load.lab_types import with_lab_types
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.checkpoints import FORMAT, accumulate, read_checkpoint_file
from lab3_usd.spec.load.graph_file import parse_graph
from lab3_usd.spec.load.lab import parse_scene
from lab3_usd.spec.load.loader import assemble, load_lab, load_platform
from lab3_usd.yaml_file import read_yaml

Data = dict[str, Any]
Edit = Callable[[Data], None]

GRAPHS = data_folder("graphs")
CLOCK, DRIVE, ODOM = "ROS_Clock.yaml", "ROS_Drive.yaml", "ROS_OdomTF.yaml"
CHECKPOINTS, SCENE, TYPES = "checkpoints.yaml", "scene.yaml", "node_types.yaml"
CONTEXT = "isaacsim.ros2.bridge.ROS2Context"
CLOCK_TYPE = "isaacsim.ros2.bridge.ROS2PublishClock"
ARRAY = "omni.graph.nodes.ConstructArray"
RAW_TF = "isaacsim.ros2.bridge.ROS2PublishRawTransformTree"
GRAPH_FILES = sorted(path.name for path in GRAPHS.glob("ROS_*.yaml"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(GRAPHS, tmp_path / "graphs"))


def read(file: Path) -> Data:
    data: Data = quick_yaml.load(file.read_bytes())
    return data


def whole_types() -> Data:
    """A lab's file of node types that describes some types whole, as Isaac Sim's own files do."""
    isaac = GRAPHS / "isaac"
    known = {**read(isaac / "omnigraph.yaml")["types"], **read(isaac / TYPES)["types"]}
    roles = read(isaac / "roles.yaml")
    types = {
        name: known[name] | roles.get(name, {}) for name in (CONTEXT, CLOCK_TYPE, ARRAY, RAW_TF)
    }
    return {"scripts": read(isaac / "omnigraph.yaml")["scripts"], "types": types}


def edited(file: Path, edit: Edit) -> None:
    data = whole_types() if file.name == TYPES else read(file)
    edit(data)
    file.write_text(quick_yaml.dump(data))


def types_of(lab: Lab) -> dict[str, str]:
    """Return all that is said of each node type; as objects, two that were read are never equal."""
    return {name: repr(kind) for name, kind in lab.platform.types.items()}


def refusal(folder: Path) -> str:
    with pytest.raises(SpecError) as refused:
        load_lab(folder)
    line = str(refused.value)
    assert "\n" not in line
    return line


def put(*path: str | int, value: Any) -> Edit:
    def edit(data: Any) -> None:
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] = value

    return edit


def drop(*path: str | int) -> Edit:
    def edit(data: Any) -> None:
        for key in path[:-1]:
            data = data[key]
        del data[path[-1]]

    return edit


def wire(text: str, section: str = "X1", kind: str = "wires") -> Edit:
    def edit(data: Data) -> None:
        data.setdefault(kind, {})[section] = [text]

    return edit


def setting(role: str, port: str, value: Any, key: str = "set") -> Edit:
    def edit(data: Data) -> None:
        data["nodes"][role].setdefault(key, {})["X1"] = {port: value}

    return edit


# Each case: the file, what is made wrong in it, and what the line must name.
WRONG_NODES = {
    "unknown type": (
        CLOCK,
        put("nodes", "ros2_publish_clock", "type", value="isaacsim.ros2.bridge.ROS2PublishClok"),
        ("ros2_publish_clock", "isaacsim.ros2.bridge.ROS2PublishClok"),
    ),
    "name before 4.5": (
        CLOCK,
        put("nodes", "ros2_context", "type", value="omni.isaac.ros2_bridge.ROS2Context"),
        ("ros2_context", "omni.isaac.ros2_bridge.ROS2Context"),
    ),
    "variable of no type of USD": (
        CLOCK,
        put("variables", value={"speed": {"type": "velocity", "value": 1.0}}),
        ("variables: speed", "'velocity' is not the USD type of a value"),
    ),
    "missing type": (CLOCK, drop("nodes", "ros2_context", "type"), ("ros2_context", "type")),
    "unknown port": (
        CLOCK,
        setting("ros2_publish_clock", "topicname", "/clock"),
        ("ros2_publish_clock", "topicname"),
    ),
    "unknown kept port": (
        CLOCK,
        put("nodes", "ros2_publish_clock", "keep", value={"X1": ["qos"]}),
        ("ros2_publish_clock", "qos"),
    ),
    "unknown relationship": (
        DRIVE,
        setting("articulation_controller", "targetPrims", ["/a"], key="targets"),
        ("articulation_controller", "targetPrims"),
    ),
    "unknown added port": (
        DRIVE,
        put("nodes", "make_array", "ports", value=["element1"]),
        ("make_array", "element1"),
    ),
    "added port that is always there": (
        DRIVE,
        put("nodes", "make_array", "ports", value=["input1", "arraySize"]),
        ("make_array", "arraySize"),
    ),
    "frames from a value": (
        ODOM,
        put("nodes", "ros2_publish_odometry", "frames_from", value=["topicName"]),
        ("ros2_publish_odometry", "topicName"),
    ),
    "text for a number": (
        CLOCK,
        setting("ros2_publish_clock", "queueSize", "10"),
        ("ros2_publish_clock", "inputs:queueSize", "'10'", "uint64"),
    ),
    "negative for unsigned": (
        CLOCK,
        setting("ros2_publish_clock", "queueSize", -1),
        ("ros2_publish_clock", "inputs:queueSize", "-1"),
    ),
    "too large for a byte": (
        CLOCK,
        setting("ros2_context", "domain_id", 256),
        ("ros2_context", "inputs:domain_id", "256", "uchar"),
    ),
    "number for a switch": (
        CLOCK,
        setting("ros2_context", "useDomainIDEnvVar", 0),
        ("ros2_context", "inputs:useDomainIDEnvVar", "bool"),
    ),
    "switch for a number": (
        DRIVE,
        setting("differential_controller", "wheelRadius", value=True),
        ("differential_controller", "inputs:wheelRadius", "double"),
    ),
    "fraction for a count": (
        DRIVE,
        setting("make_array", "arraySize", 2.5),
        ("make_array", "inputs:arraySize", "2.5"),
    ),
    "nothing for a text": (
        CLOCK,
        setting("ros2_publish_clock", "topicName", None),
        ("ros2_publish_clock", "inputs:topicName", "None"),
    ),
    "value for a signal": (
        CLOCK,
        setting("ros2_publish_clock", "execIn", 1),
        ("ros2_publish_clock", "inputs:execIn", "execution"),
    ),
    "value for a relationship": (
        DRIVE,
        setting("articulation_controller", "targetPrim", "/a"),
        ("articulation_controller", "inputs:targetPrim", "target"),
    ),
    "prims for a value": (
        CLOCK,
        setting("ros2_publish_clock", "topicName", ["/a"], key="targets"),
        ("ros2_publish_clock", "inputs:topicName", "string"),
    ),
    "relative path of a prim": (
        DRIVE,
        setting("articulation_controller", "targetPrim", ["base_link"], key="targets"),
        ("articulation_controller", "inputs:targetPrim", "base_link"),
    ),
    "value not among the allowed": (
        "ROS_Lidar2D.yaml",
        setting("ros2_rtx_lidar_helper", "type", "laserscan"),
        ("ros2_rtx_lidar_helper", "inputs:type", "laserscan", "laser_scan, point_cloud"),
    ),
    "unit not among the allowed": (
        DRIVE,
        setting("scale_linear_velocity", "conversion", "stage units"),
        ("scale_linear_velocity", "inputs:conversion", "Convert to meters"),
    ),
    "unknown key": (
        CLOCK,
        put("nodes", "ros2_context", "sets", value={}),
        ("ros2_context", "sets"),
    ),
    "position with one number": (
        CLOCK,
        put("nodes", "ros2_context", "at", value=[50]),
        ("ros2_context", "at", "[50]"),
    ),
    "input set twice": (
        CLOCK,
        setting("ros2_publish_clock", "topicName", "/clock"),
        ("ros2_publish_clock", "inputs:topicName", "twice"),
    ),
    "role that cannot name a prim": (
        CLOCK,
        put("nodes", "ros2-context", value={}),
        ("ros2-context",),
    ),
}

WRONG_WIRES = {
    "signal into data": "on_playback_tick.tick -> ros2_publish_odometry.timeStamp",
    "data into signal": "isaac_read_simulation_time.simulationTime -> ros2_publish_odometry.execIn",
    "number into text": "ros2_context.context -> ros2_publish_odometry.topicName",
    "number into vector": "isaac_read_simulation_time.simulationTime -> "
    "ros2_publish_odometry.robotFront",
    "vector into quaternion": "isaac_compute_odometry.position -> "
    "ros2_publish_odometry.orientation",
    "names into one name": "isaac_compute_transform_tree.parentFrames -> "
    "ros2_publish_odometry.odomFrameId",
    "rotations into positions": "isaac_compute_transform_tree.orientations -> "
    "ros2_publish_transform_tree.translations",
    "data into a relationship": "ros2_context.context -> ros2_publish_transform_tree.parentPrim",
    "into an output": "on_playback_tick.time -> ros2_context.context",
    "into nothing": "on_playback_tick.time -> ros2_context.domain",
    "from an input": "ros2_publish_odometry.timeStamp -> ros2_publish_transform_tree.timeStamp",
    "from nothing": "ros2_context.domain -> ros2_publish_transform_tree.timeStamp",
    "from an unknown role": "ros_context.context -> ros2_publish_odometry.context",
    "into an unknown role": "ros2_context.context -> ros2_publish_odom.context",
    "second source": "on_playback_tick.time -> ros2_publish_odometry.timeStamp",
    "same wire twice": "ros2_context.context -> ros2_publish_odometry.context",
    "the wrong way round": "ros2_publish_odometry.context -> ros2_context.context",
    "without an arrow": "ros2_context.context, ros2_publish_odometry.context",
    "with a full port name": "ros2_context.outputs:context -> ros2_publish_odometry.context",
}

WRONG_CHECKPOINTS = {
    "none at all": (put("checkpoints", value={}), ("checkpoints",)),
    "an id with a space": (put("checkpoints", "a b", value={}), ("a b",)),
    "names without the id": (put("files", value="stage_{name}"), ("files", "{id}")),
    "no pattern of names": (drop("files"), ("files",)),
    "unknown sensor": (
        put("checkpoints", "06", "adds", "sensors", value=["radar"]),
        ("06", "radar"),
    ),
    "graph added again": (
        put("checkpoints", "06", "adds", "graphs", value=["ROS_Clock"]),
        ("06", "ROS_Clock", "01"),
    ),
    "sensor added again": (
        put("checkpoints", "06", "adds", "sensors", value=["lidar"]),
        ("06", "lidar", "03"),
    ),
    "unknown key": (put("checkpoints", "02", "add", value={}), ("02", "add")),
    "unknown addition": (put("checkpoints", "02", "adds", "graph", value=[]), ("02", "graph")),
    "missing title": (drop("checkpoints", "02", "title"), ("02", "title")),
    "missing policy": (drop("policy", "keep_default"), ("policy", "keep_default")),
    "edge without arrow": (
        put("frames", "edges", value=["odom base_footprint"]),
        ("frames", "edges", "entry 1", "odom base_footprint"),
    ),
    "edge that is no text": (
        put("frames", "localization", "edge", value=["map", "odom"]),
        ("frames", "localization", "'edge'", "'parent -> child'"),
    ),
    "text for a truth value": (
        put("checkpoints", "05", "adds", "frames", value="no"),
        ("05", "frames", "'no'"),
    ),
    "unknown key beside the checkpoints": (put("extra", value={}), ("'extra'",)),
    "unknown key of the frames": (put("frames", "roots", value=[]), ("'roots'",)),
}

WRONG_SCENES = {
    "missing part": (drop("sensors", "camera", "kind"), ("camera", "kind")),
    "pose without scale": (drop("sensors", "lidar", "pose", "scale"), ("lidar", "scale")),
    "pose with two numbers": (
        put("sensors", "camera", "pose", "rotate", value=[90.0, 0.0]),
        ("camera", "rotate"),
    ),
    "attribute of another type": (
        put("sensors", "lidar", "attributes", "omni:sensor:tickRate", "value", value="10 Hz"),
        ("lidar", "omni:sensor:tickRate", "10 Hz", "float"),
    ),
    "mass in words": (
        put("robot", "links", "base_link", "mass", value="0.8 kg"),
        ("robot", "base_link", "mass", "0.8 kg"),
    ),
    "ground without a place": (drop("world", "ground", "usual"), ("world", "ground")),
    "tolerance in words": (put("tolerance", "mass", value="small"), ("tolerance", "mass")),
    "missing tolerance": (drop("tolerance", "rest"), ("tolerance", "rest")),
    "map with two numbers": (put("map", "origin", value=[0, 0]), ("map", "origin")),
    "unknown key of a sensor": (put("sensors", "camera", "look", value={}), ("camera", "'look'")),
    "former key of a sensor": (
        put("sensors", "camera", "looks", value={}),
        ("camera: 'looks' is called 'view' now",),
    ),
    "key of a sensor's value that is gone": (
        put("sensors", "lidar", "attributes", "omni:sensor:tickRate", "unset", value="x"),
        ("'unset' is gone: leave it out, what is not set has the value of its schema",),
    ),
    "key of a scan that is gone": (
        put("sensors", "lidar", "scan", "rising", value=["x"]),
        ("scan: 'rising' is gone: leave it out, the schema",),
    ),
    "view in words": (put("sensors", "camera", "view", "up", value="Z"), ("view", "'up'")),
    "scan without limits": (drop("sensors", "lidar", "scan", "whole"), ("lidar", "scan", "whole")),
    "view along nothing": (
        put("sensors", "camera", "view", "along", value=[0.0, 0.0, 0.0]),
        ("camera", "along and up are directions"),
    ),
    "one robot and several": (put("robots", value={"two": {}}), ("'robot' or 'robots'",)),
    "value of a thing that is only a type": (
        put(
            "props", value={"lamp": {"path": "/Lamp", "handout": "A1", "set": {"a": {"type": "x"}}}}
        ),
        ("lamp", "set: a: is written as {type: float, value: 1.0}"),
    ),
    "left wheel that is none": (put("robot", "wheels", "left", value="left"), ("left", "joint")),
    "wheels that are no joints": (put("robot", "wheels", "joints", value=[]), ("wheels", "joints")),
}

WRONG_TYPES = {
    "mapping among names": (
        put("types", RAW_TF, "tf", "names", value=["parentFrameId", {"a": 2}]),
        (RAW_TF, "names", "entry 2"),
    ),
    "unknown key of the catalog": (put("extra", value={}), ("'extra'",)),
    "unknown key of the scripts": (put("scripts", "names", value=[]), ("'names'",)),
    "default of another type": (
        put("types", CONTEXT, "inputs", "domain_id", value="uchar = -1"),
        (CONTEXT, "inputs:domain_id", "-1"),
    ),
    "default that is no JSON": (
        put("types", CONTEXT, "inputs", "domain_id", value="uchar = zero"),
        (CONTEXT, "inputs:domain_id", "zero"),
    ),
    "unknown type of a port": (
        put("types", CONTEXT, "outputs", "context", value="uint65"),
        (CONTEXT, "outputs:context", "uint65"),
    ),
    "unknown key of a port": (
        put("types", CONTEXT, "inputs", "domain_id", value={"type": "uchar", "min": 0}),
        (CONTEXT, "inputs: domain_id", "min"),
    ),
    "unknown key of a type": (put("types", CONTEXT, "ui", value="x"), (CONTEXT, "ui")),
    "missing version of a new type": (
        put("types", "acme.Filter", value={"name": "Filter", "prim": "filter"}),
        ("acme.Filter", "version"),
    ),
    "version in words": (put("types", CONTEXT, "version", value="2"), (CONTEXT, "version")),
    "unknown role": (put("types", CLOCK_TYPE, "role", value="shouter"), (CLOCK_TYPE, "shouter")),
    "topic port that is not there": (
        put("types", CLOCK_TYPE, "topics", value=["topic"]),
        (CLOCK_TYPE, "inputs:topic"),
    ),
    "frame port that is not there": (
        put("types", RAW_TF, "tf", "names", value=["parent", "childFrameId"]),
        (RAW_TF, "inputs:parent"),
    ),
    "count port that is not there": (
        put("types", ARRAY, "dynamic", "count", value="size"),
        (ARRAY, "inputs:size"),
    ),
}


@pytest.mark.parametrize("case", WRONG_NODES)
def test_a_wrong_node_is_named_with_file_graph_role_and_port(case: str, folder: Path) -> None:
    file, edit, named = WRONG_NODES[case]
    edited(folder / file, edit)
    line = refusal(folder)
    for part in (file, Path(file).stem, *named):
        assert part in line


@pytest.mark.parametrize("case", WRONG_WIRES)
def test_a_wrong_wire_is_quoted_with_file_and_graph(case: str, folder: Path) -> None:
    text = WRONG_WIRES[case]
    edited(folder / ODOM, wire(text))
    assert refusal(folder).startswith(f"{ODOM}: ROS_OdomTF: wire '{text}': ")


@pytest.mark.parametrize("kind", ["optional_wires", "forbidden_wires"])
def test_wires_that_are_not_built_are_checked_too(kind: str, folder: Path) -> None:
    text = "on_playback_tick.tock -> ros2_publish_clock.timeStamp"
    edited(folder / CLOCK, wire(text, kind=kind))
    assert text in refusal(folder)


def test_a_wire_into_a_port_that_was_not_added_is_refused(folder: Path) -> None:
    edited(folder / DRIVE, drop("nodes", "make_array", "ports"))
    line = refusal(folder)
    assert line.startswith(f"{DRIVE}: ROS_Drive: wire 'constant_right_joint.value")
    assert "inputs:input1" in line


def test_a_checkpoint_that_wants_an_unknown_graph_is_refused(folder: Path) -> None:
    edited(folder / CHECKPOINTS, put("checkpoints", "06", "adds", "graphs", value=["ROS_Radar"]))
    line = refusal(folder)
    assert "ROS_Radar" in line
    assert CHECKPOINTS in line


def test_a_graph_file_that_describes_another_graph_is_refused(folder: Path) -> None:
    shutil.copyfile(folder / CLOCK, folder / DRIVE)
    line = refusal(folder)
    for part in (DRIVE, "ROS_Clock", "ROS_Drive"):
        assert part in line


@pytest.mark.parametrize(
    ("file", "edit", "named"),
    [
        pytest.param(file, *case, id=f"{file}: {name}")
        for file, cases in (
            (CHECKPOINTS, WRONG_CHECKPOINTS),
            (SCENE, WRONG_SCENES),
            (TYPES, WRONG_TYPES),
        )
        for name, case in cases.items()
    ],
)
def test_a_wrong_entry_is_named_with_its_file(
    file: str, edit: Edit, named: tuple[str, ...], folder: Path
) -> None:
    edited(folder / file, edit)
    line = refusal(folder)
    assert line.startswith(f"{file}: ")
    for part in named:
        assert part in line


@pytest.mark.parametrize(
    ("file", "key"),
    [
        (CLOCK, "  ros2_context: {type: x, at: [0, 0], handout: B3}\n"),
        (CLOCK, "wires: {}\n"),
        (CHECKPOINTS, '  "08": {name: x, title: x, part: I, adds: {}}\n'),
        (SCENE, "world: {}\n"),
    ],
)
def test_a_role_or_key_given_twice_is_refused(file: str, key: str, folder: Path) -> None:
    text = (folder / file).read_text()
    lines = text.splitlines(keepends=True)
    # A second entry goes right below the section that holds the first one.
    section = "nodes:\n" if "ros2_context" in key else "checkpoints:\n"
    place = lines.index(section) + 1 if key.startswith(" ") else len(lines)
    lines.insert(place, key)
    (folder / file).write_text("".join(lines))
    line = refusal(folder)
    assert line.startswith(f"{file}: line ")
    assert f"'{quick_yaml.load(key).popitem()[0]}' is given twice" in line


@pytest.mark.parametrize("file", [TYPES, CHECKPOINTS, SCENE, CLOCK])
class TestAnyFile:
    def test_missing_is_refused_where_it_is_the_lab_s_own(self, file: str, folder: Path) -> None:
        (folder / file).unlink()
        if file == TYPES:  # then they are the bundled ones
            assert types_of(load_lab(folder)) == types_of(load_lab())
        else:
            assert file in refusal(folder)

    def test_a_folder_in_its_place_is_refused(self, file: str, folder: Path) -> None:
        (folder / file).unlink()
        (folder / file).mkdir()
        assert file in refusal(folder)

    def test_what_is_not_yaml_is_refused_with_its_line(self, file: str, folder: Path) -> None:
        with (folder / file).open("a") as text:
            text.write("more: [unclosed\n")
        assert refusal(folder).startswith(f"{file}: line ")

    def test_a_tag_makes_no_python_object(self, file: str, folder: Path) -> None:
        made = folder.parent / "made"
        with (folder / file).open("a") as text:
            text.write(f"more: !!python/object/apply:os.mkdir ['{made}']\n")
        assert refusal(folder).startswith(f"{file}: line ")
        assert not made.exists()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"- a list\n",
        b"one word\n",
        b"graph: [unclosed\n",
        b"a: b: c\n",
        b"\tgraph: x\n",
        b"graph: \xff\xfe\xfa\n",
        b"graph: \x00\n",
        b"1: a number as a key\n",
        b"? [a, b]\n: a list as a key\n",
        b"graph: *nowhere\n",
        b"graph: !!python/object/new:os.mkdir [made]\n",
        b"graph: !!python/name:os.mkdir\n",
        b"graph: !!python/tuple [a, b]\n",
        b"graph: !unknown x\n",
        b"graph: {x: 1}\n---\ngraph: a second document\n",
    ],
)
def test_what_is_no_plain_mapping_in_yaml_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / CLOCK
    file.write_bytes(content)
    with pytest.raises(SpecError) as refused:
        read_yaml(file)
    assert str(refused.value).startswith(f"{CLOCK}: ")
    assert "\n" not in str(refused.value)


def test_the_bundled_lab_loads_and_a_copy_of_it_is_equal(folder: Path) -> None:
    bundled, copied = load_lab(), load_lab(folder)
    assert types_of(bundled) == types_of(copied)
    assert repr(bundled.graphs) == repr(copied.graphs)  # which contain types
    assert bundled.checkpoints == copied.checkpoints
    assert (bundled.policy, bundled.frames, bundled.scene) == (
        copied.policy,
        copied.frames,
        copied.scene,
    )


def test_loading_twice_gives_equal_labs_in_equal_order(folder: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(folder, tmp_path / "other"))
    first, second = load_lab(folder), load_lab(other)
    assert repr(first.graphs) == repr(second.graphs)
    assert repr(first.checkpoints) == repr(second.checkpoints)
    assert repr(first.platform) == repr(second.platform)


def test_each_checkpoint_holds_all_that_the_earlier_ones_added() -> None:
    checkpoints = list(load_lab().checkpoints.values())
    for earlier, later in pairwise(checkpoints):
        assert later.graphs == (*earlier.graphs, *later.new)
        assert later.sensors == (*earlier.sensors, *later.new_sensors)


# What a slip of the pen can leave in any place of a spec.
SLIPS: tuple[Any, ...] = (None, 5, 1.5, True, "x", [], ["x"], [1], {}, {"x": 1})


def places(data: Any, here: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield where data may be wrong; of lists, whose entries are alike, at both ends."""
    ends = {0, len(data) - 1}
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        if isinstance(data, list) and key not in ends:
            continue
        yield (*here, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*here, key))


def slips(data: Data) -> Iterator[Data]:
    for place in list(places(data)):
        for slip in SLIPS:
            wrong = copied_along(data, place)
            put(*place, value=slip)(wrong)
            yield wrong
        shorter = copied_along(data, place)
        drop(*place)(shorter)
        yield shorter


def copied_along(data: Data, place: tuple[str | int, ...]) -> Data:
    """Copy what holds a place, so that it may be changed there."""
    whole = inner = copy.copy(data)
    for key in place[:-1]:
        inner[key] = copy.copy(inner[key])
        inner = inner[key]
    return whole


def refused_in_one_line(parse: Callable[[Data], object], wrong: Data) -> bool:
    """Parse wrong data; anything but success or a one-line refusal is an error of the loader."""
    line = ""
    try:
        parse(wrong)
    except SpecError as error:
        line = str(error)
    assert "\n" not in line
    return bool(line)


def parse_all_checkpoints(data: Data) -> None:
    lab = load_lab()
    accumulate(read_checkpoint_file(data), lab.graphs, lab.sensors)


@pytest.mark.parametrize("file", GRAPH_FILES)
def test_no_slip_in_a_graph_crashes_the_loader(file: str) -> None:
    catalog = load_lab().platform
    wrong = list(slips(read(GRAPHS / file)))
    refused = sum(refused_in_one_line(lambda d: parse_graph(d, catalog, file), d) for d in wrong)
    assert refused > len(wrong) / 2


@pytest.mark.parametrize(
    ("file", "parse"), [(CHECKPOINTS, parse_all_checkpoints), (SCENE, parse_scene)]
)
def test_no_slip_in_checkpoints_or_scene_crashes_the_loader(
    file: str, parse: Callable[[Data], object]
) -> None:
    wrong = list(slips(read(GRAPHS / file)))
    assert sum(refused_in_one_line(parse, data) for data in wrong) > len(wrong) / 3


def test_no_slip_in_the_catalog_crashes_the_loader() -> None:
    wrong = list(slips(whole_types()))
    platform = load_platform()
    refused = (
        refused_in_one_line(lambda d: with_lab_types(platform, d, TYPES), each) for each in wrong
    )
    assert sum(refused) > len(wrong) / 2


def test_a_node_without_a_place_stands_behind_what_is_wired_into_it(folder: Path) -> None:
    edited(folder / DRIVE, lambda data: [node.pop("at") for node in data["nodes"].values()])
    graph = load_lab(folder).graphs["ROS_Drive"]
    places = [node.at for node in graph.nodes.values()]
    assert len(set(places)) == len(places)
    for wire in graph.wires:
        assert graph.nodes[wire.source.role].at[0] < graph.nodes[wire.target.role].at[0]


def test_a_node_without_a_section_is_in_that_of_its_graph(folder: Path) -> None:
    edited(folder / CLOCK, lambda data: [node.pop("handout") for node in data["nodes"].values()])
    graph = load_lab(folder).graphs["ROS_Clock"]
    assert {node.handout for node in graph.nodes.values()} == {graph.handout}


def test_a_lab_of_a_later_format_is_refused(tmp_path: Path) -> None:
    folder = shutil.copytree(MINI, tmp_path / "lab")
    checkpoints = folder / "checkpoints.yaml"
    checkpoints.write_text(f"format: {FORMAT + 1}\n{checkpoints.read_text()}")
    with pytest.raises(SpecError, match="this release reads up to 1; install a newer one"):
        assemble(folder)


def test_a_lab_without_a_format_is_read(tmp_path: Path) -> None:
    folder = shutil.copytree(MINI, tmp_path / "lab")
    assert "format:" not in (folder / "checkpoints.yaml").read_text()
    assert assemble(folder).title == "Mini"


HEARD = """  listen:
    type: isaacsim.ros2.bridge.ROS2Subscriber
    set: {messagePackage: std_msgs, messageName: Float64, topicName: grip}
  half: {type: omni.graph.nodes.Negate}
wires:
  B4: [listen.PORT -> half.input]
"""


def listening(folder: Path, port: str) -> Lab:
    """Load a lab with a graph that takes a port of a generic subscriber."""
    file = folder / "ROS_Clock.yaml"
    head, _, _ = file.read_text(encoding="utf-8").partition("wires:\n")
    file.write_text(head + HEARD.replace("PORT", port), encoding="utf-8")
    return load_lab(folder)


def test_a_generic_subscriber_has_the_ports_of_its_message(folder: Path) -> None:
    assert "listen" in listening(folder, "data").graphs["ROS_Clock"].nodes


def test_a_generic_subscriber_has_no_other_ports(folder: Path) -> None:
    with pytest.raises(SpecError, match="has no output 'dta'; did you mean 'data'"):
        listening(folder, "dta")
