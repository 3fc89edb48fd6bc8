"""`lab3 completion`: the script that lets a shell complete commands, options and files."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from lab3_usd.data import program

SHELLS = ("bash", "zsh", "fish")


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the completion script of a shell.

    \b
    bash:  lab3 completion bash > ~/.local/share/bash-completion/completions/lab3
    zsh:   lab3 completion zsh > "${fpath[1]}/_lab3"
    fish:  lab3 completion fish > ~/.config/fish/completions/lab3.fish
    """  # noqa: D301 - click reads \b as the character, it keeps the lines apart
    completion = get_completion_class(shell)
    if completion is None:
        raise click.UsageError(f"click knows no completion for {shell}")
    root = ctx.find_root()
    name = root.info_name or program()
    click.echo(completion(root.command, {}, name, f"_{name.upper()}_COMPLETE").source())
