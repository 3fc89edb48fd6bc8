"""`lab3 completion`: the script that lets a shell complete commands, options and files."""

from __future__ import annotations

import os
from typing import ClassVar

import click
from click.shell_completion import (
    CompletionItem,
    ShellComplete,
    add_completion_class,
    get_completion_class,
)

from lab3_usd.data import program

SHELLS = ("bash", "zsh", "fish", "powershell")


@add_completion_class
class PowerShellComplete(ShellComplete):
    """Completion in PowerShell, which completes file names itself if nothing is offered."""

    name: ClassVar[str] = "powershell"
    source_template: ClassVar[str] = """\
Register-ArgumentCompleter -Native -CommandName %(prog_name)s -ScriptBlock {
    param($word, $command, $position)
    $env:%(complete_var)s = "powershell_complete"
    $env:COMP_WORDS = ($command.CommandElements | ForEach-Object { $_.Extent.Text }) -join "`n"
    $env:COMP_WORD = $word
    try {
        %(prog_name)s | ForEach-Object {
            $value, $help = $_ -split "`t", 2
            [System.Management.Automation.CompletionResult]::new(
                $value, $value, "ParameterValue", $help)
        }
    }
    finally { Remove-Item Env:%(complete_var)s, Env:COMP_WORDS, Env:COMP_WORD }
}
"""

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one that is typed, and this one."""
        incomplete = os.environ.get("COMP_WORD", "")
        words = os.environ["COMP_WORDS"].split("\n")[1:]
        before = words[:-1] if incomplete else words
        return [word.strip("'\"") for word in before], incomplete

    def format_completion(self, item: CompletionItem) -> str:
        """Return a value and its description, which PowerShell requires."""
        return f"{item.value}\t{item.help or item.value}"

    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        """Leave out the markers that ask a shell to complete file names."""
        items = super().get_completions(args, incomplete)
        return [item for item in items if item.type == "plain"]


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the completion script of a shell.

    \b
    bash:  lab3 completion bash > ~/.local/share/bash-completion/completions/lab3
    zsh:   lab3 completion zsh > "${fpath[1]}/_lab3"
    fish:  lab3 completion fish > ~/.config/fish/completions/lab3.fish
    PowerShell, in $PROFILE:
           lab3 completion powershell | Out-String | Invoke-Expression
    """  # noqa: D301 - click reads \b as the character, it keeps the lines apart
    completion = get_completion_class(shell)
    if completion is None:
        raise click.UsageError(f"click knows no completion for {shell}")
    root = ctx.find_root()
    name = root.info_name or program()
    click.echo(completion(root.command, {}, name, f"_{name.upper()}_COMPLETE").source())
