"""`lab3 config`: the effective configuration, and its sources."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.shared.configuration import config_file_options, configuration_of
from lab3_usd.commands.shared.paths import Input
from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UsageError

_DEFAULTS = {
    "rules": "no custom rules",
    "select": "all rules",
    "ignore": "no rules",
    "per-file-ignores": "none",
    "severity": "as in each rule",
    "parameters": "as in each rule",
    "checkpoints": "from file names",
    "starter": "none",
    "maps": "none",
    "lab": "the bundled one",
    "assets": "where usd-core finds them",
    "exclude": "nothing",
    "extend-exclude": "nothing",
}


@click.command("config")
@click.argument("path", default=".", type=Input(path_type=Path))
@config_file_options
def command(path: Path, config_file: str | None, *, isolated: bool) -> None:
    """Print the configuration with which PATH is checked, and the source of each value.

    It is the nearest .lab3.toml, lab3.toml, or pyproject.toml with a table [tool.lab3], in the
    folder of PATH or above it.
    """
    if not path.exists():
        raise UsageError(f"{path}: there is no such file or folder")
    config = configuration_of([str(path)], config_file, isolated=isolated)
    click.echo(f"configuration: {config.file or 'none'}")
    for key, default in _DEFAULTS.items():
        text, source = default, "(default)"
        value = getattr(config, key.replace("-", "_"))
        if key == "parameters":
            value = tuple((".".join(name), f"{number:g}") for name, number in config.parameters)
        if key == "lab" and os.environ.get(LAB_VARIABLE):
            text, source = os.environ[LAB_VARIABLE], "(--lab or LAB3_LAB)"
        elif value:
            text, source = _shown(value), f"({config.file})"
        click.echo(f"{key:<17} {text:<32} {source}".rstrip())


def _shown(value: Any) -> str:
    if not isinstance(value, tuple):
        return str(value)
    return ", ".join(
        item if isinstance(item, str) else f"{item[0]}: {_shown(item[1])}" for item in value
    )
