"""Puts odd values into right stages, one or one node type at a time, and runs the commands on them.

Usage: python benchmarks/odd_values.py [--every N] [--start N] [--match TEXT] [--verbose]

Each node type stands once in a stage with all its defaults, and beside it once for each token that
an input allows and for each odd number of an input that takes numbers. Where a right stage has such
a node, its inputs have these values one after the other as well, in place of what is wired to them.
So have the numbers of other prims, and those of the layer.

check, lint, sim, fix, draw, topics, tf and diff may call such a stage anything but an error of
their own. What fails is printed, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import math
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from breaking import correct_stage
from foreign_robots import arm, connect, copied, rover, truck, write_graph, write_node
from in_process import lab3
from pxr import Sdf, Usd

from lab3_usd.errors import EXIT_CRASH
from lab3_usd.isaac.node_types import INPUT, NodeType, Port
from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.opening import quiet

CHECKPOINT, GRAPH = "05", "/World/Odd"
_WHOLE = {"uchar": (0, 8), "int": (1, 32), "uint": (0, 32), "int64": (1, 64), "uint64": (0, 64)}
_REAL = {"half": 65504.0, "float": 3.4028234e38, "double": 1.7976931348623157e308}
_ELEMENT = re.compile(r"(u?int64|[a-z]+?)\d?(\[\])?")
_OF_PARTS = re.compile(r"(?:point|vector|normal|color|quat|matrix|texCoord)\d?([hfd])(\[\])?")
_LETTERS = {"h": "half", "f": "float", "d": "double"}
_LAYER = ("metersPerUnit", "kilogramsPerUnit", "timeCodesPerSecond", "startTimeCode")
_DRIVE = "0.15,0,0.5 0,0.8,0.5"
_FAILED = re.compile(r"rule [A-Z]\d\d failed")
# What a node that no right stage has needs before it looks at its other inputs.
_SENSIBLE = {
    "isaacsim.robot.wheeled_robots.HolonomicController": {
        "wheelRadius": [0.1] * 3,
        "wheelPositions": [(0.2, 0.0, 0.0), (-0.1, 0.2, 0.0), (-0.1, -0.2, 0.0)],
        "wheelOrientations": [(0.0, 0.0, 0.0, 1.0)] * 3,
        "mecanumAngles": [90.0] * 3,
        "inputVelocity": (1.0, 0.0, 0.5),
    },
    "isaacsim.ros2.bridge.ROS2Publisher": {
        "messagePackage": "std_msgs",
        "messageSubfolder": "msg",
        "messageName": "Int32",
    },
}


@dataclass(frozen=True, slots=True)
class Case:
    """A right stage, by name, and what is odd in it."""

    name: str
    stage: str
    change: Callable[[Usd.Stage], None]


@dataclass(frozen=True, slots=True)
class Failure:
    """A command that failed itself over a case, and what it said."""

    case: str
    command: str
    said: str


STAGES: dict[str, Callable[[], Usd.Stage]] = {
    CHECKPOINT: lambda: correct_stage(CHECKPOINT),
    "rover": rover,
    "truck": truck,
    "arm": arm,
}


@cache
def catalog() -> Platform:
    """Return the node types that are known."""
    return load_platform()


def cases() -> Iterator[Case]:
    """Yield every case, in the same order at each run."""
    for known in sorted(catalog().types.values(), key=lambda known: known.type):
        yield Case(f"{known.type}, all of it", CHECKPOINT, partial(_beside, known=known))
    seen: set[tuple[str, str]] = set()
    for name, make in STAGES.items():
        stage = make()
        for prim in stage.Traverse():
            kind = str(prim.GetTypeName())
            known = _type_of(prim)
            for attribute, usd_type in _attributes(prim, known):
                key = (known.type if known is not None else kind, attribute)
                if key in seen or (known is None and kind.startswith("OmniGraph")):
                    continue
                seen.add(key)
                port = known.port(attribute) if known is not None else None
                for label, value in _odd(usd_type, port):
                    where = str(prim.GetPath())
                    yield Case(
                        f"{name}: {where}.{attribute} = {label}",
                        name,
                        partial(_set, path=where, name=attribute, usd_type=usd_type, value=value),
                    )
    for field in _LAYER:
        for label, value in odd_numbers("double"):
            yield Case(
                f"{CHECKPOINT}: {field} = {label}",
                CHECKPOINT,
                partial(_set_of_layer, field=field, value=value),
            )


def _type_of(prim: Usd.Prim) -> NodeType | None:
    said = prim.GetAttribute("node:type")
    return catalog().get(str(said.Get())) if said else None


def _attributes(prim: Usd.Prim, known: NodeType | None) -> Iterator[tuple[str, str]]:
    """Yield what of a prim can be odd, with its type: inputs of a node, else what is written."""
    if known is None:
        for attribute in prim.GetAuthoredAttributes():
            yield attribute.GetName(), str(attribute.GetTypeName())
        return
    for port in known.ports.values():
        if port.name.startswith(INPUT) and not port.is_execution and not port.is_target:
            yield port.name, port.usd_type


def _odd(usd_type: str, port: Port | None) -> Iterator[tuple[str, Any]]:
    if port is not None:
        if port.default is not None:
            yield "its default", _as_usd(usd_type, port.default)
        yield from ((token, token) for token in port.allowed)
    yield from odd_numbers(usd_type)


def odd_numbers(usd_type: str) -> Iterator[tuple[str, Any]]:
    """Yield zero, negative and huge numbers of a type of USD, and those that are none."""
    found = _OF_PARTS.fullmatch(usd_type) or _ELEMENT.fullmatch(usd_type)
    numbers = [] if found is None else _numbers(_LETTERS.get(found[1], found[1]))
    for number in numbers:
        yield f"{number:g}", _filled(usd_type, number)
        if usd_type.endswith("[]"):
            yield f"[{number:g}] * 3", _filled(usd_type, number, 3)
    if numbers and usd_type.endswith("[]"):
        yield "[]", Sdf.ValueTypeNames.Find(usd_type).type.pythonClass()


def _numbers(kind: str) -> list[float]:
    if kind in _WHOLE:
        signed, bits = _WHOLE[kind]
        ends = [-1, -(2 ** (bits - 1)), 2 ** (bits - 1) - 1] if signed else [2**bits - 1]
        return [0, 1, *ends]
    if kind in _REAL:
        most = _REAL[kind]
        return [0.0, -1.0, 1e-30, most, -most, math.inf, -math.inf, math.nan]
    return []


def _filled(usd_type: str, number: float, count: int = 1) -> Any:
    """Return a value of a type of which every number is this one."""
    kind = Sdf.ValueTypeNames.Find(usd_type)
    if kind.isArray:
        element = _filled(str(kind.scalarType), number)
        return kind.type.pythonClass([element] * count)
    zero = kind.defaultValue
    if isinstance(zero, (int, float)):
        return number
    if hasattr(zero, "imaginary"):
        parts = type(zero.imaginary)(*[number] * 3)
        return type(zero)(number, parts)
    return type(zero)(number) if hasattr(zero, "GetRow") else type(zero)(*[number] * len(zero))


def _as_usd(usd_type: str, value: Any) -> Any:
    """Return a value of the catalog as a value of USD."""
    kind = Sdf.ValueTypeNames.Find(usd_type)
    if kind.isArray:
        element = str(kind.scalarType)
        return kind.type.pythonClass([_as_usd(element, each) for each in value])
    if not isinstance(value, (tuple, list)):
        return value
    zero = kind.defaultValue
    if hasattr(zero, "imaginary"):
        return type(zero)(value[3], type(zero.imaginary)(*value[:3]))
    if hasattr(zero, "GetRow"):
        return type(zero)([list(row) for row in value])
    return type(zero)(*value)


def _set_of_layer(stage: Usd.Stage, field: str, value: float) -> None:
    stage.SetMetadata(field, value)


def _set(stage: Usd.Stage, path: str, name: str, usd_type: str, value: Any) -> None:
    """Give a property a value, in place of what it had or is wired to."""
    prim = stage.GetPrimAtPath(path)
    found = prim.GetAttribute(name)
    if not found:
        found = prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(usd_type), custom=True)
    found.ClearConnections()
    found.Set(value)


def _beside(stage: Usd.Stage, known: NodeType) -> None:
    """Put a node of a type into a graph of its own, and one more for each odd value of it."""
    nodes: dict[str, tuple[str, dict[str, Any]]] = {
        "tick": ("omni.graph.action.OnPlaybackTick", {})
    }
    write_graph(stage, GRAPH, nodes, (), **{"evaluator:type": "push"})
    _write(stage, known, "defaults")
    count = 0
    for port in known.ports.values():
        if not port.name.startswith(INPUT) or port.is_execution or port.is_target:
            continue
        usd_types = [port.usd_type] if not port.is_union else ["double", "int64", "double[]"]
        for usd_type in usd_types:
            for _, value in _odd(usd_type, None if port.is_union else port):
                path = _write(stage, known, f"odd{count}")
                _set(stage, path, port.name, usd_type, value)
                count += 1


def _write(stage: Usd.Stage, known: NodeType, name: str) -> str:
    path = f"{GRAPH}/{name}"
    node = write_node(stage, path, known.type, {})
    sensible = _SENSIBLE.get(known.type, {})
    for port in known.ports.values():
        if not port.name.startswith(INPUT):
            continue
        if port.is_execution:
            connect(stage, GRAPH, "tick.tick", f"{name}.{port.short}")
        elif port.is_target:
            relationship = node.CreateRelationship(port.name, custom=True)
            relationship.SetTargets([_target(port.short)])
        elif port.short in sensible or port.default is not None:
            value = sensible.get(port.short, port.default)
            if not port.is_union:
                _set(stage, path, port.name, port.usd_type, _as_usd(port.usd_type, value))
    return path


@cache
def _targets() -> dict[str, str]:
    """Return prims of the right stage by a word that inputs name them with."""
    stage, found = STAGES[CHECKPOINT](), dict[str, str]()
    for prim in stage.Traverse():
        words = {"camera": "Camera", "lidar": "OmniLidar", "graph": "OmniGraph"}
        for word, kind in words.items():
            if prim.GetTypeName() == kind:
                found.setdefault(word, str(prim.GetPath()))
        if "PhysicsArticulationRootAPI" in prim.GetAppliedSchemas():
            found.setdefault("", str(prim.GetPath()))
    return found


def _target(short: str) -> str:
    found = _targets()
    return next((path for word, path in found.items() if word and word in short.lower()), found[""])


def commands(path: Path, right: Path, out: Path) -> Iterator[tuple[str, Sequence[object]]]:
    """Yield the calls by name. A stage whose name says nothing is played by its own content too."""
    at = ("--checkpoint", CHECKPOINT)
    yield "check", ("check", path, *at, "--isolated")
    yield "lint", ("lint", path, "--isolated")
    recorded = ("--drive", _DRIVE, "--bag", out / "bag", "--page", out / "sim.html")
    yield "sim, checkpoint", ("sim", path, *at, *recorded)
    yield "sim", ("sim", path, "--drive", _DRIVE)
    yield "fix", ("fix", path, *at, "--unsafe", "-o", out / "fixed.usdc", "--isolated")
    yield "fix --lint", ("fix", path, "--lint", "--diff", "--isolated")
    yield "draw", ("draw", path, "-o", out / "pictures")
    yield "topics", ("topics", path, "-v")
    yield "tf", ("tf", path, "-v")
    yield "diff", ("diff", right, path)


def failures(case: Case, folder: Path) -> Iterator[Failure]:
    """Run the commands on one case, and yield those that fail themselves."""
    stage = copied(_right(case.stage))
    with quiet():
        case.change(stage)
    right, path, out = folder / f"{case.stage}.usdc", folder / "Odd.usdc", folder / "out"
    if not right.exists():
        _right(case.stage).Export(str(right))
    stage.GetRootLayer().Export(str(path))
    out.mkdir()
    for name, call in commands(path, right, out):
        try:
            done = lab3(*call)
        except BaseException as error:  # noqa: BLE001 - an error that the program lets through
            yield Failure(case.name, name, repr(error))
            continue
        said = f"{done.stdout}{done.stderr}"
        if done.returncode == EXIT_CRASH or _FAILED.search(done.stderr):
            lines = [line for line in said.splitlines() if "rror" in line or "rash" in line]
            yield Failure(case.name, name, "\n    ".join(lines[:8]))
    path.unlink()
    shutil.rmtree(out)


@cache
def _right(name: str) -> Sdf.Layer:
    return STAGES[name]().GetRootLayer()


def main() -> int:
    """Run all cases, or every so many, and print what fails."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--match", default="", help="only cases whose name has this text")
    parser.add_argument("--verbose", action="store_true", help="name each case")
    options = parser.parse_args()
    chosen = [case for case in cases() if options.match in case.name]
    chosen = chosen[options.start :: options.every]
    started, failed = time.monotonic(), 0
    with tempfile.TemporaryDirectory() as name:
        for case in chosen:
            if options.verbose:
                print(case.name, flush=True)
            for failure in failures(case, Path(name)):
                failed += 1
                print(f"{failure.case}: {failure.command}\n    {failure.said}", flush=True)
    seconds = time.monotonic() - started
    print(f"{len(chosen)} stages, {seconds:.0f} s: {failed} calls failed themselves")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
