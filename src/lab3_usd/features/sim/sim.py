"""`lab3 sim`: play a stage without Isaac Sim, and say what it does."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import (
    assets_option,
    checkpoint_option,
    color_option,
    isaac_option,
    recorded,
    text_or_json,
)
from lab3_usd.commands.shared.paths import Input, MapInput
from lab3_usd.errors import UsageError
from lab3_usd.features.sim.additions import SimAddition, SimOptions, additions_to_sim
from lab3_usd.features.sim.behaviour import page_option, write_behaviour

if TYPE_CHECKING:
    from lab3_usd.config.settings import Config
    from lab3_usd.model.finding import Finding
    from lab3_usd.spec.lab import Lab


@click.command("sim")
@click.argument("stage", type=Input(path_type=Path))
@checkpoint_option()
@click.option(
    "--drive",
    type=Input(),
    metavar="FILE|TEXT",
    help='The test drive: segments "v,w,s ..." (m/s, rad/s, seconds), or a file.',
)
@click.option("--topic", metavar="NAME", help="Drive only the robots that subscribe to this topic.")
@click.option(
    "--maps",
    type=MapInput(path_type=Path),
    help="The map, or its folder, to compare the scan with (localization).",
)
@text_or_json
@color_option
@isaac_option
@assets_option
@page_option
@recorded("asked", SimOptions)
@additions_to_sim()
def command(stage: Path, asked: SimOptions, added: tuple[SimAddition, ...]) -> None:
    """Simulate a stage without Isaac Sim, drive its robot, and check its ROS messages.

    The graphs of STAGE are executed as they are wired, by functions written from the published
    source of Isaac Sim 6.0.1; the robot moves by exact kinematics. The checkpoint in the file name
    decides what is required. A stage without one is checked by its own content: each robot is
    driven by its own commands.

    Exit code: 0 no check failed, or nothing to run yet, 1 a check failed or not judged, 2
    unreadable or wrong usage, 3 the program itself failed.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.pipeline.any_stage import lab_in_release
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.spec.load.loader import lab_of_team, load_lab

    config = use_config(stage, asked.assets)
    lab = load_lab()
    checkpoint = checkpoint_of(stage.name, lab, asked.checkpoint) or ""
    lab = lab_of_team(lab, [(str(stage), checkpoint)] if checkpoint else [])
    topic = asked.topic or ""
    if checkpoint and topic:
        raise UsageError(f"--topic {topic}: at checkpoint {checkpoint} commands have a topic")
    if asked.release is not None:
        lab = lab_in_release(lab, asked.release, checkpoint)
    for addition in added:
        addition.refuse(asked)
    if not any(addition.plays_instead(stage, lab, checkpoint, topic) for addition in added):
        sys.exit(_judge(stage, lab, checkpoint, asked, added, config))


def _judge(
    stage: Path,
    lab: Lab,
    checkpoint: str,
    asked: SimOptions,
    added: tuple[SimAddition, ...],
    config: Config,
) -> int:
    """Play a stage, write what was asked for, and return the exit code."""
    from lab3_usd.sim.dry_run import dry_run

    run = dry_run(stage, lab, checkpoint, asked.drive, asked.topic or "", asked.maps)
    findings = _findings(stage, lab, checkpoint, config) if run.behaviour.checks else ()
    status = write_behaviour(run, lab, asked.form, asked.page, findings)
    for addition in added:
        for line in addition.lines_after(run, lab):
            click.echo(line, err=asked.form == "json")
    return status


def _findings(stage: Path, lab: Lab, checkpoint: str, config: Config) -> tuple[Finding, ...]:
    """Return what the rules find: they explain what fails, and know what a dry run cannot play."""
    from lab3_usd.pipeline.stage import JudgeSettings, check_stage, lint_stage

    if checkpoint:
        return check_stage(stage, checkpoint, lab).findings
    settings = JudgeSettings(release=lab.platform.release, config=config)
    return lint_stage(stage, settings).findings
