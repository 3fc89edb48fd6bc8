"""`lab3 sim`: play a stage without Isaac Sim, and say what it does."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lab3_usd.commands.steps.configuring import use_configured_lab
from lab3_usd.commands.steps.options import text_or_json
from lab3_usd.errors import EXIT_FOUND, EXIT_USAGE, UsageError

if TYPE_CHECKING:
    from lab3_usd.sim.dry_run import DryRun
    from lab3_usd.spec.lab import Lab


def _check_outputs(page: Path | None, bag: Path | None) -> None:
    """Refuse what cannot be written, before anything is played.

    Raises:
        UsageError: the page has the ending of a stage, the bag is there, or the extra is not.
    """
    from lab3_usd.judge.results import STAGE_ENDINGS  # noqa: PLC0415

    message = ""
    if page is not None and page.suffix.lower() in STAGE_ENDINGS:
        message = f"--page {page}: has the ending of a stage; name an .html file"
    elif bag is not None and bag.exists():
        message = f"--bag {bag}: is there already; name a new folder"
    elif bag is not None and find_spec("rosbags") is None:
        message = "--bag needs the extra lab3-usd[sim]: pip install 'lab3-usd[sim]'"
    if message:
        raise UsageError(message)


def _write_page(page: Path, run: DryRun, lab: Lab) -> None:
    from lab3_usd.files import write_whole  # noqa: PLC0415
    from lab3_usd.report.behaviour.page import render  # noqa: PLC0415

    text = render(run.behaviour, run.replay, lab)
    write_whole(page, text.encode("utf-8", "replace"), force=True)


def _write_bag(folder: Path, run: DryRun) -> None:
    from lab3_usd.sim.bag.writing import write_bag  # noqa: PLC0415 - of the extra

    if run.evidence is not None:
        folder.parent.mkdir(parents=True, exist_ok=True)
        write_bag(folder, run.evidence)


@click.command("sim")
@click.argument("stage", type=click.Path(path_type=Path))
@click.option("--checkpoint", metavar="NN", help="Ask for what this checkpoint has.")
@click.option(
    "--drive",
    metavar="FILE|LEGS",
    help='What to drive instead: a file, or legs "v,w,s ..." (m/s, rad/s, seconds).',
)
@text_or_json
@click.option("--page", type=click.Path(path_type=Path), help="Write an HTML page to this file.")
@click.option(
    "--bag", type=click.Path(path_type=Path), help="Record it as a bag (MCAP) in this new folder."
)
@click.option(
    "--live", is_flag=True, help="Run in real time over DDS, driven by /cmd_vel (extra live)."
)
@click.option("--seconds", type=float, metavar="S", help="End --live after so many seconds.")
def command(stage: Path, **options: Any) -> None:  # noqa: ANN401 - one entry per option
    """Play a stage without Isaac Sim, drive its robot, and say what comes over ROS.

    The graphs of STAGE run as they are wired, by functions written from the published source of
    Isaac Sim 6.0.1; the robot moves by exact kinematics. What is asked for is that of the
    checkpoint in the file's name, else of the last. Nothing of it counts in a score. Exit status:
    0 all right, 1 something is wrong, 2 unreadable or wrong usage, 3 the tool itself failed.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.commands.steps.live_run import check_live, live  # noqa: PLC0415
    from lab3_usd.commands.steps.options import checkpoint_number  # noqa: PLC0415
    from lab3_usd.judge.stage import checkpoint_of  # noqa: PLC0415
    from lab3_usd.spec.load.loader import load_lab  # noqa: PLC0415

    use_configured_lab(stage)
    lab = load_lab()
    known = [*lab.checkpoints]
    given = options["checkpoint"]
    named = checkpoint_of(stage.name, lab) or known[-1]
    asked = named if given is None else checkpoint_number(given, known)
    check_live(options)
    _check_outputs(options["page"], options["bag"])
    if options["live"]:
        live(stage, lab, asked, options["seconds"])
    else:
        sys.exit(_judge(stage, lab, asked, options))


def _judge(stage: Path, lab: Lab, asked: str, options: Mapping[str, Any]) -> int:
    """Play a stage, write what was asked for, and return the exit code."""
    from lab3_usd.commands.steps.options import wants_color, width  # noqa: PLC0415
    from lab3_usd.report.behaviour import json_behaviour, text  # noqa: PLC0415
    from lab3_usd.sim.dry_run import dry_run  # noqa: PLC0415

    run = dry_run(stage, lab, asked, options["drive"])
    found = run.behaviour
    if options["page"] is not None:
        _write_page(options["page"], run, lab)
    if options["bag"] is not None:
        _write_bag(options["bag"], run)
    if options["form"] == "json":
        click.echo(json_behaviour.render(found), nl=False)
    else:
        click.echo(text.render(found, width(), color=wants_color()), nl=False)
    return {"bad": EXIT_FOUND, "unreadable": EXIT_USAGE}.get(found.verdict, 0)
