"""`lab3 topics`: print or draw the topics that a stage publishes and subscribes to."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import terminal_width
from lab3_usd.features.draw.published import (
    PublishedOptions,
    print_published,
    published_options,
    read_published,
    write_published,
)


@click.command("topics")
@published_options(
    ["text", "json", "csv"],
    "table",
    "Draw nodes and topics as rqt_graph",
    "Also print frames, queue, QoS and rate.",
)
def command(stage: Path, asked: PublishedOptions) -> None:
    """Print the topics that a stage publishes and subscribes to.

    For each topic: its name as ROS 2 resolves it, message type and node; with -v also frames, queue
    size, the QoS profile that Isaac Sim 6.0.1 would use, and the source of its rate. A node that
    nothing triggers never publishes. Nodes of unknown types are counted.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.facts.endpoints import endpoints
    from lab3_usd.facts.frames import all_edges, all_unresolved_frames
    from lab3_usd.report.pictures.topic_picture import topics_picture
    from lab3_usd.report.topic_table import WIDTH, TopicReport, as_csv, as_json, as_table

    published = read_published(stage, asked)
    model = published.model
    ends = endpoints(model)
    if asked.picture is not None:
        picture = topics_picture(stage.name, ends, published.unknown, published.not_judged)
        write_published(picture, asked.picture, force=asked.force)
        return
    table = TopicReport(str(stage), ends, all_edges(model), all_unresolved_frames(model))
    if asked.form == "csv":
        click.echo(as_csv(table), nl=False)
    elif asked.form == "json":
        click.echo(as_json(table))
    else:
        columns = terminal_width() if asked.verbose else WIDTH
        print_published(as_table(table, columns, verbose=asked.verbose), published)
