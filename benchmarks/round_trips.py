"""Adds every kind of graph to every stage of a folder, by every answer, and takes it away again.

Usage: python benchmarks/round_trips.py FOLDER [--match TEXT]

Where `lab3 add` asks (which robot, which sensor), each candidate is one more request. What is added
must bring no new finding, be there when it is asked for again, and come back equal to the byte. So
must all that fits into one stage together, removed in either order. What does not is printed, and
the exit status is 1.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.author.adding import AddOptions, add_graphs
from lab3_usd.author.removing import remove_graph
from lab3_usd.author.request import Options, Request, option_name
from lab3_usd.errors import AmbiguousError, Lab3Error
from lab3_usd.isaac.releases import BASE
from lab3_usd.pipeline.any_stage import lint_platform

_FINGERS = Options(speed=0.001, open=0.04, close=0.0)
VARIANTS: dict[str, tuple[Options, ...]] = {
    "clock": (Options(), Options(graph="/Graph/Clock")),
    "drive": (Options(), Options(topic="/go", namespace="bot")),
    "odometry": (Options(), Options(robot_tf=False), Options(topic="/wheels/odom")),
    "joints": (Options(), Options(commands=True), Options(states=False, commands=True)),
    "camera": (
        Options(),
        Options(with_tf=True),
        Options(publish=("rgb", "depth_pcl", "semantic_segmentation", "bbox_3d")),
        Options(publish=("camera_info",), width=640, height=480),
    ),
    "lidar": (
        Options(),
        Options(publish=("laser_scan", "point_cloud"), metadata=("Intensity", "ObjectId")),
    ),
    "publisher": tuple(Options(kind=kind) for kind in ("rtf", "bool", "int64", "string")),
    "differential": (Options(), Options(keyboard=True)),
    "gripper": (_FINGERS, replace(_FINGERS, keyboard=True)),
}


def requests(path: Path, kind: str, options: Options) -> Iterator[Request]:
    """Yield a request, or one for each candidate where it asks."""
    try:
        add_graphs(path, [Request(kind, options)], AddOptions(BASE))
    except AmbiguousError as error:
        field = next((f for f in ("robot", "prim") if option_name(f) == error.option), None)
        for candidate in error.candidates if field else ():
            answered = replace(options, **{field: candidate.partition(" ")[0]})
            if answered != options:
                yield from requests(path, kind, answered)
    except Lab3Error:
        return
    else:
        yield Request(kind, options)


def fault_of(path: Path, request: Request) -> str:
    """Add a graph and remove it again; return what went wrong, '' for nothing."""
    original = path.read_bytes()
    try:
        added = add_graphs(path, [request], AddOptions(BASE))
        if added.data is None:
            return ""
        if added.new:
            return f"new {added.new[0].rule} {added.new[0].prim}: {added.new[0].message}"
        path.write_bytes(added.data)
        if add_graphs(path, [request], AddOptions(BASE)).data is not None:
            return "asked for again it adds something"
        for addition in [each for each in reversed(added.additions) if not each.is_there]:
            path.write_bytes(remove_graph(path, addition.request, BASE).data or b"")
        return "" if path.read_bytes() == original else "what is left is not what was there"
    except Lab3Error as error:
        return str(error)
    finally:
        path.write_bytes(original)


def fault_of_all(path: Path, wanted: Sequence[Request], *, is_turned: bool) -> str:
    """Add all that fits together and remove it in one order; return what went wrong."""
    original = path.read_bytes()
    made: list[Request] = []
    try:
        for request in wanted:
            try:
                added = add_graphs(path, [request], AddOptions(BASE))
            except Lab3Error:
                continue  # something does it already
            if added.data is not None and not added.new:
                made += [each.request for each in added.additions if not each.is_there]
                path.write_bytes(added.data)
        for request in reversed(made) if is_turned else made:
            path.write_bytes(remove_graph(path, request, BASE).data or b"")
        return "" if path.read_bytes() == original else f"of {len(made)} graphs something is left"
    except Lab3Error as error:
        return str(error)
    finally:
        path.write_bytes(original)


def main() -> None:
    """Try every kind on every stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--match", default="")
    asked = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(shutil.copytree(asked.folder, Path(folder) / "stages"))
        for path in sorted(copy.glob("*.usda")):
            if asked.match not in path.name:
                continue
            path.chmod(0o644)
            wanted = [
                request
                for kind in lint_platform().recipes
                for options in VARIANTS.get(kind, (Options(),))
                for request in requests(path, kind, options)
            ]
            told = {f"{each.kind} {each.options.given()}": fault_of(path, each) for each in wanted}
            told["all"] = fault_of_all(path, wanted, is_turned=False)
            told["all, last first"] = fault_of_all(path, wanted, is_turned=True)
            counts.update("wrong" if fault else "right" for fault in told.values())
            for what, fault in told.items():
                if fault:
                    sys.stdout.write(f"{path.name}: {what}: {fault}\n")
    sys.stdout.write(f"{counts['right']} right, {counts['wrong']} wrong\n")
    sys.exit(1 if counts["wrong"] else 0)


if __name__ == "__main__":
    main()
