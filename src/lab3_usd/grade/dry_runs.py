"""What dry runs show of the stages of a submission: whether what an item says is so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.errors import StageError
from lab3_usd.grade.scoring import SubmissionFacts
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import Scene
from lab3_usd.sim.any_stage import joint_checks
from lab3_usd.sim.dry_run import scene_of
from lab3_usd.sim.execution.drive import Session, drive_of
from lab3_usd.sim.held_play import held_play
from lab3_usd.sim.judge.checks import asked_checks, why_unplayed
from lab3_usd.sim.judge.expectations import Expected, RunFault, Trial
from lab3_usd.sim.judge.topics import expected_of_each
from lab3_usd.sim.plays import Play, asked_plays
from lab3_usd.sim.timeline import Player, played
from lab3_usd.spec.lab import Lab

_Key = tuple[str, str]  # the content of a stage, and what is expected of it
# The last play of a stage, by robot and drive.
_Later = dict[tuple[str, tuple[Session, ...]], tuple[Player, Expected]]
_DRIVE = "0.15,0,1 0,0.8,1"  # enough to see what it does: the whole drive takes thrice as long


def with_dry_runs(facts: SubmissionFacts, lab: Lab, digests: Mapping[str, str]) -> SubmissionFacts:
    """Play stages with errors or warnings, each file once for all that is expected alike of it.

    The last stage is played first: what it holds of the earlier ones is not played again.
    Others are not played: that takes several times as long as judging them, and nothing would come
    of it. A dry run that fails itself is a crash over its stage.
    """
    first: dict[_Key, tuple[Path, Mapping[str, Expected]]] = {}
    keys: list[_Key | None] = []
    for stage in facts.stages:
        demands = lab.same_demands(stage.checkpoint)
        is_suspect = bool(stage.faults) or stage.is_warned_about
        is_played = stage.readable and is_suspect and stage.path not in facts.crashes
        key = None
        if first or (is_played and demands.graphs):
            wanted = expected_of_each(lab, lab.checkpoints[demands.id])
            key = digests.get(stage.path, stage.path), repr(wanted)
            if is_played and demands.graphs and key not in first:
                first[key] = Path(stage.path), wanted
        keys.append(key if key in first else None)
    later: _Later = {}
    shown: dict[_Key, Mapping[str, str]] = {}
    failed: dict[_Key, str] = {}
    for key, (path, each) in reversed(first.items()):
        try:
            shown[key] = faults_in_dry_run(path, lab, each, later)
        except MemoryError:  # noqa: PERF203
            raise
        except Exception as error:  # noqa: BLE001 - whatever it raises is its crash
            failed[key] = f"{type(error).__name__}: {error}"
    crashes = dict(facts.crashes)
    stages = []
    for stage, key in zip(facts.stages, keys, strict=True):
        if key in failed:
            crashes[stage.path] = failed[key]
        stages.append(stage if key is None else replace(stage, shown=shown.get(key, {})))
    return replace(facts, stages=tuple(stages), crashes=crashes)


def faults_in_dry_run(
    path: Path, lab: Lab, each: Mapping[str, Expected], later: _Later | None = None
) -> dict[str, str]:
    """Return what a dry run shows to be wrong, by topic, check and kind of fault.

    `each` holds the expectations by robot; with several robots, a check or kind is also listed with
    the robot's name, as `r2: follows`. Faults that a missing asset could explain are left out. The
    effects of nodes that are not simulated, such as scripts, are ignored: no lab requires them. A
    stage that equals one of the `later` plays is not played again.
    """
    try:
        scene = scene_of(path, lab.platform)
    except StageError:
        return {}  # what is damaged, the rules did not need
    later = {} if later is None else later
    shown: dict[str, str] = {}
    for play in asked_plays(scene, lab, each):
        if play.is_of_joints:
            trial = play.recorded(scene, lab.platform)
            checks = joint_checks(play, trial, scene)
            wrong = [check for check in checks if check.verdict == "bad"]
            texts = {name: c.text for c in wrong for name in (c.name, c.kind) if name}
        else:
            texts = _shown(_briefly(play, scene, lab.platform, later), scene)
        for name, text in texts.items():
            shown.setdefault(name, text)
            if play.name and not name.startswith("/"):
                shown[f"{play.name}: {name}"] = text
    return shown


def _briefly(play: Play, scene: Scene, platform: Platform, later: _Later) -> Trial:
    """Return what is judged of a robot; one on two wheels is driven as briefly as shows it."""
    short = play
    if play.robot is None:
        short = replace(play, drive=drive_of(_DRIVE, play.wanted.limits))
    sessions = later.get((short.name, short.drive))
    player = held_play(scene, short.wanted, *sessions, platform) if sessions is not None else None
    if player is None:
        player = played(scene, platform, short.drive, short.wanted)
        later[short.name, short.drive] = player, short.wanted
    trial = short.shown_by(player)
    if play.robot is None and trial.has_ramps:  # it needs the time between the legs to stop
        return play.recorded(scene, platform)
    return trial


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
    for name, look in asked_checks(trial).items():
        faults = [fault for fault in look.faults(trial) if is_sure(name, fault)]
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
