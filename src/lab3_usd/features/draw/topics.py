"""`lab3 topics`: print or draw the topics that a stage publishes and subscribes to."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.configuration import leave_broken_lab, use_config
from lab3_usd.commands.shared.options import (
    StageOptions,
    assets_option,
    echo,
    isaac_option,
    recorded,
    scene_option,
    terminal_width,
)
from lab3_usd.commands.shared.paths import Input, OutputFile


@click.command("topics")
@click.argument("stage", type=Input(path_type=Path))
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "csv"]),
    default="text",
    show_default=True,
    help="Format of the table.",
)
@click.option(
    "--graph",
    "picture",
    type=OutputFile(path_type=Path),
    help="Draw nodes and topics as rqt_graph does, into a .svg, .png, .dot or .mmd.",
)
@click.option("--force", is_flag=True, help="With --graph: replace a picture that exists.")
@click.option("-v", "--verbose", is_flag=True, help="Also print frames, queue, QoS and rate.")
@scene_option
@isaac_option
@assets_option
@recorded("reading", StageOptions)
def command(
    stage: Path,
    form: str,
    picture: Path | None,
    reading: StageOptions,
    *,
    force: bool,
    verbose: bool,
) -> None:
    """Print the topics that a stage publishes and subscribes to.

    For each topic: its name as ROS 2 resolves it, message type and node; with -v also frames, queue
    size, the QoS profile that Isaac Sim 6.0.1 would use, and the source of its rate. A node that
    nothing triggers never publishes. Nodes of unknown types are counted.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.facts.endpoints import endpoints
    from lab3_usd.facts.frames import all_edges, all_unresolved_frames
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import read_ros
    from lab3_usd.report.entries import coverage_line, missing_line
    from lab3_usd.report.picture.picture_file import write_picture
    from lab3_usd.report.pictures.topic_picture import topics_picture
    from lab3_usd.report.safe_text import folded, printable
    from lab3_usd.report.topic_table import WIDTH, TopicReport, as_csv, as_json, as_table

    use_config(stage, reading.assets)
    leave_broken_lab()
    ros = read_ros(stage, reading.scene or "", reading.release or BASE)
    _platform, model = ros.subject.platform, ros.subject.stage
    ends, not_judged = endpoints(model), printable(coverage_line(ros.coverage))
    if picture is not None:
        write_picture(topics_picture(stage.name, ends, ros.unknown, not_judged), picture, force)
        echo(picture)
        return
    edges, hidden = all_edges(model), all_unresolved_frames(model)
    table = TopicReport(str(stage), ends, edges, hidden)
    if form == "csv":
        click.echo(as_csv(table), nl=False)
    elif form == "json":
        click.echo(as_json(table))
    else:
        columns = terminal_width() if verbose else WIDTH
        lines = as_table(table, columns, verbose=verbose)
        missing = printable(missing_line(asset.asset for asset in model.unresolved))
        rest = [line for text in (not_judged, missing) if text for line in folded(text, WIDTH)]
        click.echo("\n".join([*lines, *rest]))
