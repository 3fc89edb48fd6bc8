"""Completes the options of a command by what a configuration file says."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.steps.options import all_of, split_rules
from lab3_usd.data import LAB_VARIABLE

config_options = all_of(
    click.option(
        "--config",
        "config_file",
        type=click.Path(),
        metavar="FILE",
        help="Use this configuration, not the nearest lab3.toml or pyproject.toml.",
    ),
    click.option("--isolated", is_flag=True, help="Use no configuration."),
)


def with_config(paths: Iterable[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options, those that were not given as the configuration has them.

    Raises:
        UsageError: the configuration is wrong, or names of rules are.
    """
    from lab3_usd.config.config import Config, config_for, load_config  # noqa: PLC0415 - fast --help

    if options["isolated"]:
        config = Config()
    elif options["config_file"] is not None:
        config = load_config(Path(options["config_file"]))
    else:
        config = config_for(paths)
    use_lab(config.lab)
    return {
        **options,
        "config": config,
        "select": split_rules(options["select"]) or config.select,
        "ignore": split_rules(options["ignore"]) or config.ignore,
        "starter": options.get("starter") or _text(config.starter),
        "maps": options.get("maps") or _text(config.maps),
    }


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)


def use_configured_lab(path: Path) -> None:
    """Read the lab that the configuration of a stage names.

    Raises:
        UsageError: the configuration is wrong.
    """
    from lab3_usd.config.config import config_for  # noqa: PLC0415 - keeps --help fast

    use_lab(config_for([str(path)]).lab)


def use_lab(folder: Path | None) -> None:
    """Name the lab's folder in the environment for this call, where nobody has named another."""
    if folder is None or os.environ.get(LAB_VARIABLE):
        return
    os.environ[LAB_VARIABLE] = str(folder.resolve())
    context = click.get_current_context(silent=True)
    if context is not None:
        context.call_on_close(lambda: os.environ.pop(LAB_VARIABLE, None))
