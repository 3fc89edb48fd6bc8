"""The scans of a recording lie on the map that was recorded with them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from in_process import invoke

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")

from recordings import STORE, Sent, recorded, rewritten, tied

from lab3_usd.data import data_folder
from lab3_usd.deliverables.maps import read_map

YAML = "turtlebot3_map.yaml"


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("recording"))


def localized(shift: float = 0.0, *, inverted: bool = False) -> Any:
    """Add what AMCL and map_server send: where odometry starts in the map, and the map."""
    grid = read_map(data_folder("maps") / YAML)

    def change(sent: Sent) -> Iterator[Sent]:
        for each in tied(sent, "map"):
            if each is not sent:
                each.said.transforms[0].transform.translation.x = 1.8 + shift
            yield each
        if sent.topic == "/clock" and sent.time < 40_000_000:
            yield Sent(sent.time, "/map", "nav_msgs/msg/OccupancyGrid", message(), sent.qos)

    def message() -> Any:
        numpy, types = __import__("numpy"), STORE.types
        stamp = types["builtin_interfaces/msg/Time"](0, 0)
        pose = types["geometry_msgs/msg/Pose"](
            types["geometry_msgs/msg/Point"](*grid.origin[:2], 0.0),
            types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        )
        cells = numpy.zeros((grid.height, grid.width), dtype=numpy.int8)
        for column, row in grid.walls:
            cells[row, column] = 100
        cells = 100 - cells if inverted else cells
        info = types["nav_msgs/msg/MapMetaData"](
            stamp, grid.resolution, grid.width, grid.height, pose
        )
        head = types["std_msgs/msg/Header"](stamp, "map")
        return types["nav_msgs/msg/OccupancyGrid"](head, info, cells.ravel())

    return change


def map_of_recording(run: Path, *arguments: str) -> dict[str, Any]:
    done = invoke("bag", run, "--checkpoint", "07", "--format", "json", *arguments)
    checks = json.loads(done.stdout)["checks"]
    found: dict[str, Any] = next(check for check in checks if check["name"] == "map")
    return found


def test_the_scans_of_a_recording_lie_on_its_map(plain: Path, tmp_path: Path) -> None:
    run = rewritten(plain, tmp_path / "run", localized())
    assert map_of_recording(run)["verdict"] == "ok"
    assert "100% of " in invoke("bag", run, "--checkpoint", "07").stdout


def test_localization_that_is_off_shows_in_a_recording(plain: Path, tmp_path: Path) -> None:
    run = rewritten(plain, tmp_path / "run", localized(1.0))
    found = map_of_recording(run)
    assert (found["verdict"], found["rule"]) == ("bad", "M09")
    assert "moved by (+0.95, +0.00) m" in found["message"]  # or +1.00: a cell is 0.05


def test_an_inverted_map_shows_in_a_recording(plain: Path, tmp_path: Path) -> None:
    run = rewritten(plain, tmp_path / "run", localized(inverted=True))
    found = map_of_recording(run)
    assert (found["verdict"], found["rule"]) == ("bad", "M06")


def test_a_map_that_is_given_counts_instead_of_the_recorded_one(
    plain: Path, tmp_path: Path
) -> None:
    run = rewritten(plain, tmp_path / "run", localized())
    other = Path(shutil.copytree(data_folder("maps"), tmp_path / "maps"))
    text = (other / YAML).read_text(encoding="utf-8")
    (other / YAML).write_text(text.replace("0.05", "0.07"), encoding="utf-8")
    assert map_of_recording(run, "--maps", str(other))["verdict"] == "bad"
