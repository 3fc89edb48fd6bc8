"""A complete, correct submission, made from the builders, the maps, and what the commands print."""

from __future__ import annotations

import atexit
import shutil
from collections.abc import Callable, Iterator
from functools import cache, lru_cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from unittest.mock import patch

from made_once import copy_of
from msgspec.structs import replace
from pxr import Sdf, Usd
from ros_outputs import good_outputs

from lab3_usd.data import data_folder
from lab3_usd.deliverables.evidence import saved_outputs as evidence_reader
from lab3_usd.deliverables.maps import map_subject, opens_all
from lab3_usd.deliverables.nav2_parameters import read_params
from lab3_usd.deliverables.nav2_templates import nav2_files
from lab3_usd.model.finding import StageResult
from lab3_usd.model.folder import Agreement, Listing, MapSubject, NavigationSubject
from lab3_usd.pipeline import deliverables as folder_checks
from lab3_usd.pipeline import folder as pipeline_folder
from lab3_usd.pipeline.folder import FolderResult, check_folder, find_starters
from lab3_usd.pipeline.stage import JudgeSettings, check_stage, judge_stage
from lab3_usd.pipeline.starter_comparison import Starter, against_starter, open_starter
from lab3_usd.spec.lab import FrameSpec, Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.ros import MapFacts, RosSpec
from lab3_usd.stage.read.opening import kept_open
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files
from lab3_usd.stage.write.starter import build_starter

LAB = load_lab()
ROS = load_lab().ros
SPEC = load_lab().submission
STARTER = f"assets/{SPEC.stages.starter}.usda"
ROBOT = LAB.scene.robot.path
# A pixel: what counts is that there is a picture.
PICTURE = b"\x89PNG\r\n\x1a\n"
# Notes that a submission without a fault has: how map and walls agree, and stamps after Stop.
ALWAYS = {"M09", "P09"}

WALL_AGREEMENTS, FACTS = folder_checks._wall_agreements, evidence_reader._facts

Fault = Callable[[Path], None]


def stage_name(number: str, ending: str = ".usda") -> str:
    return f"work/{LAB.checkpoints[number].file}{ending}"


def diagnostics() -> dict[str, str]:
    """Return what every diagnostic command prints, by the name of its file."""
    outputs = good_outputs()
    files = {}
    for command in ROS.commands:
        fitting = [text for words, text in outputs.items() if command.line.startswith(words)]
        files[command.file] = fitting[-1]
    return files


def write_submission(folder: Path) -> Path:
    """Write the whole submission, and return its folder."""
    shutil.copytree(_template(), folder, dirs_exist_ok=True)
    return folder


@cache
def _template() -> Path:
    folder = Path(mkdtemp(prefix="submission"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name in ("assets", "work", "maps", "logs", "results", "images", "config"):
        (folder / name).mkdir()
    build_starter(folder / STARTER)
    plan = plan_files(LAB, folder / "work", list(LAB.checkpoints), "usda")
    build_files(LAB, folder / STARTER, plan, BuildOptions())
    for path in data_folder("maps").iterdir():
        shutil.copy(path, folder / "maps")
    for name, text in diagnostics().items():
        (folder / "results" / name).write_text(text)
    for name, text in nav2_files(LAB, ROS).items():
        (folder / "config" / name).write_text(text)
    for number in range(11):
        (folder / "images" / f"{number:02}.png").write_bytes(PICTURE)
    (folder / "report.pdf").write_bytes(b"%PDF-1.7\n")
    (folder / "video.txt").write_text("https://youtu.be/dQw4w9WgXcQ\n")
    return folder


def checked(folder: Path, **settings: object) -> FolderResult:
    """Judge a folder with its stages kept open, as commands do.

    A file that is as it was built is judged once for all folders.
    """
    _is_as_built.cache_clear()
    with (
        kept_open(),
        patch.multiple(
            pipeline_folder,
            find_starters=_find_once,
            judge_stage=_judge_once,
        ),
        patch.multiple(
            folder_checks,
            _wall_agreements=_agree_once,
            map_subject=_map_once,
            read_params=_read_once,
        ),
        patch.object(evidence_reader, "_facts", _facts_once),
    ):
        return check_folder(folder, JudgeSettings(**settings))  # type: ignore[arg-type]


def _find_once(folder: Path, listing: Listing, supplied: Path | Starter | None, lab: Lab) -> object:
    is_built = listing.starter == STARTER and _is_as_built(folder / STARTER, STARTER)
    if supplied is not None or not is_built:
        return find_starters(folder, listing, supplied, lab)
    return _built_starters(listing.starter)


def _judge_once(path: str, settings: JudgeSettings, at: tuple[Lab, str]) -> StageResult:
    starter, number = settings.starter, at[1]
    if not _is_as_built(Path(path), stage_name(number)) or settings.native:
        return judge_stage(path, settings, at)
    if starter is None:
        return replace(_built_result(number), path=path)
    if isinstance(starter, Path) or starter.faults or not _is_as_built(starter.path, STARTER):
        return judge_stage(path, settings, at)
    return replace(_built_beside_starter(number), path=path)


def _agree_once(stage: Path, image: Path, facts: MapFacts, lab: Lab) -> tuple[Agreement, ...]:
    numbers = [
        checkpoint for checkpoint in LAB.checkpoints if _is_as_built(stage, stage_name(checkpoint))
    ]
    if not numbers or not _is_as_built(image, f"maps/{image.name}"):
        return tuple(WALL_AGREEMENTS(stage, image, facts, lab))
    return _built_agreements(numbers[0], image.name, facts)


def _map_once(
    path: Path | None,
    facts: MapFacts,
    root: Path | None = None,
    may_open: Callable[[str], str] = opens_all,
) -> MapSubject:
    if path is None or root is None or may_open is not opens_all:
        return map_subject(path, facts, root, may_open)
    files = [f"maps/{name}" for name in (path.name, Path(facts.image).name)]
    if path != root / files[0] or not all(_is_as_built(root / file, file) for file in files):
        return map_subject(path, facts, root, may_open)
    return _built_map(path.name, facts)


def _facts_once(text: str, name: str, ros: RosSpec, *, ran: bool) -> Iterator[Any]:
    """Yield what a text shows; whatever else is in a folder, most of its texts are the same."""
    if ros is not LAB.ros:
        return FACTS(text, name, ros, ran=ran)
    return iter(_facts(text, name, ran))


@lru_cache(maxsize=256)
def _facts(text: str, name: str, ran: bool) -> tuple[Any, ...]:  # noqa: FBT001 - part of a key
    return tuple(FACTS(text, name, LAB.ros, ran=ran))


def _read_once(path: Path, ros: RosSpec, frames: FrameSpec, root: Path) -> NavigationSubject:
    if not _is_as_built(path, f"config/{path.name}"):
        return read_params(path, ros, frames, root)
    return replace(_built_params(path.name), file=path.relative_to(root).as_posix())


@cache
def _is_as_built(path: Path, name: str) -> bool:
    return path.is_file() and path.read_bytes() == _built_files().get(name)


@cache
def _built_files() -> dict[str, bytes]:
    folder = _template()
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@cache
def _built_starters(starter: str) -> object:
    return find_starters(_template(), Listing((), starter=starter), None, LAB)


@cache
def _built_result(number: str) -> StageResult:
    return check_stage(_template() / stage_name(number), number, LAB)


@cache
def _built_beside_starter(number: str) -> StageResult:
    starter = open_starter(_template() / STARTER, LAB)
    assert not starter.faults
    return against_starter(_built_result(number), starter, LAB)


@cache
def _built_agreements(number: str, image: str, facts: MapFacts) -> tuple[Agreement, ...]:
    stage, map_image = _template() / stage_name(number), _template() / "maps" / image
    return tuple(WALL_AGREEMENTS(stage, map_image, facts, LAB))


@cache
def _built_map(name: str, facts: MapFacts) -> MapSubject:
    return map_subject(_template() / "maps" / name, facts, _template())


@cache
def _built_params(name: str) -> NavigationSubject:
    return read_params(_template() / "config" / name, ROS, LAB.frames)


def said(result: FolderResult, *severities: str) -> list[str]:
    """Return rule and site of the findings; those of a stage begin with its checkpoint."""
    found = [
        (finding.severity, f"{finding.rule} {stage.checkpoint}:{finding.prim}")
        for stage in result.results
        for finding in stage.findings
    ]
    found += [
        (finding.severity, f"{finding.rule} {finding.prim}")
        for finding in result.submission.findings
    ]
    return sorted(site for severity, site in found if severity in severities)


def faults(result: FolderResult) -> list[str]:
    """Return rule and site of everything that is a fault."""
    assert not any(each.crashes for each in (*result.results, result.submission))
    return said(result, "error", "warning")


def notes(result: FolderResult) -> list[str]:
    """Return rule and site of the notes that not every submission has."""
    return [each for each in said(result, "note") if each.split()[0] not in ALWAYS]


def edit_stage(path: Path, change: Callable[[Usd.Stage], object]) -> None:
    """Change a stage file through the USD API."""
    layer = copy_of(_layer(path.read_bytes()))
    change(Usd.Stage.Open(layer))
    layer.Export(str(path))


@cache
def _layer(text: bytes) -> Sdf.Layer:
    """Read a stage in text once; never changed, only copied."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text.decode())
    return layer


def edit(number: str, change: Callable[[Usd.Stage], object]) -> Fault:
    """Return the fault that changes the stage of one checkpoint."""
    return lambda folder: edit_stage(folder / stage_name(number), change)


def rewrite(name: str, old: str, new: str) -> Fault:
    """Return the fault that replaces the first such text in a file that is no stage."""

    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text, f"{name} holds no {old!r}"
        (folder / name).write_text(text.replace(old, new, 1))

    return change


def put(name: str, text: str) -> Fault:
    return lambda folder: void((folder / name).write_text(text))


def delete(name: str) -> Fault:
    def change(folder: Path) -> None:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()

    return change


def rename(old: str, new: str) -> Fault:
    def change(folder: Path) -> None:
        (folder / new).parent.mkdir(parents=True, exist_ok=True)
        (folder / old).rename(folder / new)

    return change


def copy(old: str, new: str) -> Fault:
    return lambda folder: void(shutil.copy(folder / old, folder / new))


def void(_: object) -> None:
    """Drop what a call returns."""
