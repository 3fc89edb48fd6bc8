"""Loads the platform and the lab: everything that `graphs/` says, checked once, then frozen."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from lab3_usd.data import data_folder, own_lab, own_team, program
from lab3_usd.errors import SpecError, UnknownTeamError
from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.load.compiled import PLATFORM, compiled_or_loaded

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab


def load_lab(folder: Path | None = None, team: str = "") -> Lab:
    """Load the lab described by the YAML files of `folder`.

    By default it is the folder that the environment variable `LAB3_LAB` names, else the bundled
    one. Values by team are those of `team`, by default the one that `LAB3_TEAM` names.

    Raises:
        SpecError: a file is missing or wrong; the line names file, graph, role and port.
    """
    folder = folder or own_lab()
    if folder is None:
        return _bundled(data_folder("graphs"))
    lab, team = _load(folder), team or own_team()
    return _load(folder, team) if lab.by_team and team else lab


def lab_of_team(lab: Lab, names: Iterable[tuple[str, str]]) -> Lab:
    """Return a lab with the values of the team that names of stages say, else the environment.

    `names` are those of the files, each with its checkpoint. A lab that was loaded for a team, or
    where all teams have the same values, is returned as it is.

    Raises:
        UnknownTeamError: no name says the team, or the lab has no values for it.
    """
    from lab3_usd.spec.submission import example_of, team_of

    given = [(PurePath(name).stem, lab.files[checkpoint]) for name, checkpoint in names]
    if not lab.by_team or lab.team or not given:
        return lab
    team = next((team for stem, file in given if (team := team_of(stem, file))), own_team())
    if not team:
        stem, file = given[0]
        by_folder = ", for grades also a folder called team_7"
        said = "" if example_of(file) == file else f", as {example_of(file)} does"
        raise UnknownTeamError(
            f"{stem}: names no team{said}; {program()} --team N says it{by_folder * (not said)}"
        )
    try:
        return load_lab(lab.folder, team)
    except SpecError as error:
        raise UnknownTeamError(f"there are no values for the team {team}: {error}") from error


def load_platform(folder: Path | None = None) -> Platform:
    """Load Isaac Sim with the node types that the lab of `folder` adds, and nothing else of it.

    By default it is the folder that the environment variable `LAB3_LAB` names, else the bundled
    one.

    Raises:
        SpecError: the lab's file of node types is wrong; the line names file, type and port.
    """
    bundled = data_folder("graphs")
    folder = folder or own_lab() or bundled
    return _bundled(bundled).platform if folder == bundled else _own_platform(folder)


@lru_cache(maxsize=1)
def _bundled(folder: Path) -> Lab:
    return compiled_or_loaded(folder, _load)


@lru_cache(maxsize=4)
def _own_platform(folder: Path) -> Platform:
    return _platform_of(folder)


def _platform_of(folder: Path) -> Platform:
    """Return the platform of a folder: its own, or the bundled one with the types of the lab."""
    from lab3_usd.spec.lab import CATALOG

    own, system = folder / CATALOG, folder / PLATFORM
    bundled = data_folder("graphs")
    release = _release_of(folder) if folder != bundled else ""
    if not own.exists() and not system.is_dir():
        platform = _bundled(bundled).platform
        return _in_release(platform, release)
    from lab3_usd.isaac.load.lab_types import with_lab_types
    from lab3_usd.isaac.load.platform import assemble_platform
    from lab3_usd.yaml_file import read_yaml

    base = assemble_platform(system) if system.is_dir() else _bundled(bundled).platform
    types = read_yaml(own if own.exists() else bundled / CATALOG)
    return with_lab_types(_in_release(base, release), types, CATALOG)


def _release_of(folder: Path) -> str:
    """Return the release that a lab is for, '' where it names none; it is read in full later."""
    from lab3_usd.spec.lab import CHECKPOINTS
    from lab3_usd.yaml_file import read_yaml

    if not (folder / CHECKPOINTS).is_file():
        return ""
    release = read_yaml(folder / CHECKPOINTS).get("isaac", "")
    return release if isinstance(release, str) else ""


def _in_release(platform: Platform, release: str) -> Platform:
    if release and release not in platform.known_releases:
        from lab3_usd.spec.lab import CHECKPOINTS

        releases = ", ".join(platform.known_releases)
        wrong = f"'{release}' is not a release of Isaac Sim; known are {releases}"
        raise SpecError(f"{CHECKPOINTS}: isaac: {wrong}")
    return platform.in_release(release) if release else platform


def assemble(folder: Path, team: str = "") -> Lab:
    """Read the lab of `folder` for a team, without holding its files against each other.

    Raises:
        SpecError: a file is missing or wrong; the line ends with its place in the file.
    """
    from lab3_usd.spec.load.lab import assemble_lab, refuse_no_lab
    from lab3_usd.spec.positions import located

    refuse_no_lab(folder)
    try:
        return assemble_lab(folder, _platform_of(folder), team)
    except SpecError as error:
        raise located(error, folder) from error


@lru_cache(maxsize=16)
def _load(folder: Path, team: str = "") -> Lab:
    from lab3_usd.spec.contradictions.references import refuse_faulty

    lab = assemble(folder, team)
    refuse_faulty(lab)
    return lab
