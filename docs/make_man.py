"""Writes a manual page for each command into a folder; `make man` calls it."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from click_man.core import write_man_pages

from lab3_usd.cli import lab3
from lab3_usd.data import PROGRAMS
from lab3_usd.report.options import tool_version


def write(folder: Path) -> None:
    """Write the pages; in the place of a date, which would differ, stands the version."""
    context = click.Context(lab3, info_name=PROGRAMS[0])
    names = lab3.list_commands(context)
    commands = {name: lab3.get_command(context, name) for name in names}
    whole = click.Group(PROGRAMS[0], {k: v for k, v in commands.items() if v}, help=lab3.help)
    folder.mkdir(parents=True, exist_ok=True)
    version = tool_version()
    write_man_pages(PROGRAMS[0], whole, version=version, target_dir=str(folder), date=version)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
