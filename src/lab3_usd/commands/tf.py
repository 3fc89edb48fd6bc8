"""`lab3 tf`: print the TF tree that a stage publishes."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.steps.options import assets_option, use_config


@click.command("tf")
@click.argument("stage", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "dot", "json"]),
    default="text",
    show_default=True,
    help="How to write the tree.",
)
@assets_option
@click.option("-v", "--verbose", is_flag=True, help="Name the publisher of each transform.")
def command(stage: Path, form: str, assets: tuple[str, ...], *, verbose: bool) -> None:
    """Print the TF tree that a stage publishes.

    The transforms are those that Isaac Sim 6.0.1 would send while STAGE plays, from all its
    graphs, on /tf and /tf_static. What tf2 cannot make a tree of is marked with an exclamation
    mark; `lab3 check` says what to do about it. Frames that only an asset could tell which cannot
    be found stand below the tree, with a question mark.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.check.tf.frames import published_edges, unknown_publishers, unresolved_frames
    from lab3_usd.report.tf_tree import TreeReport, as_dot, as_json, as_text
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.read.reader import read_stage

    use_config(stage, assets)
    lab = load_lab()
    model = read_stage(stage, lab)
    tree = TreeReport(
        str(stage),
        published_edges(model, lab),
        unknown_publishers(model, lab),
        lab.frames.reserved,
        unresolved_frames(model, lab),
    )
    if form == "text":
        click.echo("\n".join(as_text(tree, verbose=verbose)))
    else:
        click.echo(as_dot(tree) if form == "dot" else as_json(tree))
