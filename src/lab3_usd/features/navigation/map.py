"""`lab3 map`: make an occupancy map from the walls of a stage."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.commands.shared.options import (
    FiniteRange,
    echo,
    recorded,
    write_into,
    written_folder,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab
    from lab3_usd.stage.lidar_plane import StageSlice

CELLS = click.IntRange(1, 10_000)
FARTHEST = 100_000.0  # metres; no laboratory is larger, and larger numbers lose centimetres


PLACE = FiniteRange(-FARTHEST, FARTHEST)


class MapOptions(Struct, frozen=True):
    """The part of the floor that is drawn, and where it is cut; None as the lab has it."""

    resolution: float | None
    origin: tuple[float, float] | None
    size: tuple[int, int] | None
    height: float | None
    start: tuple[float, float] | None


@click.command("map")
@click.argument("stage", type=Input(path_type=Path))
@written_folder("Folder for the map's YAML and image.")
@click.option("--resolution", type=FiniteRange(0.001, 100.0), metavar="M", help="Metres per cell.")
@click.option("--origin", type=(PLACE, PLACE), metavar="X Y", help="Lower left corner, metres.")
@click.option("--size", type=(CELLS, CELLS), metavar="W H", help="Cells across and up.")
@click.option(
    "--height", metavar="Z", type=PLACE, help="Height of the cut, metres; by default the lidar's."
)
@click.option(
    "--start", type=(PLACE, PLACE), metavar="X Y", help="A free position; by default the robot's."
)
@recorded("area", MapOptions)
def command(stage: Path, folder: Path, area: MapOptions, *, force: bool) -> None:
    """Make an occupancy map from the walls of a stage.

    Cuts the collision geometry of STAGE at the height of the lidar and fills the area that the
    robot can reach. By default the map has the frame and the values of the handout (4.2). The map
    frame is the world of the stage.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.deliverables.drawn_maps import MapFrame, draw_map
    from lab3_usd.deliverables.maps import map_yaml, pgm
    from lab3_usd.spec.load.loader import load_lab

    lab = load_lab()
    spec = lab.scene.map
    if spec is None:
        raise UsageError(f"{lab.title} has no map: its scene.yaml describes none")
    yaml_file, image_file = folder / spec.yaml, folder / spec.image
    width, height = area.size or (spec.width, spec.height)
    origin = area.origin or spec.origin[:2]
    frame = MapFrame(area.resolution or spec.resolution, origin, width, height)
    cut = _cut(stage, lab, area.height)
    start = area.start or cut.robot
    if start is None:
        raise UsageError(f"{stage}: has no {lab.scene.robot.path} to start from, give --start")
    drawn = draw_map(frame, cut.segments, start)
    if not drawn.closed:
        click.echo("warning: the free space reaches the edge of the map", err=True)
    described = replace(spec, resolution=frame.resolution, origin=(*frame.origin, spec.origin[2]))
    files = {yaml_file: map_yaml(described).encode(), image_file: pgm(drawn.grid)}
    write_into(folder, files, force=force)


def _cut(stage: Path, lab: Lab, height: float | None) -> StageSlice:
    """Slice the stage, and print what the map leaves out."""
    from lab3_usd.report.entries import plural
    from lab3_usd.stage.lidar_plane import SliceOptions, slice_stage
    from lab3_usd.stage.read.opening import open_stage

    robot = (lab.scene.robot_of(lab.lidar_link) or lab.scene.robot).path
    if height is None and not lab.lidar_link:
        raise UsageError(f"{lab.title} has no lidar to take the height from, give --height")
    cut = slice_stage(open_stage(stage), SliceOptions(robot, lab.lidar_link, height))
    if cut.missing:
        assets = plural(cut.missing, "missing asset")
        echo(f"warning: the map lacks the content of {assets}", err=True)
    for path in cut.not_cut:
        echo(f"warning: the map lacks {path}, a shape that cannot be cut", err=True)
    if not cut.segments:
        raise UsageError(
            f"{stage}: has nothing that collides at a height of {cut.height:g} m, give --height"
        )
    return cut
