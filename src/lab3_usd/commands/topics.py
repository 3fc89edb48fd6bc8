"""`lab3 topics`: print the topics that a stage publishes and subscribes to."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.steps.options import assets_option, use_config


@click.command("topics")
@click.argument("stage", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "csv"]),
    default="text",
    show_default=True,
    help="How to write the table.",
)
@assets_option
def command(stage: Path, form: str, assets: tuple[str, ...]) -> None:
    """Print the topics that a stage publishes and subscribes to.

    For each topic: its name as ROS 2 will see it, message type, node, frames, queue size, the QoS
    profile that Isaac Sim 6.0.1 would use, and what sets the pace. A node that nothing drives
    publishes never.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.check.ros.topics import endpoints
    from lab3_usd.check.tf.frames import published_edges, unresolved_frames
    from lab3_usd.report.topic_table import TopicReport, as_csv, as_json, as_table
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.read.reader import read_stage

    use_config(stage, assets)
    lab = load_lab()
    model = read_stage(stage, lab)
    edges, hidden = published_edges(model, lab), unresolved_frames(model, lab)
    table = TopicReport(str(stage), endpoints(model, lab), edges, hidden)
    if form == "csv":
        click.echo(as_csv(table), nl=False)
    else:
        click.echo("\n".join(as_table(table)) if form == "text" else as_json(table))
