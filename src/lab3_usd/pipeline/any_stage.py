"""Reads any stage or script, by the platform of a release of Isaac Sim."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameters
from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError, UsageError
from lab3_usd.files import is_script_file
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_platform

AUTO = "auto"


def lint_platform(release: str = BASE) -> Platform:
    """Return a release of Isaac Sim, with the node types that the lab adds.

    A stage of no lab needs none: a lab that cannot be loaded adds nothing.

    Raises:
        UsageError: the release is not known.
    """
    try:
        return _in_release(load_platform(), release)
    except SpecError:
        return _in_release(load_platform(data_folder("graphs")), release)


def lab_in_release(lab: Lab, release: str, checkpoint: str | None = None) -> Lab:
    """Return a lab beside another release of Isaac Sim, for stages that it does not judge.

    Raises:
        UsageError: the release is not known, or the stage is one of a checkpoint.
    """
    if checkpoint:
        raise UsageError(f"--isaac {release}: at checkpoint {checkpoint} the lab names the release")
    return replace(lab, platform=lint_platform(release))


@lru_cache(maxsize=8)
def _in_release(platform: Platform, release: str) -> Platform:
    releases = platform.known_releases
    parts = release.split(".")
    is_patch = len(parts) > _PARTS and all(part.isdecimal() for part in parts)
    name = ".".join(parts[:_PARTS]) if is_patch else release
    if name not in releases:
        raise UsageError(f"there is no Isaac Sim '{release}' here; known are {', '.join(releases)}")
    return platform.in_release(name)


_PARTS = 2  # of the name of a release; what follows counts repairs of it: 6.0.1, 2023.1.1


def scene_at(path: str, platform: Platform) -> StageModel | None:
    """Read the stage that scripts load.

    Raises:
        StageError: it cannot be opened.
    """
    if not path:
        return None
    from lab3_usd.stage.read.stage_reader import read_stage

    return read_stage(Path(path), platform)


def lint_subject(
    model: StageModel, moved_from: str = "", parameters: Parameters = ()
) -> LintSubject:
    """Return a stage as it is judged, beside the release that it comes from.

    Raises:
        UsageError: the release is not known.
    """
    if moved_from != AUTO:
        origin = lint_platform(moved_from) if moved_from else None
        return LintSubject(model, origin, parameters=parameters)
    from lab3_usd.facts.saved_releases import saved_by

    saved = saved_by(model)
    origin = model.platform if saved is None else lint_platform(saved.release)
    return LintSubject(model, origin, is_guessed=True, parameters=parameters)


def read_any(path: Path, platform: Platform, scene: str = "") -> StageModel:
    """Read a stage, or the one that a script leaves, over the `scene` that it loads.

    Raises:
        StageError: the file cannot be opened, or builds no graph.
        UsageError: a stage is given a scene, or the release is not known.
    """
    if is_script_file(path):
        from lab3_usd.pipeline.script_results import joined_stage

        return joined_stage(path, platform, scene_at(scene, platform))
    if scene:
        raise UsageError(f"--stage is for scripts, and {path} is none")
    from lab3_usd.stage.read.stage_reader import read_stage

    return read_stage(path, platform)
