"""`lab3 demo`: the files of the tour in README, made anywhere."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
from msgspec import Struct, json

from lab3_usd.commands.shared.options import echo
from lab3_usd.commands.shared.paths import OutputFolder, refuse_inputs
from lab3_usd.data import data_folder, program
from lab3_usd.errors import UsageError
from lab3_usd.files import make_folder, refuse_existing, write_whole
from lab3_usd.installation import command_line
from lab3_usd.model.changes import Connect, Edit, RemovePrim, Repair, SetValue

DEMO = "demo.json"
EXAMPLES = "docs/examples"
LINTED = "carter.usda"


class Demo(Struct, frozen=True):
    """The last checkpoint of the tour, and the mistakes that are made in a copy of its stage.

    They are inputs that are disconnected, attributes with other values, and removed prims.
    """

    about: str
    checkpoint: str
    disconnected: tuple[tuple[str, str, str], ...]
    changed: tuple[tuple[str, str, str, str | float], ...]
    removed: tuple[str, ...]

    @property
    def edits(self) -> Iterator[Edit]:
        """The mistakes as changes of a stage."""
        yield from (Connect(*place) for place in self.disconnected)
        yield from (SetValue(*change) for change in self.changed)
        yield from map(RemovePrim, self.removed)


@click.command("demo")
@click.argument("folder", metavar="[DIR]", default=".", type=OutputFolder(path_type=Path))
@click.option("--force", is_flag=True, help="Replace files that exist.")
def command(folder: Path, *, force: bool) -> None:
    """Write example stages to try the program with.

    DIR/tour gets the first correct stages of the lab, DIR/mine a copy of the last of them with four
    common mistakes, and DIR itself a robot that belongs to no lab.
    """
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files

    lab = load_lab()
    if not (lab.folder / DEMO).is_file():
        raise UsageError(f"{lab.title} has no {DEMO}, which says what to do wrong")
    demo = json.decode((lab.folder / DEMO).read_bytes(), type=Demo)
    numbers = list(lab.checkpoints)
    plan = plan_files(lab, folder / "tour", numbers[: numbers.index(demo.checkpoint) + 1], "usda")
    copy, robot = folder / "mine" / f"{lab.checkpoints[demo.checkpoint].file}.usda", folder / LINTED
    refuse_inputs((*plan, copy, robot))
    for target in (copy, robot):
        refuse_existing(target, force=force)
    files = build_files(lab, None, plan, BuildOptions("usda", force=force))
    make_folder(copy.parent)
    write_whole(copy, _with_mistakes(files[-1], demo), force=force)
    write_whole(robot, (data_folder(EXAMPLES) / LINTED).read_bytes(), force=force)
    for file in (*files, copy, robot):
        echo(str(file))
    click.echo("try:")
    for words in (("check", copy), ("fix", copy, "--diff"), ("lint", robot)):
        echo(f"  {command_line(program(), *map(str, words))}")


def _with_mistakes(correct: Path, demo: Demo) -> bytes:
    """Return the text of a stage after the mistakes; the stage itself stays as it is."""
    from lab3_usd.fix.repairing import repair_open_stage
    from lab3_usd.stage.read.opening import open_stage
    from lab3_usd.stage.read.properties import release_start_values

    stage = open_stage(correct)
    release_start_values(stage)
    repair_open_stage(Repair(demo.about, tuple(demo.edits)), stage)
    text: str = stage.GetRootLayer().ExportToString()
    return text.encode()
