"""`lab3 server`: a language server for editors."""

from __future__ import annotations

import sys

import click

from lab3_usd.commands.shared.options import isaac_option
from lab3_usd.errors import UsageError
from lab3_usd.installation import install_command


@click.command("server")
@isaac_option
def command(release: str | None) -> None:
    """Serve an editor: findings as you type, manuals, repairs, and the ends of wires.

    The editor starts this command and speaks the Language Server Protocol with it over standard
    input and output (docs/editor.md has the settings). Nothing of a stage is run, and nothing is
    written but what you accept.
    """
    from lab3_usd.pipeline.any_stage import lint_platform

    if release:
        lint_platform(release)  # which refuses an unknown one
    try:
        from lab3_usd.server.protocol import make_server
    except ImportError as error:
        raise UsageError(
            f"lab3 server needs the extra editor: {install_command('editor')}"
        ) from error
    from lab3_usd.report.options import tool_version

    # The server closes what it writes to when the editor is done; the program's own stays open.
    with open(sys.stdout.fileno(), "wb", closefd=False) as output:
        make_server(tool_version(), release or "").start_io(stdout=output)
