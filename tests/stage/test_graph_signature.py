"""The same graphs are found again in whatever layers they stand."""

from __future__ import annotations

from pathlib import Path

from breaking import built
from pxr import Sdf, Usd

from lab3_usd.stage.graph_signature import files_read, graph_signature


def layered(folder: Path, topic: str) -> Path:
    """Write a stage whose root layer only refers to the layers of the work."""
    folder.mkdir()
    built("05").Export(str(folder / "graphs.usda"))
    values = Sdf.Layer.CreateNew(str(folder / "values.usda"))
    node = Sdf.CreatePrimInLayer(values, "/World/ROS_Clock/ros2_publish_clock")
    Sdf.AttributeSpec(node, "inputs:topicName", Sdf.ValueTypeNames.String).default = topic
    values.Save()
    root = Sdf.Layer.CreateNew(str(folder / "Lab3_05.usda"))
    root.subLayerPaths[:] = ["values.usda", "graphs.usda"]
    root.Save()
    return folder / "Lab3_05.usda"


def test_a_flattened_copy_of_layers_has_the_same_graphs(tmp_path: Path) -> None:
    stage = layered(tmp_path / "ann", "/time")
    copy = tmp_path / "flat.usda"
    Usd.Stage.Open(str(stage)).Flatten().Export(str(copy))
    assert graph_signature(copy) == graph_signature(stage) != ""


def test_the_same_root_layer_over_other_values_is_other_work(tmp_path: Path) -> None:
    ann, bob = (layered(tmp_path / who, topic) for who, topic in (("ann", "/a"), ("bob", "/b")))
    assert ann.read_bytes() == bob.read_bytes()
    assert graph_signature(ann) != graph_signature(bob)


def test_a_stage_without_graphs_is_like_no_other(tmp_path: Path) -> None:
    built("00").Export(str(tmp_path / "Lab3_00.usda"))
    assert graph_signature(tmp_path / "Lab3_00.usda") == ""


def test_the_files_of_a_stage_are_those_of_all_its_layers(tmp_path: Path) -> None:
    names = [Path(name).name for name in files_read(layered(tmp_path / "ann", "/time"))]
    assert names == ["Lab3_05.usda", "graphs.usda", "values.usda"]
