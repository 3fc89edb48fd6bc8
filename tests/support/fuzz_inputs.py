"""Stages that nobody would save: from the grammar of USD text, and from damaged real files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

Input = tuple[str, bytes]  # the ending of the file, and what is in it

_NAMES = st.sampled_from(
    [
        "World",
        "turtlebot3_burger",
        "base_scan",
        "Lidar2D",
        "Camera_1",
        "ROS_Clock",
        "ROS_Drive",
        "tick",
        "a",
        "b",
    ]
)
_TYPES = st.sampled_from(
    [
        "Xform",
        "OmniGraph",
        "OmniGraphNode",
        "OmniGraphNode",
        "Camera",
        "OmniLidar",
        "PhysicsScene",
        "Plane",
        "PhysicsRevoluteJoint",
        "Mesh",
        "Scope",
    ]
)
_WORDS = st.sampled_from(
    [
        r"isaacsim.ros2.bridge.ROS2PublishClock",
        r"omni.graph.action.OnPlaybackTick",
        r"scan",
        r"/clock",
        r"tf",
        r"ü",
        r"xformOp:translate",
        r"!resetXformStack!",
        r"base_footprint",
        r"odom",
        r"\n",
        r"\t",
        r"X",
        r"Y",
    ]
)
_REAL = st.one_of(
    st.integers(-1000, 1000).map(str),
    st.floats(allow_nan=False, allow_infinity=False, width=32).map(repr),
    st.sampled_from(["inf", "-inf", "nan", "1e30"]),
)
_WHOLE = st.one_of(st.integers(0, 255).map(str), st.just("2147483647"))
_PATHS = st.sampled_from(
    [
        "/World",
        "/World/ROS_Clock/a.outputs:tick",
        "/World.inputs:x",
        "/turtlebot3_burger/base_scan",
        "/a.b",
        "../x.y",
        "/World/ROS_Clock/b.outputs:tick",
    ]
)
_ASSETS = st.sampled_from(
    [
        "./Lab3_05_odometry_tf.usda",
        "../up.usda",
        "/etc/passwd",
        "https://a.b/c.usd",
        "a.usda",
        "x.png",
    ]
)
_QUOTED = _WORDS.map(lambda word: f'"{word}"')


def _tuple(size: int) -> SearchStrategy[str]:
    return st.lists(_REAL, min_size=size, max_size=size).map(lambda all_: f"({', '.join(all_)})")


def _list(items: SearchStrategy[str]) -> SearchStrategy[str]:
    return st.lists(items, max_size=4).map(lambda all_: f"[{', '.join(all_)}]")


_MATRIX = st.lists(_tuple(4), min_size=4, max_size=4).map(lambda rows: f"({', '.join(rows)})")
_BY_TYPE = {
    "token": _QUOTED,
    "string": _QUOTED,
    "token[]": _list(_QUOTED),
    "bool": st.sampled_from(["0", "1", "true", "false"]),
    "int": _WHOLE,
    "uint": _WHOLE,
    "uint64": _WHOLE,
    "double": _REAL,
    "float": _REAL,
    "float2": _tuple(2),
    "double3": _tuple(3),
    "quatd": _tuple(4),
    "double[]": _list(_REAL),
    "matrix4d": _MATRIX,
    "asset": _ASSETS.map(lambda asset: f"@{asset}@"),
}
# Each property has one type in a file; USD takes no second one for an error in the value alone.
_PROPERTIES = {
    "node:type": "token",
    "node:typeVersion": "int",
    "inputs:execIn": "uint",
    "inputs:topicName": "string",
    "inputs:context": "uint64",
    "inputs:resetOnStop": "bool",
    "inputs:wheelRadius": "double",
    "outputs:tick": "uint",
    "xformOp:translate": "double3",
    "xformOp:translate:pivot": "matrix4d",
    "xformOp:orient": "quatd",
    "xformOp:scale": "token",
    "xformOp:transform": "matrix4d",
    "xformOp:rotateXYZ": "double",
    "xformOpOrder": "token[]",
    "physics:mass": "float",
    "physics:axis": "token",
    "isaac:namespace": "string",
    "clippingRange": "float2",
    "focalLength": "token",
    "omni:sensor:tickRate": "double[]",
    "x": "asset",
}
_ANY_VALUE = st.one_of(*_BY_TYPE.values(), st.just("None"))
_PRIM_PATHS = st.sampled_from(["</World>", "</turtlebot3_burger>", "</a/b>"])
_ARCS = {
    "prepend references": st.one_of(_BY_TYPE["asset"], _PRIM_PATHS),
    "prepend payload": _BY_TYPE["asset"].map(lambda asset: f"{asset}</World>"),
    "inherits": _PRIM_PATHS,
    "specializes": _PRIM_PATHS,
    "prepend apiSchemas": st.sampled_from(
        ['["PhysicsRigidBodyAPI"]', '["PhysicsArticulationRootAPI", "NoSuchAPI"]', "[]"]
    ),
    "active": st.sampled_from(["true", "false"]),
    "instanceable": st.sampled_from(["true", "false"]),
    "kind": _QUOTED,
}


def _now_and_then(usual: SearchStrategy[str], odd: SearchStrategy[str]) -> SearchStrategy[str]:
    return st.integers(0, 39).flatmap(lambda number: usual if number else odd)


@st.composite
def _metadata(draw: DrawFn) -> str:
    names = draw(st.lists(st.sampled_from(sorted(_ARCS)), max_size=2, unique=True))
    lines = [f"{name} = {draw(_now_and_then(_ARCS[name], _ANY_VALUE))}" for name in names]
    return "(\n" + "\n".join(lines) + "\n)" if lines else ""


@st.composite
def _property(draw: DrawFn) -> str:
    name = draw(st.sampled_from([*_PROPERTIES, "rel"]))
    if name == "rel":
        return f"custom rel inputs:targetPrims = {draw(_PRIM_PATHS)}"
    kind = _PROPERTIES[name]
    declared = f"{draw(st.sampled_from(['', 'custom ']))}{kind} {name}"
    form = draw(st.sampled_from(["plain", "value", "value", "connect", "samples"]))
    value = draw(_now_and_then(_BY_TYPE[kind], _ANY_VALUE))
    return {
        "plain": declared,
        "value": f"{declared} = {value}",
        "connect": f"{declared}.connect = <{draw(_PATHS)}>",
        "samples": f"{declared}.timeSamples = {{\n0: {value},\n1: {value},\n}}",
    }[form]


@st.composite
def _prim(draw: DrawFn, name: str, depth: int = 0) -> str:
    specifier = draw(st.sampled_from(["def", "def", "def", "over", "class"]))
    inside = draw(st.lists(_property(), max_size=4, unique_by=lambda line: line.split()[-1]))
    if depth < 3:
        children = draw(st.lists(_NAMES, max_size=3, unique=True))
        inside += [draw(_prim(child, depth + 1)) for child in children]
    head = f'{specifier} {draw(_TYPES)} "{name}" {draw(_metadata())}'
    return f"{head}\n{{\n" + "\n".join(inside) + "\n}\n"


_HEADS = [*["#usda 1.0\n"] * 9, "#usda 1.1\n", "#sdf 1.4.32\n", ""]
_LAYERS = [
    "",
    '(\n upAxis = "Z"\n)\n',
    "(\n subLayers = [@a.usda@]\n)\n",
    "(\n metersPerUnit = nan\n)\n",
]


@st.composite
def written(draw: DrawFn) -> Input:
    """Text that follows the grammar for the most part."""
    head, layer = draw(st.sampled_from(_HEADS)), draw(st.sampled_from(_LAYERS))
    names = draw(st.lists(_NAMES, max_size=4, unique=True))
    text = head + layer + "".join(draw(_prim(name)) for name in names)
    return ".usda", text.encode("utf-8", "surrogatepass")


_VALUE = re.compile(r'"[^"\n]*"|<[^>\n]*>|(?<== )[-+.\w]+')


@st.composite
def rewritten(draw: DrawFn, whole: str) -> Input:
    """A real text with lines gone, twice there or elsewhere, and with other values in them."""
    lines = whole.splitlines()
    for _ in range(draw(st.integers(1, 10))):
        at = draw(st.integers(0, len(lines) - 1))
        if "=" not in lines[at]:
            continue
        how = draw(st.sampled_from(["value", "value", "gone", "twice", "moved"]))
        if how == "value":
            lines[at] = _VALUE.sub(lambda _: draw(_ANY_VALUE), lines[at], count=1)
        elif how == "gone":
            lines[at] = ""
        else:
            lines.insert(draw(st.integers(1, len(lines))) if how == "moved" else at, lines[at])
    return ".usda", "\n".join(lines).encode("utf-8", "surrogatepass")


_BYTES = [b"\xff" * 8, bytes(8), b"\x7f" + b"\xff" * 7, b"\0", b"{", b'"', b"\r\n", b"\xc3"]


@st.composite
def damaged(draw: DrawFn, ending: str, whole: bytes) -> Input:
    """A real file with bytes changed, taken out, put in, moved, or cut off."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        size = draw(st.integers(1, 64))
        how = draw(st.sampled_from(["flip", "flip", "flip", "set", "cut", "insert", "copy", "end"]))
        if how == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif how == "set":
            data[at : at + 8] = draw(st.sampled_from(_BYTES))
        elif how == "cut":
            del data[at : at + size]
        elif how == "insert":
            data[at:at] = draw(st.binary(min_size=1, max_size=16))
        elif how == "copy":
            data[at:at] = data[at : at + size]
        else:
            del data[at:]
    return ending, bytes(data)


def inputs(texts: list[bytes], crates: list[bytes]) -> SearchStrategy[Input]:
    """Every kind of input, from real files in both forms."""
    return st.one_of(
        *(written() for _ in range(3)),
        *(rewritten(text.decode()) for text in texts),
        *(rewritten(text.decode()) for text in texts),
        *(damaged(".usda", text) for text in texts),
        *(damaged(".usd", crate) for crate in crates),
    )


def generate(strategy: SearchStrategy[Input], count: int, start: int) -> list[Input]:
    """Return `count` inputs, the same for the same `start`."""
    found: list[Input] = []

    @seed(start)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def collect(made: Input) -> None:
        found.append(made)

    run: Callable[[], None] = collect
    run()
    return found[:count]


def write_inputs(folder: Path, made: list[Input]) -> None:
    """Write each input as a submission of its own."""
    for index, (ending, data) in enumerate(made):
        place = folder / f"{index:05}"
        place.mkdir(parents=True)
        (place / f"Lab3_05_odometry_tf{ending}").write_bytes(data)
