"""`lab3 nav2`: write launch, parameter and RViz files for localization and navigation."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, write_into, written_folder


@click.command("nav2")
@written_folder("Folder for the files.")
def command(folder: Path, *, force: bool) -> None:
    """Write launch, parameter and RViz files for localization and navigation.

    For ROS 2 Humble; one of the RViz configurations shows the lidar alone. The files have not been
    run in ROS. Files that exist are kept.
    """
    from lab3_usd.deliverables.nav2_templates import nav2_files
    from lab3_usd.spec.load.loader import load_lab

    lab = load_lab()
    files = {folder / name: text.encode() for name, text in nav2_files(lab, lab.ros).items()}
    kept = [path for path in files if path.exists() and not force]
    new = {path: content for path, content in files.items() if path not in kept}
    write_into(folder, new, force=force)
    for path in kept:
        echo(f"{path} exists and was kept, --force replaces it", err=True)
