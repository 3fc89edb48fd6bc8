"""`lab3 bag`: judge a recording of the running system."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import click

from lab3_usd.commands.shared.options import checkpoint_option, color_option, text_or_json
from lab3_usd.commands.shared.paths import Input, MapInput, RecordingInput
from lab3_usd.data import program
from lab3_usd.errors import UsageError
from lab3_usd.features.sim.behaviour import page_option, write_behaviour
from lab3_usd.installation import install_command


@click.command("bag")
@click.argument("recording", type=RecordingInput(path_type=Path))
@checkpoint_option()
@click.option(
    "--stage",
    type=Input(path_type=Path),
    help="Compare with the dry run of this stage, topic by topic.",
)
@click.option(
    "--maps",
    type=MapInput(path_type=Path),
    help="The map, or its folder, to compare the scan with, instead of the recorded one.",
)
@text_or_json
@color_option
@page_option
def command(
    recording: Path,
    checkpoint: str | None,
    stage: Path | None,
    maps: Path | None,
    form: str,
    page: Path | None,
) -> None:
    """Check a recording of the running system by the checks of `lab3 sim`.

    RECORDING is the output of `ros2 bag record -a`, MCAP or sqlite3, or one file of it. The
    checkpoint in its name, or in that of the stage, decides what is required; localization and
    navigation are required only if they were recorded, or if --checkpoint is given. Without a
    checkpoint any robots are judged by what was recorded, and nothing of a lab is asked. Exit
    code: 0 all right, 1 a fault or not judged, 2 unreadable or wrong usage, 3 the program itself
    failed.
    """
    # The specs are slow to import, and `lab3 --help` does not need them.
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.spec.load.loader import lab_of_team, load_lab

    if find_spec("rosbags") is None:
        needs = f"bag needs the extra sim: {install_command('sim')}"
        raise UsageError(f"{program()} {needs}")
    from lab3_usd.sim.bag.any_recording import judge_any_recording
    from lab3_usd.sim.bag.judge import judge_recording
    from lab3_usd.sim.outcome import differences

    lab = load_lab()
    names = [recording.name, stage.name if stage is not None else ""]
    number = next(filter(None, (checkpoint_of(name, lab, checkpoint) for name in names)), "")
    lab = lab_of_team(lab, [(name, number) for name in names if name and number])
    if maps is not None and not number:
        raise UsageError("--maps: a recording of no checkpoint is laid on no map")
    dry = None
    if stage is not None:
        from lab3_usd.sim.dry_run import dry_run

        dry = dry_run(stage, lab, number).behaviour
        if dry.verdict == "unreadable":
            raise UsageError(f"--stage {stage}: {dry.not_simulated[0].reason}")
    if number:
        run = judge_recording(recording, lab, number, whole=checkpoint is not None, maps=maps)
    else:
        commanded = {robot.topic for robot in dry.robots} if dry is not None else ()
        run = judge_any_recording(recording, lab.platform, commanded)
    if dry is not None and run.behaviour.verdict != "unreadable":
        from msgspec.structs import replace

        behaviour = replace(run.behaviour, differences=differences(run.behaviour, dry))
        run = replace(run, behaviour=behaviour)
    sys.exit(write_behaviour(run, lab, form, page))
