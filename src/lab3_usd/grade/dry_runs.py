"""What dry runs show of the stages of a submission: whether what an item says is so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.errors import StageError
from lab3_usd.grade.scoring import SubmissionFacts
from lab3_usd.model.dry_run import Scene
from lab3_usd.sim.dry_run import is_asked, scene_of, watched_body
from lab3_usd.sim.execution.drive import drive_of
from lab3_usd.sim.judge.checks import CHECKS, why_unplayed
from lab3_usd.sim.judge.expectations import Expected, RunFault, Trial
from lab3_usd.sim.judge.topics import expected_of_each
from lab3_usd.sim.timeline import record
from lab3_usd.spec.lab import Lab

_DRIVE = "0.15,0,1 0,0.8,1"  # enough to see what it does: the whole drive takes thrice as long


def with_dry_runs(facts: SubmissionFacts, lab: Lab, digests: Mapping[str, str]) -> SubmissionFacts:
    """Play the stages that have faults, each file once for all that is expected alike of it.

    Stages without faults are not played: nothing would come of it. A dry run that fails itself is a
    crash over its stage.
    """
    shown: dict[tuple[str, str], Mapping[str, str]] = {}
    failed: dict[tuple[str, str], str] = {}
    crashes = dict(facts.crashes)
    stages = []
    for stage in facts.stages:
        demands = lab.same_demands(stage.checkpoint)
        is_played = stage.readable and stage.faults and stage.path not in facts.crashes
        if not (is_played and demands.graphs) and not shown:
            stages.append(stage)
            continue
        wanted = expected_of_each(lab, lab.checkpoints[demands.id])
        key = digests.get(stage.path, stage.path), repr(wanted)
        if is_played and demands.graphs and key not in shown:
            try:
                shown[key] = shown_by(Path(stage.path), lab, wanted)
            except MemoryError:
                raise
            except Exception as error:  # noqa: BLE001 - whatever it raises is its crash
                shown[key] = {}
                failed[key] = f"{type(error).__name__}: {error}"
        if key in failed:
            crashes[stage.path] = failed[key]
        stages.append(replace(stage, shown=shown.get(key, {})))
    return replace(facts, stages=tuple(stages), crashes=crashes)


def shown_by(path: Path, lab: Lab, each: Mapping[str, Expected]) -> dict[str, str]:
    """Return what a dry run shows to be wrong, by topic, check and kind of fault.

    `each` is what is expected of each robot by name: of several, a check or kind is also there by
    the robot's name, as `r2: follows`. What an asset that is missing could bring is not in there.
    What a node would do that is not simulated, as a script, is not looked for: it is not what the
    lab asks for.
    """
    try:
        scene = scene_of(path, lab.platform)
    except StageError:
        return {}  # what is damaged, the rules did not need
    shown: dict[str, str] = {}
    for robot, wanted in each.items():
        watched = watched_body(wanted, robot, scene, lab)
        trial = record(scene, lab.platform, drive_of(_DRIVE, wanted.limits), watched)
        for name, text in _shown(trial, scene).items():
            shown.setdefault(name, text)
            if robot and not name.startswith("/"):
                shown[f"{robot}: {name}"] = text
    return shown


def _shown(trial: Trial, scene: Scene) -> dict[str, str]:
    """Return what the play of one robot shows to be wrong."""

    def is_sure(check: str, fault: RunFault) -> bool:
        """Whether no asset that is missing could be at fault."""
        if why_unplayed(check, trial):
            return False
        if not fault.sure or (trial.recording.assumed and fault.prim in trial.recording.assumed):
            return False
        return not scene.missing or trial.causes is None or not trial.causes.doubt(check, fault)

    shown: dict[str, str] = {}
    for name in (name for name in CHECKS if is_asked(name, trial)):
        faults = [fault for fault in CHECKS[name](trial) if is_sure(name, fault)]
        if faults and not (name == "scan" and trial.recording.assumed):
            shown |= {fault.kind: _text(fault) for fault in faults}
            shown[name] = "; ".join(map(_text, faults))
    silent = ((topic, fault) for topic, fault in _silent(trial) if is_sure("topics", fault))
    return shown | {topic: _text(fault) for topic, fault in silent}


def _text(fault: RunFault) -> str:
    return f"{fault.message}; {fault.cause}" if fault.cause else fault.message


def _silent(trial: Trial) -> Iterator[tuple[str, RunFault]]:
    """Yield the topics on which nothing comes of their type, and why."""
    for topic, kind in trial.wanted.types.items():
        if not any(message.type == kind for message in trial.recording.topic(topic, 0)):
            cause = trial.causes.of_silence(topic, kind) if trial.causes is not None else None
            prim, because, _ = cause or ("", "", None)
            yield topic, RunFault(f"nothing is received on {topic}", "silent-topic", prim, because)
