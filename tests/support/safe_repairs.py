"""What a safe repair made worse, of any stage: new errors, or what the dry run shows no more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agreement_stages import Subject
from breaking import the_lab

from lab3_usd.errors import StageError
from lab3_usd.fix.repairing import Fixed, FixOptions, fix_linted, fix_stage
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import site_of
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.sim.effects import effects_of
from lab3_usd.stage.read.opening import open_stage


def worsened(subject: Subject, folder: Path, release: str = BASE) -> list[str]:
    """Say what is worse after the safe repairs of a stage, which are written into a copy."""
    path = subject.make if isinstance(subject.make, Path) else _saved(subject.make(), folder)
    ways = [lambda: fix_linted(path, release, FixOptions())]
    if subject.checkpoint:
        ways.append(lambda: fix_stage(path, subject.checkpoint, the_lab(), FixOptions()))
    return [text for fix in ways for text in _worse(path, fix, folder, release)]


def _saved(stage: Any, folder: Path) -> Path:
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    return path


def _worse(path: Path, fix: Any, folder: Path, release: str) -> list[str]:
    try:
        fixed: Fixed = fix()
    except StageError:  # no stage, or a package
        return []
    if fixed.files.keys() != {path}:
        return []
    known = {site_of(finding) for finding in fixed.before if finding.severity == "error"}
    after = [finding for finding in fixed.after if finding.severity == "error"]
    new = [f"{each.rule} {each.prim}" for each in after if site_of(each) not in known]
    worse = [", ".join(new)] if len(after) > len(known) else []
    repaired = folder / f"repaired{path.suffix}"
    repaired.write_bytes(fixed.files[path])
    platform = lint_platform(release)
    before, now = (effects_of(open_stage(each), platform) for each in (path, repaired))
    return [*worse, *sorted(before - now)]
