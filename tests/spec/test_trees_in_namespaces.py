"""Robots in namespaces of their own, whose frames have the same names: a tree on each topic."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from in_process import invoke
from places import REPOSITORY
from pxr import Sdf

from lab3_usd.errors import SpecError
from lab3_usd.features.bag.sim_recording import record_run
from lab3_usd.new_lab.lab import describe_lab
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.outcome import DryRun
from lab3_usd.spec.lab import CHECKPOINTS
from lab3_usd.spec.load.loader import load_lab

WAREHOUSE = REPOSITORY / "docs" / "examples" / "labs" / "warehouse"
FRAMES = """frames:
  handout: "5.1"
  trees:
    - topic: /r1/tf
      edges: [odom -> base, base -> left_wheel, base -> right_wheel, base -> castor, base -> mast,
        base -> imu]
    - topic: /r2/tf
      edges: [odom -> body, body -> left_wheel, body -> right_wheel, body -> tower, body -> front,
        body -> back]
  names: {/World/r1/base/Imu: imu, /World/r2/body/Front: front, /World/r2/body/Back: back}

checkpoints:"""
R1, R2 = "/World/r1/OdometryR1", "/World/OdometryR2"
Change = Callable[[Sdf.Layer], object]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lab of two robots, without prefixes of frames, and its built stage with the trees."""
    folder = shutil.copytree(WAREHOUSE, tmp_path_factory.mktemp("trees") / "lab")
    for file in folder.glob("*.yaml"):
        text = re.sub(
            r"((?:[fF]rameId|frame_id|nameOverride.*value): )r[12]/", r"\1", file.read_text()
        )
        if file.stem.startswith("Odometry"):
            text = text.replace("topicName: /tf", f"topicName: /{file.stem[-2:].lower()}/tf")
        if file.name == "ros.yaml":
            text = re.sub(r"  /tf: (.*)\n", r"  /r1/tf: \1\n  /r2/tf: \1\n", text)
            text = re.sub(r".*of: /tf\b.*\n|\nnavigation:(.|\n)*", "", text)
        if file.name == "checkpoints.yaml":
            text = re.sub(r"frames:\n(.|\n)*?\ncheckpoints:", FRAMES, text)
            text = text.replace(", localization: true", "")
        file.write_text(text)
    made = invoke("--lab", folder, "build", "--out", folder.parent / "built", "--only", "5")
    assert made.exit_code == 0, made.output
    return folder


def found(folder: Path, change: Change) -> list[tuple[str, str]]:
    (built,) = (folder.parent / "built").iterdir()
    layer = Sdf.Layer.OpenAsAnonymous(str(built))
    change(layer)
    stage = folder.parent / built.name
    layer.Export(str(stage))
    findings = check_stage(stage, lab=load_lab(folder, "01")).findings
    return [(each.rule, each.prim) for each in findings if each.severity == "error"]


def without(graph: str, prim: str) -> Change:
    def change(layer: Sdf.Layer) -> None:
        listed = layer.GetRelationshipAtPath(f"{graph}/links.inputs:targetPrims").targetPathList
        listed.explicitItems = [path for path in listed.explicitItems if path != prim]

    return change


def sent_on(topic: str) -> Change:
    def change(layer: Sdf.Layer) -> None:
        layer.GetAttributeAtPath(f"{R2}/publish_links.inputs:topicName").default = topic

    return change


MISTAKES: dict[str, tuple[Change, list[tuple[str, str]]]] = {
    "none": (lambda _: None, []),
    "one lacks what the other has": (
        without(R2, "/World/r2/body/left_wheel"),
        [("T01", f"{R2}/links")],
    ),
    "the other": (without(R1, "/World/r1/left_wheel"), [("T01", f"{R1}/links")]),
    "the tree of one in that of the other": (sent_on("/r1/tf"), [("P01", f"{R2}/publish_links")]),
    "a tree that nobody hears": (sent_on("/tf"), [("P01", f"{R2}/publish_links")]),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_is_found_once_in_its_tree(folder: Path, mistake: str) -> None:
    change, told = MISTAKES[mistake]
    assert found(folder, change) == told


def test_a_frame_that_is_lost_costs_one_requirement(folder: Path) -> None:
    found(folder, without(R2, "/World/r2/body/left_wheel"))
    (stage,) = folder.parent.glob("*.usda")
    requirements = check_stage(stage, lab=load_lab(folder)).requirements
    titles = [each.title for each in requirements if not each.met]
    assert titles == ["body -> left_wheel is published on /r2/tf"]


@pytest.fixture(scope="module")
def run(folder: Path) -> DryRun:
    (stage,) = (folder.parent / "built").iterdir()
    return dry_run(stage, load_lab(folder), "5", "0.1,0,0.6")


OF_EACH = [("r1", "ok"), ("r2", "ok")]


def test_each_robot_moves_its_own_tree(run: DryRun) -> None:
    checks = run.behaviour.checks
    assert [(c.of, c.verdict) for c in checks if c.name == "tree"] == OF_EACH


def test_each_robot_moves_its_own_tree_in_a_recording(
    run: DryRun, folder: Path, tmp_path: Path
) -> None:
    pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
    from lab3_usd.sim.bag.judge import judge_recording

    lab = load_lab(folder)
    [*record_run(run, lab, tmp_path / "run")]
    checks = judge_recording(tmp_path / "run", lab, "5", whole=False).behaviour.checks
    for name in ("tree", "frames"):
        assert [(c.of, c.verdict) for c in checks if c.name == name] == OF_EACH


REFUSED = {
    "a topic of no graph": (
        "topic: /r2/tf",
        "topic: /r3/tf",
        "'/r3/tf' is not a topic of the graphs' transforms",
    ),
    "edges as well": (
        "  trees:",
        "  edges: [odom -> base]\n  trees:",
        "trees or edges: both are given",
    ),
    "two parents in a tree": (
        "body -> back]",
        "odom -> left_wheel]",
        "'left_wheel' has two parents",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_trees_that_cannot_be_are_refused(folder: Path, tmp_path: Path, case: str) -> None:
    before, after, message = REFUSED[case]
    lab = shutil.copytree(folder, tmp_path / "lab")
    text = (lab / "checkpoints.yaml").read_text()
    assert before in text
    (lab / "checkpoints.yaml").write_text(text.replace(before, after))
    with pytest.raises(SpecError, match=message):
        load_lab(lab)


def test_a_lab_is_described_with_both_trees(folder: Path) -> None:
    (stage,) = (folder.parent / "built").iterdir()
    text = describe_lab([stage], load_lab()).files[CHECKPOINTS]
    assert re.findall(r"topic: (\S+),", text) == ["/r1/tf", "/r2/tf"]
