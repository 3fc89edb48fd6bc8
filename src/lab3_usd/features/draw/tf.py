"""`lab3 tf`: print or draw the TF tree that a stage publishes."""

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


@click.command("tf")
@published_options(
    ["text", "dot", "json"],
    "tree",
    "Draw it with publishers and rates as view_frames",
    "Name publisher and rate of each transform.",
)
def command(stage: Path, asked: PublishedOptions) -> None:
    """Print the TF tree that a stage publishes.

    The transforms are those that Isaac Sim 6.0.1 would send during Play, from all graphs of STAGE,
    on /tf and /tf_static, and on those of a namespace such as /robot1/tf: a tree for each domain
    and topic. An exclamation mark shows where they do not form a tree; `lab3 check` and `lab3 lint`
    give the repair. Frames that only a missing asset could define are below the tree, with a
    question mark. Nodes of unknown types are counted.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.facts.endpoints import endpoints
    from lab3_usd.facts.frames import (
        all_edges,
        all_unresolved_frames,
        known_tops,
        published_transforms,
        trees_of,
    )
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.report.picture.flowcharts import graphviz
    from lab3_usd.report.pictures.tf_picture import published_frames_picture
    from lab3_usd.report.tf_tree import TreeReport, as_lines, tree_json
    from lab3_usd.spec.load.loader import load_lab

    published = read_published(stage, asked)
    model = published.model
    edges, hidden = all_edges(model), all_unresolved_frames(model)
    rates = {end.node.path: end.rate for end in endpoints(model)}
    tops = frozenset(top for heard in trees_of(edges) for top in known_tops(heard, model))
    sent = published_transforms(model)
    unknown = tuple(each.publisher.path for each in sent if each.edges is None)
    lab = load_lab()
    # What a lab leaves to others, any other stage may place.
    reserved = lab.frames.reserved if checkpoint_of(stage.name, lab) else {}
    tree = TreeReport(str(stage), edges, unknown, reserved, hidden, rates, tops)
    if asked.picture is not None:
        picture = published_frames_picture(tree, published.not_judged)
        write_published(picture, asked.picture, force=asked.force)
    elif asked.form == "text":
        lines = as_lines(tree, terminal_width(), verbose=asked.verbose)
        print_published(lines, published, mark="? ")
    elif asked.form == "dot":
        click.echo(graphviz(published_frames_picture(tree, published.not_judged)), nl=False)
    else:
        click.echo(tree_json(tree))
