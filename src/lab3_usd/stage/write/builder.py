"""Builds checkpoint stages: the starter, plus the additions of each part of the lab."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from msgspec import Struct
from pxr import Sdf, Tf, Usd, UsdUtils

from lab3_usd.errors import Lab3Error, NoRoomError, StageError, UsageError, unwritten
from lab3_usd.facts.frame_targets import NAME_OVERRIDE
from lab3_usd.files import make_folder, temporary_beside
from lab3_usd.model.changes import AddGraph
from lab3_usd.model.physics import MASS
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Checkpoint, Lab, articulated_at_roots
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.submission import example_of
from lab3_usd.stage.read.assets import layer_files
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.write.graphs import (
    author_graph,
    author_pose,
    author_sensor,
    define_parents,
    take_out,
)
from lab3_usd.stage.write.props import author_props
from lab3_usd.stage.write.starter import (
    robots_articulated_at_root,
    set_units,
    starter_layer,
    starter_problems,
)

_URI = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")
LIDAR = "lidar"
ENDINGS = {"usda": ".usda", "usdc": ".usd"}


class StarterError(Lab3Error):
    """The starter is not usable; `reasons` are one line each."""

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
        raise UsageError(
            f"there is no checkpoint '{checkpoint}'; known are {', '.join(lab.checkpoints)}"
        )
    form = "usda" if target.suffix == ENDINGS["usda"] else "usdc"
    if target.suffix not in {*ENDINGS.values(), ".usdc"}:
        raise UsageError(f"{target}: a stage ends in .usda (text), .usd or .usdc (binary)")
    plan = {target: lab.checkpoints[checkpoint]}
    return build_files(lab, starter, plan, BuildOptions(form))[0]


@quiet()
def checkpoint_layer(lab: Lab, starter: str | None, checkpoint: Checkpoint) -> Sdf.Layer:
    """Return a checkpoint in memory as it is built from a starter, None for the bundled one.

    Raises:
        StarterError: the starter lacks what the lab needs, or holds it already.
        StageError: the starter cannot be opened.
    """
    stage = _open_starter(lab, None if starter is None else Path(starter))
    lab = articulated_at_roots(lab, robots_articulated_at_root(lab, stage))
    return _layer_of(lab, stage, checkpoint)


@quiet()
def described_layer(lab: Lab, checkpoint: Checkpoint) -> Sdf.Layer:
    """Return a checkpoint in memory as a lab alone describes it, without the starter scene.

    It has the sensors and graphs, and overs with the poses of robots and the masses of links.
    """
    stage = Usd.Stage.CreateInMemory()
    set_units(stage, lab.scene.stage)
    for robot in lab.scene.robots:
        root = Sdf.CreatePrimInLayer(stage.GetRootLayer(), robot.path)
        if robot.pose is not None:
            author_pose(root, robot.pose, lab.scene.stage.meters_per_unit)
        for name, link in robot.links.items():
            if link.mass is not None:
                over = Sdf.CreatePrimInLayer(stage.GetRootLayer(), robot.path_of(name))
                Sdf.AttributeSpec(over, MASS, Sdf.ValueTypeNames.Float).default = link.mass
    return _layer_of(lab, stage, checkpoint)


def _layer_of(lab: Lab, stage: Usd.Stage, checkpoint: Checkpoint) -> Sdf.Layer:
    """Return the layer of one checkpoint, which would grow on to later ones."""
    plan = {Path(f"{example_of(checkpoint.file, lab.team)}.usda"): checkpoint}
    _, layer = next(_checkpoint_layers(lab, stage, plan, BuildOptions()))
    return layer


def plan_files(lab: Lab, folder: Path, numbers: Sequence[str], form: str) -> dict[Path, Checkpoint]:
    """Name the file of each checkpoint in `folder`, as the handout does."""
    checkpoints = (lab.checkpoints[number] for number in numbers)
    return {
        folder / f"{example_of(each.file, lab.team)}{ENDINGS[form]}": each for each in checkpoints
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
    lab = articulated_at_roots(lab, robots_articulated_at_root(lab, stage))
    _check_targets(plan, stage, options)
    for target in plan:
        make_folder(target.parent)
    written: dict[Path, Path] = {}
    try:
        for target, layer in _checkpoint_layers(lab, stage, plan, options):
            written[target] = export_layer(layer, target, options.form)
        _put_in_place(written)
    finally:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)
    return list(plan)


def _open_starter(lab: Lab, starter: Path | None) -> Usd.Stage:
    """Open the starter and make sure that it is usable."""
    if starter is None:
        stage = Usd.Stage.Open(starter_layer(lab.folder))
        name = "the lab's starter"
    else:
        stage = open_stage(starter)
        name = str(starter)
    reasons = starter_problems(lab, stage)
    if reasons:
        raise StarterError(name, reasons)
    return stage


def _check_targets(plan: dict[Path, Checkpoint], stage: Usd.Stage, options: BuildOptions) -> None:
    existing = [target for target in plan if os.path.lexists(target)]
    inputs = layer_files(stage).files if existing else frozenset()
    for target in existing:
        if target.resolve() in inputs:
            raise UsageError(
                f"{target}: is a file of the starter, which is never written; choose --output"
            )
        if target.is_dir():
            raise UsageError(f"{target}: is a folder; choose another one for --output")
        if not options.force:
            raise UsageError(f"{target}: exists already; choose another folder or give --force")


def _checkpoint_layers(
    lab: Lab, stage: Usd.Stage, plan: dict[Path, Checkpoint], options: BuildOptions
) -> Iterator[tuple[Path, Sdf.Layer]]:
    """Yield one growing layer at each planned checkpoint; each is written before it grows on."""
    targets = {checkpoint.id: target for target, checkpoint in plan.items()}
    folder = next(iter(plan)).parent
    growing = _copy_for(stage.GetRootLayer(), folder)
    before: Mapping[str, GraphSpec] = {}
    props: Mapping[str, PropSpec] = {}
    for checkpoint in lab.checkpoints.values():
        layer = growing
        if checkpoint.optional:  # nothing grows on it
            if checkpoint.id not in targets:
                continue
            layer = Sdf.Layer.CreateAnonymous(".usda")
            layer.TransferContent(growing)
        for path in checkpoint.removed:
            _remove(layer, stage, path)
        with Sdf.ChangeBlock():
            for sensor in checkpoint.new_sensors:
                spec = lab.sensors[sensor]
                asset = options.lidar_asset if spec.kind == LIDAR else None
                author_sensor(layer, spec, lab.scene.stage.meters_per_unit, asset)
                _author_names(layer, lab, spec.path)
            graphs = lab.at(checkpoint.id).graphs
            for name in checkpoint.graphs:
                if name not in checkpoint.new and graphs[name] == before.get(name):
                    continue
                path = graphs[name].path
                define_parents(layer, stage, path)
                former = layer.GetPrimAtPath(path)
                if name not in checkpoint.new and former is not None:
                    take_out(former)
                author_graph(layer, AddGraph.of(graphs[name].graph), lab.platform)
                _author_names(layer, lab, path)
        author_props(layer, lab, checkpoint, props)
        if not checkpoint.optional:
            before, props = graphs, lab.props_at(checkpoint)
        if checkpoint.id in targets:
            yield targets.pop(checkpoint.id), layer
            if not targets:
                return


def _remove(layer: Sdf.Layer, stage: Usd.Stage, path: str) -> None:
    """Take a prim out of a stage: switch it off where another layer than the starter has it."""
    spec, prim = layer.GetPrimAtPath(path), stage.GetPrimAtPath(path)
    own = stage.GetRootLayer()
    if prim and any(each.layer != own for each in prim.GetPrimStack()):
        Sdf.CreatePrimInLayer(layer, path).active = False
    elif spec is not None:
        take_out(spec)


def _author_names(layer: Sdf.Layer, lab: Lab, path: str) -> None:
    """Write what the lab calls the frame of a prim, and the namespace that it gives to topics."""
    attribute = lab.platform.ros.namespace_attribute
    for name, given in ((NAME_OVERRIDE, lab.frames.names), (attribute, lab.scene.namespaces)):
        if path in given:
            prim = layer.GetPrimAtPath(path)
            Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.String).default = given[path]


def _copy_for(source: Sdf.Layer, folder: Path) -> Sdf.Layer:
    """Return an anonymous copy of `source` whose relative asset paths start from `folder`.

    Addresses (`https:`, `omniverse:`) and absolute paths stay as they are. Nothing is flattened:
    the layers referred to are not touched.
    """
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.TransferContent(source)
    # usd-core drops `..` from paths as written, without following links; so does this.
    start = Path(os.path.abspath(folder))  # noqa: PTH100 - Path.resolve() follows links
    if source.realPath and (
        Path(source.realPath).parent != start or source.GetFileFormat().IsPackage()
    ):
        UsdUtils.ModifyAssetPaths(copy, lambda path: _from_folder(path, source, start))
    return copy


def _from_folder(path: str, source: Sdf.Layer, folder: Path) -> str:
    if not path or _URI.match(path) or path.startswith("/"):
        return path
    absolute = Sdf.ComputeAssetPathRelativeToLayer(source, path)
    if not absolute.startswith("/"):
        return path  # a search path that only the application's own resolver knows
    relative = os.path.relpath(absolute, folder)
    return relative if relative.startswith("..") else f"./{relative}"


def export_layer(layer: Sdf.Layer, target: Path, form: str) -> Path:
    """Write `layer` beside `target` as `form` (`usda` or `usdc`) and return the temporary file.

    Raises:
        StageError: the folder cannot be written to, or the disk is full.
    """
    try:
        temporary = temporary_beside(target, ".usd")
    except OSError as error:
        raise unwritten(target, error, StageError) from error
    try:
        written = layer.Export(str(temporary), "", {"format": form})
    except Tf.ErrorException:
        written = False
    if not written:
        temporary.unlink(missing_ok=True)
        if shutil.disk_usage(target.parent).free < len(layer.ExportToString()):
            raise NoRoomError(f"{target} cannot be written: the disk is full")
        raise StageError(f"{target}: cannot be written")
    return temporary


def _put_in_place(files: Mapping[Path, Path]) -> None:
    """Rename each temporary file to its target.

    Raises:
        StageError: a target cannot be replaced; new files that came before it are gone again.
    """
    made: list[Path] = []
    for target, temporary in files.items():
        is_new = not target.exists()
        try:
            temporary.replace(target)
        except OSError as error:
            for path in made:
                path.unlink(missing_ok=True)
            raise unwritten(target, error, StageError) from error
        if is_new:
            made.append(target)
