"""`lab3 nav2`: write launch, parameter and RViz files for localization and navigation."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, written_folder
from lab3_usd.commands.shared.paths import refuse_inputs


@click.command("nav2")
@written_folder("Folder for the files.")
def command(folder: Path, *, force: bool) -> None:
    """Write launch, parameter and RViz files for localization and navigation.

    For ROS 2 Humble; one of the RViz configurations shows the lidar alone. The files have not been
    run in ROS. Files that exist are kept.
    """
    from lab3_usd.deliverables.nav2_templates import nav2_files, write_nav2
    from lab3_usd.files import make_folder
    from lab3_usd.spec.load.loader import load_lab

    lab = load_lab()
    files = nav2_files(lab, lab.ros)
    refuse_inputs(folder / name for name in files)
    make_folder(folder)
    written, kept = write_nav2(folder, files, force=force)
    for path in written:
        echo(path)
    for path in kept:
        echo(f"{path} exists and was kept, --force replaces it", err=True)
