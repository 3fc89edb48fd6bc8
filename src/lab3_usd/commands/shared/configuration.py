"""What a configuration file completes: rules, lab, starter, maps and assets of a call."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.commands.shared.options import all_of, recorded, split_rules
from lab3_usd.commands.shared.paths import Input
from lab3_usd.data import LAB_VARIABLE, program, variable_set
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.config.settings import Config
    from lab3_usd.model.finding import Severity


class ConfigOptions(Struct, frozen=True):
    """Which configuration is used, the named file, none, or the nearest, and what counts before it.

    That are the rules and families that are asked for, and the assets, as they were given.
    """

    config_file: str | None
    isolated: bool
    select: tuple[str, ...]
    ignore: tuple[str, ...]
    assets: tuple[str, ...]


config_file_options = all_of(
    click.option(
        "--config",
        "config_file",
        type=Input(),
        metavar="FILE",
        help="Use this configuration, not the nearest lab3.toml or pyproject.toml.",
    ),
    click.option("--isolated", is_flag=True, help="Use no configuration."),
)
config_options = all_of(config_file_options, recorded("configuration", ConfigOptions))


def configuration_of(paths: Iterable[str], config_file: str | None, *, isolated: bool) -> Config:
    """Return the configuration of a call: the file that is named, none, or the nearest.

    Raises:
        UsageError: it is wrong.
    """
    from lab3_usd.config.settings import Config, config_for, load_config

    if isolated:
        return Config()
    return config_for(paths) if config_file is None else load_config(Path(config_file))


def configured(paths: Iterable[str], given: ConfigOptions) -> Config:
    """Return the configuration of a call, with the rules of the command line where it has some.

    The lab and the assets that it names are used until the call ends.

    Raises:
        UsageError: the configuration is wrong, or names of rules are.
    """
    from lab3_usd.check.registry import own_rules_removed_on_exit

    click.get_current_context().with_resource(own_rules_removed_on_exit())
    config = configuration_of(paths, given.config_file, isolated=given.isolated)
    use_lab(config.lab)
    use_assets(given.assets, config.assets)
    return replace(
        config,
        select=split_rules(given.select) or config.select,
        ignore=split_rules(given.ignore) or config.ignore,
    )


force_exclude_option = click.option(
    "--force-exclude", is_flag=True, help="Pass over excluded files also where PATHS name them."
)


def unexcluded(paths: Iterable[str], config: Config) -> tuple[str, ...]:
    """Return what is named without the files that the configuration excludes."""
    return tuple(path for path in paths if Path(path).is_dir() or not config.excludes(Path(path)))


def path_text(path: Path | None) -> str | None:
    """Return a path as the command line has one."""
    return None if path is None else str(path)


own_rules_option = click.option(
    "--config",
    "config_file",
    type=Input(),
    help="Also the custom rules that this file names, and the severities that it sets.",
)


def use_own_rules(config_file: str | None) -> tuple[tuple[str, Severity], ...]:
    """Add, for this call, the rules of one's own that a configuration names.

    Returns:
        The severities that it sets, by rules and families.

    Raises:
        UsageError: the configuration is wrong.
    """
    if config_file is None:
        return ()
    from lab3_usd.check.registry import own_rules_removed_on_exit
    from lab3_usd.config.settings import load_config

    click.get_current_context().with_resource(own_rules_removed_on_exit())
    return load_config(Path(config_file)).severity


def use_config(path: Path, assets: Iterable[str]) -> Config:
    """Read the lab, and find the assets, that the configuration of a stage names, and return it.

    `assets` are those of the command line, which count first.

    Raises:
        UsageError: the configuration or an option is wrong.
    """
    from lab3_usd.config.settings import reading_for

    config = reading_for(path)
    use_lab(config.lab)
    use_assets(assets, config.assets)
    return config


def use_assets(given: Iterable[str], configured: Iterable[tuple[str, Path]] = ()) -> None:
    """Let addresses lead to folders for this call: `URL=FOLDER` each, and what is configured.

    Raises:
        UsageError: one is no address, or a folder is missing.
    """
    places = dict(configured) | asset_places(given)
    if places:
        from lab3_usd.stage.read.server_assets import assets_at

        click.get_current_context().with_resource(assets_at(places))


def asset_places(given: Iterable[str]) -> dict[str, Path]:
    """Return the folders of `URL=FOLDER` by their addresses.

    Raises:
        UsageError: one has no equals sign.
    """
    places: dict[str, Path] = {}
    for text in given:
        address, sign, folder = text.partition("=")
        if not sign:
            raise UsageError(f"--assets {text}: expected URL=FOLDER")
        places[address] = Path(folder)
    return places


def leave_broken_lab() -> None:
    """Leave aside, for this call, a lab of one's own that cannot be loaded: it is not needed."""
    from lab3_usd.errors import SpecError
    from lab3_usd.spec.load.loader import load_lab

    named = os.environ.get(LAB_VARIABLE)
    if not named:
        return
    try:
        load_lab()
    except SpecError as error:
        click.echo(f"{program()}: the lab {named} is left aside: {error}", err=True)
        click.get_current_context().with_resource(variable_set(LAB_VARIABLE, None))


def use_lab(folder: Path | None) -> None:
    """Name the lab's folder in the environment for this call, unless another is named."""
    if folder is not None and not os.environ.get(LAB_VARIABLE):
        named = variable_set(LAB_VARIABLE, str(folder.resolve()))
        click.get_current_context().with_resource(named)
