"""`lab3 nav2`: write launch, parameter and RViz files for localization and navigation."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("nav2")
@click.option(
    "-o",
    "--out",
    "folder",
    required=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for the files.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
def command(folder: Path, *, force: bool) -> None:
    """Write launch, parameter and RViz files for localization and navigation.

    For ROS 2 Humble; one of the RViz configurations shows the lidar alone. The files have not been
    run in ROS. Files that exist are kept.
    """
    from lab3_usd.deliverables.scripts import nav2_files, write_nav2
    from lab3_usd.spec.load.loader import load_lab

    lab = load_lab()
    written, kept = write_nav2(folder, nav2_files(lab, lab.ros), force=force)
    for path in written:
        click.echo(path)
    for path in kept:
        click.echo(f"{path} exists and was kept, --force replaces it", err=True)
