"""The seed of Python's hashes changes nothing that is built, matched, found, drawn or printed."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path
from unittest.mock import patch

from breaking import broken
from other_labs import files_below
from places import REPOSITORY, TESTS
from starters import layered_starter

SCRIPT = """
import os, sys
from pathlib import Path
from plain_graphs import doubled, graph_of, judged_model, with_graphs
from lab3_usd.check.registry import all_rules
from lab3_usd.data import LAB_VARIABLE
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.model.finding import Report
from lab3_usd.report.formats.registry import render
from lab3_usd.report.picture.svg import svg_file
from lab3_usd.report.pictures.graph_picture import spec_picture
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter
stage, given, out, other_lab = map(Path, sys.argv[1:])
report = Report((check_stage(stage),))
print(report, render("html", report, all_rules()))
print(svg_file(spec_picture(load_lab().graphs["ROS_OdomTF"])))
for name in ("ROS_Drive", "ROS_OdomTF"):
    print(judged_model(with_graphs(doubled(graph_of(name)))))
build_starter(out / "starter.usda")
os.environ[LAB_VARIABLE] = str(other_lab)
for ending in (".usda", ".usd"):
    build_checkpoint(given, "05", out / f"05{ending}")
"""
MINI = TESTS / "labs" / "mini"
WRONG = [
    {"remove": "ROS_Clock/ros2_context"},
    {"disconnect": "ROS_Drive/make_array.inputs:input0"},
    {"targets": ["ROS_OdomTF/isaac_compute_transform_tree.inputs:targetPrims"]},
    {"copy": ["ROS_Camera/ros2_camera_helper", "ROS_Camera/again"]},
]


def run_here(*arguments: Path) -> bytes:
    """Run the script in this process, whose seed is another one in each run."""
    out = io.TextIOWrapper(io.BytesIO(), "utf-8", newline="")
    words = ["-c", *map(str, arguments)]
    with (
        patch.object(sys, "argv", words),
        patch.dict(os.environ),
        redirect_stdout(out),
    ):
        exec(SCRIPT, {})  # noqa: S102 - our own
    out.seek(0)
    return out.buffer.read()


def run_with_seed(seed: str, *arguments: Path) -> bytes:
    """Run the script in a process whose hashes have this seed."""
    modules = os.pathsep.join([str(REPOSITORY / "src"), str(TESTS / "support")])
    env = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": modules}
    command = [sys.executable, "-c", SCRIPT, *map(str, arguments)]
    return subprocess.run(command, env=env, capture_output=True, check=True).stdout


def test_no_hash_seed_changes_anything(tmp_path: Path) -> None:
    stage, given = tmp_path / "Lab3_05.usda", layered_starter(tmp_path / "given")
    broken("05", WRONG).GetRootLayer().Export(str(stage))
    outs = [tmp_path / "out" / name for name in ("here", "there")]
    for out in outs:
        out.mkdir(parents=True)
    here, there = ((stage, given, out, MINI) for out in outs)
    printed = [run_here(*here), run_with_seed("4711", *there)]
    written = [files_below(out) for out in outs]
    assert printed[0].count(b"N07") > 1
    assert printed[0].count(b"<figure") > 1
    assert len(written[0]) == 3
    assert printed == printed[:1] * 2
    assert written == written[:1] * 2
