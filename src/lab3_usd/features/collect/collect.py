"""`lab3 collect`: write the script that collects evidence from the running system."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, written_file


@click.command("collect")
@written_file("script", "Where to write the script.")
def command(script: Path, *, force: bool) -> None:
    """Write the script that collects evidence from the running system.

    Run it with bash beside Isaac Sim, in the submission folder: it saves the output of every
    diagnostic command of the handout in the folder (`results` in the bundled lab) where `lab3
    check` reads it.
    """
    from lab3_usd.errors import UsageError
    from lab3_usd.features.collect.script import collect_script
    from lab3_usd.files import make_folder, write_whole
    from lab3_usd.spec.load.loader import load_lab

    lab = load_lab()
    if not lab.ros.commands:
        raise UsageError(f"{lab.title} asks for no output of ROS commands")
    make_folder(script.parent)
    write_whole(script, collect_script(lab).encode(), force=force)
    script.chmod(0o755)
    echo(script)
