"""How well a map agrees with the walls of a stage, for each guess of where the map lies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lab3_usd.check.subjects_lab import Agreement
from lab3_usd.errors import Lab3Error
from lab3_usd.lab.maps import agreement, read_pgm
from lab3_usd.lab.raster import MapFrame, draw_map
from lab3_usd.spec.ros_spec import MapFacts
from lab3_usd.spec.spec import Lab


def wall_agreements(
    stage_path: Path, image: Path, facts: MapFacts, lab: Lab
) -> tuple[Agreement, ...]:
    """Compare a map with the one that the stage's walls give.

    Nobody says whether the map's frame is the world's or begins where the robot starts, so both
    are tried. What cannot be compared gives no figure.
    """
    try:
        return tuple(_agreements(stage_path, image, facts, lab))
    except Lab3Error:
        return ()


def _agreements(stage_path: Path, image: Path, facts: MapFacts, lab: Lab) -> Iterator[Agreement]:
    from lab3_usd.stage.opening import open_stage  # noqa: PLC0415 - pxr, only when it is needed
    from lab3_usd.stage.slices import CutAt, slice_stage  # noqa: PLC0415

    robot = lab.scene["robot"]
    lidar_link = lab.scene["lidar"]["path"].rpartition("/")[0]
    cut = slice_stage(open_stage(stage_path), CutAt(robot["path"], lidar_link))
    if cut.robot is None or not cut.segments:
        return
    grid = read_pgm(image)
    start_x, start_y, _ = robot["pose"]["translate"]
    guesses = {"the world's": (0.0, 0.0), "the robot's start": (start_x, start_y)}
    for about, (x, y) in guesses.items():
        corner = (facts.origin_x + x, facts.origin_y + y)
        frame = MapFrame(facts.resolution, corner, facts.width, facts.height)
        drawn = draw_map(frame, cut.segments, cut.robot)
        yield Agreement(agreement(grid, drawn.grid), f"with the origin at {about}")
