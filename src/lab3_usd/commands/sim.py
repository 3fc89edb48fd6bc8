"""`lab3 sim`: play a stage without Isaac Sim, and say what it does."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click
from msgspec import Struct

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import (
    assets_option,
    color_option,
    complete_checkpoints,
    isaac_option,
    recorded,
    text_or_json,
)
from lab3_usd.commands.shared.paths import Input, MapInput, OutputFolder, OutputReport
from lab3_usd.data import program
from lab3_usd.errors import EXIT_FOUND, EXIT_USAGE, UsageError
from lab3_usd.installation import install_command

if TYPE_CHECKING:
    from lab3_usd.model.finding import Finding, StageResult
    from lab3_usd.sim.dry_run import DryRun
    from lab3_usd.sim.judge.expectations import Trial
    from lab3_usd.sim.live import Lived
    from lab3_usd.spec.lab import Lab


LONGEST = 86400.0  # seconds
SLOW = 0.95  # times real time, below which the last line names the speed
_EXTRA = ("cyclonedds", "rosbags")


class SimOptions(Struct, frozen=True):
    """How a stage is played, and what is made of it.

    `drive` is a file or legs; commands go to the robots that subscribe to `topic`. `seconds` end
    a `live` play.
    """

    checkpoint: str | None
    drive: str | None
    topic: str | None
    maps: Path | None
    form: str
    release: str | None
    assets: tuple[str, ...]
    page: Path | None
    bag: Path | None
    live: bool
    seconds: float | None


def check_live(asked: SimOptions) -> None:
    """Refuse what does not go together, before anything is played.

    Raises:
        UsageError: options do not go together, or the extra is not installed.
    """
    seconds = asked.seconds
    judging = {"--drive": asked.drive, "--page": asked.page, "--bag": asked.bag}
    refused = [option for option, value in judging.items() if value is not None]
    refused += ["--format json"] if asked.form == "json" else []
    message = ""
    if not asked.live:
        message = "--seconds is for --live only" if seconds is not None else ""
    elif refused:
        message = f"--live and {refused[0]} do not go together: it is driven over ROS, not judged"
    elif seconds is not None and not 0 < seconds <= LONGEST:
        message = f"--seconds {seconds:g}: is not between 0 and {LONGEST:.0f}"
    elif any(find_spec(name) is None for name in _EXTRA):
        message = f"--live needs the extra live: {install_command('live')}"
    if message:
        raise UsageError(message)


def live(stage: Path, lab: Lab, checkpoint: str, topic: str, seconds: float | None) -> None:
    """Play a stage until Ctrl-C, or for so many simulated seconds.

    Raises:
        UsageError: DDS does not start.
        StageError: the stage cannot be read.
    """
    from lab3_usd.report.behaviour.text import WHAT_IT_IS
    from lab3_usd.report.safe_text import printable
    from lab3_usd.sim.dry_run import scene_of
    from lab3_usd.sim.execution.drive import RATE
    from lab3_usd.sim.judge.topics import expected_at
    from lab3_usd.sim.live import DdsLink, play_live
    from lab3_usd.sim.robots import expected_of, robots_of
    from lab3_usd.sim.timeline import player_of

    scene, platform = scene_of(stage, lab.platform), lab.platform
    if checkpoint:
        wanted = expected_at(lab, lab.checkpoints[checkpoint])
    else:
        robots = robots_of(scene, platform, topic)
        wanted = expected_of(robots[0] if robots else None)
    player = player_of(scene, platform, wanted)
    player.world.network.environment = os.environ.get("ROS_DOMAIN_ID", "")

    def tell(topic: str, kind: str, domain: int) -> None:
        click.echo(printable(f"listens to {topic} ({kind}) in domain {domain}"))

    with closing(DdsLink(wanted.domain)) as link:
        click.echo(f"{printable(str(stage))}: {WHAT_IT_IS}")
        click.echo("live on 127.0.0.1; Ctrl-C ends")
        frames = math.inf if seconds is None else seconds * RATE
        lived = play_live(player, link, lambda played: played >= frames, tell, topic)
    for line in closing_lines(lived):
        click.echo(printable(line))


def closing_lines(lived: Lived) -> Iterator[str]:
    """Yield the last lines: topics, time, and what was left out."""
    yield ""
    several = len({domain for *_, domain in lived.sent}) > 1
    for (topic, kind, domain), count in lived.sent.items():
        where = f" in domain {domain}" if several else ""
        yield f"{topic:<20} {kind:<27} {count} sent{where}"
    if not lived.sent:
        yield "nothing was sent"
    yield ""
    for topic, kind, domain in lived.unsent:
        where = f" in domain {domain}" if several else ""
        yield f"not sent: {topic} ({kind}){where}: a dry run does not make its content"
    for domain, reason in lived.refused.items():
        yield f"not sent or heard: what is in domain {domain}: DDS does not start there: {reason}"
    for prim, reason in lived.failed.items():
        yield f"failed: {prim}: {reason}"
    for prim, reason in lived.not_simulated.items():
        yield f"not simulated: {prim}: {reason}"
    if lived.lost:
        yield f"{lived.lost} messages were lost, because a subscriber does not keep up"
    rate = lived.played / lived.took if lived.took else 1.0
    slow = f", at {rate:.2f} times real time: this computer is too slow" if rate < SLOW else ""
    yield f"{lived.played:.1f} s played{slow}; {lived.commands} commands received"


def _check_bag(bag: Path | None) -> None:
    """Refuse a bag that cannot be written, before anything is played.

    Raises:
        UsageError: it is there already, or the extra is not installed.
    """
    message = ""
    if bag is not None and bag.exists():
        message = f"--bag {bag}: exists already; name a new folder"
    elif bag is not None and find_spec("rosbags") is None:
        message = f"--bag needs the extra sim: {install_command('sim')}"
    if message:
        raise UsageError(message)


@click.command("sim")
@click.argument("stage", type=Input(path_type=Path))
@click.option(
    "--checkpoint",
    metavar="NN",
    shell_complete=complete_checkpoints,
    help="Judge at this checkpoint.",
)
@click.option(
    "--drive",
    type=Input(),
    metavar="FILE|LEGS",
    help='The drive: a file, or legs "v,w,s ..." (m/s, rad/s, seconds).',
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
@click.option("--page", type=OutputReport(path_type=Path), help="Write an HTML page to this file.")
@click.option(
    "--bag", type=OutputFolder(path_type=Path), help="Record it as a bag (MCAP) in this new folder."
)
@click.option(
    "--live",
    is_flag=True,
    help="Run in real time over DDS, driven by the topics of commands (extra live).",
)
@click.option("--seconds", type=float, metavar="S", help="End --live after this many seconds.")
@recorded("asked", SimOptions)
def command(stage: Path, asked: SimOptions) -> None:
    """Play a stage without Isaac Sim, drive its robot, and judge the messages of ROS.

    The graphs of STAGE are executed as they are wired, by functions written from the published
    source of Isaac Sim 6.0.1; the robot moves by exact kinematics. The checkpoint in the file name
    decides what is required. A stage without one is judged by its own content: each robot is driven
    by its own commands.

    Exit status: 0 all right, or nothing to run yet, 1 a fault or not judged, 2 unreadable or wrong
    usage, 3 the program itself failed.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.commands.shared.options import checkpoint_number
    from lab3_usd.pipeline.any_stage import lab_in_release
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.spec.load.loader import load_lab

    use_config(stage, asked.assets)
    lab = load_lab()
    numbers = [*lab.checkpoints]
    given = asked.checkpoint
    named = checkpoint_of(stage.name, lab) or ""
    checkpoint = named if given is None else checkpoint_number(given, numbers)
    topic = asked.topic or ""
    if checkpoint and topic:
        raise UsageError(f"--topic {topic}: at checkpoint {checkpoint} commands have a topic")
    if asked.release is not None:
        lab = lab_in_release(lab, asked.release, checkpoint)
    check_live(asked)
    _check_bag(asked.bag)
    if asked.live:
        live(stage, lab, checkpoint, topic, asked.seconds)
    else:
        sys.exit(_judge(stage, lab, checkpoint, asked))


def _judge(stage: Path, lab: Lab, checkpoint: str, asked: SimOptions) -> int:
    """Play a stage, write what was asked for, and return the exit code."""
    from lab3_usd.commands.shared.options import wants_color, width
    from lab3_usd.report.behaviour import text
    from lab3_usd.sim.dry_run import dry_run

    run = dry_run(stage, lab, checkpoint, asked.drive, asked.topic or "", asked.maps)
    behaviour = run.behaviour
    findings: tuple[Finding, ...] = ()
    if any(check.verdict != "ok" for check in behaviour.checks):
        from lab3_usd.pipeline.stage import JudgeSettings, check_stage, lint_stage

        # What fails in the dry run, the rules know to explain and to repair.
        settings = JudgeSettings(release=lab.platform.release)
        if checkpoint:
            findings = check_stage(stage, checkpoint, lab).findings
        else:
            findings = lint_stage(stage, settings).findings
    page, bag = asked.page, asked.bag
    if page is not None:
        from lab3_usd.files import write_whole
        from lab3_usd.report.behaviour.page import render

        html = render(behaviour, run.replays, lab, findings)
        write_whole(page, html.encode("utf-8", "replace"), force=True)
    is_json = asked.form == "json"
    if is_json:
        click.echo(text.render_json(behaviour, findings), nl=False)
    else:
        shown = text.render(behaviour, width(), findings, color=wants_color())
        click.echo(shown, nl=False, color=True)
    if bag is not None and run.trial is not None:
        for line in _record(run, run.trial, lab, bag, asked.drive):
            click.echo(line, err=is_json)
    exits = {"bad": EXIT_FOUND, "not judged": EXIT_FOUND, "unreadable": EXIT_USAGE}
    return 0 if behaviour.is_early else exits.get(behaviour.verdict, 0)


def _record(run: DryRun, trial: Trial, lab: Lab, bag: Path, drive: str | None) -> Iterator[str]:
    """Write a run as a bag for each domain, and yield what each holds, and what it cannot hold."""
    from lab3_usd.report.safe_text import printable
    from lab3_usd.sim.bag.tape import tape_of, tape_of_plays, tape_of_robots
    from lab3_usd.sim.bag.writer import write_bags

    tape = tape_of(trial)
    if run.scene is not None and len(run.robots) > 1:
        tape = tape_of_robots(run.scene, lab.platform, run.robots, drive)
    elif run.scene is not None and len(run.plays) > 1:
        tape = tape_of_plays(run.scene, lab.platform, [*run.plays.values()])
    for written in write_bags(bag, tape):
        holds = f"{written.messages} messages on {written.topics} topics"
        yield printable(f"recorded: {written.folder}: {holds}")
        if written.left_out:
            yield printable(f"  without content, so not recorded: {', '.join(written.left_out)}")
    told = {(command.domain, command.topic) for command in tape.commands}
    for robot in run.behaviour.robots:
        if (robot.domain, robot.topic) not in told:
            yield printable(f"  commands on {robot.topic} come in another play: not recorded")


class PlayedResult(NamedTuple):
    """The result of a stage that was played as well, and what a page shows of the run."""

    result: StageResult
    drawn: object | None = None


def with_dry_run(result: StageResult) -> PlayedResult:
    """Return a result with a note for each bad check of a dry run; the score stays.

    `lab3 check --sim` calls it.
    """
    from msgspec.structs import replace

    from lab3_usd.check.explanations import ONLY_IN_A_DRY_RUN, explaining_finding
    from lab3_usd.check.registry import all_rules
    from lab3_usd.check.rule_runs import run_rule
    from lab3_usd.pipeline.results import unreadable, with_findings
    from lab3_usd.report.behaviour.page import dry_run_summary
    from lab3_usd.sim.dry_run import dry_run
    from lab3_usd.spec.load.loader import load_lab

    if result.verdict == "unreadable" or result.checkpoint is None:
        return PlayedResult(result)
    run = dry_run(Path(result.path), load_lab(), result.checkpoint)
    if run.behaviour.verdict == "unreadable":  # by damage where no rule looks
        reason = run.behaviour.not_simulated[0].reason
        return PlayedResult(unreadable(result.path, result.checkpoint, reason))
    hint = f"{program()} sim plays the stage and shows what it does"
    notes = []
    for check in (check for check in run.behaviour.checks if check.verdict == "bad"):
        (note,) = run_rule(all_rules()[ONLY_IN_A_DRY_RUN], check, None).findings
        cause = explaining_finding(check, result.findings)
        rule, name = (note.rule, note.name) if cause is None else (cause.rule, cause.name)
        notes.append(replace(note, rule=rule, name=name, hint=hint))
    noted = with_findings(result, (*result.findings, *notes))
    return PlayedResult(noted, dry_run_summary(run.behaviour, run.replays))
