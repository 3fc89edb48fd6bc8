"""The JSON schemas of a lab's files take what the loader takes, and refuse what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from in_process import invoke
from jsonschema import Draft202012Validator
from places import REPOSITORY, TESTS

from lab3_usd.grade.lab_schemas import FILES, schema_of

LABS = [
    REPOSITORY / "graphs",
    REPOSITORY / "docs" / "examples" / "labs" / "jetbot",
    TESTS / "labs" / "mini",
    TESTS / "labs" / "rig",
]
PATHS = [path for lab in LABS for path in sorted(lab.glob("*.yaml"))]


def faults(name: str, data: Any) -> list[list[Any]]:
    """Return the keys that lead to each fault."""
    errors = Draft202012Validator(schema_of(name)).iter_errors(data)
    return [[*error.absolute_path] for error in errors]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_a_file_of_a_lab_fits_its_schema(path: Path) -> None:
    assert faults(path.name, quick_yaml.load(path.read_text())) == []


WRONG: list[tuple[str, list[Any], Any]] = [
    ("checkpoints.yaml", ["checkpoints", "00", "adds", "frames"], "yes"),
    ("checkpoints.yaml", ["frames", "edges", 0], "odom base_footprint"),
    ("scene.yaml", ["robot", "links", "base_link", "mass"], "heavy"),
    ("ros.yaml", ["topics", "/clock", "publishers"], "one"),
    ("ros.yaml", ["commands", 0, "kind"], 1),
    ("submission.yaml", ["stages", "endings"], ".usd"),
    ("rubric.yaml", ["items", "clock", "points"], "ten"),
    ("starter.yaml", ["prims", "World", "type"], 3),
    ("node_types.yaml", ["world_frame"], 1),
    ("ROS_Clock.yaml", ["nodes", "on_playback_tick", "type"], 1),
]


@pytest.mark.parametrize(("name", "keys", "value"), WRONG)
def test_a_value_of_the_wrong_kind_is_found_where_it_is(
    name: str, keys: list[Any], value: Any
) -> None:
    data = quick_yaml.load((REPOSITORY / "graphs" / name).read_text())
    inside = data
    for key in keys[:-1]:
        inside = inside[key]
    inside[keys[-1]] = value
    assert faults(name, data) == [keys]


@pytest.mark.parametrize("name", FILES)
def test_a_key_that_no_file_knows_is_refused(name: str) -> None:
    example = "ROS_Clock.yaml" if name == "graph.yaml" else name
    data = quick_yaml.load((REPOSITORY / "graphs" / example).read_text())
    assert faults(name, {**data, "colour": "red"}) == [[]]


def test_names_that_stand_as_keys_are_not_asked_for_again() -> None:
    assert "name" not in schema_of("ros.yaml")["$defs"]["TopicSpec"]["properties"]
    assert "id" not in schema_of("rubric.yaml")["$defs"]["Item"]["properties"]


def test_the_command_prints_one_or_writes_all(tmp_path: Path) -> None:
    printed = json.loads(invoke("lab", "schema", "scene.yaml").stdout)
    assert printed == json.loads(json.dumps(schema_of("scene.yaml")))
    written = invoke("lab", "schema", "--out", tmp_path / "schemas").stdout.split()
    assert [Path(path).stem for path in written] == [Path(name).stem for name in FILES]
    assert invoke("lab", "schema").exit_code == 2


def test_a_new_lab_names_schemas_that_lie_in_it(tmp_path: Path) -> None:
    stage = invoke("build", "--only", "02", "--out", tmp_path).stdout.strip()
    folder = tmp_path / "lab"
    invoke("lab", "new", folder, "--from", stage)
    for path in folder.glob("*.yaml"):
        first = path.read_text().splitlines()[0]
        schema = folder / first.removeprefix("# yaml-language-server: $schema=")
        assert schema.is_file()
        assert faults(path.name, quick_yaml.load(path.read_text())) == []
