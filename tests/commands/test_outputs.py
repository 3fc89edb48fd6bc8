"""No command writes over what it reads, by whatever name the output is given."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from in_process import invoke
from other_labs import copied, stage

from lab3_usd import cli
from lab3_usd.commands.shared.paths import (
    ChangedFolder,
    Input,
    OutputFile,
    OutputFolder,
)
from lab3_usd.data import data_folder
from lab3_usd.errors import Lab3Error

# A call that reads these files, with each option of a file that it writes.
CALLS = {
    "check STAGE --starter STARTER --maps maps/map.yaml --baseline base.json": (
        "-o --write-baseline"
    ),
    "check work": "-o --write-baseline",
    "check STAGE --config other.toml": "-o --write-baseline",
    "lint STAGE": "-o --write-baseline",
    "lint work --baseline base.json": "-o --write-baseline",
    "lint STAGE --last-failed base.json": "-o --write-baseline",
    "lint STAGE --fix": "-o",
    "fix STAGE --starter STARTER --force": "-o",
    "add publisher STAGE --force": "-o --layer",
    "add --file ros.yaml STAGE --force": "-o --layer",
    "remove clock STAGE --force": "-o",
    "sim STAGE --drive drive.txt --maps maps/map.yaml": "--page",
    "bag run --stage STAGE --maps maps": "--page",
    "bag run/run.mcap": "--page",
    "tf STAGE --force": "--graph",
    "topics STAGE --force": "--graph",
    "--lab lab starter --force": "-o",
    "--lab lab collect --force": "-o",
    "--lab lab record --force": "-o",
    "grade sub --format gradescope --starter STARTER --rubric lab/rubric.yaml --maps maps": "-o",
}
READ = {
    "STAGE": [
        "work/Lab3_01_ros_clock.usda",
        "lab3.toml",
        "supplied/starter.usda",
        "supplied/maps/m.yaml",
    ],
    "STARTER": ["supplied/starter.usda"],
    "work": ["work/Lab3_01_ros_clock.usda", "work/notes.txt", "lab3.toml"],
    "maps/map.yaml": ["maps/map.yaml", "maps/map.pgm"],
    "maps": ["maps/map.yaml", "maps/map.pgm"],
    "run": ["run/run.mcap", "run/metadata.yaml"],
    "run/run.mcap": ["run/run.mcap", "run/metadata.yaml"],
    "lab": ["lab/ros.yaml", "lab/scene.yaml"],
    "lab/rubric.yaml": ["lab/rubric.yaml"],
    "base.json": ["base.json"],
    "drive.txt": ["drive.txt"],
    "ros.yaml": ["ros.yaml"],
    "other.toml": ["other.toml", "supplied/maps/m.yaml"],
    "sub": ["sub/Lab3_01_ros_clock.usda"],
}
PLACES = {"STAGE": "work/Lab3_01_ros_clock.usda", "STARTER": "supplied/starter.usda"}
NOT_CONFIGURED = {
    "add",
    "remove",
    "sim",
    "bag",
    "tf",
    "topics",
}  # these read neither starter nor map of a configuration


def digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make everything that the calls name."""
    monkeypatch.chdir(tmp_path)
    for name in ("work", "supplied/maps", "maps", "run", "sub", "links"):
        Path(name).mkdir(parents=True)
    for name in (*PLACES.values(), "sub/Lab3_01_ros_clock.usda"):
        shutil.copy(stage("01"), name)
    copied(Path("lab"))
    texts = {
        "lab3.toml": 'starter = "supplied/starter.usda"\nmaps = "supplied/maps/m.yaml"\n',
        "other.toml": 'maps = "supplied/maps/m.yaml"\n',
        "work/notes.txt": "mine\n",
        "base.json": '{"version": 1, "findings": []}',
        "drive.txt": "0.1,0,1\n",
        "ros.yaml": "add: [publisher]\n",
        "maps/map.yaml": "image: map.pgm\n",
        "maps/map.pgm": "P5 1 1 255 0",
        "supplied/maps/m.yaml": "image: m.pgm\n",
        "run/metadata.yaml": "rosbag2_bagfile_information:\n",
        "run/run.mcap": "mcap",
    }
    for name, text in texts.items():
        Path(name).write_text(text)
    return tmp_path


def inputs_of(call: str) -> Iterator[str]:
    """Yield the files that a call reads."""
    words = call.split()
    command = next(word for word in words if word in cli.all_commands())
    is_configured = command not in NOT_CONFIGURED and "other.toml" not in words
    for word in words:
        for name in READ.get(word, ()):
            if name.startswith("supplied") and not (is_configured or word != "STAGE"):
                continue
            if name == "lab3.toml" and "other.toml" in words:
                continue
            if command == "grade" and word == "STAGE":
                continue
            yield name


def names_of(path: Path) -> Iterator[str]:
    """Yield an input by its path, whole and not, by links to it and its folder, and in capitals."""
    yield str(path)
    yield os.path.relpath(path)
    soft, hard, folder = (Path("links", name) for name in ("soft", "hard", "folder"))
    soft, hard = soft.with_suffix(path.suffix), hard.with_suffix(path.suffix)
    soft.symlink_to(path)
    hard.hardlink_to(path)
    folder.symlink_to(path.parent)
    yield from (str(soft), str(hard), str(folder / path.name))
    yield str(path.with_name(path.name.upper()))
    for link in (soft, hard, folder):
        link.unlink()


def said(*words: str) -> str:
    try:
        result = invoke(*words)
    except (Lab3Error, click.UsageError) as error:
        return str(error)
    return result.output if result.exit_code == 2 else f"exit {result.exit_code}: {result.output}"


@pytest.mark.parametrize("call", CALLS)
def test_no_output_replaces_an_input(call: str, place: Path, subtests: pytest.Subtests) -> None:
    before = digests(place)
    words = [PLACES.get(word, word) for word in call.split()]
    for option in CALLS[call].split():
        for name in dict.fromkeys(inputs_of(call)):
            for output in names_of(place / name):
                with subtests.test(option=option, output=output):
                    existed = os.path.lexists(output)
                    answer = said(*words, option, output)
                    assert not (existed and answer.startswith("exit")), answer
                    assert digests(place) | before == digests(place)
                    if not existed:  # capitals, of which most systems make another name
                        Path(output).unlink(missing_ok=True)


# A call that makes files in a folder, and one of these files, which it reads.
IN_FOLDERS = {
    "--lab lab nav2 --force -o lab": "lab/lab3_launch.py",
    "--lab lab lab schema --force --out lab": "lab/ros.json",
    "--lab lab demo lab --force": "lab/carter.usda",
    "--lab lab map work/Lab3_01_ros_clock.usda --height 0.1 --start 0 0 --force -o lab": (
        "lab/m.yaml"
    ),
    "--lab lab draw ROS_Clock --force -o lab": "lab/ROS_Clock.svg",
    "--lab lab build --force -o lab": "lab/Lab3_01_ros_clock.usda",
    "--lab lab diff sub/Lab3_01_ros_clock.usda supplied/start.usda --pictures lab --force": (
        "lab/ROS_Clock.svg"
    ),
    "grade --explain ana -o book --gradebook canvas --roster book/canvas.csv": "book/canvas.csv",
    "grade --regrade book --rubric book/grades.json": "book/grades.json",
}


@pytest.mark.parametrize("call", IN_FOLDERS)
def test_no_file_that_is_made_in_a_folder_replaces_an_input(call: str, place: Path) -> None:
    shutil.copytree(data_folder("graphs"), "lab", dirs_exist_ok=True)
    read = place / IN_FOLDERS[call]
    read.parent.mkdir(exist_ok=True)
    read.write_text("mine")
    scene = place / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().replace("yaml: turtlebot3_map.yaml", "yaml: m.yaml"))
    shutil.copy(stage("00"), "supplied/start.usda")
    before = digests(place)
    answer = said(*call.split())
    assert f"{IN_FOLDERS[call]}: " in answer
    assert "this command reads" in answer or "read by this command" in answer
    assert digests(place) == before


def test_every_option_of_a_file_that_is_written_is_tried() -> None:
    root = click.Context(cli.lab3)
    tried = {
        (word, option)
        for call, options in CALLS.items()
        for word in call.split()
        for option in options.split()
    }
    for name in cli.all_commands():
        for parameter in cli.lab3.get_command(root, name).params:
            if isinstance(parameter.type, OutputFile):
                assert not tried.isdisjoint((name, option) for option in parameter.opts), name


def test_every_path_of_a_command_is_an_input_or_an_output() -> None:
    root = click.Context(cli.lab3)
    commands = [cli.lab3.get_command(root, name) for name in cli.all_commands()]
    commands += [inner for each in commands for inner in getattr(each, "commands", {}).values()]
    kinds = (Input, OutputFile, OutputFolder, ChangedFolder)
    plain = [
        (command.name, parameter.name)
        for command in commands
        for parameter in command.params
        if isinstance(parameter.type, (click.Path, click.File))
        and not isinstance(parameter.type, kinds)
    ]
    assert plain == []


def test_a_baseline_beside_the_stages_is_written_again(place: Path) -> None:
    for _ in range(2):
        invoke("lint", "work", "--write-baseline", "work/base.json")
    assert '"version": 1' in (place / "work" / "base.json").read_text()


def test_an_existing_file_of_a_judged_folder_is_no_report(place: Path) -> None:
    assert "exists in work, which this command reads" in said(
        "lint", "work", "-o", "work/notes.txt"
    )
    assert (place / "work" / "notes.txt").read_text() == "mine\n"


@pytest.mark.parametrize(
    "call",
    [
        "lint STAGE -o no/report.txt",
        "check STAGE --write-baseline no/base.json",
        "sim STAGE --page no/page.html",
        "tf STAGE --graph no/tree.svg",
        "grade sub --format gradescope --starter STARTER -o no/results.json",
    ],
)
def test_the_folder_of_an_output_must_be_there(call: str, place: Path) -> None:
    answer = said(*(PLACES.get(word, word) for word in call.split()))
    assert "there is no folder no; make it first" in answer
    assert not (place / "no").exists()


@pytest.mark.parametrize(
    "call",
    ["starter -o new/below/starter.usda", "collect -o new/collect.sh", "record -o new/play.py"],
)
def test_the_folder_of_the_one_file_that_a_command_is_for_is_made(call: str, place: Path) -> None:
    assert invoke(*call.split()).exit_code == 0
    assert (place / call.rsplit(maxsplit=1)[-1]).is_file()


@pytest.mark.parametrize("call", ["build -o taken --only 01", "draw STAGE -o taken/below"])
def test_where_a_folder_is_needed_a_file_is_told(call: str, place: Path) -> None:
    (place / "taken").write_text("mine")
    answer = said(*(PLACES.get(word, word) for word in call.split()))
    assert "taken: is a file, and a folder is needed; name another one" in answer
    assert (place / "taken").read_text() == "mine"


@pytest.mark.parametrize("call", ["lint STAGE -o loop", "sim STAGE --bag loop", "starter -o loop"])
def test_a_link_to_itself_is_no_output(call: str, place: Path) -> None:
    (place / "loop").symlink_to("loop")
    assert "loop cannot be written" in said(*(PLACES.get(word, word) for word in call.split()))


@pytest.mark.parametrize(
    "call", ["sim STAGE --bag one --page one", "check STAGE -o one --write-baseline ./one"]
)
def test_two_outputs_are_two_files(call: str, place: Path) -> None:
    assert "name another file for one of them" in said(
        *(PLACES.get(word, word) for word in call.split())
    )
    assert not (place / "one").exists()


def test_a_layer_of_the_stage_is_not_replaced_by_its_repair(place: Path) -> None:
    layer = Path(PLACES["STAGE"]).with_name("layer.usda")
    shutil.copy(PLACES["STAGE"], layer)
    top = layer.with_name("top.usda")
    top.write_text("#usda 1.0\n(\n    subLayers = [@layer.usda@]\n)\n")
    before = digests(place)
    answer = said("fix", str(top), "--lint", "-o", str(layer), "--force")
    assert "is a file of work/top.usda, which this command reads" in answer
    assert digests(place) == before


def test_the_starter_is_not_repaired_in_place_by_itself(place: Path) -> None:
    name = PLACES["STAGE"]
    wrong = Path(name).read_text().replace("uniform token[] apiSchemas", "token[] odd")
    Path(name).write_text(wrong.replace("/clock", "/clok"))
    before = digests(place)
    answer = said("fix", name, "--starter", name, "--in-place", "--isolated")
    assert digests(place) == before, answer


def test_schemas_of_somebody_stay_without_force(place: Path) -> None:
    invoke("lab", "schema", "--out", "schemas")
    invoke("lab", "schema", "--out", "schemas")  # what is the same may stay
    mine = place / "schemas" / "scene.json"
    mine.write_text("mine")
    assert "use --force" in said("lab", "schema", "--out", "schemas")
    assert mine.read_text() == "mine"
    invoke("lab", "schema", "--out", "schemas", "--force")
    assert mine.read_text() != "mine"
