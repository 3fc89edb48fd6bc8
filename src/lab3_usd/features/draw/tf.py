"""`lab3 tf`: print or draw the TF tree that a stage publishes."""

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


@click.command("tf")
@click.argument("stage", type=Input(path_type=Path))
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "dot", "json"]),
    default="text",
    show_default=True,
    help="Format of the tree.",
)
@click.option(
    "--graph",
    "picture",
    type=OutputFile(path_type=Path),
    help="Draw it with publishers and rates as view_frames does, into a .svg, .png, .dot or .mmd.",
)
@click.option("--force", is_flag=True, help="With --graph: replace a picture that exists.")
@scene_option
@isaac_option
@assets_option
@click.option("-v", "--verbose", is_flag=True, help="Name publisher and rate of each transform.")
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
        published_transforms,
        trees_of,
    )
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import read_ros
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.report.entries import coverage_line, missing_line
    from lab3_usd.report.picture.picture_file import write_picture
    from lab3_usd.report.pictures.tf_picture import published_frames_picture
    from lab3_usd.report.safe_text import folded, printable
    from lab3_usd.report.tf_tree import TreeReport, as_lines, tree_dot, tree_json
    from lab3_usd.report.topic_table import WIDTH
    from lab3_usd.spec.load.loader import load_lab

    use_config(stage, reading.assets)
    leave_broken_lab()
    ros = read_ros(stage, reading.scene or "", reading.release or BASE)
    _platform, model = ros.subject.platform, ros.subject.stage
    edges, hidden = all_edges(model), all_unresolved_frames(model)
    rates = {end.node.path: end.rate for end in endpoints(model)}
    not_judged = printable(coverage_line(ros.coverage))
    tops = frozenset(top for heard in trees_of(edges) for top in ros.subject.tops(heard))
    if picture is not None:
        drawn = published_frames_picture(edges, hidden, rates, not_judged, tops)
        write_picture(drawn, picture, force)
        echo(picture)
        return
    sent = published_transforms(model)
    unknown = tuple(each.publisher.path for each in sent if each.edges is None)
    lab = load_lab()
    # What a lab leaves to others, any other stage may place.
    reserved = lab.frames.reserved if checkpoint_of(stage.name, lab) else {}
    tree = TreeReport(str(stage), edges, unknown, reserved, hidden, rates, tops)
    if form == "text":
        lines = as_lines(tree, terminal_width(), verbose=verbose)
        missing = printable(missing_line(asset.asset for asset in model.unresolved))
        texts = filter(None, (not_judged, missing))
        rest = [line for text in texts for line in folded(f"? {text}", WIDTH, rest="  ")]
        click.echo("\n".join([*lines, *rest]))
    else:
        click.echo(tree_dot(tree) if form == "dot" else tree_json(tree))
