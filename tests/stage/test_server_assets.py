"""Where assets of a server lie on this computer: addresses lead there, and stay what is said."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from foreign_robots import TICK, rover, write_graph
from in_process import lab3
from pxr import Sdf, Usd

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.stage.read.assets import find_unresolved
from lab3_usd.stage.read.server_assets import SEARCH_PATH, assets_at

SERVER = "https://server.example/Assets/Isaac/6.0"
ROBOT = "/World/Rover"
ROBOT_URL = f"{SERVER}/Robots/rover.usda"


@pytest.fixture
def server(tmp_path: Path) -> Path:
    """A folder with the rover as the server has it: in two files, with a graph that has a fault."""
    folder = tmp_path / "isaac assets"
    robots = folder / "Robots"
    robots.mkdir(parents=True)
    whole = rover()
    write_graph(
        whole,
        f"{ROBOT}/Graph",
        {"tick": TICK, "late": ("ros.ROS2PublishClock", {"topicName": "late"})},
        ["tick.tick -> late.execIn"],
    )
    (robots / "parts").mkdir()
    part = Sdf.Layer.CreateNew(str(robots / "parts" / "body.usda"))
    Sdf.CopySpec(whole.GetRootLayer(), ROBOT, part, "/Rover")
    part.defaultPrim = "Rover"
    part.Save()
    asset = Usd.Stage.CreateNew(str(robots / "rover.usda"))
    top = asset.DefinePrim("/Rover", "Xform")
    top.GetReferences().AddReference("./parts/body.usda")
    asset.SetDefaultPrim(top)
    asset.Save()
    return folder


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """The rover's stage, whose robot is on the server."""
    made = rover()
    made.RemovePrim(ROBOT)
    made.DefinePrim(ROBOT, "Xform").GetReferences().AddReference(ROBOT_URL)
    path = tmp_path / "work" / "stage.usda"
    path.parent.mkdir()
    made.GetRootLayer().Export(str(path))
    return path


def found(path: Path) -> list[Finding]:
    """Return what is found of the asset: that it is missing, or the fault that it has."""
    return [each for each in lint_stage(path).findings if each.rule in {"F02", "K10"}]


def test_an_asset_of_a_server_is_missing_without(stage: Path) -> None:
    assert {finding.rule for finding in found(stage)} == {"F02"}


def test_what_the_server_has_is_judged_with(stage: Path, server: Path) -> None:
    with assets_at({SERVER: server}):
        (finding,) = found(stage)
    assert (finding.rule, finding.prim) == ("K10", f"{ROBOT}/Graph/late")


def test_a_finding_in_an_asset_names_the_file_of_the_folder(stage: Path, server: Path) -> None:
    with assets_at({SERVER: server}):
        (finding,) = found(stage)
    assert finding.layer is not None
    assert Path(finding.layer).resolve() == server / "Robots" / "parts" / "body.usda"
    assert finding.line is not None


def test_an_asset_that_the_folder_lacks_goes_by_its_address(stage: Path, server: Path) -> None:
    with assets_at({SERVER: server / "Robots"}):
        (finding,) = found(stage)
    assert (finding.rule, finding.actual) == ("F02", ROBOT_URL)


def test_what_an_asset_lacks_goes_by_its_own_name(stage: Path, server: Path) -> None:
    (server / "Robots" / "parts" / "body.usda").unlink()
    with assets_at({SERVER: server}):
        opened = Usd.Stage.Open(str(stage))
        (missing,) = find_unresolved(opened)
    assert (missing.prim, missing.asset) == (ROBOT, "./parts/body.usda")


@pytest.mark.parametrize(
    "address",
    ["omniverse://localhost/NVIDIA", "http://server.example/a%20b/", "file:/home/ana/kit"],
)
def test_addresses_of_every_kind_lead_to_a_folder(address: str, stage: Path, server: Path) -> None:
    opened = Usd.Stage.Open(str(stage))
    references = opened.GetPrimAtPath(ROBOT).GetReferences()
    references.SetReferences([Sdf.Reference(f"{address.rstrip('/')}/Robots/rover.usda")])
    opened.Save()
    with assets_at({address: server}):
        assert {finding.rule for finding in found(stage)} == {"K10"}


def test_the_longer_address_counts_first(stage: Path, server: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    (empty / "Robots").mkdir(parents=True)
    (empty / "Robots" / "rover.usda").write_text('#usda 1.0\n(defaultPrim = "R")\ndef "R" {}\n')
    with assets_at({SERVER: empty, f"{SERVER}/Robots": server / "Robots"}):
        assert {finding.rule for finding in found(stage)} == {"K10"}


def test_afterwards_addresses_lead_nowhere_again(
    stage: Path, server: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SEARCH_PATH, "/somewhere")
    with assets_at({SERVER: server}):
        assert os.environ[SEARCH_PATH].endswith(f"{os.pathsep}/somewhere")
    assert os.environ[SEARCH_PATH] == "/somewhere"
    assert {finding.rule for finding in found(stage)} == {"F02"}


@pytest.mark.parametrize("address", ["", "Isaac/6.0", "/home/ana", "https:", "https://a/../../b"])
def test_what_is_no_address_is_refused(address: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError), assets_at({address: tmp_path}):
        pass


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError), assets_at({SERVER: tmp_path / "gone"}):
        pass


# ---- on the command line


@pytest.mark.parametrize("command", ["lint", "check", "fix", "sim", "tf", "topics", "draw", "diff"])
def test_the_commands_that_read_stages_follow_it(
    command: str, stage: Path, server: Path, tmp_path: Path
) -> None:
    whole = tmp_path / "whole.usda"
    made = rover()
    made.GetRootLayer().Export(str(whole))
    words = {
        "fix": ["--lint"],
        "sim": ["--drive", "0.1,0,0.3"],
        "check": ["--checkpoint", "00"],
        "draw": ["--out", str(tmp_path / "pictures"), "--format", "dot", "--force"],
        "diff": [str(whole)],
    }
    without = lab3(command, stage, *words.get(command, []))
    there = lab3(command, stage, *words.get(command, []), "--assets", f"{SERVER}={server}")
    assert there.returncode in {0, 1}
    assert there.stdout != without.stdout


def test_the_linter_names_the_missing_asset_by_its_address(stage: Path, server: Path) -> None:
    assert ROBOT_URL in lab3("lint", stage).stdout
    done = lab3("lint", stage, "--assets", f"{SERVER}={server}", "--jobs", 2)
    assert (done.returncode, "lab3-assets" in done.stdout) == (1, False)
    assert f"error K10 unset-input {ROBOT}/Graph/late.inputs:timeStamp" in done.stdout


@pytest.mark.parametrize(
    "given", ["https://server.example", "=x", "x=", "https://server.example=/gone"]
)
def test_wrong_usage_is_one_line(given: str, stage: Path) -> None:
    done = lab3("lint", stage, "--assets", given)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_a_configuration_names_folders_beside_itself(stage: Path, server: Path) -> None:
    file = stage.parents[1] / "lab3.toml"
    file.write_text(f'[assets]\n"{SERVER}" = "{server.name}"\n')
    assert "error K10" in lab3("lint", stage).stdout
    assert "F02" in lab3("lint", stage, "--isolated", "--format", "concise").stdout
    assert f"{SERVER}: {server}" in lab3("config", stage.parent).stdout
    assert "late" in lab3("topics", stage).stdout


def test_the_command_line_counts_before_the_configuration(
    stage: Path, server: Path, tmp_path: Path
) -> None:
    (tmp_path / "empty").mkdir()
    file = stage.parents[1] / "lab3.toml"
    file.write_text(f'assets = {{"{SERVER}" = "empty"}}\n')
    assert "F02" in lab3("lint", stage, "--format", "concise").stdout
    assert "error K10" in lab3("lint", stage, "--assets", f"{SERVER}={server}").stdout


@pytest.mark.parametrize("text", ['assets = "x"', '[assets]\n"https://a" = "gone"', "assets = [1]"])
def test_a_configuration_that_is_wrong_is_wrong_usage(text: str, stage: Path) -> None:
    (stage.parents[1] / "lab3.toml").write_text(text)
    assert lab3("lint", stage).returncode == 2


def test_the_search_path_of_usd_core_serves_as_well(
    stage: Path, server: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is read when usd-core starts; `assets_at` sets it again."""
    place = tmp_path / "mirror" / "https:" / "server.example" / "Assets" / "Isaac"
    place.mkdir(parents=True)
    (place / "6.0").symlink_to(server)
    monkeypatch.setenv(SEARCH_PATH, str(tmp_path / "mirror"))
    with assets_at({"https://other.example": server}):
        assert {finding.rule for finding in found(stage)} == {"K10"}


def test_results_are_the_same_each_time(stage: Path, server: Path) -> None:
    results = []
    for _ in range(2):
        with assets_at({SERVER: server}):
            results.append(lint_stage(stage))
    assert results[0] == results[1]
