"""Builds checkpoint stages: the starter, plus what each part of the lab adds to it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.errors import Lab3Error, StageError, UsageError
from lab3_usd.spec.articulated import lab_of_root
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Checkpoint, Lab
from lab3_usd.stage.author import author_graph
from lab3_usd.stage.fitness import is_root_articulated, reasons_against
from lab3_usd.stage.inputs import inputs_of
from lab3_usd.stage.opening import open_stage, quiet
from lab3_usd.stage.rebase import copy_for
from lab3_usd.stage.sensors import author_sensor
from lab3_usd.stage.starter import starter_layer
from lab3_usd.stage.writing import export_layer, put_in_place

ENDINGS = {"usda": ".usda", "usdc": ".usd"}


class StarterError(Lab3Error):
    """A starter that cannot carry the lab; `reasons` says all of why, one line each."""

    def __init__(self, path: str, reasons: Sequence[str]) -> None:
        """Keep the reasons, in the order in which the lab meets them."""
        self.reasons = tuple(reasons)
        super().__init__(f"{path}: this starter cannot carry the lab")


class BuildOptions(Struct, frozen=True):
    """How to build: the text or the binary form, whose lidar, and whether to replace files."""

    form: str = "usda"
    lidar_asset: str | None = None
    force: bool = False


def build_checkpoint(starter: Path | str | None, checkpoint: str, target: Path | str) -> Path:
    """Build one checkpoint stage from a starter (None for the bundled one) and return its path.

    Raises:
        StarterError: the starter lacks what the lab needs, or holds it already.
        StageError: the starter cannot be opened, or the target not be written.
        UsageError: there is no such checkpoint, the target exists or is not named as a stage.
    """
    starter, target = None if starter is None else Path(starter), Path(target)
    lab = load_lab()
    if checkpoint not in lab.checkpoints:
        message = f"there is no checkpoint '{checkpoint}'; known are {', '.join(lab.checkpoints)}"
        raise UsageError(message)
    form = "usda" if target.suffix == ENDINGS["usda"] else "usdc"
    if target.suffix not in {*ENDINGS.values(), ".usdc"}:
        message = f"{target}: a stage ends in .usda (text), .usd or .usdc (binary)"
        raise UsageError(message)
    plan = {target: lab.checkpoints[checkpoint]}
    return build_files(lab, starter, plan, BuildOptions(form))[0]


def plan_files(lab: Lab, folder: Path, numbers: Sequence[str], form: str) -> dict[Path, Checkpoint]:
    """Name the file of each checkpoint in `folder`, as the handout does."""
    return {
        folder / f"{lab.checkpoints[number].file}{ENDINGS[form]}": lab.checkpoints[number]
        for number in numbers
    }


@quiet()
def build_files(
    lab: Lab, starter: Path | None, plan: dict[Path, Checkpoint], options: BuildOptions
) -> list[Path]:
    """Write every planned checkpoint, all or none.

    Raises:
        StarterError, StageError, UsageError: as `build_checkpoint`; nothing is written then.
    """
    stage = _open_starter(lab, starter)
    if is_root_articulated(lab, stage):
        lab = lab_of_root(lab)
    _check_targets(plan, stage, options)
    for target in plan:
        _make_folder(target.parent)
    written: dict[Path, Path] = {}
    try:
        for target, layer in _checkpoint_layers(lab, stage, plan, options):
            written[target] = export_layer(layer, target, options.form)
        put_in_place(written)
    finally:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)
    return list(plan)


def _open_starter(lab: Lab, starter: Path | None) -> Usd.Stage:
    """Open the starter and make sure that it can carry the lab."""
    if starter is None:
        stage = Usd.Stage.Open(starter_layer(lab.folder))
        name = "the bundled starter"
    else:
        stage = open_stage(starter)
        name = str(starter)
    reasons = reasons_against(lab, stage)
    if reasons:
        raise StarterError(name, reasons)
    return stage


def _check_targets(plan: dict[Path, Checkpoint], stage: Usd.Stage, options: BuildOptions) -> None:
    existing = [target for target in plan if os.path.lexists(target)]
    inputs = inputs_of(stage).files if existing else frozenset()
    for target in existing:
        if target.resolve() in inputs:
            message = f"{target}: is a file of the starter, which is never written; choose --out"
            raise UsageError(message)
        if target.is_dir():
            message = f"{target}: is a folder; choose another one for --out"
            raise UsageError(message)
        if not options.force:
            message = f"{target}: exists already; choose another folder or give --force"
            raise UsageError(message)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{folder}: cannot be made ({error.strerror})"
        raise StageError(message) from error


def _checkpoint_layers(
    lab: Lab, stage: Usd.Stage, plan: dict[Path, Checkpoint], options: BuildOptions
) -> Iterator[tuple[Path, Sdf.Layer]]:
    """Yield one growing layer at each planned checkpoint; each is written before it grows on."""
    wanted = {checkpoint.id: target for target, checkpoint in plan.items()}
    folder = next(iter(plan)).parent
    layer = copy_for(stage.GetRootLayer(), folder)
    for checkpoint in lab.checkpoints.values():
        _add(layer, lab, checkpoint, options)
        if checkpoint.id in wanted:
            yield wanted[checkpoint.id], layer


def _add(layer: Sdf.Layer, lab: Lab, checkpoint: Checkpoint, options: BuildOptions) -> None:
    with Sdf.ChangeBlock():
        for sensor in checkpoint.new_sensors:
            asset = options.lidar_asset if sensor == "lidar" else None
            author_sensor(layer, lab.scene[sensor], asset)
        for name in checkpoint.new:
            author_graph(layer, lab.graphs[name], lab.catalog)
